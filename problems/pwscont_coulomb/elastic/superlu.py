"""Elimination by SciPy's SuperLU: simple, and a check of the multifrontal one.

The interior is factorised with a minimum degree order and diagonal pivots; the Schur complement
takes one solution per kept unknown, in blocks so that memory stays bounded. For many kept unknowns
:class:`~pwscont_coulomb.elastic.Multifrontal` is far faster.

Failure modes and answers
-------------------------
- The interior is singular: an error says so. An indefinite interior would go unnoticed here, but
  supports and materials, which are checked before, exclude it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.sparse.linalg import splu

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.elastic.elimination import NOT_DEFINITE, Eliminated, Elimination

#: Right-hand sides solved at once.
BLOCK = 32


@final
@dataclass(frozen=True, slots=True)
class SuperLU(Elimination):
    """Elimination by SuperLU and one solution per kept unknown."""

    def eliminate(self, A: Matrix, kept: Indices, positions: Array) -> Eliminated:
        """Eliminate all but the kept unknowns; see :class:`Elimination`."""
        return SolvedInterior(A, kept)


def _solver(interior: Matrix) -> Callable[[Array], Array]:
    """Factorise by symmetric pivoting on the diagonal: positive pivots are those of Cholesky."""
    try:
        lu = splu(
            interior.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise InvalidInputError(NOT_DEFINITE) from error
    return lu.solve  # type: ignore[no-any-return]


@final
class SolvedInterior(Eliminated):
    """An elimination by solutions with the factorised interior.

    Parameters
    ----------
    A : scipy.sparse, shape (n, n)
    kept : ndarray of int, shape (k,)
    """

    def __init__(self, A: Matrix, kept: Indices) -> None:
        A = A.tocsr()
        self._n, self._kept = A.shape[0], kept
        self._interior = np.setdiff1d(np.arange(self._n), kept)
        self._coupling = A[self._interior][:, kept].tocsc()
        inner = A[self._interior][:, self._interior]
        self._solve = _solver(inner) if len(self._interior) else np.zeros_like
        self._schur = self._complement(A[kept][:, kept].toarray())

    def _complement(self, block: Array) -> Array:
        across = self._coupling.T.tocsr()
        for first in range(0, len(block), BLOCK):
            columns = slice(first, first + BLOCK)
            block[:, columns] -= across @ self._solve(self._coupling[:, columns].toarray())
        return 0.5 * (block + block.T)

    @property
    def schur(self) -> Array:
        """The Schur complement, shape (k, k)."""
        return self._schur

    def reduce(self, f: Array) -> Array:
        """Return the condensed load, shape (k,)."""
        condensed: Array = f[self._kept] - self._coupling.T @ self._solve(f[self._interior])
        return condensed

    def recover(self, f: Array, kept: Array) -> Array:
        """Return all unknowns, shape (n,)."""
        found = np.empty(self._n)
        found[self._kept] = kept
        found[self._interior] = self._solve(f[self._interior] - self._coupling @ kept)
        return found
