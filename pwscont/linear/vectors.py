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

#: Largest part of nonzeros, of all entries of a dense matrix, for which sparse rows are cheaper.
SPARSE = 0.1
#: Number of entries up to which a dense matrix stays dense, whatever its entries are.
LARGE = 10_000
#: Largest number of entries in a sparse row, and in all rows filled up to equal length, for which
#: :class:`Padded` is faster than scipy's product, whose overhead is about as long.
FEW_ENTRIES, FEW = 4, 6_000

#: The inner product of two vectors.
dot: Callable[[Array, Array], float] = blas.ddot


def times(factor: float, vector: Array) -> Array:
    """Multiply a vector in place, and return the vector."""
    multiple: Array = blas.dscal(factor, vector)
    return multiple


def plus(point: Array, factor: float, direction: Array) -> Array:
    """Add a multiple of a direction to a point, in place, and return the point."""
    moved: Array = blas.daxpy(direction, point, a=factor)
    return moved


def add_multiples(rows: Array, factors: Array, row: Array) -> None:
    """Add multiples of a row to rows, shape (l, k), in place."""
    blas.dger(1.0, row, factors, 1, 1, rows.T, 0, 0, 1)  # strides of one; only rows change


@final
class Rows:
    """Constant rows, such as the gradients of affine tests, for many products.

    Parameters
    ----------
    matrix : ndarray or sparse matrix, shape (m, k)
        Copied.
    """

    def __init__(self, matrix: Matrix) -> None:
        self.matrix: Any = _summed(matrix) if sp.issparse(matrix) else _thinned(matrix)
        is_short = not isinstance(self.matrix, np.ndarray) and _are_short(self.matrix)
        #: The product with a vector, shape (m,).
        self.dot: Callable[[Array], Array]
        self.dot = Padded(self.matrix).dot if is_short else self.matrix.dot

    @cached_property
    def magnitudes(self) -> Any:
        """The magnitudes of all entries, for products with vectors that are not negative."""
        return abs(self.matrix)

    def one(self, index: int) -> Array:
        """Return one row, dense, shape (k,), not to be written to."""
        if isinstance(self.matrix, np.ndarray):
            row: Array = self.matrix[index]
            return row
        row = np.zeros(self.matrix.shape[1])
        starts = self.matrix.indptr
        entries = slice(starts.item(index), starts.item(index + 1))
        row[self.matrix.indices[entries]] = self.matrix.data[entries]
        return row

    def some(self, which: Indices) -> Array:
        """Return a few rows, dense, shape (len(which), k)."""
        if isinstance(self.matrix, np.ndarray):
            return self.matrix[which]
        rows = np.zeros((len(which), self.matrix.shape[1]))
        for row, i in zip(rows, which, strict=True):
            row[:] = self.one(int(i))
        return rows


@final
class Padded:
    """Sparse rows of a few entries each; shorter rows are filled up with zeros.

    The zeros stand at a column of the row itself, so that no row depends on other unknowns, which
    may be infinite.

    Parameters
    ----------
    matrix : csr_matrix, shape (m, k)
        No row is empty.
    """

    def __init__(self, matrix: Any) -> None:
        starts, lengths = matrix.indptr, np.diff(matrix.indptr)
        row = np.repeat(np.arange(len(lengths)), lengths)
        place = np.arange(len(row)) - starts[row]
        first, longest = matrix.indices[starts[:-1]].astype(np.intp), int(lengths.max())
        self._columns = np.tile(first, (longest, 1))
        self._entries = np.zeros(self._columns.shape)
        self._columns[place, row], self._entries[place, row] = matrix.indices, matrix.data
        self._ones = np.ones(longest)

    def dot(self, x: Array) -> Array:
        """Return the product with a vector, shape (m,)."""
        values: Array = self._ones.dot(x.take(self._columns) * self._entries)
        return values


def _are_short(matrix: Any) -> bool:
    """Tell whether :class:`Padded` serves a matrix, and is faster than scipy's product."""
    lengths = np.diff(matrix.indptr)
    longest = int(lengths.max(initial=0))
    is_short: bool = longest <= FEW_ENTRIES and longest * len(lengths) <= FEW
    return is_short and bool(len(lengths)) and bool(lengths.all())


def _summed(matrix: Matrix) -> Any:
    """Return a copy of sparse rows, with each entry stored once."""
    stored = sp.csr_matrix(matrix, copy=True)
    stored.sum_duplicates()
    return stored


def _thinned(matrix: Array) -> Any:
    """Return a copy of dense rows, sparse where few entries are not zero."""
    entries = matrix.ravel()
    if len(entries) > LARGE:
        places = (entries != 0.0).nonzero()[0]
        if len(places) < SPARSE * len(entries):
            rows, columns = np.divmod(places, matrix.shape[1])  # faster than scipy's conversion
            starts = np.searchsorted(rows, np.arange(len(matrix) + 1))
            return sp.csr_matrix((entries[places].astype(float), columns, starts), matrix.shape)
    return np.array(matrix, dtype=float)
