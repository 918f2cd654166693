"""Sparse Jacobians, and the LU of sparse matrices by SuperLU."""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import EPS
from pwscont.linear.factor import Factor, sign_of_permutation
from pwscont.linear.jacobian import StoredJacobian


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
        return int(signs) * sign_of_permutation(self._lu.perm_r[self._lu.perm_c].tolist())

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
