"""The system with memory that a user writes, and the seam of what finds the ways on."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.printing import card
from pwscont.evolution.states import EvolutionState, StateReader
from pwscont.system.system import PiecewiseLinearSystem


@final
@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A state at one time.

    Attributes
    ----------
    t : float
    z : ndarray, shape (m,)
        The unknowns that an :class:`Evolver` computes with.
    memory : ndarray, shape (k,)
    mode : bytes
        What else the evolver wants to know of the state.
    error : ndarray, shape (j, m + 1), optional
        Samples of the error of (z, t).
    """

    t: float
    z: Array
    memory: Array
    mode: bytes = b""
    error: Array | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """A smooth piece that leaves a moment: z(t) = z + (t - t of the moment) rate.

    Attributes
    ----------
    label : str
        The modes of the parts, in words.
    z : ndarray, shape (m,)
        The state where the piece begins: that of the moment, up to rounding.
    rate : ndarray, shape (m,)
    until : float
        The time of the next event, infinite where none follows.
    mode : bytes
        What the evolver wants to know at the end of the piece.
    """

    label: str
    z: Array
    rate: Array
    until: float = math.inf
    mode: bytes = b""


@final
@dataclass(frozen=True, slots=True, eq=False)
class WaysOn:
    """All ways on that were found at a moment.

    Attributes
    ----------
    ways : tuple of Way
    complete : bool
        Whether there certainly are no other ways.
    remark : str
        What is uncertain, in words; empty where nothing is.
    """

    ways: tuple[Way, ...]
    complete: bool = True
    remark: str = ""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Some states at one time, and whether there certainly are no others.

    Attributes
    ----------
    moments : tuple of Moment
    complete : bool
    remark : str
        What is uncertain, in words; empty where nothing is.
    origin : str
        Which states were asked for, in words, if not all states were asked for.
    """

    moments: tuple[Moment, ...]
    complete: bool = True
    remark: str = ""
    origin: str = ""


class Evolver(StateReader):
    """What a system with memory does at an event: starts, ways on, states elsewhere.

    The default evolver solves the cone problem of the restated law. A plug-in that knows more
    about its law returns an evolver of its own from
    :meth:`pwscont.SystemWithMemory.evolver`. An evolver may compute with other unknowns than users
    see, and says by :meth:`shown` what users see.
    """

    @abstractmethod
    def starts(self, t: float, start: Any) -> Moments:
        """Return the states with which evolutions begin.

        Parameters
        ----------
        t : float
        start : object
            What the user gave; None for all states that the initial memory admits.

        Raises
        ------
        InvalidInputError
            If the start is no state of the system.
        """

    @abstractmethod
    def ways_on(self, moment: Moment) -> WaysOn:
        """Return the ways on from a moment."""

    @abstractmethod
    def elsewhere(self, moment: Moment) -> Moments:
        """Return the other states at the same time that the memory of a moment admits."""

    @abstractmethod
    def sizes(self) -> Array:
        """Return typical magnitudes of the unknowns, shape (m,)."""

    def forget(self) -> None:
        """Forget what is kept between events, so that a resumed run repeats every bit."""

    def reached(self, moment: Moment, way: Way, t: float) -> Moment:
        """Return the state on a way at a later time; default on the straight line."""
        z = way.z + (t - moment.t) * way.rate
        return Moment(t, z, self.memory(z, t), way.mode)


def closeness(a: Array, b: Array, sizes: Array | float) -> float:
    """Return how far two vectors are apart, each component by its size."""
    apart, size = np.abs(a - b), np.maximum(np.abs(a), np.abs(b)) + sizes
    return float((apart / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


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
