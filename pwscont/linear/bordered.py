"""Bordered matrices [[B, b], [c^T, d]] by solves with B alone, also where B is singular.

B keeps its structure (banded, sparse), which a full row and a full column would spoil.

Failure modes and answers
-------------------------
- B is singular at every fold, where the bordered matrix is not: plain block elimination loses
  all digits there. The mixed elimination BEMW of Govaerts (2000, section 3.6) finds the last
  unknown with the transpose of B, and corrects it with B: as stable as the solves with B. Far
  from folds its first half is left out, which saves a third of the time.
- The bordered matrix itself is singular: the solution of a generic right-hand side is huge.
- Rows and columns in different units: both are scaled as in :mod:`pwscont.linear.factorise`.
"""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.generic import generic_angles
from pwscont.basics.rounding import EPS
from pwscont.linear.cores import Core
from pwscont.linear.factor import Factor, power_of_two

#: Plain elimination loses as many digits as B^-1 b is larger than b. Up to this growth nothing is
#: done about the loss: what is lost of a Newton correction is below rounding of the unknowns.
GROWTH = 1e4


@final
class Interior:
    """What a bordered matrix needs of [B, b], whatever the border.

    Parameters
    ----------
    core : Core
        LU of B, shape (n, n).
    column : ndarray, shape (n,)
        b.
    """

    def __init__(self, core: Core, column: Array) -> None:
        self.core, self.column = core, column
        #: Vectors f that B^-1 f is known of.
        self.beside: tuple[tuple[Array, Array], ...] = ()

    def solve(self, f: Array) -> Array:
        """Return B^-1 f."""
        for known, solution in self.beside:
            if np.array_equal(known, f):
                return solution
        return self.core.solve(f)

    @classmethod
    def at_once(cls, core: Core, column: Array, beside: Array | None = None) -> Interior:
        """Return an interior whose solves are done together, where all cost as much as one.

        Also for f, shape (n,), if it is given ``beside``.
        """
        interior, vectors = cls(core, column), _generic(len(column) + 1)
        more = [] if beside is None else [beside]
        right, one, other, *solved = core.solve_all(np.vstack([column, vectors[:, :-1], *more]))
        interior.right = right
        interior.generic = tuple(zip(vectors, (one, other), strict=True))
        interior.beside = tuple(zip(more, solved, strict=True))
        return interior

    @cached_property
    def right(self) -> Array:
        """B^-1 b, shape (n,)."""
        return self.core.solve(self.column)

    @cached_property
    def generic(self) -> tuple[tuple[Array, Array], ...]:
        """Two generic vectors f, shape (n + 1,), each with B^-1 f[:-1]."""
        vectors = _generic(len(self.column) + 1)
        return tuple(zip(vectors, self.core.solve_all(vectors[:, :-1]), strict=True))


@final
class BorderedFactor(Factor, Core):
    """Factorisation of [[B, b], [c^T, d]] by one of B.

    Parameters
    ----------
    interior : Interior
        B and b.
    row : ndarray, shape (n + 1,)
        (c, d).
    rows, columns : ndarray, shape (n + 1,)
        What the rows of the matrix were divided by, and its columns multiplied by.
    """

    def __init__(self, interior: Interior, row: Array, rows: Array, columns: Array) -> None:
        self._interior, self._core, self._column = interior, interior.core, interior.column
        self._row, self._corner = row[:-1], float(row[-1])
        self._rows, self._columns = rows, columns
        self._right = interior.right
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

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n + 1)."""
        if self._is_ill:
            return super().solve_all(rhs)
        scaled = rhs / self._rows
        inner = self._core.solve_all(scaled[:, :-1])
        pairs = zip(inner, scaled[:, -1], strict=True)
        return self._columns * np.stack([self._completed(f, float(g)) for f, g in pairs])

    def _solve(self, rhs: Array) -> Array:
        f, g = rhs[:-1], float(rhs[-1])
        guess = self._guess(f, g) if self._is_ill else 0.0
        if guess:
            f, g = f - guess * self._column, g - guess * self._corner
        inner = self._interior.solve(f) if f.any() else f  # zero for a tangent
        return self._completed(inner, g, guess)

    def _completed(self, inner: Array, g: float, guess: float = 0.0) -> Array:
        """Return the solution from B^-1 f, the entry for the border and a guess of the last."""
        correction = (g - float(self._row.dot(inner))) / self._schur
        solution = np.empty(len(inner) + 1)
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
        twin = Interior(_Transposed(self._core), self._row)
        column = np.append(self._column, self._corner)
        return BorderedFactor(twin, column, 1.0 / self._columns, 1.0 / self._rows)

    @cached_property
    def _transposed(self) -> tuple[Array, float]:
        left = self._core.solve_transposed(self._row)
        schur = self._corner - float(self._column.dot(left))
        return left, schur or EPS  # that it vanishes and the other does not is rounding

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding, by solving for two generic vectors."""
        if self.failed:
            return True
        # entries are about one, so that these are about 1 / (smallest singular value)
        growth = [np.linalg.norm(self._generic(*pair)) for pair in self._interior.generic]
        return not max(growth) * EPS * np.sqrt(0.5 * len(self._rows)) < 1.0

    def _generic(self, f: Array, inner: Array) -> Array:
        """Return the solution for a generic vector f, of which B^-1 f[:-1] is known."""
        return self._solve(f) if self._is_ill else self._completed(inner, float(f[-1]))


def _generic(size: int) -> Array:
    """Return two vectors related to no simple numbers, shape (2, size)."""
    angles = generic_angles(size)
    return np.stack([np.cos(angles), np.sin(angles)])


def row_scale(largest: Array, row: Array) -> Array:
    """Return what rows and border are divided by, from the largest entries of the rows."""
    return power_of_two(np.append(largest, np.abs(row).max()))


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
