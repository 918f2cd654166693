"""A state as a run computes with the state, the ways on, and the seam of what finds the ways."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array


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


class StateReader(ABC):
    """What the unknowns of a run mean: the state that users see, and the memory."""

    @abstractmethod
    def memory(self, z: Array, t: float) -> Array:
        """Return what a state leaves behind, shape (k,)."""

    def shown(self, z: Array, t: float) -> Array:
        """Return the state as users see the state; default the same unknowns."""
        return z

    @abstractmethod
    def names(self) -> Sequence[str]:
        """Return a name for each unknown that users see."""


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
