"""The seam of the searches for starts, and how searches combine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.curve.metric import Metric
from pwscont.search.enumeration import Found
from pwscont.system.system import PiecewiseSystem


class Search(ABC):
    """Finds solutions from which components can be traced; searches add up with ``+``."""

    @abstractmethod
    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield solutions (z, alpha) with their errors; a component may be hit repeatedly."""

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Return what this search does for a system, in words, and what that promises.

        A search that says nothing of itself promises nothing.
        """
        return SearchScope(type(self).__name__, Guarantee.NOTHING)

    def __add__(self, other: Search) -> Search:
        return CombinedSearch(self, other)


class BringsSearches(ABC):
    """A system for which there are searches of its kind.

    They are added to the default of :func:`pwscont.explore` where trying every cell would take
    too long.
    """

    __slots__ = ()

    @abstractmethod
    def searches(self) -> Sequence[Search]:
        """Return these searches."""


@final
@dataclass(frozen=True, slots=True)
class CombinedSearch(Search):
    """Two searches, one after the other."""

    first: Search
    second: Search

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield what the first finds, then what the second finds."""
        yield from self.first.starts(system, metric, interval)
        yield from self.second.starts(system, metric, interval)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Return both descriptions and the better promise."""
        a, b = self.first.searched(system), self.second.searched(system)
        return SearchScope(f"{a.what}; {b.what}", max(a.promise, b.promise))
