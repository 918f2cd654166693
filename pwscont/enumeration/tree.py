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
- Equations that depend on those decided before: found by the factorisation of each block's own
  equations on the subspace left to them, whose basis is orthonormal; such a choice leaves the
  batch. A cell without a unique point is handed on as a subspace, not solved.
- Blocks with one option, of which there may be many: they come first, so that what follows
  from them is worked out once and the batches have only the few unknowns left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import final

import numpy as np
import numpy.typing as npt
from scipy.optimize import Bounds, LinearConstraint, milp

from pwscont.enumeration.options import Option, Problem
from pwscont.foundation.arrays import Array, Indices
from pwscont.foundation.rounding import EPS

#: Relative slack of everything that only cuts off: HiGHS itself works to 1e-7.
SLACK = 1e-5
#: Choices decided in one batch: a larger one gains little, cuts off less and costs memory.
BATCH = 4**7


@final
@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """A complete choice and the points that satisfy its equations: start + directions @ s.

    Attributes
    ----------
    chosen : tuple of Option
    start : ndarray, shape (d,)
    directions : ndarray, shape (d, q)
        q is 0 but in singular cells.
    """

    chosen: tuple[Option, ...]
    start: Array
    directions: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Subspace:
    """The points that satisfy the equations decided so far: start + directions @ s."""

    start: Array
    directions: Array


def leaves(problem: Problem) -> Iterator[Leaf]:
    """Yield every choice whose equations have a solution that nearly satisfies its inequalities."""
    d = problem.dimension
    yield from _descend(problem, (), _Subspace(np.zeros(d), np.eye(d)))


def _descend(problem: Problem, chosen: tuple[Option, ...], space: _Subspace) -> Iterator[Leaf]:
    rest = problem.blocks[len(chosen) :]
    if prod(map(len, rest)) <= BATCH:
        yield from _together(problem, chosen, space, rest)
        return
    for option in rest[0]:
        narrower = _impose(space, option)
        if narrower is not None and _feasible(problem, (*chosen, option), narrower):
            yield from _descend(problem, (*chosen, option), narrower)


def _impose(space: _Subspace, option: Option) -> _Subspace | None:
    """Return the part of a subspace in which E y + e = 0, None where there is none."""
    matrix, rest = option.E @ space.directions, option.E @ space.start + option.e
    U, sigma, Vt = np.linalg.svd(matrix)
    rank = int((sigma > _negligible(matrix)).sum())
    coefficients = U.T @ rest
    size = 1.0 + np.abs(space.start).max(initial=0.0)
    if (np.abs(coefficients[rank:]) > SLACK * size).any():
        return None
    step = Vt[:rank].T @ (coefficients[:rank] / sigma[:rank])
    return _Subspace(space.start - space.directions @ step, space.directions @ Vt[rank:].T)


def _negligible(matrix: Array) -> float:
    """Return the rounding of unit rows in an orthonormal basis, shape (..., k, q)."""
    return 8.0 * EPS * float(max(matrix.shape[-2:]))


def _feasible(problem: Problem, chosen: tuple[Option, ...], space: _Subspace) -> bool:
    """Tell whether some point satisfies all inequalities known so far, relaxed by SLACK."""
    G, g = _known(problem, chosen)
    size = 1.0 + np.abs(space.start).max(initial=0.0)
    least = -(G @ space.start + g) - SLACK * size
    # milp without integers is SciPy's shortest way to HiGHS, half the time of linprog
    result = milp(
        np.zeros(space.directions.shape[1]),
        constraints=LinearConstraint(G @ space.directions, least, np.inf),
        bounds=Bounds(-np.inf, np.inf),
    )
    return bool(result.status != 2)  # 2: proved infeasible


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Fan:
    """Many choices for the same blocks, and the points that satisfy the equations of each.

    Attributes
    ----------
    picks : ndarray of int, shape (m, N)
        Which option every choice takes in each of the m blocks decided.
    starts, directions : ndarray, shapes (N, d) and (N, d, q)
        As in a subspace, for every choice.
    """

    picks: Indices
    starts: Array
    directions: Array


