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
- Magnitudes are far too large, and all sides of a cell are rounding: the blur is the whole square.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np

from pwscont import Character, InvalidSystemError
from pwscont.extending import (
    EPS,
    GUARD,
    AffineCells,
    Array,
    Curve,
    Failure,
    Indices,
    Metric,
    Polyhedron,
    Selection,
    Signs,
    check_budget,
    enumerate_cells,
    newton,
)
from pwscont.two_parameters.affine import AffineFamily
from pwscont.two_parameters.half_planes import clipped

#: Largest error of inequalities, as a part of the square, with which the map is certain: half of
#: the digits.
COARSE = EPS**0.5
#: Least distance, in units of the square, by which a point counts as farther: the accuracy of the
#: linear programs.
APART_IN_PLANE = 1e-9


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


def strip_of(family: AffineFamily, cells: AffineCells, i: int) -> Strip | None:
    """Return the strip of singular cell i, None without infinitely many solutions over a point."""
    off, growth = float(cells.rounding[i]), float(cells.growth[i])
    onto, turned, is_certain = _onto(family, cells.directions[i], growth)
    around = _around(family, cells, i, onto, turned)
    if around is None or not cells.is_solved(i, GUARD * growth):
        return None
    character = cells.character(i)
    if GUARD * off > COARSE:
        return Strip(character, np.zeros((1, 2)), False, 1.0, False)
    inside = around.inside(GUARD * off)
    if inside is None or not _is_infinite(onto @ inside[1], family.typical):
        return None
    shadow = _Shadow(around.moved(inside[0]), onto)
    hull = shadow.hull() + onto @ inside[0] + cells.starts[i, -2:]
    blur = 4.0 * off * float(family.typical.max())
    return Strip(character, hull, shadow.has_no_bound(), blur, is_certain)


def _onto(family: AffineFamily, directions: Array, growth: float) -> tuple[Array, Array, bool]:
    """Return how points of a cell move over the square, and whether the rank is certain.

    The points start + directions @ turned @ w lie over the points origin + onto @ w. Columns of
    ``onto`` that are zero within rounding are exactly zero: along such directions solutions may be
    unbounded, and rounding would grow.
    """
    typical = family.typical[:, np.newaxis]
    U, sigma, Vt = np.linalg.svd(directions[-2:] / typical, full_matrices=True)
    rank = int((sigma > GUARD * EPS * growth).sum())
    onto = np.zeros((2, directions.shape[1]))
    onto[:, :rank] = typical * U[:, :rank] * sigma[:rank]
    return onto, Vt.T, bool((sigma[rank:] <= GUARD * EPS).all())


def _around(
    family: AffineFamily, cells: AffineCells, i: int, onto: Array, turned: Array
) -> Polyhedron | None:
    """Return the inequalities of a cell and of the square; None if no point satisfies all."""
    typical, origin = np.tile(family.typical, 2), cells.starts[i, -2:]
    own = slice(len(family.necessary[1]), None)
    parts = cells.sides[i, own], cells.sides[i, : own.start - 4]
    values = cells.values[i, own], cells.values[i, : own.start - 4]
    square = np.vstack([onto, -onto]) / typical[:, np.newaxis]
    matrix = np.vstack([*(part @ turned for part in parts), square])
    vector = np.concatenate([*values, (1.0 + np.append(origin, -origin)) / typical])
    return Polyhedron.of(matrix, vector, GUARD * float(cells.rounding[i]))


def _is_infinite(onto: Array, typical: Array) -> bool:
    """Tell whether several points of a cell lie over a single point of the square."""
    rank = np.linalg.matrix_rank(onto / typical[:, np.newaxis], tol=GUARD * EPS)
    return bool(onto.shape[1] > rank)


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
        if way @ (point - a) > APART_IN_PLANE and not _same(point, a) and not _same(point, b):
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
    return bool(np.abs(a - b).max() <= APART_IN_PLANE)


def _apart(points: list[Array]) -> list[Array]:
    """Return points without repetitions of earlier points."""
    kept: list[Array] = []
    for point in points:
        if not any(_same(point, other) for other in kept):
            kept.append(point)
    return kept


