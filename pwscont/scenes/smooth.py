"""Smooth curves through the points of a piece.

Corners of a polygon would look like kinks. The curve's parameter is the length along the points;
its cubics never leave the range of their ends (Fritsch and Carlson 1980). Unknowns that change by
rounding only do not count for the length; points that nearly coincide are drawn as one point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from pwscont.basics.arrays import Array

#: Least points of a piece that is drawn as a smooth curve, and parts of each of its steps.
LEAST_POINTS, FINER = 4, 8
#: Points of a piece closer than this part of its length are drawn as one.
APART = 1e-6
#: Unknowns that change by less than this part of the largest value change by rounding only.
SAME = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Smooth:
    """The places at which a curve through points is drawn.

    Attributes
    ----------
    kept : ndarray of bool, shape (k,)
        The points that the curve passes through.
    length : ndarray
        The length along the points at the kept points.
    fine : ndarray
        The lengths at which the curve is drawn.
    """

    kept: npt.NDArray[np.bool_]
    length: Array
    fine: Array

    @classmethod
    def through(cls, points: Array, finer: int = FINER) -> Smooth | None:
        """Return the curve through points (z, alpha), shape (k, n + 1), None through too few."""
        if len(points) < LEAST_POINTS:
            return None
        length = length_along(points)
        apart = np.diff(length) > APART * length[-1]
        kept = np.concatenate([[True], apart[:-1] & apart[1:], [True]])
        length = length[kept]
        if len(length) < LEAST_POINTS:
            return None
        ends = np.arange(len(length))
        fine = np.interp(np.linspace(0.0, ends[-1], finer * ends[-1] + 1), ends, length)
        return cls(kept, length, fine)

    def __call__(self, values: Array) -> Array:
        """Return values along the curve from those at all points, shape (k,) or (k, m)."""
        along: Array = PchipInterpolator(self.length, values[self.kept])(self.fine)
        return along


def is_straight(values: Array, parts: Array) -> bool:
    """Tell whether values, (k,) or (k, m), at parts of the way lie on the line of their ends."""
    line = values[0] + np.multiply.outer(parts, values[-1] - values[0])
    return bool((np.abs(values - line) <= SAME * np.abs(values).max(axis=0)).all())


def length_along(points: Array) -> Array:
    """Return the length along points, shape (k, m), at each; columns count by their extent."""
    extent, size = np.ptp(points, axis=0), np.abs(points).max()
    steps = np.diff(points / np.where(extent > SAME * size, extent, np.inf), axis=0)
    return np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
