"""Choices of options, the subspaces that the equations of options leave, and decisions in batches.

Blocks are decided in batches, block after block: each block has a batch of small factorisations,
which all choices of later blocks share. Batches serve if the cells are few, and if no choice can be
cut off because a point lies in the cells of all choices.

Failure modes and answers
-------------------------
- Equations of a block depend on equations decided before: the factorisation on the orthonormal
  basis of the subspace that is left finds the dependence, and the choice leaves the batch. A cell
  without a unique point is handed on as a subspace, not solved.
- A pivot is rounding that has grown above what is negligible: exact elimination of the equations
  decides about every pivot that small.
- A solution on the very boundary of a cell must not be cut off: inequalities that cut off choices
  are relaxed by SLACK, far above rounding, and by more where ill-conditioned equations make it
  grow. The caller decides exactly, from a refined solution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.budget import check_budget
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.options import Option, Problem

#: Largest ratio to rounding of a pivot that may be rounding that has grown.
GROWN_ROUNDING = 256.0
#: Relative slack of inequalities by which choices are cut off.
SLACK = 1e-5


@final
@dataclass(frozen=True, slots=True, eq=False)
class Choices:
    """Choices of options for the first m blocks, with the points that satisfy the equations.

    The points of choice i are ``starts[i] + directions[i] @ s``.
    """

    picks: Indices  # which option of each block every choice takes, shape (m, N)
    starts: Array  # shape (N, d)
    #: All choices have the same q: 0 once all blocks are decided, except in singular cells, shape
    #: (N, d, q).
    directions: Array
    #: Shape (N,): by how much rounding may have grown in the starts: the worst condition of the
    #: equations of a block on the subspace left to the block. (The product over all blocks would be
    #: a bound, so large that nothing would be cut off.).
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


def together(problem: Problem, chosen: tuple[int, ...], space: Subspace) -> Iterator[Choices]:
    """Decide all blocks after the chosen options, which leave a space, for all choices at once."""
    picks = np.array(chosen, dtype=np.intp)[:, np.newaxis]
    growth = np.array([space.growth])
    choices = Choices(picks, space.start[np.newaxis], space.directions[np.newaxis], growth)
    for options in problem.blocks[len(chosen) :]:
        check_budget()
        choices, dependent = _spread(problem, choices, options)
        for picked, parent in dependent:
            narrower = parent.narrowed(options[picked[-1]], partial(problem.rank_added, picked))
            if narrower is not None:
                yield from together(problem, picked, narrower)
    yield choices if choices.directions.shape[-1] else _inside(problem, choices)


def _spread(
    problem: Problem, choices: Choices, options: Sequence[Option]
) -> tuple[Choices, Iterator[tuple[tuple[int, ...], Subspace]]]:
    """Impose every option of a further block on every choice, as far as equations are independent.

    Of each dependent choice return the picks with the subspace before the last pick.
    """
    E, e = np.stack([option.E for option in options]), np.stack([option.e for option in options])
    matrices = E @ choices.directions[:, np.newaxis]  # shape (N, options, k, q)
    values, k = np.tensordot(choices.starts, E, (1, 2)) + e, e.shape[-1]
    Q, R = np.linalg.qr(np.swapaxes(matrices, -1, -2), mode="complete")
    R = np.swapaxes(R[..., :k, :], -1, -2)
    pivots = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    regular = (pivots > negligible(matrices)).all(axis=-1)
    for near in np.argwhere(regular & is_near(pivots, matrices)):
        rank = problem.rank_added(_picked(choices, *near))
        regular[tuple(near)] = rank in (None, k)
    parents, taken = np.nonzero(regular)
    Q, directions = Q[regular], choices.directions[parents]
    steps = Q[..., :k] @ np.linalg.solve(R[regular], values[regular][..., np.newaxis])
    starts = choices.starts[parents] - (directions @ steps)[..., 0]
    picks = np.vstack([choices.picks[:, parents], taken])
    worst = 1.0 / pivots[regular].min(axis=-1, initial=1.0)
    growth = np.maximum(choices.growth[parents], worst)
    spread = Choices(picks, starts, directions @ Q[..., k:], growth)
    parts = choices.starts, choices.directions, choices.growth.astype(float)
    dependent = (
        (_picked(choices, i, option), Subspace(*(part[i] for part in parts)))
        for i, option in np.argwhere(~regular)
    )
    return spread, dependent


def _picked(choices: Choices, parent: int, option: int) -> tuple[int, ...]:
    return (*choices.picks[:, parent].tolist(), int(option))


def _inside(problem: Problem, choices: Choices) -> Choices:
    """Return the choices whose point satisfies all inequalities, relaxed; few satisfy the last."""
    slack = slack_at(choices.growth) * (1.0 + np.abs(choices.starts).max(axis=1, initial=0.0))
    inside = np.ones(len(choices), dtype=bool)
    for options, picks in zip(problem.blocks[::-1], choices.picks[::-1], strict=True):
        for k in np.flatnonzero(np.bincount(picks[inside])):
            mine = np.flatnonzero(inside & (picks == k))
            values = choices.starts[mine] @ options[k].G.T + options[k].g
            inside[mine] = (values >= -slack[mine, np.newaxis]).all(axis=1)
    values = choices.starts[inside] @ problem.A.T + problem.b
    inside[inside] = (values >= -slack[inside, np.newaxis]).all(axis=1)
    return choices[np.flatnonzero(inside)]
