"""Condensed loads and recovery by solutions with a factorised interior."""

from __future__ import annotations

from collections.abc import Callable
from typing import final

import numpy as np

from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.elastic.elimination import Eliminated


@final
class SolvedInterior(Eliminated):
    """An elimination that solves with the interior for each load and for each recovery.

    Parameters
    ----------
    A : scipy.sparse csr, shape (n, n)
    kept : ndarray of int, shape (k,)
    interior : ndarray of int, shape (n - k,)
        All other unknowns.
    solve : callable
        Returns the solution of A_II x = b, shape (n - k,), of a right-hand side.
    schur : ndarray, shape (k, k)
        Symmetric.
    """

    def __init__(
        self,
        A: Matrix,
        kept: Indices,
        interior: Indices,
        solve: Callable[[Array], Array],
        schur: Array,
    ) -> None:
        self._n, self._kept, self._interior = A.shape[0], kept, interior
        self._across = A[kept][:, interior]
        self._solve, self._schur = solve, schur

    @property
    def schur(self) -> Array:
        """The Schur complement, shape (k, k)."""
        return self._schur

    def reduce(self, f: Array) -> Array:
        """Return the condensed load, shape (k,)."""
        condensed: Array = f[self._kept] - self._across @ self._solve(f[self._interior])
        return condensed

    def recover(self, f: Array, kept: Array) -> Array:
        """Return all unknowns, shape (n,)."""
        found = np.empty(self._n)
        found[self._kept] = kept
        found[self._interior] = self._solve(f[self._interior] - self._across.T @ kept)
        return found
