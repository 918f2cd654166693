"""Solutions at a given load and friction, by increasing the friction from zero.

Without friction the problem is convex, with a unique solution. Following this solution while all
coefficients grow in proportion leads to an odd number of solutions at the given friction, since the
component starts at F = 0 only once. Solutions on components that do not reach F = 0 are not found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import InvalidInputError, PiecewiseSystem, Search, StartNotFoundError, trace
from pwscont.extending import Array, Guarantee, Metric, SearchScope
from pwscont_coulomb.coulomb import Coulomb


@final
@dataclass(frozen=True, slots=True)
class FromFrictionless(Search):
    """Solutions at lo and hi of the interval by homotopy from F = 0.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad, FromFrictionless
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> system = CoulombLoad(body, AffineLoad([0.25, 0], [0, 1]), 4.0)
    >>> explore(system, (-2.0, 2.0), search=FromFrictionless()).count(1.0)
    1
    """

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the solutions found at lo, then the solutions found at hi."""
        if not isinstance(system, Coulomb):
            raise InvalidInputError(
                f"FromFrictionless is for Coulomb friction, not for {type(system).__name__}"
            )
        for alpha in interval:
            yield from _at(system, alpha)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing beyond the component of the frictionless solution."""
        return SearchScope("homotopy from zero friction at both ends", Guarantee.NOTHING)


def _at(system: Coulomb, alpha: float) -> Iterator[tuple[Array, Array]]:
    """Yield the solutions at a given alpha that the homotopy leads to."""
    homotopy, start = system.along_friction(alpha), np.zeros(system.size)
    try:
        graph = trace(homotopy, (start, 0.0), (0.0, 1.0), parameter="homotopy")
    except StartNotFoundError:
        return
    for solution in graph.solutions(1.0):
        yield np.append(solution.z, alpha), np.zeros((1, system.size + 1))
