"""Searches at given values of alpha."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.curve.metric import Metric
from pwscont.search.enumeration import Found, starts_at
from pwscont.search.search import Search
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

#: Most values of alpha that are listed one by one.
MANY_LISTED = 5
#: Where a slice cuts its part of the interval: the smaller part of the golden section.
OFFSET = 0.5 * (3.0 - 5.0**0.5)


@final
@dataclass(frozen=True, slots=True)
class EndPoints(Search):
    """All solutions at both ends of the interval.

    A component of the zero set within the interval is a closed loop or ends at an end of the
    interval. So this search finds every component but loops, wherever the enumeration is complete
    and solutions stay bounded: a component that comes from infinity and returns there within the
    interval meets no end. Where unknowns have bounds, a component may also end at a bound, and
    nothing is promised.

    Examples
    --------
    >>> from pwscont import LCP, EndPoints, explore
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    >>> explore(problem, (-1.0, 2.0), search=EndPoints()).guarantee
    'complete but for closed loops'
    """

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield the solutions at lo, then those at hi."""
        for alpha in interval:
            yield from starts_at(system, metric, alpha)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise everything but loops for slices that can be enumerated."""
        if isinstance(system, SlicewiseLinearSystem):
            ends = Guarantee.NOTHING if Box.of(system).is_bounded else Guarantee.BUT_LOOPS
            return SearchScope("all solutions at both ends of the interval", ends)
        return SearchScope("one Newton iteration per cell at both ends", Guarantee.NOTHING)


@final
@dataclass(frozen=True, slots=True)
class Slices(Search):
    """Solutions at some values of alpha in between, which find loops that cross them.

    Complete where the system is affine in z at fixed alpha; otherwise Newton is tried once in every
    cell, which may miss some.

    Attributes
    ----------
    alphas : tuple of float
        Values of the interval that is explored.

    Examples
    --------
    >>> from pwscont import LCP, Slices, explore
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    >>> explore(problem, (-1.0, 2.0), search=Slices((0.0,))).guarantee
    'balanced'
    """

    alphas: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the values."""
        if finite_array("Slices.alphas", self.alphas).ndim != 1:
            raise InvalidInputError(
                f"Slices takes several values of alpha, as in Slices((0.7,)), got {self.alphas!r}"
            )

    @classmethod
    def spread(cls, count: int, interval: tuple[float, float]) -> Slices:
        """Return slices at even distances that avoid the middle and other special values."""
        lo, hi = interval
        return cls(tuple((lo + (hi - lo) * (np.arange(count) + OFFSET) / count).tolist()))

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield the solutions slice by slice.

        Raises
        ------
        InvalidInputError
            If one lies outside the interval.
        """
        lo, hi = interval
        alphas = finite_array("Slices.alphas", self.alphas)
        outside = [float(alpha) for alpha in alphas.ravel() if not lo <= alpha <= hi]
        if outside:
            raise InvalidInputError(f"Slices: {outside[0]} lies outside the interval [{lo}, {hi}]")
        for alpha in self.alphas:
            yield from starts_at(system, metric, alpha)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing beyond the slices."""
        linear = isinstance(system, SlicewiseLinearSystem)
        what = "all solutions" if linear else "one Newton iteration per cell"
        if len(self.alphas) > MANY_LISTED:
            first, last = min(self.alphas), max(self.alphas)
            where = f"{len(self.alphas)} values of alpha from {first:.6g} to {last:.6g}"
        else:
            where = "alpha = " + ", ".join(f"{alpha:.6g}" for alpha in self.alphas)
        return SearchScope(f"{what} at {where}", Guarantee.NOTHING)
