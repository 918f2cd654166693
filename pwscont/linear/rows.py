"""Constant rows, such as the gradients of affine tests, asked for once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Indices, Matrix

#: Dense rows with fewer nonzeros than this part of all are stored sparse: that is cheaper.
SPARSE = 0.1
#: Smaller matrices are stored as they are.
LARGE = 10_000
#: Of sparse rows with no more entries each, and up to so many in all, products are taken at once.
FEW_ENTRIES, FEW = 4, 6_000


@final
class Rows:
    """A matrix of which products, and single rows, are asked for again and again.

    Parameters
    ----------
    matrix : ndarray or sparse matrix, shape (m, k)
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
        first, last = starts.item(index), starts.item(index + 1)
        row[self.matrix.indices[first:last]] = self.matrix.data[first:last]
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
    """Sparse rows of a few entries each, shorter ones filled up with zeros.

    Those are at a column of the row itself, so that no row depends on other unknowns.

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
    """Tell whether what scipy's product costs beside the operations themselves matters."""
    lengths = np.diff(matrix.indptr)
    longest = int(lengths.max(initial=0))
    is_short: bool = longest <= FEW_ENTRIES and longest * len(lengths) <= FEW
    return is_short and bool(len(lengths)) and bool(lengths.all())


def _summed(matrix: Matrix) -> Any:
    """Return sparse rows of their own, with each entry once."""
    stored = sp.csr_matrix(matrix, copy=True)
    stored.sum_duplicates()
    return stored


def _thinned(matrix: Array) -> Any:
    """Return dense rows of their own, sparse where few entries are not zero."""
    entries = matrix.ravel()
    if len(entries) > LARGE:
        places = (entries != 0.0).nonzero()[0]
        if len(places) < SPARSE * len(entries):
            rows, columns = np.divmod(places, matrix.shape[1])  # what scipy does takes longer
            starts = np.searchsorted(rows, np.arange(len(matrix) + 1))
            return sp.csr_matrix((entries[places].astype(float), columns, starts), matrix.shape)
    return np.array(matrix, dtype=float)
