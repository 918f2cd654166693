"""Small linear systems without a search: parts with a single unknown, and blocks in batches.

A part with a single unknown is solved mode by mode, by a division. In a chain of such parts
magnitudes may fall from part to part until no typical magnitude can be told; a division needs none.

Blocks are decided in batches, block after block: each block has a batch of small factorisations,
which all choices of later blocks share. Batches serve if the cells are few, and if no choice can be
cut off because a point lies in the cells of all choices.

Failure modes and answers
-------------------------
- Equations of a block depend on equations decided before: the factorisation of the block's
  equations, on the orthonormal basis of the subspace that is left, finds the dependence, and the
  choice leaves the batch. A cell without a unique point is handed on as a subspace, not solved.
- A pivot is rounding that has grown above what is negligible: exact elimination of the equations
  decides about every pivot that small.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.enumeration.by_parts import PartSlice
from pwscont.enumeration.choices import Choices, Subspace, is_near, negligible, slack_at
from pwscont.enumeration.options import Option, Problem
from pwscont.enumeration.polyhedron import Point, Slice


def solve_scalar(part: PartSlice, scale: float) -> Slice | None:
    """Return all solutions of a part with a single unknown; None if a mode leaves the unknown free.

    Parameters
    ----------
    part : PartSlice
    scale : float
        The typical magnitude of the unknown.
    """
    modes = part.blocks()[0].modes if part.blocks() else ((),)
    found: list[_Root] = []
    for character in map(Character, modes):
        tests = np.array(part.bounding_tests(character), dtype=np.intp)
        side = character.array[tests]
        known = next((root for root in found if root.lies_in(tests, side)), None)
        if known is None:
            known = _Root.of(part, character, scale)
            if known is None:
                return None
            if not known.lies_in(tests, side):
                continue
            found.append(known)
        known.cells.append(character)
        known.in_doubt |= not known.lies_in(tests, side, inside=True)
    return Slice(tuple(root.point() for root in found), ())


@final
@dataclass(slots=True, eq=False)
class _Root:
    """The solution of a mode, the values of all tests there, and the errors of the values."""

    x: float
    error: Array
    sign: int
    tests: Array
    slack: Array
    cells: list[Character] = field(default_factory=list)
    in_doubt: bool = False

    @classmethod
    def of(cls, part: PartSlice, character: Character, scale: float) -> _Root | None:
        """Solve a mode; None if the equation of the mode does not depend on the unknown."""
        slope, value, errors = part.scalar_row(character)
        if slope == 0.0:
            return None
        x = -value / slope
        error = np.append(errors / slope, EPS * abs(x))
        gradients, values, inherited = part.scalar_tests()
        off = EPS * np.abs(gradients * x) + np.abs(gradients) * float(np.hypot.reduce(error))
        slack = CONFIDENCE * (off + inherited) + EPS * scale * np.abs(gradients)
        return cls(x, error, 1 if slope > 0.0 else -1, gradients * x + values, slack)

    def lies_in(self, tests: Indices, side: Signs, inside: bool = False) -> bool:
        """Tell whether the solution lies in a closed cell, or certainly inside."""
        values = np.where(side, self.tests[tests], -self.tests[tests])
        slack = self.slack[tests]
        return bool((values > slack).all() if inside else (values >= -slack).all())

    def point(self) -> Point:
        """Return the solution with an idle parameter of zero."""
        error = np.column_stack([self.error, np.zeros(len(self.error))])
        in_doubt = self.in_doubt and len(self.cells) == 1
        return Point(np.array([self.x, 0.0]), error, tuple(self.cells), self.sign, (), in_doubt)


def together(problem: Problem, chosen: tuple[int, ...], space: Subspace) -> Iterator[Choices]:
    """Decide all remaining blocks, block after block, for all choices at once.

    Parameters
    ----------
    problem : Problem
    chosen : tuple of int
        The options of the first blocks.
    space : Subspace
        The points that satisfy the equations of the options.
    """
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
    """Impose every option of a further block on every choice.

    Returns the choices whose new equations are independent of the old equations, and for each
    dependent choice the picks with the subspace before the last pick.
    """
    matrices, values = _equations(choices, options)
    k = values.shape[-1]
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
    return spread, _dependent(choices, regular)


def _equations(choices: Choices, options: Sequence[Option]) -> tuple[Array, Array]:
    """Return E @ directions, (N, options, k, q), and E @ start + e, (N, options, k)."""
    E, e = np.stack([option.E for option in options]), np.stack([option.e for option in options])
    values = np.tensordot(choices.starts, E, (1, 2)) + e
    return E @ choices.directions[:, np.newaxis], values


def _dependent(
    choices: Choices, regular: npt.NDArray[np.bool_]
) -> Iterator[tuple[tuple[int, ...], Subspace]]:
    for parent, option in np.argwhere(~regular):
        picked = _picked(choices, parent, option)
        parts = choices.starts[parent], choices.directions[parent], float(choices.growth[parent])
        yield picked, Subspace(*parts)


def _picked(choices: Choices, parent: int, option: int) -> tuple[int, ...]:
    return (*choices.picks[:, parent].tolist(), int(option))


def _inside(problem: Problem, choices: Choices) -> Choices:
    """Return the choices whose point satisfies all inequalities, relaxed by SLACK.

    The blocks decided last are tested first, because few choices satisfy these blocks.
    """
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
