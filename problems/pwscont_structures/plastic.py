"""Trusses of elastic-plastic bars along a loading history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont import InvalidInputError, LoadHistory, SystemWithMemory
from pwscont.extending import EPS, GUARD, Array, counted, finite_array
from pwscont_structures.plastic_law import PlasticLaw

if TYPE_CHECKING:
    from pwscont.extending import EvolutionState


@final
class PlasticTruss(SystemWithMemory):
    """A truss of elastic-plastic bars with kinematic hardening, z = (u, s).

    The force of bar i is s_i + H_i e_i with the elongation e = B u. The part s_i is elastic,
    s_i = k_i (e_i - plastic elongation), within -y_i <= s_i <= y_i. The memory is the plastic
    elongation of each bar. One node on springs in parallel is the model of Prandtl and Ishlinskii.

    Parameters
    ----------
    B : array_like, shape (m, n)
        Elongations of the m bars by the n displacements.
    history : LoadHistory
        Loads at the n displacements.
    stiffness, strength : float or array_like, shape (m,)
        k and y, positive.
    hardening : float or array_like, shape (m,), optional
        H, not negative. Default 0: then a truss may collapse, where evolutions are lost.

    Raises
    ------
    InvalidInputError
        If shapes do not fit or a number has the wrong sign.

    Examples
    --------
    >>> from pwscont import LoadHistory, evolve
    >>> from pwscont_structures import PlasticTruss
    >>> load = LoadHistory([[0.0], [4.0], [0.0]])
    >>> springs = PlasticTruss([[1.0], [1.0]], load, [1.0, 2.0], [1.0, 1.0], hardening=0.5)
    >>> evolution = evolve(springs, (0.0, 2.0))
    >>> [path.labels for path in evolution.paths()][0][:3]
    ['elastic', 'bar 2 yields in tension', 'bar 1 yields in tension, bar 2 yields in tension']
    >>> round(evolution.states(2.0)[0]["u_1"], 6)
    1.0
    """

    def __init__(
        self, B: Any, history: LoadHistory, stiffness: Any, strength: Any, hardening: Any = 0.0
    ) -> None:
        self.B = finite_array("B", B)
        if self.B.ndim != 2 or not self.B.size:
            raise InvalidInputError(f"B must be a matrix, got shape {self.B.shape}")
        m, n = self.B.shape
        if not isinstance(history, LoadHistory):
            raise InvalidInputError(f"history must be a LoadHistory, got {history!r}")
        if history.loads.shape[1] != n:
            raise InvalidInputError(f"loads must have {n} components, as B has columns")
        self.history = history
        self.stiffness = _numbers("stiffness", stiffness, m)
        self.strength = _numbers("strength", strength, m)
        self.hardening = _numbers("hardening", hardening, m, least_is_allowed=True)

    def remembering(self, memory: Array) -> PlasticLaw:
        """Return equilibrium with given plastic elongations, shape (m,)."""
        parts = self.B, self.stiffness, self.strength, self.hardening
        return PlasticLaw(*parts, self.history, np.asarray(memory))

    def memory(self, z: Array, t: float) -> Array:
        """Return the plastic elongations, shape (m,)."""
        n = self.B.shape[1]
        plastic: Array = self.B @ z[:n] - z[n:] / self.stiffness
        return plastic

    def initial_memory(self) -> Array:
        """Return no plastic elongation."""
        return np.zeros(len(self.B))

    def evolver(self, interval: tuple[float, float]) -> None:
        """Refuse an interval that leaves the history; the ways on are those of the cone problem."""
        self.history.refuse_beyond(interval)

    def dissipation(self, before: EvolutionState, after: EvolutionState) -> float:
        """Return the plastic work between two states of one piece, exact on straight pieces.

        Plastic elongations are differences, whose rounding does no work.
        """
        n, change = self.B.shape[1], after.memory - before.memory
        ends = [
            np.abs(self.B) @ np.abs(z[:n]) + np.abs(z[n:]) / self.stiffness
            for z in (before.z, after.z)
        ]
        change[np.abs(change) <= GUARD * EPS * (ends[0] + ends[1])] = 0.0
        return float(0.5 * (before.z[n:] + after.z[n:]) @ change)

    def __repr__(self) -> str:
        m, n = self.B.shape
        sizes = f"{counted(m, 'bar')}, {counted(n, 'displacement')}"
        return f"PlasticTruss({sizes}, {self.history!r})"


def _numbers(name: str, values: Any, count: int, least_is_allowed: bool = False) -> Array:
    array = finite_array(name, values)
    if array.shape not in ((), (count,)):
        raise InvalidInputError(f"{name} must be a number or {count} numbers")
    fits = (array >= 0.0) if least_is_allowed else (array > 0.0)
    if not fits.all():
        kind = "not be negative" if least_is_allowed else "be positive"
        raise InvalidInputError(f"{name} must {kind}, got {array.min():.6g}")
    return np.broadcast_to(array, (count,)).copy()
