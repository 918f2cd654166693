"""Preconditioned interval Newton contraction of boxes of (z, alpha).

With J the interval derivatives on a box X and c a point of X, every solution x in X satisfies
0 = H(c) + J' (x - c) for some J' in J. Multiplied by any matrix, the equations still hold; a matrix
that nearly makes unit columns of the middle of J, for the n most important of n + 1 coordinates,
lets every row bound one coordinate by the others (Neumaier, *Interval Methods for Systems of
Equations*, 1990, chapter 5; Kearfott, *Rigorous Global Search*, 1996, chapter 3).
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.intervals.interval import Interval
from pwscont.proof.evaluate import slopes_of, values_of
from pwscont.proof.tape import Tape


def stacked(intervals: list[Interval]) -> Interval:
    """Return intervals of one shape as one, along a new first axis."""
    return Interval(np.stack([x.lo for x in intervals]), np.stack([x.hi for x in intervals]))


def formula(tape: Tape, box: Interval) -> Interval:
    """Return the n entries of the formula on boxes (n + 1, B), shape (n, B)."""
    return picked(tape, values_of(tape, box))


def with_slopes(tape: Tape, box: Interval) -> tuple[Interval, Interval]:
    """Return the formula and the derivatives by (z, alpha), shapes (n, B) and (n, n + 1, B)."""
    values = values_of(tape, box)
    slopes = slopes_of(tape, values, box)
    return picked(tape, values), picked(tape, slopes)


def picked(tape: Tape, found: list[Interval]) -> Interval:
    """Return of what is known of all steps what is known of the outputs."""
    return stacked([found[place] for place in tape.outputs])


def times(matrix: Array, right: Interval) -> Interval:
    """Return matrices of numbers (n, n, B) times intervals (n, ..., B)."""
    rows = []
    for row in matrix:
        parts = [
            Interval.point(row[k].reshape((1,) * (right.lo.ndim - 2) + row[k].shape)) * right[k]
            for k in range(len(row))
        ]
        rows.append(total(parts))
    return stacked(rows)


def total(parts: list[Interval]) -> Interval:
    """Return the sum of intervals."""
    found = parts[0]
    for part in parts[1:]:
        found = found + part
    return found


def eliminated(middle: Array, width: Array) -> tuple[Array, Indices]:
    """Return a matrix that turns the n largest columns into unit columns, and these columns.

    Parameters
    ----------
    middle : ndarray, shape (n, n + 1, B)
        About the derivatives; any numbers will do.
    width : ndarray, shape (n + 1, B)
        The importance of each column.

    Returns
    -------
    matrix : ndarray, shape (n, n, B)
        Finite; not exact, which no rule needs.
    columns : ndarray of int, shape (n, B)
    """
    n, _, count = middle.shape
    rows = np.where(np.isfinite(middle), middle, 0.0).transpose(2, 0, 1).copy()
    inverse = np.broadcast_to(np.eye(n), (count, n, n)).copy()
    columns, each = np.zeros((n, count), dtype=np.intp), np.arange(count)
    for i in range(n):
        size = np.abs(rows[:, i:, :]) * width.T[:, np.newaxis, :]
        best = size.reshape(count, (n - i) * (n + 1)).argmax(axis=1)
        row, columns[i] = i + best // (n + 1), best % (n + 1)
        for matrix in (rows, inverse):
            matrix[each, i], matrix[each, row] = matrix[each, row], matrix[each, i].copy()
        pivot = rows[each, i, columns[i]][:, np.newaxis]
        factors = rows[each, :, columns[i]] / pivot
        factors[:, i] = 0.0
        for matrix in (rows, inverse):
            matrix[:] -= factors[:, :, np.newaxis] * matrix[:, [i], :]
            matrix[:, i] /= pivot
    return np.where(np.isfinite(inverse), inverse, 0.0).transpose(1, 2, 0), columns


def inverse(middle: Array) -> Array:
    """Return about the inverse of square matrices (n, n, B); any numbers will do."""
    n, _, count = middle.shape
    whole_width = np.vstack([np.ones((n, count)), np.zeros((1, count))])
    padded = np.concatenate([middle, np.zeros((n, 1, count))], axis=1)
    rows, columns = eliminated(padded, whole_width)
    found = np.zeros_like(rows)
    each = np.arange(count)
    for i in range(n):
        found[columns[i], :, each] = rows[i].T
    return found


def newton(tape: Tape, box: Interval, slopes: Interval) -> tuple[Interval, Signs]:
    """Return boxes contracted by one sweep of interval Newton, and which boxes are empty."""
    middle = box.middle()
    at_middle = formula(tape, Interval.point(middle))
    matrix, columns = eliminated(slopes.middle(), box.width())
    rows, rest = times(matrix, slopes), times(matrix, at_middle)
    lo, hi = box.lo.copy(), box.hi.copy()
    empty = np.zeros(lo.shape[1], dtype=bool)
    for i in range(tape.size):
        away = Interval(lo, hi) - Interval.point(middle)
        terms = rows[i] * away
        empty |= (rest[i] + total(list(_each(terms)))).excludes_zero()
        _bound(lo, hi, middle, rows[i], rest[i], terms, columns[i])
    empty |= (lo > hi).any(axis=0)
    return Interval(lo, hi), empty


def _each(intervals: Interval) -> list[Interval]:
    return [intervals[j] for j in range(len(intervals.lo))]


def _bound(
    lo: Array,
    hi: Array,
    middle: Array,
    row: Interval,
    rest: Interval,
    terms: Interval,
    own: Indices,
) -> None:
    """Bound in each box one coordinate, ``own``, by one row; the ends are changed."""
    count = len(own)
    for j in range(len(lo)):
        mine = np.flatnonzero(own == j)
        if not len(mine):
            continue
        some = np.s_[:] if len(mine) == count else mine
        others = [terms[k][some] for k in range(len(lo)) if k != j]
        away = -(total([rest[some], *others])) / row[j][some]
        found = Interval.point(middle[j][some]) + away
        lo[j, some] = np.fmax(lo[j, some], found.lo)
        hi[j, some] = np.fmin(hi[j, some], found.hi)
