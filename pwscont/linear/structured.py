"""The seam of Jacobians that know their structure.

Whatever is neither dense nor scipy.sparse fulfils it: banded matrices here, the contact problem's
in its plug-in. Numerics that find no use for the structure take the dense array instead.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, Matrix
from pwscont.linear.cores import Core
from pwscont.linear.factor import Factor


class StructuredJacobian(ABC):
    """A Jacobian (n, n + 1) that multiplies and factorises itself.

    Attributes
    ----------
    shape : tuple of int
        (n, n + 1).
    is_at_hand : bool
        Whether making one costs no more than a few residuals do; default False.
    """

    __array_ufunc__ = None  # array @ jacobian is for this class to compute
    shape: tuple[int, int]
    is_at_hand: bool = False

    @abstractmethod
    def __matmul__(self, x: Array) -> Array:
        """Return J x, shape (n,)."""

    def dot(self, x: Array) -> Array:
        """Return J x, by the name that arrays and sparse matrices have for it, too."""
        return self @ x

    @abstractmethod
    def __rmatmul__(self, y: Array) -> Array:
        """Return y J, shape (n + 1,)."""

    @abstractmethod
    def __abs__(self) -> Any:
        """Return something that multiplies vectors by the magnitudes of the entries."""

    @abstractmethod
    def toarray(self) -> Array:
        """Return the same matrix as a dense one."""

    @abstractmethod
    def bordered(self, row: Array, scale: Array, beside: Array | None = None) -> Factor | None:
        """Factorise [J; row]; None where its part for z has no factorisation.

        Parameters
        ----------
        row : ndarray, shape (n + 1,)
        scale : ndarray, shape (n + 1,)
            Typical magnitudes of the unknowns, powers of two.
        beside : ndarray, shape (n + 1,), optional
            A right-hand side that will be asked for next: solved at once where that costs little.
        """

    def inner(self, scale: Array) -> Core | None:
        """Factorise the part for z, for solves in its own units; default None, it cannot."""
        return None

    def column_at(self, index: int) -> Array:
        """Return a column, shape (n,); default by a product."""
        unit = np.zeros(self.shape[1])
        unit[index] = 1.0
        return self @ unit

    def scaled(self, columns: Array) -> Matrix:
        """Return a new matrix with columns multiplied; default dense."""
        return self.toarray() * columns

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.asarray(self.toarray(), dtype=dtype)
