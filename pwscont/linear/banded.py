"""Jacobians that are banded in z, and the LU of a banded matrix by LAPACK.

Differences and elements along a line give such Jacobians: a few diagonals for z, and a full column
for alpha.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.printing import named
from pwscont.linear.factor import Factor, regularise, sign_of_pivots
from pwscont.linear.jacobian import StoredJacobian


@final
class BandedJacobian(StoredJacobian):
    """A Jacobian (n, n + 1) whose part for z is banded and whose last column is full.

    Parameters
    ----------
    bands : ndarray, shape (lower + upper + 1, n)
        The diagonals as in :func:`scipy.linalg.solve_banded`:
        ``bands[upper + i - j, j] == dH[i]/dz[j]``. Entries outside the matrix are ignored.
    lower, upper : int
        Numbers of diagonals below and above the main diagonal.
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
        n = len(self.column)
        offsets = np.arange(self.upper, -self.lower - 1, -1)
        square = sp.dia_matrix((self.bands, offsets), shape=(n, n))
        return sp.hstack([square, self.column[:, np.newaxis]]).tocsc()

    def __abs__(self) -> BandedJacobian:
        return BandedJacobian(np.abs(self.bands), self.lower, self.upper, np.abs(self.column))

    def split(self) -> tuple[Factor, Array]:
        return BandLU(self.bands, self.lower, self.upper), self.column

    def column_at(self, index: int) -> Array:
        return self.column.copy() if index == len(self.column) else super().column_at(index)

    def scaled(self, columns: Array) -> BandedJacobian:
        bands, column = self.bands * columns[:-1], self.column * columns[-1]
        return BandedJacobian(bands, self.lower, self.upper, column)

    def divided(self, rows: Array) -> BandedJacobian:
        bands = self.bands.copy()
        for diagonal, i, _ in diagonals(bands, self.upper):
            np.divide(diagonal, rows[i], out=diagonal)
        return BandedJacobian(bands, self.lower, self.upper, self.column / rows)

    def largest_in_rows(self) -> Array:
        largest: Array = np.abs(self.column)
        for diagonal, i, _ in diagonals(np.abs(self.bands), self.upper):
            np.maximum(largest[i], diagonal, out=largest[i])
        return largest

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
    """Yield each diagonal as a view, with the slices of rows and columns of the entries."""
    n = bands.shape[1]
    for below, band in enumerate(bands, -upper):
        first, end = max(0, -below), min(n, n - below)
        yield band[first:end], slice(first + below, end + below), slice(first, end)


@final
class BandLU(Factor):
    """LU of a square matrix, stored as the bands of :class:`BandedJacobian` are."""

    def __init__(self, bands: Array, lower: int, upper: int) -> None:
        self._solved: Callable[..., Any]
        self._transposed: int | str = 1
        if lower == upper == 1 and bands.shape[1] > 2:  # a third of the time of other bands
            *lu, _ = lapack.dgttrf(bands[2, :-1], bands[1], bands[0, 1:])
            self._diagonal, self._pivots = lu[1], lu[4] - 1
            self._solved, self._transposed = partial(lapack.dgttrs, *lu), "T"
        else:
            room = np.zeros((2 * lower + upper + 1, bands.shape[1]), order="F")  # for fill-in
            room[lower:] = bands
            lu, self._pivots, _ = lapack.dgbtrf(room, lower, upper, overwrite_ab=True)
            self._diagonal = lu[lower + upper]
            self._solved = partial(lapack.dgbtrs, lu, lower, upper, ipiv=self._pivots)
        regularise(self._diagonal)

    @property
    def sign(self) -> int:
        return sign_of_pivots(self._diagonal, self._pivots)

    def solve(self, rhs: Array) -> Array:
        return np.asarray(self._solved(b=rhs.T)[0].T)

    solve_all = solve

    def solve_transposed(self, rhs: Array) -> Array:
        return np.asarray(self._solved(b=rhs.T, trans=self._transposed)[0].T)
