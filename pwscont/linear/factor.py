"""The seam of the factorisations of square matrices."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from pwscont.basics.arrays import Array


class Factor(ABC):
    """An LU factorisation of a square matrix.

    Attributes
    ----------
    failed : bool
        Whether a pivot vanished exactly, so that nothing can be solved.
    """

    failed: bool

    @property
    @abstractmethod
    def sign(self) -> int:
        """Sign of the determinant; 0 where a pivot vanishes exactly."""

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side, shape (k,)."""

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, k); default one by one."""
        return np.stack([self.solve(f) for f in rhs])

    @abstractmethod
    def is_singular(self) -> bool:
        """Tell whether the matrix is singular to rounding."""


def power_of_two(values: Array) -> Array:
    """Return for each value a power of two that is at most twice as large; one for zero."""
    return np.ldexp(1.0, np.frexp(values)[1])
