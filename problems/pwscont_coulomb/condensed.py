"""Bodies condensed onto their contact unknowns, and what was condensed recovered.

With B = [N; T] and the flexibility C = B A^-1 B^T, equilibrium A u = f + B^T lam gives
C^-1 (B u) = C^-1 B A^-1 f + lam for the 2 p contact displacements B u alone: the body with
stiffness C^-1 under the load C^-1 B A^-1 f, whose first p unknowns are the normal and whose last p
the tangential displacements (docs/theory, F9).

Failure modes and answers
-------------------------
- A body whose contact nodes are nearly rigid against each other: C is inverted by Cholesky, whose
  error is that of a stiffness of the same condition.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices, Matrix, dense, finite_array
from pwscont_coulomb.eliminated import EliminatedFactor

if TYPE_CHECKING:
    from pwscont_coulomb.elastic.elimination import Elimination

#: Right-hand sides solved at once.
BLOCK = 64
#: Fewest displacements, in all and per contact node, of a body that is condensed by itself.
LARGE, PER_NODE = 1000, 8
#: Largest product of displacements and contact nodes of a body that is condensed by itself.
MOST = 2e7


def is_worth_condensing(n: int, p: int) -> bool:
    """Tell whether a body has so many displacements beside its contact nodes that time is saved."""
    return n >= max(LARGE, PER_NODE * p) and n * p <= MOST


@final
class Condensation:
    """What leads from a body to its contact unknowns and back.

    Parameters
    ----------
    A : ndarray or scipy.sparse, shape (n, n)
    N, T : ndarray or scipy.sparse, shape (p, n)
    elimination : Elimination, optional
        Default a factorisation by SciPy.
    """

    def __init__(
        self, A: Matrix, N: Matrix, T: Matrix, elimination: Elimination | None = None
    ) -> None:
        self._A, self._N, self._T, self._elimination = A, N, T, elimination
        self.n, self.p = A.shape[0], N.shape[0]

    def __reduce__(self) -> tuple[type[Condensation], tuple[Any, ...]]:
        """Leave factorisations behind in copies, also those for other processes."""
        return Condensation, (self._A, self._N, self._T, self._elimination)

    def with_nodes(self, kept: Indices) -> Condensation:
        """Return the same for some contact nodes, with the same factorisation."""
        twin = Condensation(self._A, self._N[kept], self._T[kept], self._elimination)
        if "_factor" in vars(self):
            vars(twin)["_factor"] = self._factor
        return twin

    @cached_property
    def _picks(self) -> Matrix:
        if sp.issparse(self._A):
            return sp.vstack([sp.csr_matrix(self._N), sp.csr_matrix(self._T)]).tocsr()
        return np.vstack([dense(self._N), dense(self._T)])

    @cached_property
    def _factor(self) -> Any:
        """A factorisation of A, with a method ``solve``."""
        if self._elimination is not None:
            return EliminatedFactor(self._A, self._picks, self._elimination)
        if sp.issparse(self._A):
            from scipy.sparse.linalg import splu  # noqa: PLC0415  only for sparse bodies

            options = {"SymmetricMode": True}
            kind = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": options}
            return splu(self._A.tocsc(), **kind)
        return _DenseFactor(self._A)

    @cached_property
    def flexibility(self) -> Array:
        """The contact displacements by contact forces, shape (2 p, 2 p)."""
        if isinstance(self._factor, EliminatedFactor):
            return self._factor.flexibility(self._picks)
        B, columns = self._picks, range(0, 2 * self.p, BLOCK)
        solved = [
            B @ self._factor.solve(np.asfortranarray(dense(B[k : k + BLOCK].T))) for k in columns
        ]
        C: Array = np.hstack(solved)
        symmetric: Array = 0.5 * (C + C.T)
        return symmetric

    @cached_property
    def stiffness(self) -> Array:
        """The condensed stiffness, shape (2 p, 2 p)."""
        inverse = np.linalg.inv(self.flexibility)
        return 0.5 * (inverse + inverse.T)

    def contact_displacements(self, u: Array) -> Array:
        """Return N u and T u, shape (2 p, k), of displacements, shape (n, k)."""
        return np.asarray(self._picks @ u)

    def reduced(self, load: Array) -> Array:
        """Return the condensed load, shape (2 p,) or (2 p, k), of loads, shape (n,) or (n, k)."""
        reduced: Array = self.stiffness @ (self._picks @ self._factor.solve(load))
        return reduced

    def solve(self, loads: Array) -> Array:
        """Return the displacements under loads, shape (n,) or (n, k), without contact."""
        solved: Array = self._factor.solve(loads)
        return solved

    def by_forces(self, forces: Array) -> Array:
        """Return the displacements, shape (k, n), under contact forces, shape (k, 2 p)."""
        parts = range(0, len(forces), BLOCK)
        solved = [self._factor.solve(self._picks.T @ forces[k : k + BLOCK].T).T for k in parts]
        return np.vstack(solved) if solved else np.zeros((0, self.n))

    def recovered(self, forces: Array, load: Array) -> Array:
        """Return all displacements, shape (n,).

        Parameters
        ----------
        forces : ndarray, shape (2 p,)
            lam_nu, then lam_t.
        load : ndarray, shape (n,)
        """
        recovered: Array = self._factor.solve(load + self._picks.T @ forces)
        return recovered


@final
class _DenseFactor:
    """The Cholesky factor of a dense matrix."""

    def __init__(self, A: Array) -> None:
        self._factor = cho_factor(A)

    def solve(self, right: Array) -> Array:
        """Return A^-1 b."""
        return np.asarray(cho_solve(self._factor, right))


def checked_load(name: str, load: Any, n: int) -> Array:
    """Return a load of the whole body, shape (n,), or loads side by side, shape (n, k)."""
    array = finite_array(name, load)
    if array.ndim not in (1, 2) or array.shape[0] != n:
        raise InvalidInputError(f"{name} has shape {array.shape}, expected ({n},) or ({n}, k)")
    return array
