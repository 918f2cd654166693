"""Bordered matrices [[B, b], [c^T, d]] by solves with B alone, also where B is singular.

B keeps a structure (banded, sparse, eliminated by hand) that a full row and a full column would
spoil. Where B is nearly singular, as at folds, plain block elimination loses all digits: the mixed
elimination BEMW of Govaerts (2000, section 3.6) finds the last unknown with the transpose of B
first, and is as stable as the solves with B.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, generic_angles, power_of_two
from pwscont.basics.rounding import EPS
from pwscont.linear.factor import Factor

#: Bound on the largest entry of B^-1 b, a number without unit since the entries of B and b are
#: scaled to about 1. Plain elimination multiplies rounding errors by the largest entry; an error of
#: GROWTH * EPS = 2e-12 of a Newton correction is below rounding of the corrected unknowns.
GROWTH = 1e4


@final
class Interior:
    """[B, b], and the solves with B that do not depend on the border.

    ``core``: a factorisation of B, shape (n, n), which solves with the transpose, too.
    ``column``: b, shape (n,).
    """

    def __init__(self, core: Factor, column: Array) -> None:
        self.core, self.column = core, column

    @cached_property
    def right(self) -> Array:
        """B^-1 b, shape (n,)."""
        return self.core.solve(self.column)

    @cached_property
    def generic(self) -> tuple[tuple[Array, Array], ...]:
        """Two generic vectors f, shape (n + 1,), each with B^-1 f[:-1]."""
        angles = generic_angles(len(self.column) + 1)
        vectors = np.stack([np.cos(angles), np.sin(angles)])
        return tuple(zip(vectors, self.core.solve_all(vectors[:, :-1]), strict=True))


@final
class BorderedFactor(Factor):
    """Factorisation of a matrix M in any units, where (M / rows) * columns is [[B, b], [c^T, d]].

    ``interior``: B and b. ``row``: (c, d). All three arrays have the shape (n + 1,).
    """

    is_whole = True

    def __init__(self, interior: Interior, row: Array, rows: Array, columns: Array) -> None:
        self._interior, self._core, self._column = interior, interior.core, interior.column
        self._row, self._corner = row[:-1], float(row[-1])
        self._rows, self._columns = rows, columns
        self._right = interior.right
        self._schur = self._corner - float(self._row.dot(self._right))
        self._is_ill = not np.abs(self._right).max() < GROWTH
        self.failed = not 0.0 < abs(self._schur) < math.inf  # nan fails as well

    @property
    def sign(self) -> int:
        if self.failed:
            return 0
        return self._core.sign if self._schur > 0.0 else -self._core.sign

    def solve(self, rhs: Array) -> Array:
        return self._columns * self._solve(rhs / self._rows)

    def _solve(self, rhs: Array) -> Array:
        """Return the scaled solution for a scaled right-hand side."""
        f, g = rhs[:-1], float(rhs[-1])
        guess = (g - float(self._left[0].dot(f))) / self._left[1] if self._is_ill else 0.0
        if guess:
            f, g = f - guess * self._column, g - guess * self._corner
        inner = self._core.solve(f) if f.any() else f  # a tangent is solved for with f = 0
        return self._completed(inner, g, guess)

    def solve_all(self, rhs: Array) -> Array:
        if self._is_ill:
            return super().solve_all(rhs)
        scaled, solutions = rhs / self._rows, np.empty(rhs.shape)
        inner, last = self._core.solve_all(scaled[:, :-1]), solutions[:, -1]
        np.divide(scaled[:, -1] - inner.dot(self._row), self._schur, out=last)
        np.subtract(inner, np.multiply.outer(last, self._right), out=solutions[:, :-1])
        return self._columns * solutions

    def _completed(self, inner: Array, g: float, guess: float = 0.0) -> Array:
        """Return the solution from B^-1 f, the last entry g and a guess of the last unknown."""
        correction = (g - float(self._row.dot(inner))) / self._schur
        solution = np.empty(len(inner) + 1)
        np.subtract(inner, correction * self._right, out=solution[:-1])
        solution[-1] = guess + correction
        return solution

    @cached_property
    def _left(self) -> tuple[Array, float]:
        """B^-T c, and the Schur complement that follows from B^-T c."""
        left = self._core.solve_transposed(self._row)
        schur = self._corner - float(self._column.dot(left))
        return left, schur or EPS  # zero by rounding alone, for the Schur complement is not zero

    def solve_transposed(self, rhs: Array) -> Array:
        interior = Interior(_Transposed(self._core), self._row)
        column = np.append(self._column, self._corner)
        transposed = BorderedFactor(interior, column, 1.0 / self._columns, 1.0 / self._rows)
        return transposed.solve(rhs)

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding, from solutions for two generic vectors.

        A solution is about as long as the vectors divided by the smallest singular value.
        """
        if self.failed:
            return True
        solutions = (
            self._solve(f) if self._is_ill else self._completed(inner, float(f[-1]))
            for f, inner in self._interior.generic
        )
        longest = max(map(np.linalg.norm, solutions))
        return not longest * EPS * np.sqrt(0.5 * len(self._rows)) < 1.0


def row_scale(largest: Array, row: Array) -> Array:
    """Return the divisors of the rows of [J; row], shape (n + 1,), powers of two.

    ``largest``: the largest magnitude in each row of J, with scaled columns as ``row`` has.
    """
    return power_of_two(np.append(largest, np.abs(row).max()))


@final
class _Transposed(Factor):
    """The transpose of a matrix, whose factorisation solves with the transpose, too."""

    def __init__(self, factor: Factor) -> None:
        self._factor = factor

    @property
    def sign(self) -> int:
        return self._factor.sign

    def solve(self, rhs: Array) -> Array:
        return self._factor.solve_transposed(rhs)

    def solve_transposed(self, rhs: Array) -> Array:
        return self._factor.solve(rhs)
