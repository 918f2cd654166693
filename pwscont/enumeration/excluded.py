"""Cells that hold no solution for certain, told in floating point before exact arithmetic begins.

Failure modes and answers
-------------------------
- A nearly singular cell, whose solution floating point does not know: it is left to exact
  arithmetic, as is one whose solution may be within rounding of an interface.
- Many cells: they are looked at in batches, so that memory is bounded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.budget import check_budget
from pwscont.basics.rounding import EPS

#: Cells that are looked at together.
BATCH = 4**6
#: Solutions are known to half of their digits where unit rows have no larger condition.
WORST = EPS**-0.5
#: A solution of such a cell is outside if a test is negative by more than this part of its terms:
#: far above the error of the solution.
OUTSIDE = 1e-5


@final
@dataclass(frozen=True, slots=True, eq=False)
class CellsInDoubles:
    """Equations of cells and their tests, by the unknowns that blocks decide, in doubles.

    Attributes
    ----------
    options : list of ndarray, shapes (modes, k, d + 1)
        The equations of each mode of each block, rows of unit size with the constant last.
    sides : list of ndarray, shapes (modes, m)
        +1 or -1 where a test bounds a mode, 0 where it does not.
    tests : ndarray, shape (m, d + 1)
    z : ndarray, shape (n, d + 1)
        All unknowns as functions of those that blocks decide.
    whole : ndarray, shape (m, n + 1)
        The tests by all unknowns.
    scale : ndarray, shape (n,)
    growth : float
        By how much rounding of the other equations grows in these.
    """

    options: Sequence[Array]
    sides: Sequence[Array]
    tests: Array
    z: Array
    whole: Array
    scale: Array
    growth: float

    def left(self) -> Indices:
        """Return the choices of modes, shape (N, blocks), that may hold a solution or nearly."""
        numbers = [len(options) for options in self.options]
        found = [self._left_of(picks) for picks in _batches(numbers)]
        return np.concatenate(found)

    def _left_of(self, picks: Indices) -> Indices:
        parts = [options[k] for options, k in zip(self.options, picks.T, strict=True)]
        rows = np.concatenate([np.zeros((len(picks), 0, len(self.tests.T))), *parts], axis=1)
        known = np.linalg.slogdet(rows[..., :-1])[0] != 0.0
        excluded = np.zeros(len(picks), dtype=bool)
        if known.any():
            excluded[known] = self._excluded(picks[known], rows[known])
        return picks[~excluded]

    def _excluded(self, picks: Indices, rows: Array) -> Signs:
        """Tell which regular choices have their solution outside."""
        inverse = np.linalg.inv(rows[..., :-1])
        condition = self.growth * np.abs(inverse).sum(axis=2).max(axis=1, initial=1.0)
        y = np.ones((len(picks), len(self.tests.T)))
        y[:, :-1] = -(inverse @ rows[..., -1:])[..., 0]
        sizes = np.abs(y)
        reach = EPS * condition * sizes.max(axis=1)
        off = np.outer(reach, np.abs(self.tests).sum(axis=1))
        typical = np.abs(y @ self.z.T) + self.scale
        terms = typical @ np.abs(self.whole[:, :-1]).T + np.abs(self.whole[:, -1])
        side = sum(sides[k] for sides, k in zip(self.sides, picks.T, strict=True))
        outside = side * (y @ self.tests.T) < -(OUTSIDE * terms + off)
        excluded: Signs = outside.any(axis=1) & (condition <= WORST)
        return excluded


def _batches(numbers: Sequence[int]) -> Iterator[Indices]:
    """Yield all choices of one number below each of some numbers, in batches."""
    for first in range(0, prod(numbers), BATCH):
        check_budget()
        which = np.arange(first, min(first + BATCH, prod(numbers)))
        yield np.array(np.unravel_index(which, numbers)).T if numbers else np.zeros((1, 0), np.intp)
