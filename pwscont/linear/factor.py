"""The seam of all factorisations, and what all implementations share.

A Jacobian J has shape (n, n + 1) and columns for the unknowns z and for alpha; B is the part of J
for z, and b the column for alpha. A matrix with entries of about 1 has an LU with partial pivoting:
:class:`DenseLU` by LAPACK, and others in jacobian.py. A matrix in any units has the LU of the
scaled matrix (:class:`ScaledFactor`). Other factors are made from factors: from a factor and
changes of the matrix (:class:`ProductForm`), and around a factor of B (:class:`BorderedFactor`).

Only signs of determinants are computed, for determinants overflow (docs/theory, F10). Scales are
powers of two, which round nothing. B is singular at every fold, where the bordered matrix
[J; row] is not: a pivot of B that vanishes to rounding is moved to the size of a rounding error,
for which :class:`BorderedFactor` makes up.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from itertools import count
from operator import ne
from typing import final

import numpy as np
from scipy.linalg import blas, lapack

from pwscont.basics.arrays import Array, Indices, add_multiples, generic_angles, power_of_two
from pwscont.basics.rounding import EPS

#: Most rows, and most right-hand sides, for solutions one after the other, see :func:`_solved`.
ROWS_IN_TURN, COLUMNS_IN_TURN = 32, 8


class Factor(ABC):
    """A factorisation of a square matrix, shape (k, k)."""

    failed: bool = False  #: Whether a pivot vanished exactly, so that nothing can be solved.
    #: Whether the matrix is no part of a larger matrix that is factorised as well; for counts.
    is_whole: bool = False

    @property
    @abstractmethod
    def sign(self) -> int:
        """Sign of the determinant; 0 where a pivot vanishes exactly."""

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """Return the solution for a right-hand side, shape (k,)."""

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, k); by default singly."""
        return np.stack([self.solve(f) for f in rhs])

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix, for which a border around B asks."""
        name = type(self).__name__
        raise NotImplementedError(f"{name} does not solve with the transposed matrix: define it")

    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding; to be defined for a bordered matrix."""
        return self.failed


@final
class ScaledFactor(Factor):
    """The factorisation of a matrix M, made from a factor of (M / rows) * columns.

    ``rows``, ``columns``, shape (k,): powers of two.
    """

    def __init__(
        self, factor: Factor, rows: Array, columns: Array, *, is_whole: bool = False
    ) -> None:
        self._factor, self._rows, self._columns = factor, rows, columns
        self.failed, self.is_whole = factor.failed, is_whole

    @property
    def sign(self) -> int:
        return self._factor.sign

    def solve(self, rhs: Array) -> Array:
        return self._columns * self._factor.solve(rhs / self._rows)

    def solve_all(self, rhs: Array) -> Array:
        return self._columns * self._factor.solve_all(rhs / self._rows)

    def solve_transposed(self, rhs: Array) -> Array:
        return self._factor.solve_transposed(self._columns * rhs) / self._rows

    def is_singular(self) -> bool:
        return self._factor.is_singular()


def regularise(pivots: Array) -> None:
    """Move pivots below EPS to a size of EPS, in place; entries of the matrix are about 1."""
    sizes = np.abs(pivots)
    if sizes.min() < EPS:
        tiny = sizes < EPS
        pivots[tiny] = np.copysign(EPS, pivots[tiny])


def sign_of_pivots(pivots: Array, exchanges: Indices) -> int:
    """Return the sign of a determinant from the pivots and the row exchange of each pivot."""
    if len(pivots) <= ROWS_IN_TURN:  # numbers of Python take a third of the time
        odd = sum(map(ne, exchanges.tolist(), count()))
        return -1 if (odd + sum(map((0.0).__gt__, pivots.tolist()))) % 2 else 1
    negative = np.count_nonzero(np.signbit(pivots))
    odd = np.count_nonzero(exchanges != np.arange(len(exchanges)))
    return -1 if (negative + odd) % 2 else 1


def sign_of_permutation(order: Sequence[int]) -> int:
    """Return the sign of a permutation: -1 if the number of cycles of even length is odd."""
    rest, sign = set(range(len(order))), 1
    while rest:
        length, i = 0, rest.pop()
        first = i
        while (i := order[i]) != first:
            rest.discard(i)
            length += 1
        sign = -sign if length % 2 else sign
    return sign


def _solved(lu: Array, pivots: Indices, rhs: Array, transposed: bool = False) -> Array:
    """Return the solutions for the columns of an array, shape (k,) or (k, l).

    A few columns of a small matrix are solved for in turn: OpenBLAS would share them among threads.
    """
    if rhs.ndim == 2 and 1 < rhs.shape[1] <= COLUMNS_IN_TURN and len(pivots) <= ROWS_IN_TURN:
        solutions = np.array(rhs, order="F")
        for column in solutions.T:  # solved for in the room of the column
            lapack.dgetrs(lu, pivots, column, int(transposed), 1)
        return solutions
    return np.asarray(lapack.dgetrs(lu, pivots, rhs, int(transposed))[0])


def row_maxima(matrix: Array) -> Array:
    """Return the largest magnitude in each row, without an array of all magnitudes."""
    return np.asarray(np.maximum(matrix.max(axis=1), -matrix.min(axis=1)))


