"""LU factorisations of square matrices that may be singular: what bordered solves are made of.

Failure modes and answers
-------------------------
- The matrix is singular, as dH/dz is at every fold: a pivot that vanishes to rounding is moved to
  the size of a rounding error, which a bordered solve makes up for, see
  :class:`~pwscont.linear.bordered.BorderedFactor`.
- SuperLU gives up where a pivot vanishes exactly: there is no core then, and the caller
  factorises the whole bordered matrix instead.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from operator import ne
from typing import Any, final

import numpy as np
from scipy.linalg import lapack

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS

#: LAPACK's tridiagonal routines are wrapped for matrices of at least this size.
SMALLEST_TRIDIAGONAL = 3
#: Of no more pivots Python finds the sign of their product faster than numpy.
FEW_PIVOTS = 32


class Core(ABC):
    """An LU factorisation of a square matrix that may be singular, with entries up to one."""

    @property
    @abstractmethod
    def sign(self) -> int:
        """Sign of the determinant."""

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side, shape (n,)."""

    @abstractmethod
    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n); default one by one."""
        return np.stack([self.solve(f) for f in rhs])


def banded_core(bands: Array, lower: int, upper: int) -> Core:
    """Factorise a banded matrix stored as in :class:`BandedJacobian`."""
    if lower == upper == 1 and bands.shape[1] >= SMALLEST_TRIDIAGONAL:
        return TridiagonalCore(bands)
    return BandCore(bands, lower, upper)


@final
class TridiagonalCore(Core):
    """LU of a tridiagonal matrix by LAPACK; a third of the time of :class:`BandCore`."""

    def __init__(self, bands: Array) -> None:
        *self._lu, _ = lapack.dgttrf(bands[2, :-1], bands[1], bands[0, 1:])
        regularise(self._lu[1])

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return sign_of_pivots(self._lu[1], self._lu[4] - 1)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        solution: Array = lapack.dgttrs(*self._lu, rhs)[0]
        return solution

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n)."""
        solutions: Array = lapack.dgttrs(*self._lu, rhs.T)[0]
        return solutions.T

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        solution: Array = lapack.dgttrs(*self._lu, rhs, trans="T")[0]
        return solution


@final
class BandCore(Core):
    """LU with partial pivoting of a banded matrix by LAPACK."""

    def __init__(self, bands: Array, lower: int, upper: int) -> None:
        self._widths = lower, upper
        room = np.zeros((2 * lower + upper + 1, bands.shape[1]), order="F")  # for fill-in
        room[lower:] = bands
        self._lu, self._pivots, _ = lapack.dgbtrf(room, lower, upper, overwrite_ab=True)
        regularise(self._lu[lower + upper])

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return sign_of_pivots(self._lu[sum(self._widths)], self._pivots)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        solution: Array = lapack.dgbtrs(self._lu, *self._widths, rhs, self._pivots)[0]
        return solution

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n)."""
        solutions: Array = lapack.dgbtrs(self._lu, *self._widths, rhs.T, self._pivots)[0]
        return solutions.T

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        solution: Array = lapack.dgbtrs(self._lu, *self._widths, rhs, self._pivots, trans=1)[0]
        return solution


def factorised(matrix: Array, overwrite: bool = False) -> tuple[Array, Indices]:
    """Return an LU with partial pivoting; pivots that vanish to rounding are moved off zero."""
    lu, pivots, _ = lapack.dgetrf(matrix, overwrite_a=overwrite)
    regularise(lu.ravel(order="K")[:: len(lu) + 1])
    return lu, pivots


def solved(lu: Array, pivots: Indices, rhs: Array, transposed: bool = False) -> Array:
    """Return the solution for one right-hand side, shape (n,), or several, shape (l, n)."""
    solution: Array = lapack.dgetrs(lu, pivots, rhs.T, int(transposed))[0]
    return solution.T


@final
class DenseCore(Core):
    """LU with partial pivoting by LAPACK, as :func:`factorised` returns it."""

    def __init__(self, lu: Array, pivots: Indices) -> None:
        self._lu, self._pivots = lu, pivots

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return sign_of_pivots(self._lu.diagonal(), self._pivots)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        return solved(self._lu, self._pivots, rhs)

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n)."""
        return solved(self._lu, self._pivots, rhs)

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        return solved(self._lu, self._pivots, rhs, transposed=True)


def regularise(pivots: Array) -> None:
    """Move pivots off zero by a rounding error."""
    sizes = np.abs(pivots)
    if sizes.min() < EPS:
        tiny = sizes < EPS
        pivots[tiny] = np.copysign(EPS, pivots[tiny])


def sign_of_pivots(pivots: Array, exchanges: Indices) -> int:
    """Return the sign of the determinant."""
    if len(pivots) > FEW_PIVOTS:
        negative = np.count_nonzero(pivots < 0.0)
        odd = np.count_nonzero(exchanges != np.arange(len(exchanges)))
        return -1 if (negative + odd) % 2 else 1
    sign = math.copysign(1.0, math.prod(pivots.tolist()))  # right where it underflows, too
    odd = sum(map(ne, exchanges.tolist(), range(len(exchanges))))
    return -1 if (odd + (sign < 0.0)) % 2 else 1


@final
class SparseCore(Core):
    """LU by SuperLU.

    Parameters
    ----------
    lu : scipy.sparse.linalg.SuperLU
    """

    def __init__(self, lu: Any) -> None:
        self._lu = lu

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return sign_of_superlu(self._lu)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        solution: Array = self._lu.solve(rhs)
        return solution

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n)."""
        solutions: Array = self._lu.solve(np.asfortranarray(rhs.T))
        return solutions.T

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        solution: Array = self._lu.solve(rhs, trans="T")
        return solution


@final
class ScaledCore(Core):
    """Solves with the matrix of which a core has the rows divided and the columns multiplied.

    Parameters
    ----------
    core : Core
    rows, columns : ndarray, shape (n,)
        The divisors of the rows and the factors of the columns, powers of two.
    """

    def __init__(self, core: Core, rows: Array, columns: Array) -> None:
        self._core, self._rows, self._columns = core, rows, columns

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return self._core.sign

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        return self._columns * self._core.solve(rhs / self._rows)

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n)."""
        return self._columns * self._core.solve_all(rhs / self._rows)

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        return self._core.solve_transposed(self._columns * rhs) / self._rows


def superlu(matrix: Any) -> Any | None:
    """Factorise a sparse square matrix; None where a pivot vanishes exactly."""
    from scipy.sparse.linalg import splu  # noqa: PLC0415  only for sparse systems

    try:
        return splu(matrix)
    except RuntimeError:  # SuperLU's word for an exactly zero pivot
        return None


def sign_of_superlu(lu: Any) -> int:
    """Return the sign of the determinant of a matrix factorised by SuperLU."""
    negative = np.count_nonzero(lu.U.diagonal() < 0.0)
    odd = _is_odd(lu.perm_r[lu.perm_c].tolist())  # one product has the parity of both
    return -1 if (negative + odd) % 2 else 1


def _is_odd(permutation: list[int]) -> int:
    """Return 1 for an odd permutation, by counting its cycles."""
    seen = [False] * len(permutation)
    cycles = 0
    for start in range(len(permutation)):
        if not seen[start]:
            cycles += 1
            j = start
            while not seen[j]:
                seen[j] = True
                j = permutation[j]
    return (len(permutation) - cycles) % 2
