"""Jacobians that are banded in z.

Differences and elements along a line give such Jacobians: a few diagonals for z, and a full
column for alpha.

Failure modes and answers
-------------------------
- Bands stored the wrong way round give a wrong matrix: the shapes are checked here, the entries
  by :func:`pwscont.check_system`.
- Code that knows nothing of bands: numpy takes the matrix as the dense array that it stands for.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.looks import named
from pwscont.linear.bordered import BorderedFactor, Interior, row_scale
from pwscont.linear.cores import Core, banded_core
from pwscont.linear.factor import Factor
from pwscont.linear.structured import StructuredJacobian


@final
class BandedJacobian(StructuredJacobian):
    """A Jacobian (n, n + 1) whose part for z is banded; its last column is full.

    Parameters
    ----------
    bands : ndarray, shape (lower + upper + 1, n)
        The diagonals as in :func:`scipy.linalg.solve_banded`:
        ``bands[upper + i - j, j] == dH[i]/dz[j]``. Entries outside the matrix are ignored.
    lower, upper : int
        Numbers of diagonals below and above the main one.
    column : ndarray, shape (n,)
        dH/dalpha.

    Raises
    ------
    InvalidSystemError
        If the shapes do not fit each other.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import BandedJacobian
    >>> bands = np.array([[0.0, 1.0], [2.0, 2.0], [1.0, 0.0]])  # above, on and below the diagonal
    >>> BandedJacobian(bands, 1, 1, np.array([5.0, 6.0])).toarray()
    array([[2., 1., 5.],
           [1., 2., 6.]])
    """

    def __init__(self, bands: Array, lower: int, upper: int, column: Array) -> None:
        n = len(column)
        if bands.shape != (lower + upper + 1, n):
            raise InvalidSystemError(
                f"BandedJacobian: bands has shape {bands.shape}, expected "
                f"(lower + upper + 1, n) = ({lower + upper + 1}, {n})"
            )
        self.bands, self.lower, self.upper, self.column = bands, lower, upper, column
        self.shape = (n, n + 1)

    def __repr__(self) -> str:
        return named(self, f"{self.shape}", f"{self.lower} below, {self.upper} above the diagonal")

    def tocsc(self) -> Any:
        """Return the same matrix as a scipy.sparse one."""
        n = len(self.column)
        offsets = np.arange(self.upper, -self.lower - 1, -1)
        square = sp.dia_matrix((self.bands, offsets), shape=(n, n))
        return sp.hstack([square, self.column[:, np.newaxis]]).tocsc()

    def toarray(self) -> Array:
        """Return the same matrix as a dense one, shape (n, n + 1)."""
        dense: Array = self.tocsc().toarray()
        return dense

    def __abs__(self) -> BandedJacobian:
        return BandedJacobian(np.abs(self.bands), self.lower, self.upper, np.abs(self.column))

    def bordered(self, row: Array, scale: Array, beside: Array | None = None) -> Factor:
        """Factorise [J; row] by an LU of the part for z."""
        scaled, row = self.scaled(scale), row * scale
        rows = row_scale(scaled.largest_in_rows(), row)
        core, column = scaled.divided(rows[:-1]).split()
        return BorderedFactor(Interior(core, column), row / rows[-1], rows, scale)

    def split(self) -> tuple[Core, Array]:
        """Return an LU of the part for z, and the column for alpha; for entries of about one."""
        return banded_core(self.bands, self.lower, self.upper), self.column

    def scaled(self, columns: Array) -> BandedJacobian:
        """Return the matrix with its columns multiplied by ``columns``, shape (n + 1,)."""
        bands, column = self.bands * columns[:-1], self.column * columns[-1]
        return BandedJacobian(bands, self.lower, self.upper, column)

    def divided(self, rows: Array) -> BandedJacobian:
        """Return the matrix with its rows divided by ``rows``, powers of two, shape (n,)."""
        inverse = np.zeros(len(rows) + self.lower + self.upper)
        np.divide(1.0, rows, out=inverse[self.upper : self.upper + len(rows)])
        # entry (k, j) of the bands lies in row j + k - upper: each diagonal sees it shifted by one
        shifted: Array = np.ndarray(self.bands.shape, float, inverse, strides=2 * inverse.strides)
        column = self.column * inverse[self.upper : self.upper + len(rows)]
        return BandedJacobian(self.bands * shifted, self.lower, self.upper, column)

    def largest_in_rows(self) -> Array:
        """Return the largest magnitude in each row, shape (n,)."""
        largest: Array = np.abs(self.column)
        for diagonal, i, _ in diagonals(np.abs(self.bands), self.upper):
            np.maximum(largest[i], diagonal, out=largest[i])
        return largest

    def column_at(self, index: int) -> Array:
        """Return a column, shape (n,)."""
        n = len(self.column)
        if index == n:
            return self.column.copy()
        column, first = np.zeros(n), index - self.upper
        rows = slice(max(0, first), min(n, index + self.lower + 1))
        column[rows] = self.bands[rows.start - first : rows.stop - first, index]
        return column

    def __matmul__(self, x: Array) -> Array:
        product: Array = self.column * x[-1]
        for diagonal, rows, columns in diagonals(self.bands, self.upper):
            product[rows] += diagonal * x[columns]
        return product

    def __rmatmul__(self, y: Array) -> Array:
        product = np.empty(self.shape[1])
        product[:-1], product[-1] = 0.0, self.column.dot(y)
        for diagonal, rows, columns in diagonals(self.bands, self.upper):
            product[columns] += diagonal * y[rows]
        return product


def diagonals(bands: Array, upper: int) -> Iterator[tuple[Array, slice, slice]]:
    """Yield each diagonal as a view of its entries, with the slices of its rows and columns."""
    for band, (rows, columns) in zip(bands, _extents(*bands.shape, upper), strict=True):
        yield band[columns], rows, columns


@lru_cache(maxsize=8)
def _extents(width: int, n: int, upper: int) -> tuple[tuple[slice, slice], ...]:
    """Return the rows and columns of each diagonal."""
    below = range(-upper, width - upper)
    starts, stops = [max(0, -k) for k in below], [min(n, n - k) for k in below]
    columns = list(map(slice, starts, stops))
    return tuple((slice(c.start + k, c.stop + k), c) for k, c in zip(below, columns, strict=True))
