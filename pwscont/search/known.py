"""What a search may ask about the branches that were followed from its earlier starts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import final

from pwscont.basics.arrays import Array
from pwscont.curve.metric import Metric


class KnownBranches(ABC):
    """The branches of a run so far; a search need not lead to them again."""

    @abstractmethod
    def at(self, alpha: float) -> list[Array]:
        """Return a point (z, alpha) for each known solution, interpolated between stored points."""

    @abstractmethod
    def near(self, x: Array, metric: Metric) -> Array | None:
        """Return the nearest point between stored ones, where x may be on the same branch."""

    @abstractmethod
    def extremes(self) -> list[Array]:
        """Return the points (z, alpha) of pieces at which alpha or an unknown is extremal."""


@final
class NothingKnown(KnownBranches):
    """No branches."""

    def at(self, alpha: float) -> list[Array]:
        """Return nothing."""
        return []

    def near(self, x: Array, metric: Metric) -> Array | None:
        """Return nothing."""
        return None

    def extremes(self) -> list[Array]:
        """Return nothing."""
        return []
