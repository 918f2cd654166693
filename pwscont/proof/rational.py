"""Cells of systems of linear pieces in rational numbers: nothing is rounded."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.enumeration.echelon import Echelon, independent, integers

Point = tuple[Fraction, ...]


def value(row: Array, x: Sequence[Fraction]) -> Fraction:
    """Return the value of a row of doubles (x, constant) at a point."""
    terms = zip(row.tolist(), (*x, Fraction(1)), strict=True)
    return sum((Fraction(a) * b for a, b in terms if a and b), Fraction(0))


def segment_of(equations: Array, sides: Array, interval: tuple[float, float]) -> Any:
    """Return both ends (z, alpha) of all solutions of a cell over an interval of alpha.

    None where there are no solutions, () where they are not a segment or a point.
    """
    size = equations.shape[1] - 1
    echelon = Echelon(size)
    for row in map(integers, equations):
        longer = echelon.extended([row])
        if longer is None and echelon.reduced(row)[-1]:
            return None
        echelon = longer or echelon
    if len(echelon.rows) < size - 1:
        return ()
    whole = echelon.determinant
    free = [whole * (column not in echelon.columns) for column in range(size)]
    base = [Fraction(y, whole) for y in echelon.solved(size)]
    along = [Fraction(y, whole) for y in echelon.solved(size, 0, free)]
    ends = np.zeros((2, size + 1))
    ends[:, -2], ends[:, -1] = (1.0, -1.0), (-interval[0], interval[1])
    first, last = ([] if any(free) else [Fraction(0)] for _ in range(2))
    for row in np.vstack([sides, ends]):
        start = value(row, base)
        slope = value(np.append(row[:-1], 0.0), along)
        if slope:
            (first if slope > 0 else last).append(-start / slope)
        elif start < 0:
            return None
    if not first or not last:
        return ()
    if max(first) > min(last):
        return None
    places = max(first), min(last)
    return tuple(tuple(a + b * s for a, b in zip(base, along, strict=True)) for s in places)


def spans(rows: Array, others: Array) -> bool:
    """Tell whether other rows are sums of multiples of rows."""
    return not any(independent(np.vstack([rows, others]))[len(rows) :])
