"""The matrix [[J, b], [C, 0]]: a Jacobian (n, n + 1) with a further column and two further rows.

Newton's method for branch points solves with this matrix, see :mod:`pwscont.curve.crossing`.

Failure modes and answers
-------------------------
- The full rows and the full column would fill a sparse factorisation: rows and columns are added in
  turn to an LU of B, the part of J for z. First come the borders that make up for the rank that B
  lacks, then the column for alpha.
- B lacks two ranks, where two vertical curves cross: the whole matrix is factorised, sparse, at
  whatever cost.
"""

from __future__ import annotations

from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.linear.bordered import BorderedFactor, Interior
from pwscont.linear.dense import DenseFactor
from pwscont.linear.factor import Factor
from pwscont.linear.jacobian import StoredJacobian
from pwscont.linear.sparse import SparseFactor


def augmented(jacobian: Matrix, b: Array, C: Array) -> Factor:
    """Factorise [[J, b], [C, 0]], for solves with the matrix and with the transpose.

    Parameters
    ----------
    jacobian : ndarray or StoredJacobian, shape (n, n + 1)
        With entries of about 1.
    b : ndarray, shape (n,)
    C : ndarray, shape (2, n + 1)
    """
    n = len(b)
    if isinstance(jacobian, np.ndarray):
        whole = np.zeros((n + 2, n + 2), order="F")
        whole[:n, :-1], whole[:n, -1], whole[n:, :-1] = jacobian, b, C
        return DenseFactor(whole, np.ones(n + 2))
    by_parts = _by_parts(jacobian, b, C)
    if not by_parts.is_singular():
        return by_parts
    blocks = [[jacobian.tocsc(), b[:, np.newaxis]], [sp.csc_matrix(C), None]]
    return SparseFactor(sp.bmat(blocks, format="csc"), np.ones(n + 2))


def _by_parts(jacobian: StoredJacobian, b: Array, C: Array) -> Factor:
    """Factorise [[J, b], [C, 0]] by two borders around an LU of B.

    The rows of C are turned so that the first has no entry for alpha: this row and b are the first
    border, which needs no column for alpha. If B, or B with the first border, has no LU, a factor
    that is singular is returned.
    """
    core, column = jacobian.split()
    if core.failed:
        return core
    turn, ones = _turn(C[:, -1]), np.ones(len(b) + 2)
    first, second = turn @ C
    inner = BorderedFactor(Interior(core, b), np.append(first[:-1], 0.0), ones[1:], ones[1:])
    if inner.is_singular():
        return inner
    row = np.concatenate([second[:-1], [0.0, second[-1]]])
    outer = BorderedFactor(Interior(inner, np.append(column, 0.0)), row, ones, ones)
    return _Turned(outer, turn)


@final
class _Turned(Factor):
    """Solves with [[J, b], [C, 0]] by a factor in which C is turned and alpha comes last.

    Parameters
    ----------
    factor : Factor
        A factorisation with unknowns in the order (z, mu, alpha), and the rows ``turn @ C``.
    turn : ndarray, shape (2, 2)
        A rotation.
    """

    def __init__(self, factor: Factor, turn: Array) -> None:
        self._factor, self._turn = factor, turn
        self.failed = factor.failed

    @property
    def sign(self) -> int:
        """Sign of the determinant, which the exchange of two columns turns."""
        return -self._factor.sign

    def solve(self, rhs: Array) -> Array:
        """Return the solution for a right-hand side, shape (n + 2,)."""
        turned = np.append(rhs[:-2], self._turn @ rhs[-2:])
        return _exchanged(self._factor.solve(turned))

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        turned = self._factor.solve_transposed(_exchanged(rhs))
        return np.append(turned[:-2], self._turn.T @ turned[-2:])

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""
        return self._factor.is_singular()


def _turn(pair: Array) -> Array:
    """Return the rotation, shape (2, 2), that makes the first of two numbers zero."""
    size = float(np.hypot(*pair))
    cosine, sine = (pair[1] / size, pair[0] / size) if size > 0.0 else (1.0, 0.0)
    return np.array([[cosine, -sine], [sine, cosine]])


def _exchanged(x: Array) -> Array:
    """Return a vector with the last two entries exchanged."""
    return np.append(x[:-2], x[:-3:-1])
