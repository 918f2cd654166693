"""Linear systems too large for rational elimination, solved to far beyond double precision.

A solution is refined by an approximate inverse R of the matrix S, ``y <- y + R (b - S y)``, with
exact residuals, computed in integers. If ``|I - R S| < 1`` in the largest row sum, the error is
below ``|R (b - S y)| / (1 - |I - R S|)``, S is regular, and det S has the sign of det R (Rump,
Verification methods, Acta Numerica 19, 2010, sections 10.2 and 10.7).

Failure modes and answers
-------------------------
- Rows and columns have very different sizes: rows and columns are scaled by powers of two, without
  rounding.
- A matrix is singular to rounding: ``|I - R S|`` is not small, and the returned sign is 0.
"""

from __future__ import annotations

from fractions import Fraction
from math import lcm

import numpy as np

from pwscont.bench.truth.rational import Row
from pwscont.extending import Array

#: Solutions, in scaled unknowns, are multiples of two to the power of minus this.
BITS = 320
#: The error of solutions is below two to the power of minus this, relative to the largest unknown.
KNOWN_BITS = 200
#: Largest row sum of |I - R S| that is trusted; each pass of refinement then gains a factor of ten.
LARGEST_DEFECT = 0.1
MOST_PASSES = KNOWN_BITS

SparseRow = dict[int, int]


def refined(matrix: Array, rhs: Array) -> tuple[list[Row], int]:
    """Return the solution, a row per unknown, and the sign of the determinant.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
    rhs : ndarray, shape (n, k)

    Returns
    -------
    list of list of Fraction, int
        The solution to KNOWN_BITS bits, and the sign. If the matrix is singular to rounding, the
        solution is empty and the sign is 0.
    """
    if not (matrix.any(axis=0).all() and matrix.any(axis=1).all()):
        return [], 0
    rows = _power_of_two(np.abs(matrix).max(axis=1))
    columns = _power_of_two(np.abs(matrix / rows[:, np.newaxis]).max(axis=0))
    scaled = matrix / rows[:, np.newaxis] / columns
    inverse, sign = _inverse(scaled)
    if sign == 0:
        return [], 0
    unit, exact = _integers(np.column_stack([scaled, rhs / rows[:, np.newaxis]]))
    sides = [_refine(exact, unit, inverse, k) for k in range(rhs.shape[1])]
    whole = [Fraction(float(column)) * 2**BITS for column in columns]
    return [[Fraction(y) / by for y in ys] for by, *ys in zip(whole, *sides, strict=True)], sign


def _power_of_two(sizes: Array) -> Array:
    powers: Array = np.ldexp(1.0, np.frexp(sizes)[1])
    return powers


def _inverse(scaled: Array) -> tuple[Array, int]:
    """Return an approximate inverse and the sign of the determinant, 0 if not certain."""
    try:
        inverse = np.asarray(np.linalg.inv(scaled), dtype=np.float64)
    except np.linalg.LinAlgError:
        return scaled, 0
    defect = np.abs(np.eye(len(scaled)) - inverse @ scaled).sum(axis=1).max()
    sign, other = (int(np.linalg.slogdet(m)[0]) for m in (scaled, inverse))
    return inverse, sign if defect < LARGEST_DEFECT and sign == other else 0


def _integers(matrix: Array) -> tuple[int, list[SparseRow]]:
    """Return a unit, and each row as column -> entry times the unit, without zeros."""
    exact = [{int(j): Fraction(float(row[j])) for j in np.flatnonzero(row)} for row in matrix]
    unit = lcm(*(entry.denominator for row in exact for entry in row.values()))
    return unit, [{j: int(entry * unit) for j, entry in row.items()} for row in exact]


def _refine(exact: list[SparseRow], unit: int, inverse: Array, side: int) -> list[int]:
    """Return the solution times 2^BITS for one right side, rounded to integers."""
    size = len(exact)
    right = [row.get(size + side, 0) << BITS for row in exact]
    left = [[(j, entry) for j, entry in row.items() if j < size] for row in exact]
    y = [0] * size
    for _ in range(MOST_PASSES):
        over = zip(right, left, strict=True)
        residual = [b - sum(entry * y[j] for j, entry in row) for b, row in over]
        # a quotient of integers of any size is rounded only once
        rounded = np.array([r / (unit << BITS) for r in residual])
        correction = [int(Fraction(float(d)) * 2**BITS) for d in inverse @ rounded]
        y = [a + d for a, d in zip(y, correction, strict=True)]
        if max(map(abs, correction)) <= max(map(abs, y)) >> KNOWN_BITS:
            return y
    raise AssertionError("refinement gains a factor 1 / LARGEST_DEFECT in every pass")
