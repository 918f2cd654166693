"""Matrices whose entries stand in the same places at every state."""

from __future__ import annotations

from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix

#: Most rows of a dense matrix: in small sparse matrices bookkeeping costs more than arithmetic.
DENSE = 100


@final
class Pattern:
    """The places of entries of a matrix; entries in the same place add up.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (k,)
    shape : tuple of int
    """

    def __init__(self, rows: Indices, columns: Indices, shape: tuple[int, int]) -> None:
        self._shape, flat = shape, rows * shape[1] + columns
        self._is_dense = shape[0] <= DENSE
        places, slots = np.unique(flat, return_inverse=True)
        self._slots = flat if self._is_dense else slots
        self._count = shape[0] * shape[1] if self._is_dense else len(places)
        self._indices = places % shape[1]
        self._starts = np.searchsorted(places, shape[1] * np.arange(shape[0] + 1))

    def filled(self, entries: Array) -> Matrix:
        """Return the matrix with the given entries, shape (k,); a small matrix is dense."""
        data = np.bincount(self._slots, entries, self._count)
        if self._is_dense:
            return data.reshape(self._shape)
        return sp.csr_array((data, self._indices, self._starts), self._shape)
