"""All equilibria of trusses in series that each carry the whole load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, final

import numpy as np

from pwscont import InvalidInputError, Search
from pwscont.extending import Array, Guarantee, Metric, SearchScope


@final
@dataclass(frozen=True, slots=True)
class AllEquilibria(Search):
    """All equilibria at the ends of the interval, and at a load between neighbouring limit loads.

    The compression d of each truss is a root of force(d) = load. A branch turns only where the
    force of a truss turns, so that the loads of a closed loop range from limit load to limit load,
    with a load that is tried inside. The search therefore finds every branch.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_structures import AllEquilibria, TrussChain
    >>> graph = explore(TrussChain([1.0, 1.0]), (-0.6, 0.6), search=AllEquilibria())
    >>> graph.count(0.0), graph.guarantee
    (9, 'complete')
    """

    def starts(
        self, system: Any, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the equilibria load by load.

        Raises
        ------
        InvalidInputError
            If a stop above the last node couples the trusses.
        """
        if not getattr(system, "is_decoupled", False):
            raise InvalidInputError(
                "AllEquilibria is for a TrussChain whose only stop, if any, is at the last node"
            )
        laws = system.laws()
        for load in _loads(laws, *interval):
            for d in product(*(law.compressions(load) for law in laws)):
                u = np.cumsum(d[::-1])[::-1]
                yield np.append(u, load), np.zeros((1, len(u) + 1))

    def searched(self, system: Any) -> SearchScope:
        """Promise everything."""
        what = "all equilibria at both ends and between limit loads"
        return SearchScope(what, Guarantee.EVERYTHING)


def _loads(laws: Any, lo: float, hi: float) -> list[float]:
    """Return the ends of an interval and the middles between limit loads."""
    limits = np.unique([float(law(d)) for law in laws for d in law.turns()])
    inside = np.concatenate([[lo], limits[(lo < limits) & (limits < hi)], [hi]])
    return [lo, *(0.5 * (inside[:-1] + inside[1:])).tolist(), hi]
