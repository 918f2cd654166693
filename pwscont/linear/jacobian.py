"""Jacobians with a structure: the seam, and the sparse and banded storages with their LU.

Dense Jacobians are numpy arrays. Every other Jacobian is a :class:`StructuredJacobian`, or a
scipy.sparse matrix, which :class:`SparseJacobian` wraps. Numerics that find no use for the
structure take the dense array instead. Differences and elements along a line give Jacobians that
are banded in z: a few diagonals for z, and a full column for alpha.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property, partial
from typing import Any, Self, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from pwscont.basics.arrays import Array, Matrix, power_of_two
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.printing import named
from pwscont.basics.rounding import EPS
from pwscont.linear import factor
from pwscont.linear.factor import BorderedFactor, Factor, Interior, ScaledFactor


class StructuredJacobian(ABC):
    """A Jacobian (n, n + 1) that multiplies and factorises itself."""

    __array_ufunc__ = None  # ``array @ jacobian`` calls __rmatmul__
    shape: tuple[int, int]  #: (n, n + 1)
    is_at_hand: bool = False  #: Whether making a Jacobian costs no more than a few residuals do.

    @abstractmethod
    def __matmul__(self, x: Array) -> Array:
        """Return J x, shape (n,)."""

    def dot(self, x: Array) -> Array:
        """Return J x, as the method ``dot`` of arrays and sparse matrices does."""
        return self @ x

    @abstractmethod
    def __rmatmul__(self, y: Array) -> Array:
        """Return y J, shape (n + 1,)."""

    @abstractmethod
    def __abs__(self) -> Any:
        """Return an object that multiplies vectors by the magnitudes of the entries."""

    @abstractmethod
    def toarray(self) -> Array:
        """Return the same matrix as a dense array."""

    @abstractmethod
    def bordered(self, row: Array, scale: Array) -> Factor | None:
        """Factorise [J; row]; None where the part for z has no factorisation.

        ``scale``, shape (n + 1,): typical magnitudes of the unknowns, powers of two.
        """

    def inner(self, scale: Array) -> Factor | None:
        """Factorise B, for solves in the units of H and z; default None: not possible."""
        return None

    def column_at(self, index: int) -> Array:
        """Return a column, shape (n,); default by a product."""
        unit = np.zeros(self.shape[1])
        unit[index] = 1.0
        return self @ unit

    def scaled(self, columns: Array) -> Matrix:
        """Return a new matrix with columns multiplied; default a dense array."""
        return self.toarray() * columns

    def largest_in_scaled_rows(self, columns: Array) -> Array | None:
        """Return about the largest magnitude in each row, shape (n,), of columns multiplied.

        Default None: the scaled matrix is looked at.
        """
        return None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.asarray(self.toarray(), dtype=dtype)


class StoredJacobian(StructuredJacobian):
    """A Jacobian with stored entries, and with an LU of B, the part for z."""

    @abstractmethod
    def scaled(self, columns: Array) -> Self:
        """Return a new matrix with columns multiplied by ``columns``, shape (n + 1,)."""

    @abstractmethod
    def divided(self, rows: Array) -> Self:
        """Return a new matrix with rows divided by ``rows``, powers of two, shape (n,)."""

    @abstractmethod
    def largest_in_rows(self) -> Array:
        """Return the largest magnitude in each row, shape (n,); zero for a row of zeros."""

    @abstractmethod
    def tocsc(self) -> Any:
        """Return the matrix in a storage of scipy.sparse, by columns."""

    def toarray(self) -> Array:
        return self.tocsc().toarray()

    @abstractmethod
    def split(self) -> tuple[Factor, Array]:
        """Return an LU of B, and b; for entries of about 1."""

    def bordered(self, row: Array, scale: Array) -> Factor | None:
        """Factorise [J; row] by an LU of B; None where B has no LU."""
        scaled, row = self.scaled(scale), row * scale
        rows = factor.row_scale(scaled.largest_in_rows(), row)
        lu, column = scaled.divided(rows[:-1]).split()
        if lu.failed:
            return None
        return BorderedFactor(Interior(lu, column), row / rows[-1], rows, scale)

    def inner(self, scale: Array) -> Factor | None:
        scaled = self.scaled(scale)
        rows = power_of_two(scaled.largest_in_rows())
        lu, _ = scaled.divided(rows).split()
        return None if lu.failed else ScaledFactor(lu, rows, scale[:-1])


@final
class SparseJacobian(StoredJacobian):
    """A sparse Jacobian (n, n + 1), stored by columns; the given matrix is not written to."""

    def __init__(self, matrix: Any) -> None:
        self._csc = matrix.tocsc()
        if not self._csc.has_canonical_format:
            self._csc = self._csc.copy()
            self._csc.sum_duplicates()
        self.shape = self._csc.shape

    def __matmul__(self, x: Array) -> Array:
        return self._csc @ x

    def __rmatmul__(self, y: Array) -> Array:
        return y @ self._csc

    def __abs__(self) -> Any:
        return abs(self._csc)

    def tocsc(self) -> Any:
        return self._csc

    def scaled(self, columns: Array) -> SparseJacobian:
        return self._with(self._csc.data * np.repeat(columns, np.diff(self._csc.indptr)))

    def divided(self, rows: Array) -> SparseJacobian:
        return self._with(self._csc.data / rows[self._csc.indices])

    def largest_in_rows(self) -> Array:
        largest = np.zeros(self.shape[0])
        np.maximum.at(largest, self._csc.indices, np.abs(self._csc.data))
        return largest

    def split(self) -> tuple[Factor, Array]:
        n, end = self.shape[0], self._csc.indptr[-2]
        parts = self._csc.data[:end], self._csc.indices[:end], self._csc.indptr[:-1]
        return SparseLU(sp.csc_matrix(parts, shape=(n, n))), self.column_at(n)

    def _with(self, data: Array) -> SparseJacobian:
        """Return the matrix with other entries at the same places."""
        csc = self._csc
        matrix = sp.csc_matrix((data, csc.indices, csc.indptr), shape=csc.shape)
        matrix.has_canonical_format = True  # as in this matrix; scipy would test all entries
        return SparseJacobian(matrix)


@final
class SparseLU(Factor):
    """LU of a sparse matrix, which fails where a pivot vanishes exactly or is not finite."""

    def __init__(self, matrix: Any) -> None:
        from scipy.sparse.linalg import splu  # noqa: PLC0415  only for sparse systems

        self._lu: Any = None
        if np.isfinite(matrix.data).all():
            with suppress(RuntimeError):  # SuperLU finds a pivot that is exactly zero
                self._lu = splu(matrix)
        self.failed = self._lu is None

    @cached_property
    def _pivots(self) -> Array:
        """The diagonal of U, for which SciPy copies all of U."""
        return np.asarray(self._lu.U.diagonal())

    @property
    def sign(self) -> int:
        if self.failed:
            return 0
        signs = np.prod(np.sign(self._pivots))
        return int(signs) * factor.sign_of_permutation(self._lu.perm_r[self._lu.perm_c].tolist())

    def solve(self, rhs: Array) -> Array:
        return self._solved(rhs, "N")

    solve_all = solve

    def solve_transposed(self, rhs: Array) -> Array:
        return self._solved(rhs, "T")

    def _solved(self, rhs: Array, trans: str) -> Array:
        assert not self.failed, "nothing can be solved where the factorisation failed"
        return np.asarray(self._lu.solve(np.asfortranarray(rhs.T), trans).T)

    def is_singular(self) -> bool:
        if self.failed:
            return True
        pivots = np.abs(self._pivots)
        return bool(pivots.min() <= len(pivots) * EPS * pivots.max())


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
        factor.regularise(self._diagonal)

    @property
    def sign(self) -> int:
        return factor.sign_of_pivots(self._diagonal, self._pivots)

    def solve(self, rhs: Array) -> Array:
        return np.asarray(self._solved(b=rhs.T)[0].T)

    solve_all = solve

    def solve_transposed(self, rhs: Array) -> Array:
        return np.asarray(self._solved(b=rhs.T, trans=self._transposed)[0].T)
