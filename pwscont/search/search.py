"""The seam of the searches for starts, and how searches combine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from pwscont.foundation.guarantee import Promise, Searched
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.metric import Metric
from pwscont.search.enumeration import Found


class Search(ABC):
    """Finds solutions from which components can be traced; searches add up with ``+``."""

    @abstractmethod
    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield solutions (z, alpha) with their errors; a component may be hit repeatedly."""

    def searched(self, system: PiecewiseSystem) -> Searched:
        """Return what this search does for a system, in words, and what that promises.

        A search that says nothing of itself promises nothing.
        """
        return Searched(type(self).__name__, Promise.NOTHING)

    def __add__(self, other: Search) -> Search:
        return Together(self, other)


@final
@dataclass(frozen=True, slots=True)
class Together(Search):
    """Two searches, one after the other."""

    first: Search
    second: Search

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield what the first finds, then what the second finds."""
        yield from self.first.starts(system, metric, interval)
        yield from self.second.starts(system, metric, interval)

    def searched(self, system: PiecewiseSystem) -> Searched:
        """Return both descriptions and the better promise."""
        a, b = self.first.searched(system), self.second.searched(system)
        return Searched(f"{a.what}; {b.what}", max(a.promise, b.promise))
