"""Products of few numbers in little time: vectors by BLAS, and rows that never change.

For few entries numpy's own operators take several times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas

from pwscont.basics.arrays import Array, Indices, Matrix

#: The inner product of two vectors.
dot: Callable[[Array, Array], float] = blas.ddot


def times(factor: float, vector: Array) -> Array:
    """Multiply a vector in place, and return the vector."""
    return np.asarray(blas.dscal(factor, vector))


def plus(point: Array, factor: float, direction: Array) -> Array:
    """Add a multiple of a direction to a point, in place, and return the point."""
    return np.asarray(blas.daxpy(direction, point, a=factor))


def add_multiples(rows: Array, factors: Array, row: Array) -> None:
    """Add multiples of a row to rows, shape (l, k), in place."""
    blas.dger(1.0, row, factors, 1, 1, rows.T, 0, 0, 1)  # strides of 1; only rows change


@final
class Rows:
    """A copy of constant rows, such as the gradients of affine tests, for many products."""

    def __init__(self, matrix: Matrix) -> None:
        is_dense = isinstance(matrix, np.ndarray)
        own: Callable[..., Any] = np.array if is_dense else sp.csr_matrix
        self.matrix = own(matrix, dtype=float, copy=True)
        if not is_dense:
            self.matrix.sum_duplicates()
        #: The product with a vector, shape (m,); ``dot`` of a sparse matrix takes longer.
        self.dot: Callable[[Array], Array] = self.matrix.dot if is_dense else self.matrix.__matmul__

    @cached_property
    def magnitudes(self) -> Any:
        """The magnitudes of all entries, for products with vectors that are not negative."""
        return abs(self.matrix)

    def one(self, index: int) -> Array:
        """Return a row, dense, shape (k,), not to be written to."""
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(self.matrix[index])
        row = np.zeros(self.matrix.shape[1])
        starts = self.matrix.indptr
        entries = slice(starts.item(index), starts.item(index + 1))
        row[self.matrix.indices[entries]] = self.matrix.data[entries]
        return row

    def some(self, which: Indices) -> Array:
        """Return a few rows, dense, shape (len(which), k)."""
        if isinstance(self.matrix, np.ndarray):
            return self.matrix[which]
        return np.asarray(self.matrix[which].toarray())
