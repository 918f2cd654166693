"""Bodies from matrices, condensed by the eliminations of bodies from meshes.

Unknowns in which N or T have an entry are kept, all other unknowns are eliminated. Eliminations
order the unknowns by places in the plane; a body from matrices has no places, so the distances in
the graph of the matrix from two unknowns far apart stand for places.

Failure modes and answers
-------------------------
- The graph of the matrix falls into parts: unknowns out of reach stand beyond all others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from pwscont.extending import Array, Matrix, dense

if TYPE_CHECKING:
    from pwscont_coulomb.elastic.elimination import Elimination


@final
class EliminatedFactor:
    """A body whose unknowns away from contact are eliminated.

    Parameters
    ----------
    A : ndarray or scipy.sparse, shape (n, n)
    picks : ndarray or scipy.sparse, shape (2 p, n)
        N above T.
    elimination : Elimination
    """

    def __init__(self, A: Matrix, picks: Matrix, elimination: Elimination) -> None:
        matrix = sp.csr_matrix(A)
        self.kept = np.unique(sp.csr_matrix(picks).nonzero()[1])
        self._eliminated = elimination.eliminate(matrix, self.kept, places(matrix))
        self._small = cho_factor(self._eliminated.schur)

    def solve(self, right: Array) -> Array:
        """Return A^-1 b, for b of shape (n,) or (n, k)."""
        columns = [self._solved(b) for b in right.reshape(len(right), -1).T]
        return np.stack(columns, axis=1).reshape(right.shape)

    def _solved(self, b: Array) -> Array:
        kept = cho_solve(self._small, self._eliminated.reduce(b))
        return self._eliminated.recover(b, kept)

    def flexibility(self, picks: Matrix) -> Array:
        """Return the contact displacements by contact forces, shape (2 p, 2 p)."""
        B = dense(picks[:, self.kept])
        C = B @ cho_solve(self._small, B.T)
        symmetric: Array = 0.5 * (C + C.T)
        return symmetric


def places(A: Any) -> Array:
    """Return two numbers for each unknown that are close for coupled unknowns, shape (2, n)."""
    from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415  only for such bodies

    def far(unknown: int) -> Array:
        steps: Array = dijkstra(A != 0, indices=unknown, unweighted=True)
        return np.where(np.isfinite(steps), steps, float(A.shape[0]))

    one = far(int(np.argmax(far(0))))
    other = far(int(np.argmax(one)))
    third = far(int(np.argmax(one + other)))
    return np.stack([one - other, third])
