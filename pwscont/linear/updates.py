"""Solves with a matrix that changes a few rows at a time, each change in O(m^2).

Where one row r of M is replaced, M' = M + e (r' - r)^T, and the inverse changes by a matrix of
rank one (Sherman and Morrison); with k rows the same holds with rank k (Woodbury). The sign of the
determinant is multiplied by that of the (k, k) matrix E^T M' M^-1 E, so that no determinant is
ever computed (docs/theory, F10).

Failure modes and answers
-------------------------
- Rounding errors of the updates add up: whoever solves compares the residual with
  :func:`drifted`, mostly at no cost, and asks for a fresh factorisation where it is too large.
  After a number of updates the matrix is factorised afresh anyway, which costs one part in ten.
- The new matrix is nearly singular, or the update loses digits: small pivots of the update show
  that, and the matrix is factorised afresh. A matrix is inverted only where it is well conditioned;
  an LU factorisation with partial pivoting serves bordered solves also at folds.
- Many rows change at once, as when friction changes everywhere or Newton is far from a solution:
  a fresh factorisation is cheaper than the update, and is not inverted before an update asks.
- Someone solves with an older matrix: every solve names its matrix, and the rows are replaced
  back, so that no system is ever solved with the wrong matrix.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, final

import numpy as np
from scipy.linalg import blas, lapack

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS
from pwscont.linear.cores import regularise, sign_of_pivots

#: Residual of a solution relative to the largest of solution and right-hand side beyond which the
#: inverse has drifted. What is solved for are corrections and directions, whose points are
#: corrected afterwards: nine digits are enough.
DRIFT = 1e-9
#: An update loses as many digits as its pivots are smaller than the rows that they come from.
SMALL_PIVOT = 1e-6
#: A matrix with a smaller reciprocal condition number is not inverted.
INVERTIBLE = EPS**0.75
#: Up to this part of all rows are replaced at once; twice the bare ratio of operations.
FEW_ROWS = 1.0 / 16.0
#: After this many updates per row the matrix is factorised afresh.
MANY_UPDATES = 0.5
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
    """Updates an explicit inverse while few rows change; one array of m^2 numbers.

    Attributes
    ----------
    updates, factorisations : int
        How often the one and the other was done, since the beginning.
    """

    def __init__(self) -> None:
        self.updates = self.factorisations = 0
        self._keys: Array | None = None
        self._matrix: Array  # the inverse; before the first update the LU factorisation
        self._pivots: Indices | None = None  # of the LU factorisation
        self._size = 0.0  # one-norm of the factorised matrix
        self._sign = 0
        self._since = 0  # updates since the last factorisation

    def solve(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution for one right-hand side, or several."""
        self._take(matrix)
        return self._solve(rhs)

    def solve_transposed(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        self._take(matrix)
        if self._pivots is not None:
            return _solved(self._matrix, self._pivots, rhs, 1)
        product: Array = rhs @ self._matrix
        return product

    def sign(self, matrix: RowMatrix) -> int:
        """Return the sign of the determinant, by updates."""
        self._take(matrix)
        return self._sign

    def renew(self, matrix: RowMatrix) -> bool:
        """Factorise afresh where there was an update since the last time."""
        if self._keys is matrix.keys and not self._since:
            return False
        self._factorise(matrix)
        return True

    def _solve(self, rhs: Array) -> Array:
        if self._pivots is not None:
            return _solved(self._matrix, self._pivots, rhs, 0)
        product: Array = rhs @ self._matrix.T
        return product

    def _take(self, matrix: RowMatrix) -> None:
        """Bring the inverse to this matrix, if it is at another one."""
        if self._keys is matrix.keys:
            return
        if self._keys is None or not self._update(matrix, self._keys):
            self._factorise(matrix)
        self._keys = matrix.keys

    def _factorise(self, matrix: RowMatrix) -> None:
        self._keys = None
        self._matrix = np.empty(0)  # room for the new one
        dense = matrix.dense()
        self._size = _one_norm(dense)
        self._matrix, self._pivots = _overwritten(dense)
        self._sign = sign_of_pivots(self._matrix.diagonal(), self._pivots)
        self._keys, self._since = matrix.keys, 0
        self.factorisations += 1

    def _update(self, matrix: RowMatrix, keys: Array) -> bool:
        """Replace rows of the matrix with ``keys``; False where a factorisation serves better."""
        m, changed = len(keys), np.flatnonzero(keys != matrix.keys)
        if not len(changed):
            return True
        if len(changed) > max(2, FEW_ROWS * m) or self._since >= max(8, MANY_UPDATES * m):
            return False
        if not self._inverted():
            return False
        products = np.asfortranarray(matrix.rows(changed) @ self._matrix)  # (k, m)
        pivots, columns = products[:, changed], self._matrix[:, changed]
        smallest = np.linalg.svd(pivots, compute_uv=False)[-1]
        if not smallest > SMALL_PIVOT * np.abs(products).max():
            return False
        self._sign *= int(np.linalg.slogdet(pivots)[0])
        products[np.arange(len(changed)), changed] -= 1.0
        self._subtract(columns, np.linalg.inv(pivots) @ products)
        self._since += 1
        self.updates += 1
        return True

    def _subtract(self, columns: Array, rows: Any) -> None:
        """Subtract a product of low rank from the inverse, in place."""
        columns, rows = np.asfortranarray(columns), np.asfortranarray(rows)
        self._matrix = blas.dgemm(-1.0, columns, rows, 1.0, self._matrix, overwrite_c=1)

    def _inverted(self) -> bool:
        """Turn the LU factorisation into the inverse, where it is regular enough."""
        if self._pivots is None:
            return True
        if lapack.dgecon(self._matrix, self._size)[0] < INVERTIBLE:
            return False
        self._matrix, _ = lapack.dgetri(self._matrix, self._pivots, overwrite_lu=1)
        self._pivots = None
        return True


def _equal(a: Array | None, b: Array) -> bool:
    return a is not None and np.array_equal(a, b)


def _one_norm(matrix: Array) -> float:
    """Return the largest sum of magnitudes in a column, without a copy of the matrix."""
    parts = range(0, matrix.shape[1], PART)
    return max(float(np.abs(matrix[:, j : j + PART]).sum(axis=0).max()) for j in parts)


def _factorised(matrix: RowMatrix) -> tuple[Array, Indices]:
    return _overwritten(matrix.dense())


def _overwritten(dense: Array) -> tuple[Array, Indices]:
    """Factorise in place; pivots that vanish to rounding are moved off zero."""
    lu, pivots, _ = lapack.dgetrf(dense, overwrite_a=1)
    regularise(lu.ravel(order="K")[:: len(lu) + 1])
    return lu, pivots


def _solved(lu: Array, pivots: Indices, rhs: Array, transposed: int) -> Array:
    solution: Array = lapack.dgetrs(lu, pivots, rhs.T, trans=transposed)[0]
    return solution.T
