"""Bordered matrices [J; row]: solutions and the sign of the determinant, never its value.

Failure modes and answers
-------------------------
- The determinant of a large matrix overflows: only its sign is formed, from the signs of the
  pivots and the parity of the permutation (docs/theory, F10).
- The matrix is singular at a branch point or where the curve is tangent to an interface: the
  reciprocal condition number says so; a solution is never returned with nan in it.
- Rows and columns in different units: columns are multiplied by the typical magnitudes of the
  unknowns and rows divided by their largest entries, both rounded to powers of two, so that
  scaling itself rounds nothing. Pivoting and condition then do not depend on units.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from pwscont.basics.arrays import Array, Matrix, Signs, dense, largest
from pwscont.basics.rounding import EPS
from pwscont.linear.cores import (
    Core,
    DenseCore,
    ScaledCore,
    sign_of_pivots,
    sign_of_superlu,
    superlu,
)
from pwscont.linear.factor import Factor, power_of_two
from pwscont.linear.sparse import bordered_sparse
from pwscont.linear.structured import StructuredJacobian

__all__ = [
    "DenseFactor",
    "Factor",
    "SparseFactor",
    "bordered",
    "factor",
    "last_unit",
    "power_of_two",
]

#: Of no more rows LAPACK finds the largest entries faster than numpy.
FEW_ROWS = 32


@final
class DenseFactor(Factor):
    """LU with partial pivoting by LAPACK.

    Columns are scaled to see what rows are divided by, and whether the matrix is singular; they are
    factorised as they are, for pivots do not depend on their scale.

    Parameters
    ----------
    matrix : ndarray, shape (k, k)
        Overwritten.
    scale : ndarray, shape (k,)
        Typical magnitudes of the unknowns, powers of two.
    """

    def __init__(self, matrix: Array, scale: Array) -> None:
        self._scaled = matrix * scale
        self._columns, self._rows = scale, _row_factors(self._scaled)
        by_columns = matrix.T  # along its rows the factors lie in a row, too
        by_columns *= self._rows
        self._lu, self._pivots, info = lapack.dgetrf(matrix, True)  # in its own place
        self.failed = info > 0
        self._verdict: bool | None = None

    @property
    def sign(self) -> int:
        """Sign of the determinant; 0 where a pivot vanishes exactly."""
        return 0 if self.failed else sign_of_pivots(self._lu.diagonal(), self._pivots)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        # in place of the product, which nobody else has; not transposed
        solution: Array = lapack.dgetrs(self._lu, self._pivots, rhs * self._rows, 0, 1)[0]
        return solution

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, k)."""
        solutions: Array = lapack.dgetrs(self._lu, self._pivots, (rhs * self._rows).T, 0, 1)[0]
        return solutions.T

    def without_border(self) -> Core:
        """Return the factorisation of B, if the matrix is [[B, b], [0, 1]] and regular.

        Its last row is never exchanged for another one.
        """
        n = len(self._lu) - 1
        core = DenseCore(self._lu[:n, :n].copy(order="F"), self._pivots[:n])
        return ScaledCore(core, 1.0 / self._rows[:n], np.ones(n))

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""
        if self._verdict is None:
            self._verdict = self.failed or self._looks_singular()
        return self._verdict

    def _looks_singular(self) -> bool:
        """Tell the same once: the room of the scaled matrix is used up."""
        norm = largest(self._rows.dot(np.abs(self._scaled, out=self._scaled)))
        if not math.isfinite(norm):
            return True
        lu = np.multiply(self._lu, self._columns, out=self._scaled)
        np.copyto(lu, self._lu, where=below(len(lu)))
        rcond = lapack.dgecon(lu, norm)[0]
        return not rcond >= len(lu) * EPS  # nor where it is nan


def _row_factors(scaled: Array) -> Array:
    """Return powers of two by which the rows are multiplied; one for a row of zeros.

    Of the entries no more than their magnitudes may be left.
    """
    if len(scaled) <= FEW_ROWS:
        factors, *_, has_zeros = lapack.dgeequb(scaled)
        if not has_zeros:
            return np.asarray(factors)
    return 1.0 / power_of_two(np.maximum.reduce(np.abs(scaled, out=scaled), axis=1))


@final
class SparseFactor(Factor):
    """LU by SuperLU; parameters as for :class:`DenseFactor`."""

    def __init__(self, matrix: Any, scale: Array) -> None:
        scaled = matrix @ sp.diags(scale)
        self._columns = scale
        self._rows = power_of_two(abs(scaled).max(axis=1).toarray().ravel())
        self._lu = superlu(sp.csc_matrix(sp.diags(1.0 / self._rows) @ scaled))
        self.failed = self._lu is None

    @property
    def sign(self) -> int:
        """Sign of the determinant; 0 where a pivot vanishes exactly."""
        return sign_of_superlu(self._lu) if self._lu is not None else 0

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        assert self._lu is not None, "nothing can be solved where the factorisation failed"
        scaled: Array = self._lu.solve(rhs / self._rows)
        return self._columns * scaled

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""
        if self._lu is None:
            return True
        pivots = np.abs(self._lu.U.diagonal())
        return bool(pivots.min() <= len(pivots) * EPS * pivots.max())


def factor(matrix: Matrix, scale: Array) -> Factor:
    """Factorise a square matrix, dense or sparse; ``scale`` as for :class:`DenseFactor`."""
    return SparseFactor(matrix, scale) if sp.issparse(matrix) else DenseFactor(+matrix, scale)


def bordered(jacobian: Matrix, row: Any, scale: Array, beside: Array | None = None) -> Factor:
    """Factorise the (n + 1, n + 1) matrix [J; row]; ``scale`` as for :class:`DenseFactor`.

    A right-hand side that will be solved for next may be given ``beside``.
    """
    row = row if isinstance(row, np.ndarray) else dense(row).ravel()
    if isinstance(jacobian, np.ndarray):
        n = len(jacobian)
        matrix = np.empty((n + 1, n + 1), order="F")
        matrix[:n] = jacobian
        matrix[n] = row
        return DenseFactor(matrix, scale)
    if isinstance(jacobian, StructuredJacobian):
        structured = jacobian.bordered(row, scale, beside)
        return structured or DenseFactor(np.vstack([jacobian, row]), scale)
    found = bordered_sparse(jacobian, row, scale)
    return found or SparseFactor(sp.vstack([jacobian, sp.csr_matrix(row)]), scale)


@lru_cache(maxsize=2)
def below(size: int) -> Signs:
    """Tell which entries of a square matrix are below its diagonal, not to be written to."""
    entries = np.asfortranarray(np.tri(size, k=-1, dtype=bool))  # as LAPACK stores matrices
    entries.flags.writeable = False
    return entries


@lru_cache(maxsize=8)
def last_unit(size: int) -> Array:
    """Return the unit vector e_size, not to be written to."""
    unit = np.zeros(size)
    unit[-1] = 1.0
    unit.flags.writeable = False
    return unit
