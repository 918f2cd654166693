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
from pwscont.linear.cores import factorised, sign_of_pivots, solved
from pwscont.linear.vectors import add_multiples

#: Residual of a solution relative to the largest of solution and right-hand side beyond which the
#: inverse has drifted. What is solved for are corrections and directions, whose points are
#: corrected afterwards: nine digits are enough.
DRIFT = 1e-9
#: A change loses as many digits as its pivot is smaller than the terms that it is the sum of.
SMALL_PIVOT = 1e-6
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
#: So many changes are subtracted from the inverse at once.
TOGETHER = 48
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
        differences = matrix.rows(changed) - last.rows(changed)
        if not self._replaced(changed, differences):
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

    def _replaced(self, rows: Indices, differences: Array) -> bool:
        """Change some rows; False where that loses too many digits."""
        if len(rows) > SINGLY:
            return self._replace_together(rows, differences)
        pairs = zip(rows, differences, strict=True)
        return all(self._replace(int(row), difference) for row, difference in pairs)

    def _replace_together(self, rows: Indices, differences: Array) -> bool:
        """Change some rows at once: M'^-1 = M^-1 - W (I + D W)^-1 D M^-1 (Woodbury)."""
        self._matrix = self._changes.subtracted(self._matrix)
        self._changes.forget()
        w = self._matrix[:, rows]
        pivots, which = factorised(np.eye(len(rows)) + differences @ w)
        smallest = np.abs(pivots.diagonal()).min()
        if not smallest > SMALL_PIVOT * (1.0 + float((np.abs(differences) @ np.abs(w)).max())):
            return False
        parts = solved(pivots, which, (differences @ self._matrix).T).T
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


@final
class Changes:
    """Rows that were replaced since an inverse was formed: M^-1 = (I - V D) M_0^-1.

    The rows of D are what was added. With every change, M'^-1 = (I - w d^T / (1 + d.w)) M^-1, the
    columns of V are taken on to the new inverse, so that there is no system to be solved.

    Parameters
    ----------
    size : int
        m.
    """

    def __init__(self, size: int) -> None:
        self.count = 0
        self._v = np.empty((TOGETHER if size else 0, size))  # the columns of V
        self._d = np.empty_like(self._v)

    def forget(self) -> None:
        """Begin anew, in the same room: new room costs as much as what is written into it."""
        self.count = 0

    def add(self, w: Array, difference: Array) -> float:
        """Add a change and return its pivot, zero where it would lose too many digits."""
        k, pivot = self.count, 1.0 + float(difference.dot(w))
        if not abs(pivot) > SMALL_PIVOT * (1.0 + _most(difference, w)):
            return 0.0
        self._v[k], self._d[k] = w / pivot, difference
        if k:
            add_multiples(self._v[:k], -self._v[:k].dot(difference), self._v[k])
        self.count += 1
        return pivot

    def applied(self, solution: Array) -> Array:
        """Return solutions, shape (m,) or (l, m), from those before the changes."""
        k = self.count
        if not k:
            return solution
        changed: Array = solution - solution.dot(self._d[:k].T).dot(self._v[:k])
        return changed

    def transposed(self, rhs: Array) -> Array:
        """Return right-hand sides for the transposed matrix before the changes."""
        k = self.count
        if not k:
            return rhs
        changed: Array = rhs - rhs.dot(self._v[:k].T).dot(self._d[:k])
        return changed

    def subtracted(self, inverse: Array) -> Array:
        """Return the inverse after the changes, in place."""
        k = self.count
        if not k:
            return inverse
        parts = self._d[:k] @ inverse
        result: Array = blas.dgemm(-1.0, self._v[:k].T, parts, 1.0, inverse, overwrite_c=1)
        return result


def _most(a: Array, b: Array) -> float:
    """Return the sum of the magnitudes of the terms of a scalar product."""
    return float(blas.dasum(a * b))


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
