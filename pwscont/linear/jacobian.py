"""The seam of Jacobians with a structure.

Dense Jacobians are numpy arrays. Every other Jacobian is a :class:`StructuredJacobian`, or a
scipy.sparse matrix, which :class:`~pwscont.linear.sparse.SparseJacobian` wraps. Numerics that find
no use for the structure take the dense array instead.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Self

import numpy as np

from pwscont.basics.arrays import Array, Matrix, power_of_two
from pwscont.linear.bordered import BorderedFactor, Interior, row_scale
from pwscont.linear.factor import Factor, ScaledFactor


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
        rows = row_scale(scaled.largest_in_rows(), row)
        lu, column = scaled.divided(rows[:-1]).split()
        if lu.failed:
            return None
        return BorderedFactor(Interior(lu, column), row / rows[-1], rows, scale)

    def inner(self, scale: Array) -> Factor | None:
        scaled = self.scaled(scale)
        rows = power_of_two(scaled.largest_in_rows())
        lu, _ = scaled.divided(rows).split()
        return None if lu.failed else ScaledFactor(lu, rows, scale[:-1])
