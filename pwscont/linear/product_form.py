"""Solves with matrices that differ from a factorised one by changes of rank one (product form).

B' = B + c g^T has the inverse (I - w g^T / (1 + g.w)) B^-1 with w = B^-1 c (Sherman and Morrison).
The vectors of all changes since the factorisation are kept, as in the product form of the inverse
of the simplex method (Dantzig and Orchard-Hays 1954), multiplied out: a solve costs one with the
factorised matrix, and two products with the vectors.
"""

from __future__ import annotations

from typing import final

from pwscont.basics.arrays import Array
from pwscont.linear.changes import TOGETHER, Changes
from pwscont.linear.cores import Core
from pwscont.linear.factor import Factor


@final
class ProductForm:
    """A factorised matrix and its changes.

    Parameters
    ----------
    core : Core or Factor
        A factorisation of the first matrix.
    size : int
        n.
    """

    def __init__(self, core: Core | Factor, size: int) -> None:
        self._core, self._changes = core, Changes(size)

    @property
    def is_full(self) -> bool:
        """Whether a fresh factorisation is due before the next change."""
        return self._changes.count == TOGETHER

    def renew(self, core: Core | Factor) -> None:
        """Take a factorisation of the matrix with all its changes."""
        self._core = core
        self._changes.forget()

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side, shape (n,)."""
        return self._changes.applied(self._core.solve(rhs))

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n)."""
        return self._changes.applied(self._core.solve_all(rhs))

    def change(self, w: Array, g: Array) -> float:
        """Take a change up, of which w = B^-1 c is known; return its pivot 1 + g.w.

        Zero where the change would lose too many digits.
        """
        return self._changes.add(w, g)
