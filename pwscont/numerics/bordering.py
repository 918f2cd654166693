"""Bordered matrices [[B, b], [c^T, d]] by solves with B alone, also where B is singular.

B keeps its structure (banded, sparse), which a full row and a full column would spoil.

Failure modes and answers
-------------------------
- B is singular at every fold, where the bordered matrix is not: plain block elimination loses
  all digits there. The mixed elimination BEMW of Govaerts (2000, section 3.6) finds the last
  unknown with the transpose of B, and corrects it with B: as stable as the solves with B. Far
  from folds its first half is left out, which saves a third of the time.
- The bordered matrix itself is singular: the solution of a generic right-hand side is huge.
- Rows and columns in different units: both are scaled as in :mod:`pwscont.numerics.linalg`.
"""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.foundation.arrays import Array, Matrix
from pwscont.foundation.rounding import EPS
from pwscont.numerics.banded import BandedJacobian
from pwscont.numerics.cores import Core, SparseCore, banded_core, superlu
from pwscont.numerics.equilibration import columns_scaled, largest_in_rows, rows_divided
from pwscont.numerics.factor import Factor, power_of_two

#: Plain elimination loses as many digits as B^-1 b is larger than b. Up to this growth it is left
#: at that: what it loses of a Newton correction is below rounding of the unknowns.
GROWTH = 1e4


@final
class BorderedFactor(Factor, Core):
    """Factorisation of [[B, b], [c^T, d]] by one of B.

    Parameters
    ----------
    core : Core
        LU of B, shape (n, n).
    column : ndarray, shape (n,)
        b.
    row : ndarray, shape (n + 1,)
        (c, d).
    rows, columns : ndarray, shape (n + 1,)
        What the rows of the matrix were divided by, and its columns multiplied by.
    """

    def __init__(self, core: Core, column: Array, row: Array, rows: Array, columns: Array) -> None:
        self._core, self._column, self._row, self._corner = core, column, row[:-1], float(row[-1])
        self._rows, self._columns = rows, columns
        self._right = core.solve(column)
        self._schur = self._corner - float(self._row.dot(self._right))
        self._is_ill = not np.abs(self._right).max() < GROWTH
        self.failed = self._schur == 0.0

    @property
    def sign(self) -> int:
        """Sign of the determinant; 0 where it vanishes exactly."""
        if self.failed:
            return 0
        return self._core.sign if self._schur > 0.0 else -self._core.sign

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side, by the algorithm BEMW."""
        return self._columns * self._solve(rhs / self._rows)

    def _solve(self, rhs: Array) -> Array:
        f, g = rhs[:-1], float(rhs[-1])
        guess = self._guess(f, g) if self._is_ill else 0.0
        if guess:
            f, g = f - guess * self._column, g - guess * self._corner
        inner = self._core.solve(f) if f.any() else f  # zero for a tangent
        correction = (g - float(self._row.dot(inner))) / self._schur
        solution = np.empty(len(rhs))
        np.subtract(inner, correction * self._right, out=solution[:-1])
        solution[-1] = guess + correction
        return solution

    def _guess(self, f: Array, g: float) -> float:
        """Return the last unknown as the transposed elimination finds it."""
        left, schur = self._transposed
        return (g - float(left.dot(f))) / schur

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        return self._twin.solve(rhs)

    @cached_property
    def _twin(self) -> BorderedFactor:
        core, column = _Transposed(self._core), np.append(self._column, self._corner)
        return BorderedFactor(core, self._row, column, 1.0 / self._columns, 1.0 / self._rows)

    @cached_property
    def _transposed(self) -> tuple[Array, float]:
        left = self._core.solve_transposed(self._row)
        schur = self._corner - float(self._column.dot(left))
        return left, schur or EPS  # that it vanishes and the other does not is rounding

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding, by solving for two generic vectors."""
        if self.failed:
            return True
        size = len(self._rows)
        angles = 1.0 + np.sqrt(2.0) * np.arange(size)
        # entries are about one, so that these are about 1 / (smallest singular value)
        growth = [np.linalg.norm(self._solve(f)) for f in (np.cos(angles), np.sin(angles))]
        return not max(growth) * EPS * np.sqrt(0.5 * size) < 1.0


def bordered_core(jacobian: Matrix, row: Array, scale: Array) -> Factor | None:
    """Factorise [J; row] for a sparse or banded J by its part for z.

    None where there is no LU of that part; ``scale`` as for :func:`~.linalg.bordered`.
    """
    scaled, row = columns_scaled(jacobian, scale), row * scale
    rows = np.empty(len(row))
    rows[:-1], rows[-1] = largest_in_rows(scaled), np.abs(row).max()
    rows = power_of_two(rows)
    core, column = split(rows_divided(scaled, rows[:-1]))
    return BorderedFactor(core, column, row / rows[-1], rows, scale) if core else None


def split(jacobian: Matrix) -> tuple[Core | None, Array]:
    """Return an LU of the part for z, and the column for alpha.

    Parameters
    ----------
    jacobian : BandedJacobian or CSC matrix, shape (n, n + 1)
        With entries of about one.
    """
    if isinstance(jacobian, BandedJacobian):
        return banded_core(jacobian.bands, jacobian.lower, jacobian.upper), jacobian.column
    n, end = jacobian.shape[0], jacobian.indptr[-2]
    column = np.zeros(n)
    column[jacobian.indices[end:]] = jacobian.data[end:]
    parts = jacobian.data[:end], jacobian.indices[:end], jacobian.indptr[:-1]
    lu = superlu(sp.csc_matrix(parts, shape=(n, n)))
    return (SparseCore(lu) if lu is not None else None), column


@final
class _Transposed(Core):
    """A core with its two solves exchanged."""

    def __init__(self, core: Core) -> None:
        self._core = core

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return self._core.sign

    def solve(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        return self._core.solve_transposed(rhs)

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the matrix itself."""
        return self._core.solve(rhs)
