"""Factorisations of dense matrices by LAPACK.

Failure modes and answers
-------------------------
- The matrix is singular at a branch point, or where the curve is tangent to an interface: the
  reciprocal condition number of the scaled matrix tells, and nan or inf in the matrix as well.
- A matrix of thousands of rows: every routine works in the place of the given matrix.
"""

from __future__ import annotations

import math
from typing import final

import numpy as np
from scipy.linalg import lapack

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS
from pwscont.linear.factor import LU, Factor, power_of_two, regularise, sign_of_pivots

#: Most rows, and most right-hand sides, for solutions one after the other, see :func:`_solved`.
FEW_ROWS, FEW_COLUMNS = 32, 8
#: Number of columns of an inverse that LAPACK computes together, the block size of ``dgetri``:
#: with less room ``dgetri`` works column by column.
BLOCK = 64


@final
class DenseFactor(Factor):
    """LU with partial pivoting of a matrix M in any units: L U = R M C, with R and C diagonal.

    ``matrix``, shape (k, k): M, which is overwritten, or copied where M is not in Fortran order. If
    M is not finite, the factorisation has ``failed``.
    ``scale``, shape (k,): the diagonal of C: typical magnitudes of the unknowns, powers of two.
    """

    def __init__(self, matrix: Array, scale: Array) -> None:
        matrix *= scale
        self._columns, self._rows = scale, 1.0 / power_of_two(row_maxima(matrix))
        by_columns = matrix.T  # the multipliers lie along the rows of the transpose
        by_columns *= self._rows
        self._norm = lapack.dlange("1", matrix)
        self._lu, self._pivots, info = lapack.dgetrf(matrix, True)
        self.failed = info > 0 or not self._norm < math.inf
        self._is_singular: bool | None = None

    @property
    def sign(self) -> int:
        """Sign of the determinant; 0 where a pivot vanishes exactly."""
        return 0 if self.failed else sign_of_pivots(self._lu.diagonal(), self._pivots)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for a right-hand side."""
        # the arguments 0 and 1: not transposed, in the room of the product
        scaled: Array = lapack.dgetrs(self._lu, self._pivots, rhs * self._rows, 0, 1)[0]
        scaled *= self._columns
        return scaled

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, k)."""
        return _solved(self._lu, self._pivots, (rhs * self._rows).T).T * self._columns

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        scaled: Array = lapack.dgetrs(self._lu, self._pivots, rhs * self._columns, 1, 1)[0]
        return scaled * self._rows

    def is_singular(self) -> bool:
        """Tell whether the scaled matrix is singular to rounding."""
        if self._is_singular is None:
            rcond = 0.0 if self.failed else float(lapack.dgecon(self._lu, self._norm)[0])
            self._is_singular = not rcond >= len(self._lu) * EPS  # True for nan
        return self._is_singular


def _solved(lu: Array, pivots: Indices, rhs: Array, transposed: bool = False) -> Array:
    """Return the solutions for the columns of an array, shape (k,) or (k, l).

    OpenBLAS shares several right-hand sides among threads, however small the matrix is, and a
    thread may have to wait for a core: a few columns of a small matrix are solved for in turn.
    """
    if rhs.ndim == 2 and 1 < rhs.shape[1] <= FEW_COLUMNS and len(pivots) <= FEW_ROWS:
        solutions = np.array(rhs, order="F")
        for column in solutions.T:  # solved for in the room of the column
            lapack.dgetrs(lu, pivots, column, int(transposed), 1)
        return solutions
    return np.asarray(lapack.dgetrs(lu, pivots, rhs, int(transposed))[0])


def row_maxima(matrix: Array) -> Array:
    """Return the largest magnitude in each row, without an array of all magnitudes."""
    largest: Array = np.maximum(matrix.max(axis=1), -matrix.min(axis=1))
    return largest


@final
class DenseLU(LU):
    """LU of a dense matrix.

    ``lu``, ``pivots``, shapes (k, k) and (k,): factors and row exchanges in the form of LAPACK's
    ``dgetrf``, see :meth:`of`.
    """

    def __init__(self, lu: Array, pivots: Indices) -> None:
        self.lu, self.pivots = lu, pivots

    @classmethod
    def of(cls, matrix: Array, overwrite: bool = False) -> DenseLU:
        """Factorise a matrix; pivots that vanish to rounding are moved off zero."""
        lu, pivots, _ = lapack.dgetrf(matrix, overwrite_a=overwrite)
        regularise(lu.ravel(order="K")[:: len(lu) + 1])
        return cls(lu, pivots)

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return sign_of_pivots(self.lu.diagonal(), self.pivots)

    def solved(self, rhs: Array, transposed: bool = False) -> Array:
        """Return the solutions for the columns of an array."""
        return _solved(self.lu, self.pivots, rhs, transposed)

    def reciprocal_condition(self, norm: float) -> float:
        """Return the reciprocal condition number, from the 1-norm of the matrix."""
        rcond: float = lapack.dgecon(self.lu, norm)[0]
        return rcond

    def turned_into_inverse(self) -> Array:
        """Return the inverse matrix in the room of the factorisation, which is lost."""
        inverse: Array = lapack.dgetri(self.lu, self.pivots, BLOCK * len(self.lu), 1)[0]
        return inverse