def row_divisors(matrix: Array) -> Array:
    """Return powers of two that divide the rows to entries of about 1; 1 for a row of zeros.

    ``matrix`` is in Fortran order.
    """
    if len(matrix) <= ROWS_IN_TURN:  # a tenth of the time for few rows
        multipliers, *_, zero_row = lapack.dgeequb(matrix)
        if not zero_row:
            return np.asarray(1.0 / multipliers)
    return power_of_two(row_maxima(matrix))


@final
class DenseLU(Factor):
    """LU of a dense matrix; solves for right-hand sides of shape (k,) or (l, k).

    ``matrix``, shape (k, k): overwritten if ``overwrite`` and if in Fortran order.
    ``moves_pivots``: whether pivots that vanish to rounding are moved off zero; else the
    factorisation fails where a pivot vanishes exactly, or where the matrix is not finite.
    """

    def __init__(
        self, matrix: Array, *, overwrite: bool = False, moves_pivots: bool = True
    ) -> None:
        self._norm = lapack.dlange("1", matrix)
        self.lu, self.pivots, info = lapack.dgetrf(matrix, overwrite_a=overwrite)
        if moves_pivots:
            regularise(self.lu.ravel(order="K")[:: len(self.lu) + 1])
        else:
            self.failed = info > 0 or not self._norm < math.inf

    @property
    def sign(self) -> int:
        return 0 if self.failed else sign_of_pivots(self.lu.diagonal(), self.pivots)

    def solve(self, rhs: Array) -> Array:
        if rhs.ndim == 1:
            return lapack.dgetrs(self.lu, self.pivots, rhs)[0]
        return _solved(self.lu, self.pivots, rhs.T).T

    solve_all = solve

    def solve_transposed(self, rhs: Array) -> Array:
        return _solved(self.lu, self.pivots, rhs.T, transposed=True).T

    @cached_property
    def reciprocal_condition(self) -> float:
        """Estimate of the reciprocal condition number; 0 where the factorisation has failed."""
        return 0.0 if self.failed else float(lapack.dgecon(self.lu, self._norm)[0])

    def is_singular(self) -> bool:
        return not self.reciprocal_condition >= len(self.lu) * EPS  # True for nan


#: Least pivot of a change, as a part of the sum of the magnitudes of the pivot's terms. A change
#: multiplies rounding errors by the inverse of the part: ten of sixteen digits are left.
SMALL_PIVOT = 1e-6
#: Number of changes that are kept as vectors before a fresh factorisation is due: two products with
#: 48 vectors cost as much as a solve with a matrix of about a hundred rows.
MOST_CHANGES_KEPT = 48


@final
class ProductForm(Factor):
    """A factorisation of M_0, and the changes of the matrix since: M^-1 = (I - V D) M_0^-1.

    A change c g^T with w = M^-1 c multiplies the inverse by I - w g^T / (1 + g.w) (Sherman and
    Morrison), and the sign of the determinant by that of the *pivot* 1 + g.w (docs/theory, F10).
    The rows of D are the vectors g, and the columns of V are multiplied in the same way, so that no
    system has to be solved for V. ``size``: the number of rows.
    """

    def __init__(self, factor: Factor, size: int) -> None:
        self._v = np.empty((MOST_CHANGES_KEPT, size))  # the columns of V
        self._d = np.empty_like(self._v)
        self.renew(factor)

    def renew(self, factor: Factor) -> None:
        """Take a factorisation of the matrix with all changes."""
        self._factor, self.count = factor, 0
        self._turn = 1  # the sign of the product of all pivots

    @property
    def is_full(self) -> bool:
        """Whether a fresh factorisation is due before the next change."""
        return self.count == MOST_CHANGES_KEPT

    @property
    def sign(self) -> int:
        return self._turn * self._factor.sign

    def solve(self, rhs: Array) -> Array:
        return self._changed(self._factor.solve(rhs))

    def solve_all(self, rhs: Array) -> Array:
        return self._changed(self._factor.solve_all(rhs))

    def _changed(self, vectors: Array) -> Array:
        """Return (I - V D) x for vectors x."""
        k = self.count
        if not k:
            return vectors
        return vectors - vectors.dot(self._d[:k].T).dot(self._v[:k])

    def change(self, w: Array, g: Array) -> float:
        """Change the matrix by c g^T, with the known w = M^-1 c, and return the pivot 1 + g.w.

        The pivot is zero, and the matrix not changed, where the change loses too many digits.
        """
        k, pivot = self.count, 1.0 + float(g.dot(w))
        if not abs(pivot) > SMALL_PIVOT * (1.0 + blas.dasum(g * w)):
            return 0.0
        self._v[k], self._d[k] = w / pivot, g
        if k:
            add_multiples(self._v[:k], -self._v[:k].dot(g), self._v[k])
        self.count += 1
        self._turn *= -1 if pivot < 0.0 else 1
        return pivot


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

    Solves with B alone keep a structure of B that a full row and a full column would spoil. Where B
    is nearly singular, as at folds, plain block elimination loses all digits: the mixed elimination
    BEMW of Govaerts (2000, section 3.6) finds the last unknown with the transpose of B first, and
    is as stable as the solves with B.

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
