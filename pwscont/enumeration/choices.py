"""Choices of options, and what their equations leave: decisions in batches.

Blocks are decided in batches, block after block: each block has a batch of small factorisations,
which all choices of later blocks share. Equations of a block may depend on equations decided
before: the choice leaves the batch then, and a cell without a unique point is handed on with the
directions that are left. Exact elimination decides about pivots that may be rounding. Inequalities
that cut off choices are relaxed by SLACK, far above rounding, and by more where ill-conditioned
equations make rounding grow: the caller decides exactly, from a refined solution.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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

    @classmethod
    def before_all(cls, problem: Problem) -> Choices:
        """Return the only choice for no block, which leaves the whole space."""
        d, none = problem.dimension, np.zeros((0, 1), dtype=np.intp)
        return cls(none, np.zeros((1, d)), np.eye(d)[np.newaxis], np.array([problem.growth]))

    def __len__(self) -> int:
        """Return the number of choices."""
        return len(self.starts)

    @property
    def rounding(self) -> Array:
        """Estimate of the rounding error of the starts, shape (N,)."""
        return EPS * self.growth * self._sizes

    @property
    def slack(self) -> Array:
        """How far below zero an inequality of unit length may be and still hold, shape (N,)."""
        return SLACK * self._sizes + GUARD * self.rounding

    @property
    def _sizes(self) -> Array:
        return 1.0 + np.abs(self.starts).max(axis=1, initial=0.0)

    def __getitem__(self, index: Indices | slice) -> Choices:
        """Return some of the choices."""
        parts = self.starts[index], self.directions[index], self.growth[index]
        return Choices(self.picks[:, index], *parts)


def narrowed(problem: Problem, choice: Choices, pick: int) -> Choices | None:
    """Return a single choice with an option of the next block, None if its equations fail."""
    option = problem.blocks[len(choice.picks)][pick]
    picks = np.vstack([choice.picks, [[pick]]])
    start, directions, growth = choice.starts[0], choice.directions[0], float(choice.growth[0])
    matrix, rest = option.E @ directions, option.E @ start + option.e
    U, sigma, Vt = np.linalg.svd(matrix)
    rank = int((sigma > negligible(matrix)).sum())
    if is_near(sigma[:rank], matrix):
        exactly = problem.rank_added(tuple(picks[:, 0].tolist()))
        rank = rank if exactly is None else min(rank, exactly)
    coefficients = U.T @ rest
    if (np.abs(coefficients[rank:]) > choice.slack).any():
        return None
    step = Vt[:rank].T @ (coefficients[:rank] / sigma[:rank])
    growth = max(growth, 1.0 / sigma[:rank].min(initial=1.0))
    starts, free = (start - directions @ step)[np.newaxis], (directions @ Vt[rank:].T)[np.newaxis]
    return Choices(picks, starts, free, np.array([growth]))


def negligible(matrix: Array) -> float:
    """Return the size below which entries of unit rows, shape (..., k, q), are rounding."""
    return 8.0 * EPS * float(max(matrix.shape[-2:]))


def is_near(pivots: Array, matrix: Array) -> Any:
    """Tell whether rounding may have made the least of some pivots, shape (..., k)."""
    return pivots.min(axis=-1, initial=1.0) <= GROWN_ROUNDING * negligible(matrix)


def together(problem: Problem, choices: Choices) -> Iterator[Choices]:
    """Decide all blocks after the first blocks, for all choices at once."""
    for options in problem.blocks[len(choices.picks) :]:
        check_budget()
        before = choices
        choices, dependent = _spread(problem, before, options)
        for parent, pick in dependent.tolist():
            narrower = narrowed(problem, before[parent : parent + 1], pick)
            if narrower is not None:
                yield from together(problem, narrower)
    yield choices if choices.directions.shape[-1] else _inside(problem, choices)


def _spread(
    problem: Problem, choices: Choices, options: Sequence[Option]
) -> tuple[Choices, Indices]:
    """Impose every option of a further block on every choice, as far as equations are independent.

    Also return the rows (choice, option), shape (k, 2), with dependent equations.
    """
    E, e = np.stack([option.E for option in options]), np.stack([option.e for option in options])
    matrices = E @ choices.directions[:, np.newaxis]  # shape (N, options, k, q)
    values, k = np.tensordot(choices.starts, E, (1, 2)) + e, e.shape[-1]
    Q, R = np.linalg.qr(np.swapaxes(matrices, -1, -2), mode="complete")
    R = np.swapaxes(R[..., :k, :], -1, -2)
    pivots = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    regular = (pivots > negligible(matrices)).all(axis=-1)
    for parent, pick in np.argwhere(regular & is_near(pivots, matrices)).tolist():
        rank = problem.rank_added((*choices.picks[:, parent].tolist(), pick))
        regular[parent, pick] = rank in (None, k)
    parents, taken = np.nonzero(regular)
    Q, directions = Q[regular], choices.directions[parents]
    steps = Q[..., :k] @ np.linalg.solve(R[regular], values[regular][..., np.newaxis])
    starts = choices.starts[parents] - (directions @ steps)[..., 0]
    picks = np.vstack([choices.picks[:, parents], taken])
    worst = 1.0 / pivots[regular].min(axis=-1, initial=1.0)
    growth = np.maximum(choices.growth[parents], worst)
    return Choices(picks, starts, directions @ Q[..., k:], growth), np.argwhere(~regular)


def _inside(problem: Problem, choices: Choices) -> Choices:
    """Return the choices whose point satisfies all inequalities, relaxed; few satisfy the last."""
    slack = choices.slack
    inside = np.ones(len(choices), dtype=bool)
    for options, picks in zip(problem.blocks[::-1], choices.picks[::-1], strict=True):
        for k in np.flatnonzero(np.bincount(picks[inside])):
            mine = np.flatnonzero(inside & (picks == k))
            values = choices.starts[mine] @ options[k].G.T + options[k].g
            inside[mine] = (values >= -slack[mine, np.newaxis]).all(axis=1)
    values = choices.starts[inside] @ problem.A.T + problem.b
    inside[inside] = (values >= -slack[inside, np.newaxis]).all(axis=1)
    return choices[np.flatnonzero(inside)]


def inequalities_of(problem: Problem, choices: Choices) -> tuple[Array, Array, Indices]:
    """Return the inequalities sides @ w + values >= 0 of the points starts + directions @ w.

    Shapes (N, k, q), (N, k), and, for the numbers of the tests, (N, k): -1 for inequalities that
    hold in every cell, which come first, and for 1 >= 0, which fills up.
    """
    (number, d, q), every = choices.directions.shape, np.arange(len(choices))
    ways = np.swapaxes(choices.directions, 1, 2).reshape(-1, d)
    sides = [(ways @ problem.A.T).reshape(number, q, len(problem.b))]
    values = [choices.starts @ problem.A.T + problem.b]
    tests = [np.full(values[0].shape, -1)]
    for options, picks in zip(problem.blocks, choices.picks, strict=True):
        shape = len(options), max(len(option.g) for option in options)
        G, g, names = np.zeros((*shape, d)), np.ones(shape), np.full(shape, -1)
        for k, option in enumerate(options):
            t = len(option.g)
            G[k, :t], g[k, :t], names[k, :t] = option.G, option.g, option.bounding
        rows = G.reshape(-1, d).T
        sides.append((ways @ rows).reshape(number, q, *shape)[every, :, picks])
        values.append((choices.starts @ rows).reshape(number, *shape)[every, picks] + g[picks])
        tests.append(names[picks])
    return np.swapaxes(np.concatenate(sides, axis=2), 1, 2), np.hstack(values), np.hstack(tests)
