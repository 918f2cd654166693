"""Elimination by SciPy's SuperLU: simple, and a check of the multifrontal elimination.

The interior is factorised with a minimum degree order and diagonal pivots; the Schur complement
takes a solution per kept unknown, in blocks to bound memory. For many kept unknowns
:class:`~pwscont_coulomb.elastic.Multifrontal` is far faster.

Failure modes and answers
-------------------------
- The interior is singular: an error says so. An indefinite interior would go unnoticed here, but
  the checks of supports and materials exclude an indefinite interior.
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
from pwscont_coulomb.elastic.solved_interior import SolvedInterior

#: Right-hand sides solved at once, to bound memory.
BLOCK = 32


@final
@dataclass(frozen=True, slots=True)
class SuperLU(Elimination):
    """Elimination by SuperLU and a solution per kept unknown.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import SuperLU
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> triangle().build().condensed(SuperLU()).along_load().size
    4
    """

    def eliminate(self, A: Matrix, kept: Indices, positions: Array) -> Eliminated:
        """Eliminate all unknowns except the kept unknowns; see :class:`Elimination`."""
        A = A.tocsr()
        interior = np.setdiff1d(np.arange(A.shape[0]), kept)
        solve = _solver(A[interior][:, interior]) if len(interior) else np.zeros_like
        schur = _complement(A[kept][:, kept].toarray(), A[kept][:, interior], solve)
        return SolvedInterior(A, kept, interior, solve, schur)


def _solver(interior: Matrix) -> Callable[[Array], Array]:
    """Factorise by symmetric pivoting on the diagonal: positive pivots are pivots of Cholesky."""
    try:
        lu = splu(
            interior.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise InvalidInputError(NOT_DEFINITE) from error
    return lu.solve


def _complement(block: Array, across: Matrix, solve: Callable[[Array], Array]) -> Array:
    """Return the Schur complement, made in the place of the kept block of the matrix."""
    coupling = across.T.tocsc()
    for first in range(0, len(block), BLOCK):
        columns = slice(first, first + BLOCK)
        block[:, columns] -= across @ solve(coupling[:, columns].toarray())
    return 0.5 * (block + block.T)
