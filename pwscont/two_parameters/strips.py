"""Singular cells of an affine family: infinitely many solutions over one point of the plane.

The points (z, s, t) of such a cell are a polyhedron, whose shadow on the square is a point, a
segment or a polygon. It is found by linear programs: the farthest points in four directions, and
then beyond every edge of what is known, until nothing is farther.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, final

import numpy as np
from scipy.optimize import linprog

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.face import has_interior, satisfies
from pwscont.enumeration.options import Problem

#: A point counts as farther if it is by this part of the square: linear programs know no more.
FARTHER = 1e-9
#: What scipy's linprog calls a program without a largest value.
UNBOUNDED = 3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """A singular cell with infinitely many solutions over some points.

    Attributes
    ----------
    character : Character
    shadow : ndarray, shape (k, 2)
        The point, the ends of the segment or the corners of the polygon, counter-clockwise, of the
        square over which there are infinitely many solutions.
    is_unbounded : bool
        Whether solutions over one point are as large as one likes.
    """

    character: Character
    shadow: Array
    is_unbounded: bool


def strip_of(problem: Problem, one: Choices) -> Strip | None:
    """Return the shadow of a singular cell, if it has infinitely many solutions over a point."""
    start, directions, picks = one.starts[0], one.directions[0], one.picks[:, 0]
    chosen = problem.chosen(picks)
    if not satisfies(chosen, start):
        return None
    G = np.vstack([*(option.G for option in chosen), problem.A])
    g = np.concatenate([*(option.g for option in chosen), problem.b])
    matrix, vector = G @ directions, G @ start + g
    if not has_interior(matrix, vector):
        return None
    onto = problem.basis[-2:] @ directions
    origin = problem.basis[-2:] @ start + problem.origin[-2:]
    rounding = GUARD * EPS * float(one.growth[0])
    shadow = _Shadow(matrix, vector, onto, rounding)
    return Strip(problem.character(picks), shadow.hull() + origin, shadow.has_no_bound())


@final
class _Shadow:
    """The shadow of the polyhedron {w : matrix w + vector >= 0} under w -> onto w."""

    def __init__(self, matrix: Array, vector: Array, onto: Array, rounding: float) -> None:
        lengths = np.linalg.norm(matrix, axis=1)
        moving = lengths > rounding
        size = lengths[moving]
        self._matrix, self._vector = -matrix[moving] / size[:, np.newaxis], vector[moving] / size
        self._onto = onto

    def hull(self) -> Array:
        """Return its corners counter-clockwise."""
        ways = np.array([[-1.0, -0.3], [0.3, -1.0], [1.0, 0.3], [-0.3, 1.0]])
        first = _apart([self._farthest(way) for way in ways])
        if len(first) == 1:
            return np.array(first)
        ring = [*first, first[0]]
        corners = [x for a, b in pairwise(ring) for x in (a, *self._beyond(a, b))]
        return np.array(_apart(corners))

    def has_no_bound(self) -> bool:
        """Tell whether the polyhedron goes on for ever: the shadow does not, so over one point."""
        ways = np.eye(self._matrix.shape[1])
        return any(
            self._program(sign * way).status == UNBOUNDED for way in ways for sign in (1, -1)
        )

    def _beyond(self, a: Array, b: Array) -> Iterator[Array]:
        """Yield the corners between two neighbouring ones, on the outer side."""
        way = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
        point = self._farthest(way)
        if way @ (point - a) > FARTHER and not _same(point, a) and not _same(point, b):
            yield from self._beyond(a, point)
            yield point
            yield from self._beyond(point, b)

    def _farthest(self, way: Array) -> Array:
        found = self._program(way @ self._onto)
        if found.x is None:
            raise InvalidSystemError(
                "a cell in which H is singular has solutions or none by rounding only, so that the "
                f"map is not known ({found.message}); choose a larger window, or other units"
            )
        point: Array = self._onto @ found.x
        return point

    def _program(self, way: Array) -> Any:
        """Return the result of the linear program that goes as far in one way as it can."""
        free = [(None, None)] * self._matrix.shape[1]
        return linprog(-way, A_ub=self._matrix, b_ub=self._vector, bounds=free, method="highs")


def _same(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= FARTHER)


def _apart(points: list[Array]) -> list[Array]:
    """Return points without those that repeat one before."""
    kept: list[Array] = []
    for point in points:
        if not any(_same(point, other) for other in kept):
            kept.append(point)
    return kept
