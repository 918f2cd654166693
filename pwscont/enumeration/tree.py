"""The search over all choices of options.

Blocks are decided one after the other. Choices that no point can satisfy are cut off by a
linear program (HiGHS, in SciPy), which relaxes the undecided blocks; the last few blocks are
decided all at once, by solving all their small linear systems in one batch.

Failure modes and answers
-------------------------
- A solution on the very boundary of a cell must not be cut off: the linear programs and the
  first look at a batch are relaxed by SLACK, far above rounding; the exact decision is the
  caller's, from a refined solution.
- A singular cell: no unique point. It is handed on as a subspace, not solved.
- Too many choices: the search stops after a given number of leaves and says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import final

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from pwscont.enumeration.options import Option, Problem
from pwscont.foundation.arrays import Array, Indices
from pwscont.foundation.rounding import EPS

#: Relative slack of everything that only cuts off: HiGHS itself works to 1e-7.
SLACK = 1e-5
#: Choices decided in one batch; larger batches gain nothing and cost memory.
BATCH = 4096


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
    if _size(rest) <= BATCH:
        yield from _batch(problem, chosen, space, rest)
        return
    for option in rest[0]:
        narrower = _impose(space, option.E, option.e)
        if narrower is not None and _feasible(problem, (*chosen, option), narrower):
            yield from _descend(problem, (*chosen, option), narrower)


def _size(blocks: Sequence[Sequence[Option]]) -> int:
    """Return the number of choices."""
    size = 1
    for options in blocks:
        size *= len(options)
    return size


def _impose(space: _Subspace, E: Array, e: Array) -> _Subspace | None:
    """Return the part of a subspace in which E y + e = 0, None where there is none."""
    matrix, rest = E @ space.directions, E @ space.start + e
    U, sigma, Vt = np.linalg.svd(matrix)
    tolerance = EPS * max(matrix.shape) * 8.0
    rank = int((sigma > tolerance).sum())
    coefficients = U.T @ rest
    size = 1.0 + np.abs(space.start).max(initial=0.0)
    if (np.abs(coefficients[rank:]) > SLACK * size).any():
        return None
    step = Vt[:rank].T @ (coefficients[:rank] / sigma[:rank])
    return _Subspace(space.start - space.directions @ step, space.directions @ Vt[rank:].T)


def _feasible(problem: Problem, chosen: tuple[Option, ...], space: _Subspace) -> bool:
    """Tell whether some point satisfies all inequalities known so far, relaxed by SLACK."""
    G = np.vstack([problem.A, *(option.G for option in chosen)])
    g = np.concatenate([problem.b, *(option.g for option in chosen)])
    values = G @ space.start + g
    size = 1.0 + np.abs(space.start).max(initial=0.0)
    result = linprog(
        np.zeros(space.directions.shape[1]),
        A_ub=-G @ space.directions,
        b_ub=values + SLACK * size,
        bounds=(None, None),
        method="highs",
    )
    return bool(result.status != 2)  # 2: proved infeasible


def _batch(
    problem: Problem,
    chosen: tuple[Option, ...],
    space: _Subspace,
    rest: Sequence[Sequence[Option]],
) -> Iterator[Leaf]:
    """Decide all remaining blocks at once."""
    choices = [(*chosen, *more) for more in product(*rest)]
    matrices, vectors = _stack(rest, "E", "e", space)
    regular = _is_regular(matrices)
    solutions = np.linalg.solve(matrices[regular], -vectors[regular][..., np.newaxis])[..., 0]
    points = space.start + solutions @ space.directions.T
    inside = _inside(problem, chosen, rest, points, regular)
    nothing = np.zeros((problem.dimension, 0))
    for index, point in zip(np.flatnonzero(regular)[inside], points[inside], strict=True):
        yield Leaf(choices[index], point, nothing)
    for index in np.flatnonzero(~regular):
        yield from _singular(choices[index], space, matrices[index], vectors[index])


def _stack(
    rest: Sequence[Sequence[Option]], matrix: str, vector: str, space: _Subspace
) -> tuple[Array, Array]:
    """Return the equations of all choices in the coordinates of a subspace.

    Shapes (number of choices, equations, dimension) and (number of choices, equations). Every
    option is reduced once and then copied to the choices that it takes part in.
    """
    rows = [len(getattr(options[0], vector)) for options in rest]
    picks = _picks(rest)
    matrices = np.empty((picks.shape[1], sum(rows), space.directions.shape[1]))
    vectors = np.empty((picks.shape[1], sum(rows)))
    ends = np.cumsum([0, *rows])
    for options, pick, first, last in zip(rest, picks, ends[:-1], ends[1:], strict=True):
        E = np.stack([getattr(o, matrix) @ space.directions for o in options])
        e = np.stack([getattr(o, matrix) @ space.start + getattr(o, vector) for o in options])
        matrices[:, first:last], vectors[:, first:last] = E[pick], e[pick]
    return matrices, vectors


def _picks(rest: Sequence[Sequence[Option]]) -> Indices:
    """Return which option of each block every choice takes, shape (blocks, choices).

    Choices in the order of itertools.product; for more blocks than an array has dimensions.
    """
    sizes = [len(options) for options in rest]
    number, picks = np.arange(prod(sizes)), np.empty((len(sizes), prod(sizes)), dtype=np.intp)
    for block in reversed(range(len(sizes))):
        number, picks[block] = np.divmod(number, sizes[block])
    return picks


def _is_regular(matrices: Array) -> npt.NDArray[np.bool_]:
    """Tell which of the matrices are square and regular to rounding."""
    count, rows, columns = matrices.shape
    if rows != columns:
        return np.zeros(count, dtype=bool)
    if rows == 0:
        return np.ones(count, dtype=bool)
    regular: npt.NDArray[np.bool_] = np.abs(np.linalg.det(matrices)) > EPS * rows
    return regular


def _inside(
    problem: Problem,
    chosen: tuple[Option, ...],
    rest: Sequence[Sequence[Option]],
    points: Array,
    regular: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    """Tell which points satisfy all inequalities, relaxed by SLACK."""
    slack = -SLACK * (1.0 + np.abs(points).max(axis=1, initial=0.0))
    inside: npt.NDArray[np.bool_] = np.ones(len(points), dtype=bool)
    inside &= (points @ problem.A.T + problem.b >= slack[:, np.newaxis]).all(axis=1)
    for option in chosen:
        inside &= (points @ option.G.T + option.g >= slack[:, np.newaxis]).all(axis=1)
    picks = _picks(rest)[:, regular]
    for options, pick in zip(rest, picks, strict=True):
        for k, option in enumerate(options):
            mine = inside & (pick == k)
            values = points[mine] @ option.G.T + option.g
            inside[mine] = (values >= slack[mine][:, np.newaxis]).all(axis=1)
    return inside


def _singular(
    chosen: tuple[Option, ...], space: _Subspace, matrix: Array, vector: Array
) -> Iterator[Leaf]:
    """Yield the leaf of a singular cell, unless its equations contradict each other."""
    local = _impose(_Subspace(np.zeros(matrix.shape[1]), np.eye(matrix.shape[1])), matrix, vector)
    if local is not None:
        start = space.start + space.directions @ local.start
        yield Leaf(chosen, start, space.directions @ local.directions)
