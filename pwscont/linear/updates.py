"""Factorisations of a matrix that changes by a few rows or by terms of rank 1.

With B' = B + c g^T and w = B^-1 c, the inverse becomes B'^-1 = (I - w g^T / (1 + g.w)) B^-1
(Sherman and Morrison); 1 + g.w is the *pivot* of the change. The sign of the determinant is
multiplied by the sign of each pivot (docs/theory, F10).

- :class:`ProductForm`: any factorisation, and the vectors of all changes, multiplied out, as in the
  simplex method (Dantzig and Orchard-Hays 1954).
- :class:`Updating` serves a family of matrices that differ in some rows (:class:`RowMatrix`): an
  explicit inverse is kept, and all changed rows are replaced at once (Woodbury). Every solve names
  the matrix: rows are replaced back for a caller that solves with an older matrix.

A change whose pivot is small beside the terms 1 and g.w loses digits: the matrix is factorised
afresh. Rounding errors of the changes add up: the caller compares the residual with
:func:`drifted`, and asks for a fresh factorisation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import final

import numpy as np
from scipy.linalg import blas

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS
from pwscont.linear.factor import DenseLU, Factor
from pwscont.linear.vectors import add_multiples

#: Least pivot of a change, as a part of the sum of the magnitudes of the pivot's terms. A change
#: multiplies rounding errors by the inverse of the part: ten of sixteen digits are left.
SMALL_PIVOT = 1e-6
#: Number of changes that are kept as vectors before a fresh factorisation is due: two products with
#: 48 vectors cost as much as a solve with a matrix of about a hundred rows.
MOST_CHANGES_KEPT = 48
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


@final
class ProductForm(Factor):
    """A factorisation of M_0, and the changes of the matrix since: M^-1 = (I - V D) M_0^-1.

    The rows of D are the vectors g. With every change the columns of V are multiplied by
    I - w g^T / (1 + g.w), so that no system has to be solved for V. ``size``: the number of rows.
    """

    def __init__(self, factor: Factor, size: int) -> None:
        self._v = np.empty((MOST_CHANGES_KEPT, size))  # the columns of V
        self._d = np.empty_like(self._v)
        self.renew(factor)

    def renew(self, factor: Factor) -> None:
        """Take a factorisation of the matrix with all changes."""
        self._factor, self.count = factor, 0
        self._turn = 1  # the sign of the product of all pivots

    @property
    def is_full(self) -> bool:
        """Whether a fresh factorisation is due before the next change."""
        return self.count == MOST_CHANGES_KEPT

    @property
    def sign(self) -> int:
        return self._turn * self._factor.sign

    def solve(self, rhs: Array) -> Array:
        return self._changed(self._factor.solve(rhs))

    def solve_all(self, rhs: Array) -> Array:
        return self._changed(self._factor.solve_all(rhs))

    def _changed(self, vectors: Array) -> Array:
        """Return (I - V D) x for vectors x."""
        k = self.count
        if not k:
            return vectors
        return vectors - vectors.dot(self._d[:k].T).dot(self._v[:k])

    def change(self, w: Array, g: Array) -> float:
        """Change the matrix by c g^T, with the known w = M^-1 c, and return the pivot 1 + g.w.

        The pivot is zero, and the matrix not changed, where the change loses too many digits.
        """
        k, pivot = self.count, 1.0 + float(g.dot(w))
        if not abs(pivot) > SMALL_PIVOT * (1.0 + blas.dasum(g * w)):
            return 0.0
        self._v[k], self._d[k] = w / pivot, g
        if k:
            add_multiples(self._v[:k], -self._v[:k].dot(g), self._v[k])
        self.count += 1
        self._turn *= -1 if pivot < 0.0 else 1
        return pivot


class RowMatrix(ABC):
    """A square matrix with entries of about 1 and with a key, a number, for each row."""

    keys: Array  #: Shape (m,): rows of two matrices of a family are equal if the keys are equal.

    @abstractmethod
    def rows(self, which: Indices) -> Array:
        """Return some rows, shape (k, m)."""

    @abstractmethod
    def dense(self) -> Array:
        """Return a new array of the whole matrix, shape (m, m), in Fortran order."""


class RowSolver(ABC):
    """Solves with the matrices of a family; a solver remembers the last matrix."""

    @abstractmethod
    def solve(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution for a right-hand side, shape (m,), or several, shape (l, m)."""

    @abstractmethod
    def solve_transposed(self, matrix: RowMatrix, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""

    @abstractmethod
    def sign(self, matrix: RowMatrix) -> int:
        """Return the sign of the determinant of a matrix, or of a nearby matrix if singular."""

    @abstractmethod
    def renew(self, matrix: RowMatrix) -> bool:
        """Factorise a matrix afresh after drift; False where the factorisation is fresh."""


def drifted(rhs: Array, solution: Array, product: Array) -> bool:
    """Tell whether a solution, whose product with the matrix is given, is too inaccurate."""
    size = max(float(np.abs(rhs).max()), float(np.abs(solution).max()))
    return not float(np.abs(rhs - product).max()) <= DRIFT * size


@final
class Updating(RowSolver):
    """A solver that keeps the LU of the last matrix, or the inverse once a change asks for it."""

    def __init__(self) -> None:
        self.updates = self.factorisations = 0  #: How often each was done.
        self._last: RowMatrix | None = None
        self._lu: DenseLU | None = None  # of the last matrix; None if the inverse is kept
        self._inverse: Array = np.empty((0, 0))
        self._sign = 0
        self._is_invertible = True  # as far as is known
        self._replaced = 0  # rows, since the last factorisation

    def solve(self, matrix: RowMatrix, rhs: Array) -> Array:
        self._take(matrix)
        return rhs @ self._inverse.T if self._lu is None else self._lu.solve(rhs)

    def solve_transposed(self, matrix: RowMatrix, rhs: Array) -> Array:
        self._take(matrix)
        return rhs @ self._inverse if self._lu is None else self._lu.solve_transposed(rhs)

    def sign(self, matrix: RowMatrix) -> int:
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
                self._inverse, self._lu = self._lu.turned_into_inverse(), None
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
