"""Choices of options, and the subspaces that the equations of options leave.

Failure modes and answers
-------------------------
- A solution on the very boundary of a cell must not be cut off: inequalities that cut off choices
  are relaxed by SLACK, far above rounding; the caller decides exactly, from a refined solution.
- Ill-conditioned equations have solutions with far larger errors: the growth of rounding is carried
  along with each choice, and the slack grows with the growth of rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.options import Option

#: Largest ratio to rounding of a pivot that may be rounding that has grown.
GROWN_ROUNDING = 256.0
#: Relative slack of inequalities by which choices are cut off.
SLACK = 1e-5


@final
@dataclass(frozen=True, slots=True, eq=False)
class Choices:
    """Choices of options for the first m blocks, with the points that satisfy the equations.

    The points of choice i are ``starts[i] + directions[i] @ s``.

    Attributes
    ----------
    picks : ndarray of int, shape (m, N)
        Which option of each block every choice takes.
    starts : ndarray, shape (N, d)
    directions : ndarray, shape (N, d, q)
        All choices have the same q: 0 once all blocks are decided, except in singular cells.
    growth : ndarray, shape (N,)
        By how much rounding may have grown in the starts: the worst condition of the equations of
        a block on the subspace left to the block. (The product over all blocks would be a bound,
        so large that nothing would be cut off.)
    """

    picks: Indices
    starts: Array
    directions: Array
    growth: Array

    def __len__(self) -> int:
        """Return the number of choices."""
        return len(self.starts)

    @property
    def rounding(self) -> Array:
        """Estimate of the rounding error of the starts, shape (N,)."""
        sizes = 1.0 + np.abs(self.starts).max(axis=1, initial=0.0)
        rounding: Array = EPS * self.growth * sizes
        return rounding

    def __getitem__(self, index: Indices | slice) -> Choices:
        """Return some of the choices."""
        parts = self.starts[index], self.directions[index], self.growth[index]
        return Choices(self.picks[:, index], *parts)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Subspace:
    """The points that satisfy the equations decided so far: start + directions @ s.

    The attribute ``growth`` has the meaning of :attr:`Choices.growth`.
    """

    start: Array
    directions: Array
    growth: float

    @classmethod
    def whole(cls, dimension: int, growth: float) -> Subspace:
        """Return the space of all points."""
        return cls(np.zeros(dimension), np.eye(dimension), growth)

    @property
    def slack(self) -> float:
        """How far below zero an inequality of unit length may be computed and still hold."""
        return float(slack_at(self.growth) * (1.0 + np.abs(self.start).max(initial=0.0)))

    def narrowed(self, option: Option, rank_added: Callable[[], int | None]) -> Subspace | None:
        """Return the part of the subspace in which E y + e = 0, None where E y + e = 0 fails.

        If rounding leaves doubt, ``rank_added`` is asked how many of the equations are independent
        of the equations decided before.
        """
        matrix, rest = option.E @ self.directions, option.E @ self.start + option.e
        U, sigma, Vt = np.linalg.svd(matrix)
        rank = int((sigma > negligible(matrix)).sum())
        if is_near(sigma[:rank], matrix) and (exactly := rank_added()) is not None:
            rank = min(rank, exactly)
        coefficients = U.T @ rest
        if (np.abs(coefficients[rank:]) > self.slack).any():
            return None
        step = Vt[:rank].T @ (coefficients[:rank] / sigma[:rank])
        growth = max(self.growth, 1.0 / sigma[:rank].min(initial=1.0))
        start, directions = self.start - self.directions @ step, self.directions @ Vt[rank:].T
        return Subspace(start, directions, growth)


def slack_at(growth: Any) -> Any:
    """Return the relative slack of inequalities: more where rounding may have grown."""
    return SLACK + GUARD * EPS * growth


def negligible(matrix: Array) -> float:
    """Return the size below which entries of unit rows, shape (..., k, q), are rounding."""
    return 8.0 * EPS * float(max(matrix.shape[-2:]))


def is_near(pivots: Array, matrix: Array) -> Any:
    """Tell whether rounding may have made the least of some pivots, shape (..., k)."""
    return pivots.min(axis=-1, initial=1.0) <= GROWN_ROUNDING * negligible(matrix)
