"""The system with memory that a user writes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from pwscont.basics.arrays import Array
from pwscont.basics.looks import card
from pwscont.evolution.ways import Evolver
from pwscont.system.system import PiecewiseLinearSystem

if TYPE_CHECKING:
    from pwscont.evolution.states import EvolutionState


class SystemWithMemory(ABC):
    """A law whose states leave something behind: plastic strain, the place of a node that sticks.

    At every event the law is stated anew with the memory of the state reached: as a
    :class:`~pwscont.PiecewiseLinearSystem` whose parameter is the time t. The ways on from the
    state are the rays, in the direction of growing t, of the cone problem of the restated law
    (docs/theory, F16).

    A subclass writes :meth:`remembering`, :meth:`memory` and :meth:`initial_memory`. The law
    restated with the memory of a solution must hold in the same solution.

    Examples
    --------
    A slider that a spring of stiffness 1 pulls, with yield force 1: z = (force, plastic stretch).

    >>> import numpy as np
    >>> from pwscont import PiecewiseLinearSystem, SystemWithMemory, evolve
    >>> class Slider(PiecewiseLinearSystem):
    ...     size = 2
    ...     def __init__(self, slip):
    ...         self.slip = slip
    ...     def test_functions(self, z, t):
    ...         trial = t - self.slip
    ...         return np.array([1.0 - trial, 1.0 + trial])
    ...     def residual(self, z, t, character):
    ...         below, above = character.signs
    ...         trial = t - self.slip
    ...         force = trial if below and above else (1.0 if above else -1.0)
    ...         return np.array([z[0] - force, z[1] - (t - force)])
    >>> class Pulled(SystemWithMemory):
    ...     def remembering(self, memory):
    ...         return Slider(memory[0])
    ...     def memory(self, z, t):
    ...         return z[1:]
    ...     def initial_memory(self):
    ...         return np.zeros(1)
    >>> evolution = evolve(Pulled(), (0.0, 3.0))
    >>> [(point.kind, point.t) for point in evolution.events()]
    [('start', 0.0), ('event', 1.0), ('end', 3.0)]
    >>> evolution.states(3.0)[0].z.tolist()
    [1.0, 2.0]
    """

    @abstractmethod
    def remembering(self, memory: Array) -> PiecewiseLinearSystem:
        """Return the law from a state with this memory on, a system in (z, t).

        Parameters
        ----------
        memory : ndarray, shape (k,)
        """

    @abstractmethod
    def memory(self, z: Array, t: float) -> Array:
        """Return what a state leaves behind, shape (k,).

        Parameters
        ----------
        z : ndarray, shape (n,)
        t : float
        """

    @abstractmethod
    def initial_memory(self) -> Array:
        """Return the memory with which an evolution begins, shape (k,)."""

    def names(self) -> tuple[str, ...] | None:
        """Return a name for each unknown; default the names of the restated law."""
        return None

    def evolver(self, interval: tuple[float, float]) -> Evolver | None:
        """Return an object that knows the ways on better than the cone problem does.

        Default None: the ways on are the rays of the cone problem of the restated law.

        Parameters
        ----------
        interval : tuple of float
        """
        return None

    def dissipation(self, before: EvolutionState, after: EvolutionState) -> float | None:
        """Return the energy dissipated between two states of one smooth piece.

        Exactly zero where nothing is dissipated. Default None: the dissipation is not known.
        """
        return None

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def _repr_html_(self) -> str:
        return card(type(self).__name__, [("system with memory", repr(self))])
