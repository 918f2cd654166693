"""Factorisations of matrices in every storage: the functions that the other rooms call.

- :func:`bordered` factorises [J; row], for Newton's method and tangents;
- :func:`inner` factorises B alone, the part of J for z, for straight pieces;
- :func:`factor` factorises a square matrix;
- :func:`balanced_columns` says in which units the unknowns of a matrix are alike;
- :func:`columns_scaled`, :func:`rows_divided`, :func:`largest_in_rows` and :func:`column` bring a
  Jacobian to entries of about 1, and read columns;
- :func:`augmented` factorises [[J, b], [C, 0]], for Newton's method for branch points.

Failure modes and answers
-------------------------
- B has no LU, since a pivot vanishes exactly: the bordered matrix is factorised as a whole.
- The full rows and the full column would fill a sparse factorisation: rows and columns are added in
  turn to an LU of B, the part of J for z. First come the borders that make up for the rank that B
  lacks, then the column for alpha.
- B lacks two ranks, where two vertical curves cross: the whole matrix is factorised, sparse, at
  whatever cost.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix, dense
from pwscont.linear.bordered import BorderedFactor, Interior
from pwscont.linear.dense import DenseFactor, DenseLU, row_maxima
from pwscont.linear.factor import Factor, ScaledFactor, power_of_two
from pwscont.linear.jacobian import StoredJacobian, StructuredJacobian
from pwscont.linear.sparse import SparseFactor, SparseJacobian, column_of

__all__ = [
    "DenseFactor",
    "Factor",
    "SparseFactor",
    "balanced_columns",
    "bordered",
    "column",
    "columns_scaled",
    "factor",
    "inner",
    "largest_in_rows",
    "last_unit",
    "power_of_two",
    "rows_divided",
]


def bordered(jacobian: Matrix, row: Any, scale: Array, beside: Array | None = None) -> Factor:
    """Factorise [J; row], shape (n + 1, n + 1).

    Parameters
    ----------
    jacobian : ndarray, sparse matrix or StructuredJacobian, shape (n, n + 1)
    row : ndarray or sparse matrix, n + 1 entries
    scale : ndarray, shape (n + 1,)
        Typical magnitudes of the unknowns, powers of two.
    beside : ndarray, shape (n + 1,), optional
        The right-hand side of the next solve, for Jacobians that solve for several right-hand sides
        at once.
    """
    row = row if isinstance(row, np.ndarray) else dense(row).ravel()
    if isinstance(jacobian, np.ndarray):
        n = len(jacobian)
        matrix = np.empty((n + 1, n + 1), order="F")
        matrix[:n] = jacobian
        matrix[n] = row
        return DenseFactor(matrix, scale)
    by_parts = _structured(jacobian).bordered(row, scale, beside)
    return by_parts or bordered(dense(jacobian), row, scale)


def inner(jacobian: Matrix, scale: Array) -> Factor | None:
    """Factorise B, the part of J for z, in the units of H and z; None if B has no factorisation.

    B may be singular or nearly singular, as on vertical pieces: solutions are huge then, and the
    caller must look at the size of solutions. Parameters as for :func:`bordered`.
    """
    if not isinstance(jacobian, np.ndarray):
        return _structured(jacobian).inner(scale)
    own = np.multiply(jacobian, scale, order="F")  # work in place: new room costs as much
    rows = power_of_two(row_maxima(own))
    own /= rows[:, np.newaxis]
    return ScaledFactor(DenseLU.of(own[:, :-1], overwrite=True), rows, scale[:-1])


def factor(matrix: Matrix, scale: Array) -> Factor:
    """Factorise a square matrix, dense or sparse, shape (k, k); ``scale`` of shape (k,)."""
    if sp.issparse(matrix):
        return SparseFactor(matrix, scale)
    return DenseFactor(np.array(matrix, dtype=float, order="F"), scale)


@lru_cache(maxsize=8)
def last_unit(size: int) -> Array:
    """Return the unit vector (0, ..., 0, 1), shape (size,), not to be written to."""
    unit = np.zeros(size)
    unit[-1] = 1.0
    unit.flags.writeable = False
    return unit


# -- Jacobians in every storage --------------------------------------------------------------------


def columns_scaled(jacobian: Matrix, scale: Array) -> Matrix:
    """Return a new Jacobian with columns multiplied by ``scale``, shape (n + 1,)."""
    is_dense = isinstance(jacobian, np.ndarray)
    return jacobian * scale if is_dense else _structured(jacobian).scaled(scale)


def rows_divided(jacobian: Matrix, rows: Array) -> Matrix:
    """Return a new Jacobian, from a result of :func:`columns_scaled`, with rows divided."""
    is_dense = isinstance(jacobian, np.ndarray)
    return jacobian / rows[:, np.newaxis] if is_dense else jacobian.divided(rows)


def largest_in_rows(jacobian: Matrix) -> Array:
    """Return the largest magnitude in each row of a result of :func:`columns_scaled`."""
    is_dense = isinstance(jacobian, np.ndarray)
    largest: Array = row_maxima(jacobian) if is_dense else jacobian.largest_in_rows()
    return largest


def column(jacobian: Matrix, index: int) -> Array:
    """Return a column of a Jacobian, shape (n,), in a new array."""
    if sp.issparse(jacobian):
        return column_of(jacobian, index)
    if isinstance(jacobian, StructuredJacobian):
        return jacobian.column_at(index)
    return np.array(jacobian[:, index], dtype=float)


def balanced_columns(jacobian: Matrix) -> Array:
    """Return multipliers of the columns of [H_z, H_alpha] that balance H_z, powers of two.

    Each row is divided by the row's largest entry first; the multiplier for alpha is 1.
    """
    sparse = sp.issparse(jacobian)
    sizes = abs(sp.csr_array(jacobian)) if sparse else np.abs(dense(jacobian))
    rows = sizes[:, :-1]
    largest = _largest(rows, 1)
    columns = _largest(rows / np.where(largest > 0.0, largest, 1.0)[:, np.newaxis], 0)
    return power_of_two(np.append(1.0 / np.where(columns > 0.0, columns, 1.0), 1.0))


def _largest(sizes: Matrix, axis: int) -> Array:
    """Return the largest entries along an axis of a matrix, dense or in sparse rows."""
    found = sizes.max(axis=axis)
    return dense(found).ravel() if sp.issparse(sizes) else found


def _structured(jacobian: Matrix) -> StructuredJacobian:
    """Return a Jacobian that is no array as a Jacobian that factorises itself."""
    return jacobian if isinstance(jacobian, StructuredJacobian) else SparseJacobian(jacobian)


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
