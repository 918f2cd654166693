"""The matrix [[J, b], [C, 0]] with one more column and two more rows than a Jacobian (n, n + 1).

Failure modes and answers
-------------------------
- The full rows and the full column would fill a sparse factorisation: they are added one after
  the other to an LU of the part of J for z, first the borders that make up for the rank which that
  part lacks, then the column of alpha.
- The part for z lacks two ranks, where two curves that cross are both vertical: the whole matrix is
  factorised, sparse, whatever that costs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.linear.banded import BandedJacobian
from pwscont.linear.bordered import BorderedFactor, Interior
from pwscont.linear.factorise import factor
from pwscont.linear.sparse import split


class Augmented(ABC):
    """Solves with [[J, b], [C, 0]] and its transpose."""

    @abstractmethod
    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side, shape (n + 2,)."""

    @abstractmethod
    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""


def augmented(jacobian: Matrix, b: Array, C: Array) -> Augmented | None:
    """Factorise [[J, b], [C, 0]]; None where it is singular.

    Parameters
    ----------
    jacobian : ndarray, CSC matrix or BandedJacobian, shape (n, n + 1)
        With entries of about one.
    b : ndarray, shape (n,)
    C : ndarray, shape (2, n + 1)
    """
    if isinstance(jacobian, np.ndarray):
        upper, lower = np.column_stack([jacobian, b]), np.column_stack([C, np.zeros(2)])
        return DirectAugmented(np.vstack([upper, lower]))
    nested = BorderedAugmented.of(jacobian, b, C)
    if nested is not None and not nested.is_singular():
        return nested
    blocks = [[jacobian.tocsc(), b[:, np.newaxis]], [sp.csc_matrix(C), None]]
    return DirectAugmented(sp.bmat(blocks, format="csc"))


@final
class DirectAugmented(Augmented):
    """By a factorisation of the matrix and one of its transpose."""

    def __init__(self, matrix: Any) -> None:
        ones = np.ones(matrix.shape[0])
        self._direct, self._transposed = (factor(m, ones) for m in (matrix, matrix.T))

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""
        return self._direct.is_singular() or self._transposed.is_singular()

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        return self._direct.solve(rhs)

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        return self._transposed.solve(rhs)


@final
class BorderedAugmented(Augmented):
    """By borders around an LU of the part of J for z.

    The rows of C are turned so that the first has no entry for alpha. With ``T C`` in place of C
    the unknowns are ordered (z, mu, alpha) within.
    """

    def __init__(self, factor: BorderedFactor, turn: Array) -> None:
        self._factor, self._turn = factor, turn

    @classmethod
    def of(cls, jacobian: Matrix, b: Array, C: Array) -> BorderedAugmented | None:
        """Factorise; None where an inner matrix has no LU."""
        parts = jacobian.split() if isinstance(jacobian, BandedJacobian) else split(jacobian)
        core, column = parts
        turn = _turn(C[:, -1])
        first, second = turn @ C
        if core is None:
            return None
        n = len(b)
        ones, row = np.ones(n + 1), np.append(first[:-1], 0.0)
        inner = BorderedFactor(Interior(core, b), row, ones, ones)
        if inner.is_singular():
            return None
        row = np.concatenate([second[:-1], [0.0, second[-1]]])
        ones = np.ones(n + 2)
        return cls(BorderedFactor(Interior(inner, np.append(column, 0.0)), row, ones, ones), turn)

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""
        return self._factor.is_singular()

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        turned = np.append(rhs[:-2], self._turn @ rhs[-2:])
        return _exchanged(self._factor.solve(turned))

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        turned = self._factor.solve_transposed(_exchanged(rhs))
        return np.append(turned[:-2], self._turn.T @ turned[-2:])


def _turn(pair: Array) -> Array:
    """Return the rotation, shape (2, 2), that makes the first of two numbers zero."""
    size = float(np.hypot(*pair))
    cosine, sine = (pair[1] / size, pair[0] / size) if size > 0.0 else (1.0, 0.0)
    return np.array([[cosine, -sine], [sine, cosine]])


def _exchanged(x: Array) -> Array:
    """Return a vector with its last two entries exchanged."""
    return np.append(x[:-2], x[:-3:-1])
