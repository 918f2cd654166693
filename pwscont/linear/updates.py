"""Factorisations of a matrix that changes by terms of rank 1.

With B' = B + c g^T and w = B^-1 c, the inverse becomes B'^-1 = (I - w g^T / (1 + g.w)) B^-1
(Sherman and Morrison); 1 + g.w is the *pivot* of the change. The sign of the determinant is
multiplied by the sign of each pivot (docs/theory, F10). A change whose pivot is small beside the
terms 1 and g.w loses digits: the matrix is factorised afresh.
"""

from __future__ import annotations

from typing import final

import numpy as np
from scipy.linalg import blas

from pwscont.basics.arrays import Array
from pwscont.linear.factor import Factor
from pwscont.linear.vectors import add_multiples

#: Least pivot of a change, as a part of the sum of the magnitudes of the pivot's terms. A change
#: multiplies rounding errors by the inverse of the part: ten of sixteen digits are left.
SMALL_PIVOT = 1e-6
#: Number of changes that are kept as vectors before a fresh factorisation is due: two products with
#: 48 vectors cost as much as a solve with a matrix of about a hundred rows.
MOST_CHANGES_KEPT = 48


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
