"""The regular and singular cells of an affine family.

The points (z, s, t) of a singular cell are a polyhedron, whose shadow on the square is a point, a
segment or a polygon. Linear programs find the shadow: the farthest points in four directions, and
then the farthest points beyond every known edge, until no point is farther.

In a regular cell z and the tests that bound the cell are affine functions of the point (s, t) of
the square: the solutions lie over a convex polygon. A singular cell has infinitely many solutions
over each point of a segment or polygon.

Failure modes and answers
-------------------------
- A test does not depend on (s, t) in a cell, for example a test that is zero all over the cell: the
  gradient is rounding, and gives no side. The test holds all over the cell, or nowhere.
- Lines of a nearly singular cell have larger errors: the field ``blur`` has the error, and lines
  closer than the largest blur count as one line.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np

from pwscont import Character, InvalidSystemError
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.options import Option, Problem
from pwscont.enumeration.polyhedron import Polyhedron, satisfies
from pwscont.enumeration.slices import det_sign
from pwscont.enumeration.tree import Prices, leaves
from pwscont.extending import EPS, GUARD, Array, Indices, Metric, Signs, check_budget
from pwscont.two_parameters.affine import AffineFamily
from pwscont.two_parameters.half_planes import clipped

#: Largest error of inequalities, as a part of the square, with which the map is certain: half of
#: the digits.
COARSE = EPS**0.5
#: Least distance, in units of the square, by which a point counts as farther: the accuracy of the
#: linear programs.
FARTHER = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """A singular cell with infinitely many solutions over some points.

    Attributes
    ----------
    character : Character
    shadow : ndarray, shape (k, 2)
        The part of the square over which there are infinitely many solutions: a point, the ends of
        a segment, or the corners of a polygon, counter-clockwise.
    is_unbounded : bool
        Whether solutions over a point are unbounded.
    blur : float
        Estimate of the distance by which rounding moves the shadow.
    is_certain : bool
        Whether the cell is singular, not only singular within rounding.
    """

    character: Character
    shadow: Array
    is_unbounded: bool
    blur: float
    is_certain: bool


def strip_of(problem: Problem, typical: Array, one: Choices) -> Strip | None:
    """Return the strip of a singular cell, None without infinitely many solutions over a point.

    Parameters
    ----------
    problem : Problem
        The problem in the unknowns (z, s, t), with the sides of the square as last inequalities.
    typical : ndarray, shape (2,)
        Magnitudes of s and t by which the unknowns of the problem are scaled.
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
    """Tell whether several points of a cell lie over a single point of the square."""
    rank = np.linalg.matrix_rank(onto / typical[:, np.newaxis], tol=GUARD * EPS)
    return bool(onto.shape[1] > rank)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Above:
    """The points start + directions @ w of a cell, which lie over the points origin + onto @ w.

    Columns of ``onto`` that are zero within rounding are exactly zero: along such directions
    solutions may be unbounded, and rounding would grow.
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
        """Return the inequalities of cell and square; None if no point satisfies all."""
        G = np.vstack([*(option.G for option in chosen), self.problem.A[:-4]])
        g = np.concatenate([*(option.g for option in chosen), self.problem.b[:-4]])
        square = np.vstack([self.onto, -self.onto]) / np.tile(self.typical, 2)[:, np.newaxis]
        sides = (1.0 + np.append(self.origin, -self.origin)) / np.tile(self.typical, 2)
        matrix = np.vstack([G @ self.directions, square])
        return Polyhedron.of(matrix, np.append(G @ self.start + g, sides), rounding)


@final
class _Shadow:
    """The shadow of a polyhedron under w -> onto w; w = 0 is a point of the polyhedron."""

    def __init__(self, polyhedron: Polyhedron, onto: Array) -> None:
        self._polyhedron, self._onto = polyhedron, onto

    def hull(self) -> Array:
        """Return the corners of the shadow, counter-clockwise."""
        ways = np.array([[-1.0, -0.3], [0.3, -1.0], [1.0, 0.3], [-0.3, 1.0]])
        first = _apart([self._farthest(way) for way in ways])
        if len(first) == 1:
            return np.array(first)
        ring = [*first, first[0]]
        corners = [x for a, b in pairwise(ring) for x in (a, *self._beyond(a, b))]
        return np.array(_apart(corners))

    def has_no_bound(self) -> bool:
        """Tell whether the polyhedron is unbounded: over a point, for the shadow is bounded."""
        ways = np.eye(self._onto.shape[1])
        return any(self._polyhedron.is_unbounded(way) for way in (*ways, *-ways))

    def _beyond(self, a: Array, b: Array) -> Iterator[Array]:
        """Yield the corners between a and b, neighbours so far, beyond the edge from a to b."""
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
    """Return points without repetitions of earlier points."""
    kept: list[Array] = []
    for point in points:
        if not any(_same(point, other) for other in kept):
            kept.append(point)
    return kept


#: Prices of linear programs against batches: a cell that a batch leaves over has a polygon cut,
#: which takes longer than computing a point.
PRICES = Prices(1024, 1)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """A regular cell whose solutions lie over a polygon.

    Attributes
    ----------
    character : Character
    label : str
    det_sign : int
        Sign of det(dH/dz).
    z : ndarray, shape (n, 3)
        z = z[:, 0] s + z[:, 1] t + z[:, 2].
    sides : ndarray, shape (k, 3)
        (a, b, c) with a s + b t + c >= 0 in the cell, and a^2 + b^2 = 1.
    tests : ndarray of int, shape (k,)
        The test function that vanishes on each side.
    polygon : ndarray, shape (v, 2)
        The part of the square over which the cell has a solution, counter-clockwise; a little wider
        if that part is a point or a segment.
    blur : float
        Estimate of the distance by which rounding moves the sides.
    rounding : float
        Estimate of the rounding error of z, as a part of the typical magnitudes of z.
    """

    character: Character
    label: str
    det_sign: int
    z: Array
    sides: Array
    tests: Indices
    polygon: Array
    blur: float
    rounding: float

    def at(self, point: Array) -> Array:
        """Return z at a point of the square, shape (n,)."""
        z: Array = self.z @ np.append(point, 1.0)
        return z

    def margin(self, point: Array) -> float:
        """Return the distance of a point from the nearest side, negative outside."""
        return float((self.sides @ np.append(point, 1.0)).min(initial=np.inf))

    def test_at(self, point: Array) -> int:
        """Return the test function of the side next to a point."""
        return int(self.tests[np.abs(self.sides @ np.append(point, 1.0)).argmin()])


def cells_of(family: AffineFamily) -> tuple[list[Cell], list[Strip]]:
    """Return the regular cells with solutions over a polygon, and the strips of singular cells."""
    cells: list[Cell] = []
    strips: list[Strip] = []
    if family.problem is None:
        return cells, strips
    metric = Metric.of(family.system, family.window.alphas)
    for choices in leaves(family.problem, PRICES):
        check_budget()
        is_regular, inverses = _inverses(family, choices)
        for i in np.flatnonzero(~is_regular):
            strip = strip_of(family.problem, family.typical, choices[i : i + 1])
            strips += [] if strip is None else [strip]
        regular = np.flatnonzero(is_regular)
        if not len(regular):
            continue
        cells += _cells(family, metric, choices[regular], inverses[regular])
    return cells, strips


def _inverses(family: AffineFamily, choices: Choices) -> tuple[Signs, Array]:
    """Return which choices are regular, and the inverses of d(s, t) / d(free directions).

    A choice is regular if the point (s, t) determines the solution. The inverses have shape (N, 2,
    2).
    """
    problem, number, free = family.problem, len(choices), choices.directions.shape[-1]
    if problem is None or free != 2:
        return np.zeros(number, dtype=bool), np.zeros((number, 2, 2))
    maps = problem.basis[-2:] @ choices.directions
    smallest = np.linalg.svd(maps / family.typical[:, np.newaxis], compute_uv=False)[:, -1]
    is_regular: Signs = smallest > GUARD * EPS * choices.growth
    maps[~is_regular] = np.eye(2)
    return is_regular, np.asarray(np.linalg.inv(maps), dtype=float)


def _cells(
    family: AffineFamily, metric: Metric, choices: Choices, inverses: Array
) -> Iterator[Cell]:
    """Yield the cells of regular choices that have solutions over a polygon."""
    problem = family.problem
    assert problem is not None
    points = _over_the_square(problem, choices, inverses)
    sides, tests = _sides(problem, choices, points)
    rounding = choices.rounding * np.linalg.norm(inverses * family.typical, axis=(1, 2))
    for i in np.flatnonzero(_may_hold(sides, rounding)):
        lengths = np.hypot(*sides[i, :, :2].T)
        moves = lengths > GUARD * rounding[i]
        own = sides[i, moves] / lengths[moves, np.newaxis]
        off = 4.0 * float(rounding[i])
        polygon = _polygon(own, 0.5 * off / lengths[moves])
        if len(polygon) > 2:
            character = problem.character(choices.picks[:, i])
            z = (problem.basis @ points[i])[:-2]
            z[:, 2] += problem.origin[:-2]
            sign = _det_sign(family, metric, character, z, polygon)
            label, blur = family.system.label(character), off / lengths[moves].min(initial=np.inf)
            yield Cell(character, label, sign, z, own, tests[i, moves], polygon, float(blur), off)


def _polygon(sides: Array, blur: Array) -> Array:
    """Return the part of the square within sides; a point or segment is widened by the blur."""
    polygon = clipped(sides)
    return polygon if len(polygon) > 2 else clipped(sides + np.outer(blur, [0.0, 0.0, 1.0]))


def _det_sign(
    family: AffineFamily, metric: Metric, character: Character, z: Array, polygon: Array
) -> int:
    """Return the sign of det(dH/dz), which is constant in a cell."""
    point = polygon.mean(axis=0)
    x = np.append(z @ np.append(point, 1.0), family.window.inside(point)[0])
    return det_sign(family.system, metric, x, character)


def _over_the_square(problem: Problem, choices: Choices, inverses: Array) -> Array:
    """Return the reduced unknowns as affine functions of (s, t, 1), shape (N, d, 3)."""
    linear = choices.directions @ inverses
    at_start = choices.starts @ problem.basis[-2:].T + problem.origin[-2:]
    constant = choices.starts - (linear @ at_start[..., np.newaxis])[..., 0]
    return np.concatenate([linear, constant[..., np.newaxis]], axis=-1)


def _sides(problem: Problem, choices: Choices, points: Array) -> tuple[Array, Indices]:
    """Return the inequalities of each choice in (s, t, 1), shape (N, k, 3), and the tests' numbers.

    A block with fewer than the most inequalities is filled up with 1 >= 0.
    """
    sides, tests = [], []
    for options, picks in zip(problem.blocks, choices.picks, strict=True):
        most = max(len(option.g) for option in options)
        own = np.zeros((len(choices), most, 3))
        own[..., 2] = 1.0
        names = np.full((len(choices), most), -1, dtype=np.intp)
        for k, option in enumerate(options):
            mine = np.flatnonzero(picks == k)
            values = option.G @ points[mine]
            values[..., 2] += option.g
            own[mine, : len(option.g)] = values
            names[mine, : len(option.g)] = option.bounding
        sides.append(own)
        tests.append(names)
    return np.concatenate(sides, axis=1), np.concatenate(tests, axis=1)


def _may_hold(sides: Array, rounding: Array) -> Signs:
    """Tell for which choices no inequality fails all over the square."""
    most = np.abs(sides[..., :2]).sum(axis=-1) + sides[..., 2]
    holds: Signs = (most >= -GUARD * rounding[:, np.newaxis]).all(axis=1)
    return holds
