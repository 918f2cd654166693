"""The seam of everything that is watched along a piece."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Failure
from pwscont.numerics.curve import Curve, State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.rays import Ray

#: Slopes of a pair of functions that are not known.
UNKNOWN = np.zeros(2)
UNKNOWN.setflags(write=False)


@final
@dataclass(frozen=True, slots=True)
class Reading:
    """Values of the watched functions at a state, and their slopes along its tangent.

    Attributes
    ----------
    values : ndarray, shape (k,)
        Positive while nothing happens; a change to zero or below is an event.
    slopes : ndarray, shape (k,)
        Derivatives along the tangent; zero where they are not known.
    """

    values: Array
    slopes: Array


@final
@dataclass(frozen=True, slots=True)
class Arrival:
    """A special point reached, and the ways on from it.

    Attributes
    ----------
    kind : Kind
    x : ndarray, shape (n + 1,)
    message : str
        What happens there, for the user.
    rays : tuple of Ray
        Every piece that is known to end here, first the one that was followed, pointing back.
    """

    kind: Kind
    x: Array
    message: str
    rays: tuple[Ray, ...]


class TransitionDetector(ABC):
    """Watches functions along a piece; where one stops being positive is a special point."""

    @abstractmethod
    def read(self, curve: Curve, state: State) -> Reading:
        """Return what is watched at ``state``."""

    @abstractmethod
    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Return the state at which function ``index`` vanishes, for s within the bracket.

        Its tangent points in the direction of the segment.
        """

    def overlooks(self, segment: CurvedSegment, start: Reading, end: Reading) -> Failure | None:
        """Say why a shorter step must be taken, if something comes and goes within this one.

        Parameters
        ----------
        segment : CurvedSegment
        start, end : Reading
            What this detector reads at both ends.

        Returns
        -------
        Failure or None
            What is said of the branch where no shorter step helps.
        """
        return None

    @abstractmethod
    def arrive(self, curve: Curve, state: State, index: int) -> Arrival:
        """Return the special point at ``state``, where function ``index`` vanishes."""
