"""Places of special points, stored so that thousands of them are cheap.

A piece begins and ends at special points, and shares their places. Only the first digits of an
estimate of an error mean anything, and only these are kept.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, TypeAlias, final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array

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
