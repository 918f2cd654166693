"""A string over an uneven obstacle, as a user of the framework writes it, and in a bare loop.

N nodes between fixed ends are pressed down by a load that grows with alpha. Where the string lies
on the obstacle its place is known, elsewhere the forces balance. The matrix is tridiagonal, so that
any solve costs O(N).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack, solve_banded

from pwscont import BandedJacobian, Character, PiecewiseLinearSystem

INTERVAL = (0.0, 8.0)


class String(PiecewiseLinearSystem):
    """A string over an obstacle.

    Parameters
    ----------
    size : int
        N.
    banded : bool
        Whether Jacobians are :class:`pwscont.BandedJacobian`, or sparse ones of scipy.
    """

    def __init__(self, size: int, banded: bool) -> None:
        x = np.arange(1, size + 1) / (size + 1.0)
        uneven = 0.02 * np.random.default_rng(0).random(size)
        self.size, self.banded = size, banded
        self.gap = 0.05 + 0.1 * np.sin(3.0 * np.pi * x) ** 2 + uneven
        self.weight = np.full(size, 8.0 / (size + 1.0) ** 2)
        off = -np.ones(size - 1)
        balance = sp.diags_array([off, np.ones(size), off], offsets=[-1, 0, 1])
        self.gradients = sp.hstack([balance, self.weight[:, np.newaxis]]).tocsr()

    def balance(self, u: np.ndarray, alpha: float) -> np.ndarray:
        """Return the force of the obstacle at each node."""
        return bent(u) + alpha * self.weight

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        """Return what is positive where the string touches."""
        return self.balance(z, alpha) - (z + self.gap)

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        """Return what vanishes: the distance where it touches, the force elsewhere."""
        return np.where(character.array, z + self.gap, self.balance(z, alpha))

    def jacobian(self, z: np.ndarray, alpha: float, character: Character) -> Any:
        """Return the identity's row where it touches, that of the string elsewhere."""
        free = np.where(character.array, 0.0, 1.0)
        if self.banded:
            bands = np.stack([-np.roll(free, 1), 1.0 + free, -np.roll(free, -1)])
            return BandedJacobian(bands, 1, 1, free * self.weight)
        rows = [-free[1:], 1.0 + free, -free[:-1]]
        square = sp.diags_array(rows, offsets=[-1, 0, 1])
        return sp.hstack([square, (free * self.weight)[:, np.newaxis]]).tocsc()

    def test_jacobian(self, z: np.ndarray, alpha: float) -> Any:
        """Return the gradients of the tests, which are constant."""
        return self.gradients

    def kink(self, before: Character, after: Character, test: int) -> np.ndarray:
        """Return by how much the row of a node that comes to rest, or leaves, changes."""
        c = np.zeros(self.size)
        c[test] = -1.0 if after.array[test] else 1.0
        return c

    def scale(self, lo: float, hi: float) -> np.ndarray:
        """Return how far the string moves."""
        return np.full(self.size, 0.1)


def bent(u: np.ndarray) -> np.ndarray:
    """Return the second differences of a string with fixed ends."""
    force = 2.0 * u
    force[:-1] -= u[1:]
    force[1:] -= u[:-1]
    return force


def solved_at_once(touching: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Solve for place and velocity, shape (N, 2), by one tridiagonal elimination of LAPACK."""
    free = np.where(touching, 0.0, -1.0)
    *_, solution, _ = lapack.dgtsv(free[1:], 1.0 - free, free[:-1], rhs)
    return solution


def solved(touching: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Solve for place and velocity, shape (N, 2), by two calls of scipy."""
    free = np.where(touching, 0.0, 1.0)
    bands = np.stack([-np.roll(free, 1), 1.0 + free, -np.roll(free, -1)])
    return np.column_stack([solve_banded((1, 1), bands, one) for one in rhs.T])


def by_hand(
    string: String, solve: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> tuple[int, np.ndarray]:
    """Follow a string from rest in a bare loop; return the number of transitions and the end."""
    (alpha, end), transitions = INTERVAL, 0
    touching, pull = np.zeros(string.size, dtype=bool), string.weight
    while True:
        places = np.where(touching, -string.gap, -alpha * pull)
        u, moving = solve(touching, np.stack([places, np.where(touching, 0.0, -pull)], 1)).T
        values = np.where(touching, string.balance(u, alpha), u + string.gap)
        slopes = np.where(touching, bent(moving) + pull, moving)
        never = np.full(string.size, np.inf)
        falls = np.divide(np.maximum(values, 0.0), -slopes, out=never, where=slopes < 0.0)
        first = int(falls.argmin())
        if alpha + falls[first] >= end:
            return transitions, u + (end - alpha) * moving
        alpha, transitions = alpha + float(falls[first]), transitions + 1
        touching[first] = not touching[first]
