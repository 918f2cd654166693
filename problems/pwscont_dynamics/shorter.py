"""Points of shorter periods: a point of period d has every multiple of d as a period, too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import final

import numpy as np

from pwscont import PiecewiseSystem, explore
from pwscont.extending import (
    Array,
    Failure,
    Guarantee,
    Metric,
    Search,
    SearchScope,
    semismooth_newton,
)


@final
class ShorterPeriods(Search):
    """All that ``explore`` finds for the largest divisors of a period, repeated.

    A search for points of period 2 with twice as many unknowns may miss a fixed point that is
    easily found alone.

    Parameters
    ----------
    shorter : mapping of int to PiecewiseSystem
        Period -> the system of the points of that period.
    """

    def __init__(self, shorter: Mapping[int, PiecewiseSystem]) -> None:
        self._shorter = shorter

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[tuple[Array, Array]]:
        """Yield a point of every piece that is found for each shorter period."""
        for orbits in self._shorter.values():
            for piece in explore(orbits, interval).pieces:
                x = piece.points[len(piece.points) // 2]
                times = system.size // orbits.size
                found = semismooth_newton(system, metric, np.tile(x[:-1], times), float(x[-1]))
                if not isinstance(found, Failure):
                    yield found

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing."""
        periods = " and ".join(map(str, self._shorter))
        return SearchScope(f"all points found of period {periods}", Guarantee.NOTHING)


def largest_divisors(period: int) -> list[int]:
    """Return the proper divisors of a number that divide no other proper divisor of the number."""
    proper = [d for d in range(1, period) if period % d == 0]
    return [d for d in proper if not any(other % d == 0 for other in proper if other > d)]
