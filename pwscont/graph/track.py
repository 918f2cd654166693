"""The points of a piece, which shares its ends with special points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.graph.place import Place, Stored


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
