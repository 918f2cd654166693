"""The search over all choices of options.

Blocks are decided one after the other. Choices that no point can satisfy are cut off by a
linear program (HiGHS, in SciPy), which relaxes the undecided blocks. Near the leaves, where
little is cut off, the last few blocks are decided for all their choices together: one batch of
small factorisations for each block, shared by all the choices of the blocks after it.

Failure modes and answers
-------------------------
- A solution on the very boundary of a cell must not be cut off: the linear programs and the
  first look at a batch are relaxed by SLACK, far above rounding; the exact decision is the
  caller's, from a refined solution.
- Ill-conditioned equations, whose solution is off by far more: the growth of rounding is carried
  along with each choice, and the slack grows with it.
- Equations that depend on those decided before: found by the factorisation of each block's own
  equations on the subspace left to them, whose basis is orthonormal; such a choice leaves the
  batch. A cell without a unique point is handed on as a subspace, not solved.
- Blocks with one option, of which there may be many: they come first, so that their equations are
  eliminated once and the batches have only the few unknowns left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, final

import numpy as np
import numpy.typing as npt
from scipy.optimize import Bounds, LinearConstraint, milp

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.budget import check_budget
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.options import Option, Problem

#: Relative slack of inequalities by which choices are cut off: HiGHS itself works to 1e-7.
SLACK = 1e-5
#: Choices decided in one batch: a larger one gains little, cuts off less and costs memory.
BATCH = 4**7


@final
@dataclass(frozen=True, slots=True, eq=False)
class Choices:
    """Choices of options for the first m blocks, with the points that satisfy their equations.

    The points of choice i are ``starts[i] + directions[i] @ s``.

    Attributes
    ----------
    picks : ndarray of int, shape (m, N)
        Which option of each block every choice takes.
    starts : ndarray, shape (N, d)
    directions : ndarray, shape (N, d, q)
        q is the same for all; 0 once all blocks are decided, except in singular cells.
    growth : ndarray, shape (N,)
        By how much rounding may have grown in the starts: the worst condition of the equations of
        a block on the subspace left to it. (The product over all blocks bounds it, but by so much
        that nothing would be cut off.)
    """

    picks: Indices
    starts: Array
    directions: Array
    growth: Array

    def __len__(self) -> int:
        """Return the number of choices."""
        return len(self.starts)

    def __getitem__(self, index: Indices | slice) -> Choices:
        """Return some of the choices."""
        parts = self.starts[index], self.directions[index], self.growth[index]
        return Choices(self.picks[:, index], *parts)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Subspace:
    """The points that satisfy the equations decided so far: start + directions @ s.

    ``growth`` is that of :class:`Choices`.
    """

    start: Array
    directions: Array
    growth: float

    @property
    def slack(self) -> float:
        """How far below zero an inequality of unit length may be computed and still hold."""
        return float(_slack(self.growth) * (1.0 + np.abs(self.start).max(initial=0.0)))


def leaves(problem: Problem) -> Iterator[Choices]:
    """Yield all complete choices with a point that nearly satisfies their inequalities.

    In singular cells the inequalities are not looked at.
    """
    d = problem.dimension
    yield from filter(len, _descend(problem, (), _Subspace(np.zeros(d), np.eye(d), problem.growth)))


def _descend(problem: Problem, chosen: tuple[int, ...], space: _Subspace) -> Iterator[Choices]:
    check_budget()
    rest = problem.blocks[len(chosen) :]
    if prod(map(len, rest)) <= BATCH:
        yield from _together(problem, chosen, space)
        return
    for pick, option in enumerate(rest[0]):
        narrower = _impose(space, option)
        if narrower is not None and _feasible(problem, (*chosen, pick), narrower):
            yield from _descend(problem, (*chosen, pick), narrower)


def _impose(space: _Subspace, option: Option) -> _Subspace | None:
    """Return the part of a subspace in which E y + e = 0, None where there is none."""
    matrix, rest = option.E @ space.directions, option.E @ space.start + option.e
    U, sigma, Vt = np.linalg.svd(matrix)
    rank = int((sigma > _negligible(matrix)).sum())
    coefficients = U.T @ rest
    if (np.abs(coefficients[rank:]) > space.slack).any():
        return None
    step = Vt[:rank].T @ (coefficients[:rank] / sigma[:rank])
    growth = max(space.growth, 1.0 / sigma[:rank].min(initial=1.0))
    start, directions = space.start - space.directions @ step, space.directions @ Vt[rank:].T
    return _Subspace(start, directions, growth)


def _slack(growth: Any) -> Any:
    """Return the relative slack of inequalities: more where rounding may have grown."""
    return SLACK + GUARD * EPS * growth


def _negligible(matrix: Array) -> float:
    """Return the size below which entries of unit rows, shape (..., k, q), are rounding."""
    return 8.0 * EPS * float(max(matrix.shape[-2:]))


def _feasible(problem: Problem, chosen: tuple[int, ...], space: _Subspace) -> bool:
    """Tell whether some point satisfies all inequalities known so far, relaxed by SLACK."""
    options = problem.chosen(chosen)
    G = np.vstack([problem.A, *(option.G for option in options)])
    g = np.concatenate([problem.b, *(option.g for option in options)])
    least = -(G @ space.start + g) - space.slack
    if not space.directions.shape[1]:
        return bool((least <= 0.0).all())
    # milp without integers is SciPy's shortest way to HiGHS, two thirds of the time of linprog
    result = milp(
        np.zeros(space.directions.shape[1]),
        constraints=LinearConstraint(G @ space.directions, least, np.inf),
        bounds=Bounds(-np.inf, np.inf),
    )
    return bool(result.status != 2)  # 2: proved infeasible


def _together(problem: Problem, chosen: tuple[int, ...], space: _Subspace) -> Iterator[Choices]:
    """Decide all remaining blocks, one after the other, for all their choices at once."""
    picks = np.array(chosen, dtype=np.intp)[:, np.newaxis]
    growth = np.array([space.growth])
    choices = Choices(picks, space.start[np.newaxis], space.directions[np.newaxis], growth)
    for options in problem.blocks[len(chosen) :]:
        check_budget()
        choices, dependent = _spread(choices, options)
        for picked, parent in dependent:
            narrower = _impose(parent, options[picked[-1]])
            if narrower is not None:
                yield from _together(problem, picked, narrower)
    yield choices if choices.directions.shape[-1] else _inside(problem, choices)


def _spread(
    choices: Choices, options: Sequence[Option]
) -> tuple[Choices, Iterator[tuple[tuple[int, ...], _Subspace]]]:
    """Impose every option of one more block on every choice.

    Returns the choices whose new equations are independent of the old ones, and the others as
    their picks with the subspace before the last of them.
    """
    matrices, values = _equations(choices, options)
    k = values.shape[-1]
    Q, R = np.linalg.qr(np.swapaxes(matrices, -1, -2), mode="complete")
    R = np.swapaxes(R[..., :k, :], -1, -2)
    pivots = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    regular = (pivots > _negligible(matrices)).all(axis=-1)
    parents, taken = np.nonzero(regular)
    Q, directions = Q[regular], choices.directions[parents]
    steps = Q[..., :k] @ np.linalg.solve(R[regular], values[regular][..., np.newaxis])
    starts = choices.starts[parents] - (directions @ steps)[..., 0]
    picks = np.vstack([choices.picks[:, parents], taken])
    worst = 1.0 / pivots[regular].min(axis=-1, initial=1.0)
    growth = np.maximum(choices.growth[parents], worst)
    spread = Choices(picks, starts, directions @ Q[..., k:], growth)
    return spread, _dependent(choices, regular)


def _equations(choices: Choices, options: Sequence[Option]) -> tuple[Array, Array]:
    """Return E @ directions, (N, options, k, q), and E @ start + e, (N, options, k)."""
    E, e = np.stack([option.E for option in options]), np.stack([option.e for option in options])
    values = np.tensordot(choices.starts, E, (1, 2)) + e
    return E @ choices.directions[:, np.newaxis], values


def _dependent(
    choices: Choices, regular: npt.NDArray[np.bool_]
) -> Iterator[tuple[tuple[int, ...], _Subspace]]:
    for parent, option in np.argwhere(~regular):
        picked = (*choices.picks[:, parent].tolist(), int(option))
        parts = choices.starts[parent], choices.directions[parent], float(choices.growth[parent])
        yield picked, _Subspace(*parts)


def _inside(problem: Problem, choices: Choices) -> Choices:
    """Return the choices whose point satisfies all inequalities, relaxed by SLACK.

    The blocks decided last come first: they leave few choices to the others.
    """
    slack = _slack(choices.growth) * (1.0 + np.abs(choices.starts).max(axis=1, initial=0.0))
    inside = np.ones(len(choices), dtype=bool)
    for options, picks in zip(problem.blocks[::-1], choices.picks[::-1], strict=True):
        for k in np.flatnonzero(np.bincount(picks[inside])):
            mine = np.flatnonzero(inside & (picks == k))
            values = choices.starts[mine] @ options[k].G.T + options[k].g
            inside[mine] = (values >= -slack[mine, np.newaxis]).all(axis=1)
    values = choices.starts[inside] @ problem.A.T + problem.b
    inside[inside] = (values >= -slack[inside, np.newaxis]).all(axis=1)
    return choices[np.flatnonzero(inside)]