def _together(
    problem: Problem,
    chosen: tuple[Option, ...],
    space: _Subspace,
    rest: Sequence[Sequence[Option]],
) -> Iterator[Leaf]:
    """Decide all remaining blocks, one after the other, for all their choices at once."""
    nothing = np.zeros((0, 1), dtype=np.intp)
    fan = _Fan(nothing, space.start[np.newaxis], space.directions[np.newaxis])
    for depth, options in enumerate(rest):
        fan, dependent = _spread(fan, options)
        for picks, parent in dependent:
            narrower = _impose(parent, options[picks[-1]])
            if narrower is not None:
                more = (*chosen, *_taken(rest, picks))
                yield from _together(problem, more, narrower, rest[depth + 1 :])
    for index in _inside(problem, chosen, rest, fan):
        taken = _taken(rest, fan.picks[:, index])
        yield Leaf((*chosen, *taken), fan.starts[index], fan.directions[index])


def _spread(
    fan: _Fan, options: Sequence[Option]
) -> tuple[_Fan, Iterator[tuple[Indices, _Subspace]]]:
    """Impose every option of one more block on every choice.

    Returns the choices whose new equations are independent of the old ones, and the others as
    their picks with the subspace before the last of them.
    """
    matrices, values = _equations(fan, options)
    k = values.shape[-1]
    Q, R = np.linalg.qr(np.swapaxes(matrices, -1, -2), mode="complete")
    R = np.swapaxes(R[..., :k, :], -1, -2)
    pivots = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    regular = (pivots > _negligible(matrices)).all(axis=-1)
    parents, taken = np.nonzero(regular)
    Q, directions = Q[regular], fan.directions[parents]
    steps = Q[..., :k] @ np.linalg.solve(R[regular], values[regular][..., np.newaxis])
    starts = fan.starts[parents] - (directions @ steps)[..., 0]
    picks = np.vstack([fan.picks[:, parents], taken])
    return _Fan(picks, starts, directions @ Q[..., k:]), _dependent(fan, regular)


def _equations(fan: _Fan, options: Sequence[Option]) -> tuple[Array, Array]:
    """Return E @ directions, (N, options, k, q), and E @ start + e, (N, options, k)."""
    E, e = np.stack([option.E for option in options]), np.stack([option.e for option in options])
    values = np.tensordot(fan.starts, E, (1, 2)) + e
    return E @ fan.directions[:, np.newaxis], values


def _dependent(fan: _Fan, regular: npt.NDArray[np.bool_]) -> Iterator[tuple[Indices, _Subspace]]:
    for parent, option in np.argwhere(~regular):
        picks = np.append(fan.picks[:, parent], option)
        yield picks, _Subspace(fan.starts[parent], fan.directions[parent])


def _taken(rest: Sequence[Sequence[Option]], picks: Indices) -> list[Option]:
    """Return the options that one choice takes in the first blocks."""
    return [options[pick] for options, pick in zip(rest, picks, strict=False)]


def _inside(
    problem: Problem, chosen: tuple[Option, ...], rest: Sequence[Sequence[Option]], fan: _Fan
) -> Indices:
    """Return the choices whose point satisfies all inequalities, relaxed by SLACK.

    All of them where a choice leaves more than a point. The blocks decided last come first:
    they leave few choices to the others.
    """
    inside: npt.NDArray[np.bool_] = np.ones(len(fan.starts), dtype=bool)
    if fan.directions.shape[-1]:
        return np.flatnonzero(inside)
    slack = SLACK * (1.0 + np.abs(fan.starts).max(axis=1, initial=0.0))
    for options, pick in zip(rest[::-1], fan.picks[::-1], strict=True):
        for k, option in enumerate(options):
            mine = np.flatnonzero(inside & (pick == k))
            values = fan.starts[mine] @ option.G.T + option.g
            inside[mine] = (values >= -slack[mine, np.newaxis]).all(axis=1)
    G, g = _known(problem, chosen)
    left = np.flatnonzero(inside)
    values = fan.starts[left] @ G.T + g
    inside[left] = (values >= -slack[left, np.newaxis]).all(axis=1)
    return np.flatnonzero(inside)


def _known(problem: Problem, chosen: tuple[Option, ...]) -> tuple[Array, Array]:
    """Return the inequalities G y + g >= 0 of the options chosen and of all solutions."""
    G = np.vstack([problem.A, *(option.G for option in chosen)])
    return G, np.concatenate([problem.b, *(option.g for option in chosen)])
