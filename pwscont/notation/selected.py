"""Matrices whose rows are chosen one by one: dense, sparse or banded, whichever is cheapest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Indices, Matrix
from pwscont.linear.banded import BandedJacobian

#: Smaller matrices are dense.
SMALL = 10_000
#: So are those with more nonzeros than this part of all.
DENSE = 0.1
#: Matrices with more diagonals than this part of their size are not stored as banded.
THIN = 0.1


def stored(matrix: Matrix) -> Matrix:
    """Return a sparse matrix as it is cheapest: sparse, or dense and not to be written to."""
    if np.prod(matrix.shape) > SMALL and matrix.nnz < DENSE * np.prod(matrix.shape):
        return matrix
    whole = matrix.toarray()
    whole.flags.writeable = False
    return whole


@final
class RowChoice:
    """Rows of which each has one of several modes.

    Parameters
    ----------
    modes : sequence of (csr array, ndarray), shapes (n, n + 1) and (n,)
        All rows in each mode, and their constants.
    """

    def __init__(self, modes: Sequence[tuple[Matrix, Array]]) -> None:
        #: The rows of all modes, one mode after the other.
        self._all = stored(sp.vstack([matrix for matrix, _ in modes], "csr"))
        self._rests = np.concatenate([rest for _, rest in modes])
        self._numbers = np.arange(len(modes[0][1]))
        self._bands = _Bands.of(modes) if sp.issparse(self._all) else None

    def rows(self, modes: Indices) -> Matrix:
        """Return the rows in their modes, shape (n, n + 1)."""
        if self._bands is not None:
            return self._bands.rows(modes)
        return self._all[modes * len(self._numbers) + self._numbers]

    def values(self, modes: Indices, x: Array) -> Array:
        """Return the rows in their modes times x, plus their constants, shape (n,)."""
        values = self._all @ x + self._rests
        chosen: Array = values[modes * len(self._numbers) + self._numbers]
        return chosen


@final
class _Bands:
    """The rows of banded matrices."""

    def __init__(self, bands: Array, columns: Array, lower: int, upper: int) -> None:
        self._bands, self._columns, self._lower, self._upper = bands, columns, lower, upper
        n = columns.shape[1]
        self._numbers = np.arange(n)
        #: The row of each entry of the bands, and its diagonal.
        rows = self._numbers + np.arange(-upper, lower + 1)[:, np.newaxis]
        self._rows = np.clip(rows, 0, n - 1)
        self._diagonals = np.arange(lower + upper + 1)[:, np.newaxis]

    @classmethod
    def of(cls, modes: Sequence[tuple[Matrix, Array]]) -> _Bands | None:
        """Return the bands of matrices that are narrow in all modes, None of others."""
        lower, upper = _width(modes)
        if lower + upper + 1 > THIN * len(modes[0][1]):
            return None
        bands = [_bands(matrix[:, :-1].tocoo(), lower, upper) for matrix, _ in modes]
        columns = [matrix[:, [-1]].toarray()[:, 0] for matrix, _ in modes]
        return cls(np.array(bands), np.array(columns), lower, upper)

    def rows(self, modes: Indices) -> BandedJacobian:
        """Return the rows in their modes."""
        bands = self._bands[modes[self._rows], self._diagonals, self._numbers]
        column = self._columns[modes, self._numbers]
        return BandedJacobian(bands, self._lower, self._upper, column)


def _width(modes: Sequence[tuple[Matrix, Array]]) -> tuple[int, int]:
    """Return the numbers of diagonals below and above the main one."""
    lower = upper = 0
    for matrix, _ in modes:
        entries = matrix[:, :-1].tocoo()
        apart = entries.row - entries.col
        lower, upper = max(lower, apart.max(initial=0)), max(upper, (-apart).max(initial=0))
    return int(lower), int(upper)


def _bands(entries: Any, lower: int, upper: int) -> Array:
    """Return the diagonals of a sparse matrix as :class:`BandedJacobian` stores them."""
    bands = np.zeros((lower + upper + 1, entries.shape[1]))
    bands[upper + entries.row - entries.col, entries.col] = entries.data
    return bands
