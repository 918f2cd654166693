"""What a body with friction along a loading history is made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from pwscont import LoadHistory, StartNotFoundError, trace
from pwscont.extending import Array
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad
from pwscont_coulomb.names import names
from pwscont_coulomb.quasi_static.restated import RestatedCoulomb, displaced


@final
@dataclass(frozen=True, eq=False)
class FrictionProblem:
    """A body, the loads, friction and slip at rest, all checked.

    Attributes
    ----------
    body : ContactBody
    history : LoadHistory
    friction, slip : ndarray, shape (p,)
    """

    body: ContactBody
    history: LoadHistory
    friction: Array
    slip: Array

    def restated(self, memory: Array) -> RestatedCoulomb:
        """Return the static law of displacements that count from u_t."""
        return RestatedCoulomb(self.body, self.history, self.friction, memory)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the unknowns."""
        return names(self.body)

    def one_state(self, slip: Array, t: float) -> Array | None:
        """Return y of one state with nodes that slipped from some places, None where none is found.

        The friction grows from zero, where the problem is convex.
        """
        n, v = self.body.n, displaced(self.body, slip)
        load = AffineLoad(self.history(t) - self.body.A @ v, np.zeros(n))
        growing = CoulombLoad(self.body, load, self.friction).along_friction(0.0)
        try:
            graph = trace(growing, (np.zeros(growing.size), 0.0), (0.0, 1.0), parameter="friction")
        except StartNotFoundError:
            return None
        found = graph.solutions(1.0)
        if not found:
            return None
        u = found[0].z[:n] + v
        return np.concatenate([found[0].z[n:], self.body.N @ u, self.body.T @ u])
