"""Solves with matrices that differ in some rows, as where contact nodes change modes.

An explicit inverse is kept, and all changed rows are replaced at once (Woodbury). Every solve names
the matrix: rows are replaced back for a caller that solves with an older matrix. Rounding errors of
the changes add up: the caller compares the residual with :func:`drifted`, and asks for a fresh
factorisation.
"""

from __future__ import annotations

from typing import Protocol, final

import numpy as np
from scipy.linalg import blas, lapack

from pwscont.extending import EPS, SMALL_PIVOT, Array, DenseLU, Indices

#: Number of columns of an inverse that LAPACK computes together, the block size of ``dgetri``:
#: with less room ``dgetri`` works column by column.
COLUMNS_AT_ONCE = 64
#: Largest residual of a solution, as a part of the largest entry of solution and right-hand side.
#: The solutions are corrections and directions, whose points are corrected afterwards: nine digits
#: are enough.
DRIFT = 1e-9
#: Least reciprocal condition number of a matrix that is inverted: the inverse loses three quarters
#: of the digits there, and an LU less.
INVERTIBLE = EPS**0.75
#: Largest part of the rows of an inverse that is replaced at once, in 4 k m^2 operations for k of m
#: rows: two thirds of the 2 m^3 operations that a new inverse takes.
LARGEST_PART_REPLACED = 1.0 / 3.0
#: Number of changes, as a multiple of the number of rows, after which the matrix is factorised
#: afresh: the factorisation then costs a tenth of the changes before.
MANY_UPDATES = 2.0
#: Least number of changes before such a factorisation, for matrices of a few rows.
LEAST_UPDATES = 8
#: Most changed rows for which an LU is inverted, in 4/3 m^3 operations.
MOST_BEFORE_INVERSE = 8
#: Most nonzeros of a right-hand side for which only their columns of an inverse are read: a third
#: of the time of paths with 400 contact nodes.
FEW_ENTRIES = 8


class RowMatrix(Protocol):
    """A square matrix with entries of about 1 and with a key, a number, for each row."""

    keys: Array  #: Shape (m,): rows of two matrices of a family are equal if the keys are equal.

    def rows(self, which: Indices) -> Array:
        """Return some rows, shape (k, m)."""

    def dense(self) -> Array:
        """Return a new array of the whole matrix, shape (m, m), in Fortran order."""


def drifted(rhs: Array, solution: Array, product: Array) -> bool:
    """Tell whether a solution, whose product with the matrix is given, is too inaccurate."""
    size = max(float(np.abs(rhs).max()), float(np.abs(solution).max()))
    return not float(np.abs(rhs - product).max()) <= DRIFT * size


@final
class Updating:
    """Solves with the matrices of a family: keeps the last LU, or the inverse once rows change."""

    def __init__(self) -> None:
        self.updates = self.factorisations = 0  #: How often each was done.
        self._last: RowMatrix | None = None
        self._lu: DenseLU | None = None  # of the last matrix; None if the inverse is kept
        self._inverse: Array = np.empty((0, 0))
        self._sign = 0
        self._is_invertible = True  # as far as is known
        self._replaced = 0  # rows, since the last factorisation

    def solve(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution for a right-hand side, shape (m,), or several, shape (l, m)."""
        self._take(matrix)
        if self._lu is not None:
            return self._lu.solve(rhs)
        if rhs.ndim == 1 and np.count_nonzero(rhs) <= FEW_ENTRIES:  # as of a change of one node
            entries = np.flatnonzero(rhs)
            return np.asarray(self._inverse[:, entries] @ rhs[entries])
        return np.asarray(rhs @ self._inverse.T)

    def solve_transposed(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        self._take(matrix)
        return rhs @ self._inverse if self._lu is None else self._lu.solve_transposed(rhs)

    def sign(self, matrix: RowMatrix) -> int:
        """Return the sign of the determinant of a matrix, or of a nearby matrix if singular."""
        self._take(matrix)
        return self._sign

    def renew(self, matrix: RowMatrix) -> bool:
        """Factorise a matrix afresh, unless the LU of just this matrix is kept."""
        is_unchanged = self._is_at(matrix) and not self._replaced
        if is_unchanged and self._lu is not None:
            return False
        self._factorise(matrix)
        self._is_invertible = not is_unchanged  # an unchanged inverse is too inaccurate
        return True

    def _is_at(self, matrix: RowMatrix) -> bool:
        return self._last is not None and self._last.keys is matrix.keys

    def _take(self, matrix: RowMatrix) -> None:
        """Make a matrix the last matrix, by changes or a factorisation."""
        if self._is_at(matrix):
            return
        if self._last is None or not self._update(matrix, self._last):
            self._factorise(matrix)
        self._last = matrix

    def _factorise(self, matrix: RowMatrix) -> None:
        self._last = self._lu = None
        self._inverse = np.empty((0, 0))  # makes room for the new matrix
        self._lu = DenseLU(matrix.dense(), overwrite=True)
        self._sign = self._lu.sign
        self._last, self._replaced, self._is_invertible = matrix, 0, True
        self.factorisations += 1

    def _update(self, matrix: RowMatrix, last: RowMatrix) -> bool:
        """Replace rows of the last matrix; False where a factorisation serves better."""
        m, changed = len(last.keys), np.flatnonzero(last.keys != matrix.keys)
        if not len(changed):
            return True
        few = MOST_BEFORE_INVERSE if self._lu is not None else max(2.0, LARGEST_PART_REPLACED * m)
        if len(changed) > few or self._replaced >= max(LEAST_UPDATES, MANY_UPDATES * m):
            return False
        if not self._invert() or not self._replace(matrix, changed):
            return False
        self._replaced += len(changed)
        self.updates += 1
        return True

    def _invert(self) -> bool:
        """Turn the LU into the inverse; False where the matrix is conditioned too badly."""
        if self._lu is not None and self._is_invertible:
            self._is_invertible = self._lu.reciprocal_condition >= INVERTIBLE
            if self._is_invertible:
                room = COLUMNS_AT_ONCE * len(self._lu.lu)
                self._inverse = np.asarray(lapack.dgetri(self._lu.lu, self._lu.pivots, room, 1)[0])
                self._lu = None
        return self._lu is None

    def _replace(self, matrix: RowMatrix, which: Indices) -> bool:
        """Change rows E^T M to R by Woodbury's formula; False where digits are lost.

        M'^-1 = M^-1 - M^-1 E (R M^-1 E)^-1 (R M^-1 - E^T), as E^T M M^-1 E is the identity.
        """
        rows, w = matrix.rows(which), self._inverse[:, which]
        parts = rows @ self._inverse
        pivots, terms = DenseLU(parts[:, which]), np.abs(rows) @ np.abs(w)
        smallest = np.abs(pivots.lu.diagonal()).min()
        if not smallest > SMALL_PIVOT * (1.0 + terms.max()):
            return False
        parts[np.arange(len(which)), which] -= 1.0
        parts = pivots.solve(parts.T).T
        self._inverse = blas.dgemm(-1.0, w, parts, 1.0, self._inverse, overwrite_c=1)
        self._sign *= pivots.sign
        return True
