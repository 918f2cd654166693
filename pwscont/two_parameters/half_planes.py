"""Intersections of the square [-1, 1]^2 with half-planes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pwscont.extending import Array

#: The square, its corners counter-clockwise.
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def clipped(sides: Iterable[Array]) -> Array:
    """Return the part of the square in which a s + b t + c >= 0 for all (a, b, c).

    The algorithm of Sutherland and Hodgman (1974) cuts side by side.

    Returns
    -------
    ndarray, shape (k, 2)
        The corners of that part, counter-clockwise; none for an empty part.
    """
    polygon = SQUARE
    for side in sides:
        values = polygon @ side[:2] + side[2]
        if (values < 0.0).any():
            polygon = _cut(polygon, values)
        if not len(polygon):
            break
    return polygon


def _cut(polygon: Array, values: Array) -> Array:
    """Return the part of a polygon where an affine function, given at the corners, is >= 0."""
    kept: list[Array] = []
    for i, value in enumerate(values):
        before = values[i - 1]
        if (value < 0.0) != (before < 0.0):
            part = before / (before - value)
            kept.append(polygon[i - 1] + part * (polygon[i] - polygon[i - 1]))
        if value >= 0.0:
            kept.append(polygon[i])
    return np.array(kept).reshape(-1, 2)


def width_of(polygon: Array) -> float:
    """Return twice the area divided by the perimeter, a bound for the radius of circles inside."""
    if len(polygon) < 3:
        return 0.0
    ahead = np.roll(polygon, -1, axis=0)
    area = 0.5 * float((polygon[:, 0] * ahead[:, 1] - ahead[:, 0] * polygon[:, 1]).sum())
    perimeter = float(np.hypot(*(ahead - polygon).T).sum())
    return 2.0 * area / perimeter if perimeter else 0.0
