"""Singular cells of an affine family: infinitely many solutions over one point of the plane.

The points (z, s, t) of such a cell are a polyhedron, whose shadow on the square is a point, a
segment or a polygon. It is found by linear programs: the farthest points in four directions, and
then beyond every edge of what is known, until nothing is farther.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.face import satisfies
from pwscont.enumeration.options import Option, Problem
from pwscont.enumeration.polyhedron import Polyhedron

#: With less accurate inequalities than this the map is not certain.
COARSE = EPS**0.5
#: A point counts as farther if it is by this part of the square: linear programs know no more.
FARTHER = 1e-9


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
    blur : float
        Estimate of how far rounding moves the shadow.
    is_certain : bool
        Whether the cell is singular, and not only so close to it that rounding does not tell.
    """

    character: Character
    shadow: Array
    is_unbounded: bool
    blur: float
    is_certain: bool


def strip_of(problem: Problem, typical: Array, one: Choices) -> Strip | None:
    """Return the shadow of a singular cell, if it has infinitely many solutions over a point.

    Parameters
    ----------
    problem : Problem
        With unknowns (z, s, t), and the sides of the square as its last inequalities.
    typical : ndarray, shape (2,)
        Magnitudes of s and t by which its unknowns are scaled.
    one : Choices
        The cell.
    """
    picks, chosen = one.picks[:, 0], problem.chosen(one.picks[:, 0])
    above = _Above.of(problem, typical, one)
    off = float(one.rounding[0])
    around = above.polyhedron(chosen, GUARD * off)
    if around is None or not satisfies(chosen, above.start, GUARD * float(one.growth[0])):
        return None
    if GUARD * off > COARSE:
        return Strip(problem.character(picks), np.zeros((1, 2)), False, 1.0, False)
    inside = around.inside(GUARD * off)
    if inside is None or not _is_infinite(above.onto @ inside[1], typical):
        return None
    shadow = _Shadow(around.moved(inside[0]), above.onto)
    hull = shadow.hull() + above.onto @ inside[0] + above.origin
    blur, is_unbounded = 4.0 * off * float(typical.max()), shadow.has_no_bound()
    return Strip(problem.character(picks), hull, is_unbounded, blur, above.is_certain)


def _is_infinite(onto: Array, typical: Array) -> bool:
    """Tell whether several of the points inside a cell lie over one point of the square."""
    rank = np.linalg.matrix_rank(onto / typical[:, np.newaxis], tol=GUARD * EPS)
    return bool(onto.shape[1] > rank)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Above:
    """The points start + directions @ w of a cell, which lie over origin + onto @ w.

    Directions that stay over one point do so exactly, whatever rounding says: solutions may be as
    far along them as one likes.
    """

    problem: Problem
    typical: Array
    start: Array
    directions: Array
    onto: Array
    is_certain: bool

    @classmethod
    def of(cls, problem: Problem, typical: Array, one: Choices) -> _Above:
        start, directions = one.starts[0], one.directions[0]
        U, sigma, Vt = np.linalg.svd(
            problem.basis[-2:] / typical[:, np.newaxis] @ directions, full_matrices=True
        )
        rank = int((sigma > GUARD * EPS * float(one.growth[0])).sum())
        onto = np.zeros((2, directions.shape[1]))
        onto[:, :rank] = typical[:, np.newaxis] * U[:, :rank] * sigma[:rank]
        is_certain = bool((sigma[rank:] <= GUARD * EPS).all())
        return cls(problem, typical, start, directions @ Vt.T, onto, is_certain)

    @property
    def origin(self) -> Array:
        """The point of the square under the start."""
        point: Array = self.problem.basis[-2:] @ self.start + self.problem.origin[-2:]
        return point

    def polyhedron(self, chosen: Sequence[Option], rounding: float) -> Polyhedron | None:
        """Return the inequalities of the cell and of the square; None if they contradict."""
        G = np.vstack([*(option.G for option in chosen), self.problem.A[:-4]])
        g = np.concatenate([*(option.g for option in chosen), self.problem.b[:-4]])
        square = np.vstack([self.onto, -self.onto]) / np.tile(self.typical, 2)[:, np.newaxis]
        sides = (1.0 + np.append(self.origin, -self.origin)) / np.tile(self.typical, 2)
        matrix = np.vstack([G @ self.directions, square])
        return Polyhedron.of(matrix, np.append(G @ self.start + g, sides), rounding)


@final
class _Shadow:
    """The shadow of a polyhedron under w -> onto w; w = 0 lies inside."""

    def __init__(self, polyhedron: Polyhedron, onto: Array) -> None:
        self._polyhedron, self._onto = polyhedron, onto

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
        ways = np.eye(self._onto.shape[1])
        return any(self._polyhedron.is_unbounded(way) for way in (*ways, *-ways))

    def _beyond(self, a: Array, b: Array) -> Iterator[Array]:
        """Yield the corners between two neighbouring ones, on the outer side."""
        way = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
        point = self._farthest(way)
        if way @ (point - a) > FARTHER and not _same(point, a) and not _same(point, b):
            yield from self._beyond(a, point)
            yield point
            yield from self._beyond(point, b)

    def _farthest(self, way: Array) -> Array:
        found = self._polyhedron.farthest(way @ self._onto)
        if found is None:
            raise InvalidSystemError(
                "a cell in which H is singular has solutions or none by rounding only, so that the "
                "map is not known; choose a larger window, or other units"
            )
        point: Array = self._onto @ found
        return point


def _same(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= FARTHER)


def _apart(points: list[Array]) -> list[Array]:
    """Return points without those that repeat one before."""
    kept: list[Array] = []
    for point in points:
        if not any(_same(point, other) for other in kept):
            kept.append(point)
    return kept
