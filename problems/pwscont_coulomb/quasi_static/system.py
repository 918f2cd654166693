"""A body with friction along a loading history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont import InvalidInputError, LoadHistory, SystemWithMemory
from pwscont.extending import Array, ExactRates, dense
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.fixed import Fixed
from pwscont_coulomb.per_node import not_negative, per_node
from pwscont_coulomb.quasi_static.evolver import CoulombEvolver
from pwscont_coulomb.quasi_static.problem import FrictionProblem
from pwscont_coulomb.quasi_static.restated import RestatedCoulomb

if TYPE_CHECKING:
    from pwscont.extending import EvolutionState


@final
class QuasiStaticCoulomb(Fixed, SystemWithMemory, ExactRates):
    """Contact with Coulomb friction that opposes the rate of slip, along a load history.

    A state is z = (u, lam_nu, lam_t), as for :class:`~pwscont_coulomb.CoulombLoad`. A node slips
    in the positive direction under lam_t = F lam_nu and in the negative direction under
    lam_t = -F lam_nu, with lam_nu <= 0. The memory is u_t: where the nodes are.

    Parameters
    ----------
    body : ContactBody
        Every size: only the contact unknowns count from event to event.
    history : LoadHistory
    friction : float or array_like, shape (p,)
        Friction coefficient F >= 0, for all nodes or per node; constant in time.
    slip : float or array_like, shape (p,), optional
        u_t at rest: where nodes without tangential force are. Default 0.

    Raises
    ------
    InvalidInputError
        If friction or slip have the wrong shape, or the loads do not fit the body.

    Notes
    -----
    Klarbring, Ingenieur-Archiv 60 (1990) 529-541, has the rate problem; docs/theory, F16 to F18.

    Examples
    --------
    >>> from pwscont import evolve
    >>> from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> load = LoadHistory([[1, 0], [1, 3], [1, -3]])
    >>> evolution = evolve(QuasiStaticCoulomb(body, load, 0.5), (0.0, 2.0))
    >>> [path.labels for path in evolution.paths()]
    [['stick', 'slip+', 'stick', 'slip-', 'no contact']]
    >>> [round(energy, 6) for energy in evolution.dissipated(0.0, 2.0)]
    [1.75]
    """

    _given = frozenset({"body", "history", "friction", "slip"})

    def __init__(
        self, body: ContactBody, history: LoadHistory, friction: Any, slip: Any = 0.0
    ) -> None:
        if not isinstance(body, ContactBody):
            raise InvalidInputError(f"body must be a ContactBody, got {body!r}")
        if not isinstance(history, LoadHistory):
            raise InvalidInputError(f"history must be a LoadHistory, got {history!r}")
        if callable(friction):
            raise InvalidInputError("friction must be numbers: it cannot change in time")
        if history.loads.shape[1] != body.n:
            raise InvalidInputError(
                f"loads have {history.loads.shape[1]} components, the body {body.n} displacements"
            )
        body.refuse_unclamped("QuasiStaticCoulomb")
        self.body, self.history = body, history
        self.friction = np.where(body.guided, 0.0, not_negative("friction", friction, body.p))
        self.slip = per_node("slip", 0.0 if slip is None else slip, body.p)
        self.problem = FrictionProblem(body, history, self.friction, self.slip)
        for load in history.loads:
            body.refuse_guided_load(load)

    def initial_memory(self) -> Array:
        """Return u_t at rest, shape (p,)."""
        return self.slip.copy()

    def memory(self, z: Array, t: float) -> Array:
        """Return u_t, shape (p,)."""
        memory: Array = self.body.T @ z[: self.body.n]
        return memory

    def exact_rates(self) -> tuple[Array, Array, Array, Array]:
        """Return A, N, T and F as exact numbers, for :func:`pwscont.prove`."""
        body = self.body
        return dense(body.A), dense(body.N), dense(body.T), self.friction.copy()

    def remembering(self, memory: Array) -> RestatedCoulomb:
        """Return the static law of displacements that count from u_t."""
        return self.problem.restated(np.asarray(memory))

    def names(self) -> tuple[str, ...]:
        """Return u[i] (or u_nu and u_t where N and T pick single unknowns) and multipliers."""
        return self.problem.names

    def evolver(self, interval: tuple[float, float]) -> CoulombEvolver:
        """Return the evolver that works in the contact unknowns."""
        self.history.refuse_beyond(interval)
        return CoulombEvolver(self.problem, interval)

    def dissipation(self, before: EvolutionState, after: EvolutionState) -> float:
        """Return the work of friction on the way between two states of one piece.

        Forces and slip are straight in t on a piece: the mean force times the slip is exact.
        """
        force = before.z[-self.body.p :] + after.z[-self.body.p :]
        return float(-0.5 * force @ (after.memory - before.memory))

    def __repr__(self) -> str:
        return f"QuasiStaticCoulomb({self.body!r}, {self.history!r})"
