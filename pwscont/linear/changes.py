"""Changes of rank one to an inverse, kept as pairs of vectors (product form of the inverse).

Failure modes and answers
-------------------------
- The new matrix is nearly singular, or the change loses digits: 1 + d.w is small beside its terms,
  and the change is not made.
"""

from __future__ import annotations

from typing import final

import numpy as np
from scipy.linalg import blas

from pwscont.basics.arrays import Array
from pwscont.linear.vectors import add_multiples

#: A change loses as many digits as its pivot is smaller than the terms that it is the sum of.
SMALL_PIVOT = 1e-6
#: So many changes are subtracted from the inverse at once.
TOGETHER = 48


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
        return self._changed(solution, self._d, self._v)

    def transposed(self, rhs: Array) -> Array:
        """Return right-hand sides for the transposed matrix before the changes."""
        return self._changed(rhs, self._v, self._d)

    def _changed(self, vectors: Array, rows: Array, columns: Array) -> Array:
        """Return x - C (R x) for vectors x, with the rows R and columns C of all changes."""
        k = self.count
        if not k:
            return vectors
        changed: Array = vectors - vectors.dot(rows[:k].T).dot(columns[:k])
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
