"""A point (z, alpha) with the estimate of its error, and the points of a piece.

A piece begins and ends at special points, and the piece and its special points share the same
places. Only the first digits of an estimated error mean anything, and a place keeps only these.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array

#: Number of low bits of a double that are dropped: sign, exponent and four binary digits remain.
DROPPED_BITS = np.uint64(48)
#: The integer that is added to the bits of a double before the low bits are dropped, to round up.
ROUND_UP = np.uint64(2**48 - 1)
#: The first digits of estimated errors, see :func:`first_digits`.
Digits = npt.NDArray[np.uint16]


@final
class Place:
    """A point (z, alpha) with the estimate of its error.

    Parameters
    ----------
    x : ndarray, shape (n + 1,)
        The point, which nobody may write to.
    error : ndarray, shape (n + 1,)
        The estimated error of each component, not negative.
    """

    __slots__ = ("_digits", "x")

    def __init__(self, x: Array, error: Array) -> None:
        self.x, self._digits = x, first_digits(error)

    @property
    def alpha(self) -> float:
        """The parameter."""
        return float(self.x[-1])

    @property
    def error(self) -> Array:
        """The estimated error, rounded up to the first digits, shape (n + 1,)."""
        return from_first_digits(self._digits)


def first_digits(error: Array) -> Digits:
    """Return estimated errors, not negative, in two bytes each, rounded up by at most 6 %."""
    bits = np.asarray(error, dtype=float).view(np.uint64)
    return ((bits + ROUND_UP) >> DROPPED_BITS).astype(np.uint16)


def from_first_digits(digits: Digits) -> Array:
    """Return the estimated errors that :func:`first_digits` stored."""
    return (digits.astype(np.uint64) << DROPPED_BITS).view(np.float64)


@final
@dataclass(slots=True, eq=False)  # not frozen: to make thousands of frozen records takes long
class Track:
    """The points of a piece: the two ends, shared with special points, and the points between.

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
        """Return the track through points of shape (k, n + 1), with errors of zero."""
        zero = np.zeros(points.shape[1])
        return cls(Place(points[0], zero), points[1:-1], Place(points[-1], zero))

    @property
    def points(self) -> Array:
        """All points, shape (k, n + 1), a new array."""
        return np.vstack([self.start.x, self.inner, self.end.x])

    @property
    def alpha(self) -> Array:
        """The parameter at all points, shape (k,)."""
        return np.concatenate([[self.start.alpha], self.inner[:, -1], [self.end.alpha]])

    def reversed(self) -> Track:
        """Return the same points in opposite order."""
        return Track(self.end, self.inner[::-1], self.start)