#: Most Newton iterations to a solution in a cell: the first solves, the rest mends rounding.
REFINEMENTS = 3
#: Most cells that are tried all at once: a cell that is left over has a polygon cut, which takes
#: longer than computing a point.
MOST_AT_ONCE = 1024


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
    metric = Metric.of(family.system, family.window.alphas)
    sizes = np.append(family.scale, family.typical)
    parts = family.system, family.forms, family.necessary, sizes
    for found in enumerate_cells(*parts, few=MOST_AT_ONCE):
        check_budget()
        is_regular, inverses = _inverses(family, found)
        singular = (strip_of(family, found, i) for i in np.flatnonzero(~is_regular).tolist())
        strips += filter(None, singular)
        if is_regular.any():
            cells += _cells(family, metric, found, is_regular, inverses)
    return cells, strips


def _inverses(family: AffineFamily, cells: AffineCells) -> tuple[Signs, Array]:
    """Return which cells are regular, and the inverses of d(s, t) / dw, shape (N, 2, 2).

    A cell is regular if the point (s, t) determines the solution.
    """
    maps = cells.directions[:, -2:]
    if maps.shape[-1] != 2:
        return np.zeros(len(cells), dtype=bool), np.zeros((len(cells), 2, 2))
    smallest = np.linalg.svd(maps / family.typical[:, np.newaxis], compute_uv=False)[:, -1]
    is_regular: Signs = smallest > GUARD * EPS * cells.growth
    return is_regular, np.linalg.inv(np.where(is_regular[:, None, None], maps, np.eye(2)))


def _cells(
    family: AffineFamily, metric: Metric, cells: AffineCells, is_regular: Signs, inverses: Array
) -> Iterator[Cell]:
    """Yield the regular cells that have solutions over a polygon."""
    own = slice(len(family.necessary[1]), None)
    sides = _over_the_square(cells, inverses, cells.sides[:, own], cells.values[:, own])
    points = _over_the_square(cells, inverses, cells.directions[:, :-2], cells.starts[:, :-2])
    rounding = cells.rounding * np.linalg.norm(inverses * family.typical, axis=(1, 2))
    for i in np.flatnonzero(is_regular & _may_hold(sides, rounding)).tolist():
        lengths = np.hypot(*sides[i, :, :2].T)
        moves = lengths > GUARD * rounding[i]
        lines = sides[i, moves] / lengths[moves, np.newaxis]
        off = 4.0 * float(rounding[i])
        polygon = _polygon(lines, 0.5 * off / lengths[moves])
        if len(polygon) > 2:
            character, z = cells.character(i), points[i]
            sign = _det_sign(family, metric, character, z, polygon)
            label, blur = family.system.label(character), _blur(sides[i], moves, off)
            tests = cells.tests[i, own][moves]
            yield Cell(character, label, sign, z, lines, tests, polygon, blur, off)


def _blur(sides: Array, moves: Signs, off: float) -> float:
    """Return by how much rounding moves the sides: the whole square if rounding hides all sides."""
    lengths, hidden = np.hypot(*sides[:, :2].T), np.abs(sides[~moves, 2]) <= 0.25 * GUARD * off
    if not moves.any() and (hidden & (lengths > 0.0)).any():
        return 1.0
    least = float(lengths[moves].min(initial=np.inf))
    return off / (least if moves.all() else min(least, 1.0))


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
    alpha, row, curve = (
        x[-1],
        np.eye(len(x))[-1],
        Curve(Selection(family.system, character), metric),
    )
    root = newton(curve, lambda y: (float(y[-1] - alpha), row), x, REFINEMENTS)
    return 0 if isinstance(root, Failure) else root.factor.sign


def _over_the_square(cells: AffineCells, inverses: Array, ways: Array, values: Array) -> Array:
    """Return values + ways @ w of each cell as functions of (s, t, 1), shape (N, k, 3)."""
    slopes = ways @ inverses
    constants = values - (slopes @ cells.starts[:, -2:, np.newaxis])[..., 0]
    return np.concatenate([slopes, constants[..., np.newaxis]], axis=-1)


def _may_hold(sides: Array, rounding: Array) -> Signs:
    """Tell for which choices no inequality fails all over the square."""
    most = np.abs(sides[..., :2]).sum(axis=-1) + sides[..., 2]
    holds: Signs = (most >= -GUARD * rounding[:, np.newaxis]).all(axis=1)
    return holds
