"""Where points of a graph are stored, and the track of a piece.

A piece begins and ends at special points, and shares their places. Only the first digits of an
estimate of an error mean anything, and only these are kept.

The mode of a contact node fixes two of its four unknowns. Only the other two are stored.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.system.abilities import Compact, Reduction, shown_points
from pwscont.system.system import PiecewiseSystem

#: Bits of a double after sign, exponent and the first four binary digits, and what rounds these up.
DROPPED = np.uint64(48)
ROUND_UP = np.uint64(2**48 - 1)
#: The room of so few digits is next to nothing.
FEW = 64
#: Estimates of errors, or their first digits.
Kept: TypeAlias = npt.NDArray[Any]


class Place(ABC):
    """A point (z, alpha) with the estimate of its error."""

    __slots__ = ()

    @property
    @abstractmethod
    def alpha(self) -> float:
        """The parameter."""

    @property
    @abstractmethod
    def x(self) -> Array:
        """The point (z, alpha), shape (n + 1,)."""

    @property
    @abstractmethod
    def error(self) -> Array:
        """Estimate of its error, shape (n + 1,)."""


@final
class Stored(Place):
    """A place stored as it is.

    Parameters
    ----------
    x, error : ndarray, shape (n + 1,)
    """

    __slots__ = ("_error", "_x")

    def __init__(self, x: Array, error: Array) -> None:
        self._x, self._error = x, kept(error)

    @property
    def alpha(self) -> float:
        """The parameter."""
        return float(self._x[-1])

    @property
    def x(self) -> Array:
        """The point, not to be written to."""
        return self._x

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        return estimates(self._error)


@final
class WorkedOut(Place):
    """A place that is asked again and again for a moment.

    Parameters
    ----------
    place : Place
    """

    __slots__ = ("_error", "_x")

    def __init__(self, place: Place) -> None:
        self._x, self._error = place.x, place.error

    @property
    def alpha(self) -> float:
        """The parameter."""
        return float(self._x[-1])

    @property
    def x(self) -> Array:
        """The point, not to be written to."""
        return self._x

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        return self._error


def kept(error: Array) -> Kept:
    """Return what is kept of estimates: of few all, for to shorten them takes longer."""
    return first_digits(error) if len(error) > FEW else error


def estimates(error: Kept) -> Array:
    """Return the estimates of which this was kept, by their first digits."""
    return from_first_digits(error if error.dtype == np.uint16 else first_digits(error))


def first_digits(error: Array) -> npt.NDArray[np.uint16]:
    """Return estimates of errors, not negative, in two bytes each; rounded up by up to 6 %."""
    bits = np.asarray(error, dtype=float).view(np.uint64)
    return ((bits + ROUND_UP) >> DROPPED).astype(np.uint16)


def from_first_digits(digits: npt.NDArray[np.uint16]) -> Array:
    """Return the estimates that :func:`first_digits` stored."""
    return (digits.astype(np.uint64) << DROPPED).view(np.float64)


def place(system: PiecewiseSystem, character: Character, x: Array, error: Array) -> Place:
    """Return a solution of a selection and its error, of which no more is computed than stored.

    Parameters
    ----------
    system : PiecewiseSystem
    character : Character
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (n + 1,)
        The estimate of its error.
    """
    if not isinstance(system, Compact):
        return Stored(x, error)
    essential = system.essential(character)
    if essential is None:
        return Stored(x, error)
    known = np.append(essential, len(x) - 1)
    return Packed(system, character, x[known], error[known])


@final
class Packed(Place):
    """A place of which only alpha and the essential unknowns of a cell are stored.

    Parameters
    ----------
    system : Compact
    character : Character
    values, error : ndarray, shape (k + 1,)
        The essential unknowns, alpha last, and the estimate of their error.
    """

    __slots__ = ("_character", "_error", "_system", "_values")

    def __init__(self, system: Compact, character: Character, values: Array, error: Array) -> None:
        self._system, self._character = system, character
        self._values, self._error = values, kept(error)

    @property
    def alpha(self) -> float:
        """The parameter."""
        return float(self._values[-1])

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return np.append(self._completed(self._values[:-1]), self._values[-1])

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        error = estimates(self._error)
        spread = self._completed(error[:-1]) - self._completed(np.zeros(len(error) - 1))
        return np.append(np.abs(spread), error[-1])

    def _completed(self, values: Array) -> Array:
        return self._system.completed(values, self.alpha, self._character)


@final
class WithoutHidden(Place):
    """A place with the unknowns that a user knows of."""

    __slots__ = ("_place", "_system")

    def __init__(self, place: Place, system: PiecewiseSystem) -> None:
        self._place, self._system = place, system

    @property
    def alpha(self) -> float:
        """The parameter."""
        return self._place.alpha

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return shown_points(self._system, self._place.x)

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        return shown_points(self._system, self._place.error)


@final
class Lifted(Place):
    """A place of a reduced system, with all unknowns of the full one."""

    __slots__ = ("_place", "_reduction", "_size")

    def __init__(self, place: Place, reduction: Reduction, size: int) -> None:
        self._place, self._reduction, self._size = place, reduction, size

    @property
    def alpha(self) -> float:
        """The parameter."""
        return self._place.alpha

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return self._reduction.points(self._place.x, self._size)

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        return self._reduction.points(self._place.error, self._size)


@final
@dataclass(slots=True, eq=False)  # thousands are made, of frozen ones in several times as long
class Track:
    """The points of a piece: both ends, which it shares with special points, and those between.

    Attributes
    ----------
    start, end : Place
    inner : ndarray, shape (k - 2, n + 1)
    """

    start: Place
    inner: Array
    end: Place

    @classmethod
    def of(cls, points: Array) -> Track:
        """Return the track through points, shape (k, n + 1)."""
        zero = np.zeros(points.shape[1])
        return cls(Stored(points[0], zero), points[1:-1], Stored(points[-1], zero))

    @property
    def points(self) -> Array:
        """All points, shape (k, n + 1), a new array."""
        return np.vstack([self.start.x, self.inner, self.end.x])

    @property
    def alpha(self) -> Array:
        """The parameter at all points, shape (k,)."""
        return np.concatenate([[self.start.alpha], self.inner[:, -1], [self.end.alpha]])

    def reversed(self) -> Track:
        """Return the points in opposite order."""
        return Track(self.end, self.inner[::-1], self.start)
