"""Cells of systems of linear pieces in rational numbers: nothing is rounded."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array

Point = tuple[Fraction, ...]


def rational(rows: Array) -> list[list[Fraction]]:
    """Return rows of doubles as the numbers that they are."""
    return [[Fraction(number) for number in row] for row in rows.tolist()]


def value(row: list[Fraction], x: Sequence[Fraction]) -> Fraction:
    """Return the value of a row (x, constant) at a point."""
    return sum((a * b for a, b in zip(row, x, strict=False) if a and b), row[-1])


def eliminated(rows: list[list[Fraction]]) -> dict[int, list[Fraction]] | None:
    """Return unit columns with their rows (x, constant); None where no x solves all rows."""
    left, done = rows, dict[int, list[Fraction]]()
    for column in range(len(rows[0]) - 1):
        pivot = next((row for row in left if row[column]), None)
        if pivot is not None:
            unit = [number / pivot[column] for number in pivot]
            left = [_without(row, unit, column) for row in left if row is not pivot]
            done = {place: _without(row, unit, column) for place, row in done.items()}
            done[column] = unit
    return None if any(row[-1] for row in left) else done


def _without(row: list[Fraction], unit: list[Fraction], column: int) -> list[Fraction]:
    """Return a row without a column, by a row that has 1 there."""
    factor = row[column]
    if not factor:
        return row
    return [a - factor * b if b else a for a, b in zip(row, unit, strict=True)]


def segment_of(equations: Array, sides: Array, interval: tuple[float, float]) -> Any:
    """Return both ends (z, alpha) of all solutions of a cell over an interval of alpha.

    None where there are no solutions, () where they are not a segment or a point.
    """
    done, columns = eliminated(rational(equations)), equations.shape[1] - 1
    if done is None or len(done) < columns - 1:
        return None if done is None else ()
    free = next((column for column in range(columns) if column not in done), None)
    base = [-done[k][-1] if k in done else Fraction(0) for k in range(columns)]
    along = [Fraction(k == free) if free in (None, k) else -done[k][free] for k in range(columns)]
    ends = np.zeros((2, columns + 1))
    ends[:, -2], ends[:, -1] = (1.0, -1.0), (-interval[0], interval[1])
    first: Fraction | None = None if free is not None else Fraction(0)
    last = first
    for row in rational(np.vstack([sides, ends])):
        start = value(row, base)
        slope = value([*row[:-1], Fraction(0)], along)
        if slope > 0:
            first = -start / slope if first is None else max(first, -start / slope)
        elif slope < 0:
            last = -start / slope if last is None else min(last, -start / slope)
        elif start < 0:
            return None
    if first is None or last is None:
        return ()
    if first > last:
        return None
    return tuple(tuple(a + b * s for a, b in zip(base, along, strict=True)) for s in (first, last))


def spans(rows: Array, others: Array) -> bool:
    """Tell whether other rows are sums of multiples of rows."""
    used = (rows != 0.0).any(axis=0) | (others != 0.0).any(axis=0)
    left, both = (
        [[*row, Fraction(0)] for row in rational(each[:, used])]
        for each in (rows, np.vstack([rows, others]))
    )
    return len(eliminated(left) or ()) == len(eliminated(both) or ())
