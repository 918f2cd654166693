"""Solves with a matrix that changes a few rows at a time, each change in O(m k).

Where row r of M is replaced, M' = M + e_r d^T, the inverse changes by a matrix of rank one (Sherman
and Morrison): M'^-1 = M^-1 - w d^T M^-1 / (1 + d.w), with w column r of M^-1. The changes since the
inverse was formed are kept as pairs of vectors, see :class:`Changes`; after a number of them
they are subtracted from the inverse all at once, by products of matrices. The sign of the
determinant is multiplied by that of 1 + d.w, so that no determinant is ever computed (docs/theory,
F10).

Failure modes and answers
-------------------------
- Rounding errors of the changes add up: whoever solves compares the residual with
  :func:`drifted`, mostly at no cost, and asks for a fresh factorisation where it is too large.
  After a number of changes the matrix is factorised afresh anyway, which costs one part in ten.
- The new matrix is nearly singular, or the change loses digits: 1 + d.w is small beside its terms,
  and the matrix is factorised afresh. Only well conditioned matrices are inverted; an LU
  factorisation with partial pivoting serves bordered solves also at folds.
- Many rows change at once, as when friction changes everywhere or Newton is far from a solution:
  a fresh factorisation is cheaper than the changes, and is not inverted before a change asks.
- Someone solves with an older matrix: every solve names its matrix, and the rows are replaced
  back, so that no system is ever solved with the wrong matrix.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import final

import numpy as np
from scipy.linalg import blas, lapack

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS
from pwscont.linear.changes import SMALL_PIVOT, TOGETHER, Changes
from pwscont.linear.cores import factorised, sign_of_pivots, solved

#: Residual of a solution relative to the largest of solution and right-hand side beyond which the
#: inverse has drifted. What is solved for are corrections and directions, whose points are
#: corrected afterwards: nine digits are enough.
DRIFT = 1e-9
#: A matrix with a smaller reciprocal condition number is not inverted.
INVERTIBLE = EPS**0.75
#: Up to these parts of all rows of an inverse are replaced at once, in 4 k m^2 operations for k
#: rows; beyond, a new inverse costs less, 2 m^3, or a factorisation, 2/3 m^3, where matrices serve
#: few solves. A factorisation is inverted, in 4/3 m^3, only for rows that are replaced singly.
FEW_ROWS, FEW_ROWS_OF_FEW_SOLVES = 1.0 / 3.0, 1.0 / 6.0
#: A matrix that has served for so many solves is likely to be followed by others that do.
MANY_SOLVES = 8
#: A factorisation that has served for so many solves is inverted: each then costs a third, so that
#: the inverse is paid for after as many again.
INVERTED_AFTER = 24
#: After this many changes per row the matrix is factorised afresh.
MANY_UPDATES = 2.0
#: More changes than these are made together, which takes as long as one product of matrices.
SINGLY = 8
#: A right-hand side of no more entries is solved for by columns of the inverse.
FEW_ENTRIES = 4
#: Columns of an inverse that LAPACK computes together.
BLOCK = 64
#: Columns of a matrix that are copied at a time.
PART = 64


class RowMatrix(ABC):
    """A square matrix whose rows are told apart by a number each; entries of about one.

    Attributes
    ----------
    keys : ndarray, shape (m,)
        Matrices of one family with equal keys have equal rows.
    """

    keys: Array

    @abstractmethod
    def rows(self, which: Indices) -> Array:
        """Return some rows, shape (k, m)."""

    @abstractmethod
    def dense(self) -> Array:
        """Return a new array of the whole matrix, shape (m, m), in Fortran order."""

    def divided(self, which: Indices, last: RowMatrix, inverse: Array) -> tuple[Array, float]:
        """Return rows times the inverse of another matrix of the family, and a largest sum.

        Of many rows more is known: times the inverse, a row of the other matrix is a unit vector,
        and a unit vector a row of the inverse.

        Parameters
        ----------
        which : ndarray of int, shape (k,)
        last : RowMatrix
        inverse : ndarray, shape (m, m)
            Of the other matrix.

        Returns
        -------
        products : ndarray, shape (k, m)
        largest : float
            The largest sum of magnitudes of the terms of a product, in columns ``which``.
        """
        rows, columns = self.rows(which), inverse[:, which]  # copies
        sums = np.abs(rows) @ np.abs(columns, out=columns)
        return rows @ inverse, float(sums.max(initial=0.0))


class RowSolver(ABC):
    """Solves with matrices of one family, of which it remembers the last."""

    @abstractmethod
    def solve(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution for one right-hand side, shape (m,), or several, shape (l, m)."""

    @abstractmethod
    def solve_transposed(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""

    @abstractmethod
    def sign(self, matrix: RowMatrix) -> int:
        """Return the sign of the determinant; of singular matrices that of one close by."""

    @abstractmethod
    def renew(self, matrix: RowMatrix) -> bool:
        """Factorise afresh what has drifted; False where that was done already."""


def drifted(rhs: Array, solution: Array, product: Array) -> bool:
    """Tell whether a solution, whose product with the matrix is given, is too inaccurate."""
    size = max(float(np.abs(rhs).max()), float(np.abs(solution).max()))
    return not float(np.abs(rhs - product).max()) <= DRIFT * size


@final
class Updating(RowSolver):
    """Keeps an explicit inverse, and the changes of rows since; one array of m^2 numbers.

    Attributes
    ----------
    updates, factorisations : int
        How often rows were replaced and the whole was factorised, since the beginning.
    """

    def __init__(self) -> None:
        self.updates = self.factorisations = 0
        self._last: RowMatrix | None = None
        self._matrix: Array  # the inverse; before the first change the LU factorisation
        self._pivots: Indices | None = None  # of the LU factorisation
        self._size = 0.0  # one-norm of the factorised matrix
        self._sign = 0
        self._since = 0  # rows changed since the last factorisation
        self._solves = 0  # with the last factorisation
        self._served = 0  # solves with the last matrix
        self._is_regular = True  # as far as is known
        self._changes = Changes(0)

    def solve(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution for one right-hand side, or several."""
        self._take(matrix)
        self._solves += 1
        self._served += 1
        if self._pivots is not None and (self._solves < INVERTED_AFTER or not self._inverted()):
            return solved(self._matrix, self._pivots, rhs)
        return self._changes.applied(_product(self._matrix, rhs))

    def solve_transposed(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        self._take(matrix)
        if self._pivots is not None:
            return solved(self._matrix, self._pivots, rhs, transposed=True)
        product: Array = self._changes.transposed(rhs) @ self._matrix
        return product

    def sign(self, matrix: RowMatrix) -> int:
        """Return the sign of the determinant, by the signs of all changes."""
        self._take(matrix)
        return self._sign

    def renew(self, matrix: RowMatrix) -> bool:
        """Factorise afresh what was changed, or inverted, since the last time."""
        is_unchanged = self._is_at(matrix) and not self._since
        if is_unchanged and self._pivots is not None:
            return False
        self._factorise(matrix)
        self._is_regular = not is_unchanged  # or its inverse is no good
        return True

    def _is_at(self, matrix: RowMatrix) -> bool:
        return self._last is not None and self._last.keys is matrix.keys

    def _take(self, matrix: RowMatrix) -> None:
        """Bring the inverse to this matrix, if it is at another one."""
        if self._is_at(matrix):
            return
        if self._last is None or not self._update(matrix, self._last):
            self._factorise(matrix)
        self._last, self._served = matrix, 0

    def _factorise(self, matrix: RowMatrix) -> None:
        self._last = None
        self._matrix = np.empty(0)  # room for the new one
        dense = matrix.dense()
        self._size = _one_norm(dense)
        self._matrix, self._pivots = factorised(dense, overwrite=True)
        self._sign = sign_of_pivots(self._matrix.diagonal(), self._pivots)
        self._last, self._since, self._changes = matrix, 0, Changes(len(matrix.keys))
        self._solves, self._is_regular = 0, True
        self.factorisations += 1

    def _update(self, matrix: RowMatrix, last: RowMatrix) -> bool:
        """Replace rows of the last matrix; False where a factorisation serves better."""
        m, changed = len(last.keys), np.flatnonzero(last.keys != matrix.keys)
        if not len(changed):
            return True
        if len(changed) > self._few(m) or self._since >= max(8, MANY_UPDATES * m):
            return False
        if not self._inverted():
            return False
        replace = self._replace_together if len(changed) > SINGLY else self._replace_singly
        if not replace(matrix, last, changed):
            return False
        self._since += len(changed)
        self.updates += 1
        return True

    def _few(self, m: int) -> float:
        """Return up to how many rows are replaced rather than the matrix factorised afresh."""
        if self._pivots is not None:
            return SINGLY
        part = FEW_ROWS if self._served >= MANY_SOLVES else FEW_ROWS_OF_FEW_SOLVES
        return max(2.0, part * m)

    def _replace_singly(self, matrix: RowMatrix, last: RowMatrix, rows: Indices) -> bool:
        """Change some rows one by one; False where that loses too many digits."""
        differences = matrix.rows(rows) - last.rows(rows)
        pairs = zip(rows, differences, strict=True)
        return all(self._replace(int(row), difference) for row, difference in pairs)

    def _replace_together(self, matrix: RowMatrix, last: RowMatrix, rows: Indices) -> bool:
        """Change rows E^T M to R at once: M'^-1 = M^-1 - M^-1 E (R M^-1 E)^-1 (R M^-1 - E^T).

        That is Woodbury's formula, as E^T M times M^-1 E is the identity.
        """
        self._matrix = self._changes.subtracted(self._matrix)
        self._changes.forget()
        parts, largest = matrix.divided(rows, last, self._matrix)
        pivots, which = factorised(parts[:, rows])
        smallest = np.abs(pivots.diagonal()).min()
        if not smallest > SMALL_PIVOT * (1.0 + largest):
            return False
        parts[np.arange(len(rows)), rows] -= 1.0
        parts, w = solved(pivots, which, parts.T).T, self._matrix[:, rows]
        self._matrix = blas.dgemm(-1.0, w, parts, 1.0, self._matrix, overwrite_c=1)
        self._sign *= sign_of_pivots(pivots.diagonal(), which)
        return True

    def _replace(self, row: int, difference: Array) -> bool:
        """Change one row; False where that loses too many digits."""
        if self._changes.count == TOGETHER:
            self._matrix = self._changes.subtracted(self._matrix)
            self._changes.forget()
        pivot = self._changes.add(self._changes.applied(self._matrix[:, row]), difference)
        self._sign *= int(np.sign(pivot))
        return pivot != 0.0

    def _inverted(self) -> bool:
        """Turn the LU factorisation into the inverse, where it is regular enough."""
        if self._pivots is not None and self._is_regular:
            self._is_regular = lapack.dgecon(self._matrix, self._size)[0] >= INVERTIBLE
        if self._pivots is not None and self._is_regular:
            room = BLOCK * len(self._matrix)  # with less it works column by column
            self._matrix, _ = lapack.dgetri(self._matrix, self._pivots, room, overwrite_lu=1)
            self._pivots = None
        return self._is_regular


def _product(inverse: Array, rhs: Array) -> Array:
    """Return the product with right-hand sides; of few nonzeros they take few columns."""
    if rhs.ndim == 1:
        entries = np.flatnonzero(rhs)
        if len(entries) <= FEW_ENTRIES:
            return inverse[:, entries] @ rhs[entries]
    product: Array = rhs @ inverse.T
    return product


def _one_norm(matrix: Array) -> float:
    """Return the largest sum of magnitudes in a column, without a copy of the matrix."""
    parts = range(0, matrix.shape[1], PART)
    return max(float(np.abs(matrix[:, j : j + PART]).sum(axis=0).max()) for j in parts)
