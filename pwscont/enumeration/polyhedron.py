"""Polyhedra of solutions: points, faces, extreme rays.

A solver lets inequalities be violated by 1e-10 at best, which may be more than the width of a thin
polyhedron: the value of every inequality at the point found is magnified, and the program is solved
again for the rest of the way (Gleixner, Steffy and Wolter, INFORMS J. Comput. 28, 2016).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import prod
from typing import Any, final

import numpy as np
from scipy.linalg import null_space

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD, TINY
from pwscont.curve.error_samples import ONE_DIGIT
from pwscont.enumeration.choices import SLACK, Choices, inequalities_of
from pwscont.enumeration.options import Option, Problem

#: Most cells of a solution that are listed.
MOST_CELLS_LISTED = 4**6


@final
class Cells(Sequence[Character]):
    """All combinations of a cell of each part, each character made when taken: there may be 4^p.

    ``numbers``: how many cells each part has. ``cell``: makes the character of numbers of cells.
    """

    def __init__(self, numbers: Sequence[int], cell: Callable[[Sequence[int]], Character]) -> None:
        self._numbers, self._cell = numbers, cell

    def __len__(self) -> int:
        return min(prod(self._numbers), sys.maxsize)

    def listed(self) -> tuple[Character, ...]:
        """Return all cells; if too many, the cells that differ from the first in a single part."""
        if len(self) <= MOST_CELLS_LISTED:
            return tuple(self)
        others = [
            [k if place == i else 0 for place in range(len(self._numbers))]
            for i, number in enumerate(self._numbers)
            for k in range(1, number)
        ]
        return (self[0], *map(self._cell, others))

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if not 0 <= index < len(self):
            raise IndexError(index)
        picks = []
        for number in self._numbers:
            index, pick = divmod(index, number)
            picks.append(pick)
        return self._cell(picks)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """An isolated solution."""

    x: Array  # the point (z, alpha), shape (n + 1,)
    error: Array  # samples of the error of x, shape (k, n + 1)
    #: The cells in whose closure the point lies; several for a point on an interface.
    characters: Sequence[Character]
    det_sign: int  # sign of det(dH/dz) in the first of these cells
    #: The signs in all of these cells where the signs are known; else empty.
    known_signs: tuple[int, ...] = ()
    #: Whether rounding leaves open in which cells the point lies; None if not yet tested.
    in_doubt: bool | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """All solutions at a fixed alpha."""

    points: tuple[Point, ...]
    faces: tuple[Face, ...]
    undecided: int = 0  # number of cells that may or may not hold a solution, because of rounding
    exact: bool = False  # whether the points were found in exact arithmetic
    #: Number of cells whose equations may be singular, by rounding, although exact arithmetic finds
    #: a solution; no digit of such a solution is certain.
    singular: int = 0


#: Largest dimension of a face whose corners are listed.
MOST_DIMENSIONS = 3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """Infinitely many solutions in a cell, or the only solution of a singular cell."""

    character: Character
    dimension: int  # 0 for a single solution
    corners: Array  # the finite extreme points; empty for dimensions above three, shape (k, n + 1)
    inside: Array  # A point inside of the face, shape (n + 1,)
    directions: Array  # vectors that span the face, shape (n, d)

    @property
    def representatives(self) -> Array:
        """The corners, or else a point inside, shape (k, n + 1)."""
        return self.corners if len(self.corners) else self.inside[np.newaxis]


def face_of(problem: Problem, one: Choices, alpha: float) -> Face | None:
    """Return the solutions of a singular cell as a face, None for a cell without solution."""
    cell = inside_of(problem, one)
    if cell is None:
        return None
    around, point, basis, rounding = cell
    start, directions = one.starts[0], one.directions[0]

    def whole(w: Array) -> Array:
        z = problem.origin + (start + w @ directions.T) @ problem.basis.T
        return np.column_stack([z, np.full(len(z), alpha)])

    corners = whole(point + _corners(around.moved(point), basis, rounding) @ basis.T)
    span = problem.basis @ directions @ basis
    character = problem.character(one.picks[:, 0])
    return Face(character, basis.shape[1], corners, whole(point[None])[0], span)


def inside_of(problem: Problem, one: Choices) -> tuple[Polyhedron, Array, Array, float] | None:
    """Return the closed cell of a choice, its ``inside`` and the rounding, None for no solution.

    A cell without a known digit, as at 1e15, has none: rounding hides whether its equations hold.
    """
    if one.rounding[0] > ONE_DIGIT or not satisfies(problem.chosen(one.picks[:, 0]), one.starts[0]):
        return None
    rounding = min(GUARD * float(one.rounding[0]), SLACK)
    sides, values, _ = inequalities_of(problem, one)
    around = Polyhedron.of(sides[0], values[0], rounding)
    inside = around and around.inside(rounding)
    return (around, *inside, rounding) if around and inside else None


def satisfies(chosen: Sequence[Option], y: Array, growth: float = GUARD) -> bool:
    """Tell whether a point satisfies the equations of a singular cell to rounding.

    The factor ``growth`` says by how much rounding may have grown.
    """
    if not chosen:
        return True
    E = np.vstack([option.E for option in chosen])
    e = np.concatenate([option.e for option in chosen])
    terms = np.abs(E) @ np.abs(y) + np.abs(e)
    return bool((np.abs(E @ y + e) <= growth * EPS * (1.0 + terms + terms.max())).all())


def _corners(around: Polyhedron, basis: Array, rounding: float) -> Array:
    """Return the extreme points of a polyhedron around an inner point, shape (k, d)."""
    d = basis.shape[1]
    if d > MOST_DIMENSIONS or not d:
        return np.zeros((1 - min(d, 1), d))
    matrix, vector = around.matrix @ basis, around.vector
    moves = np.abs(matrix).max(axis=1) > rounding
    matrix, vector = matrix[moves], vector[moves]
    if d == 1:
        ends = [end for end in Polyhedron(matrix, vector).ends() if np.isfinite(end)]
        return np.array(ends).reshape(-1, 1)
    rows = np.array([*combinations(range(len(matrix)), d)], dtype=np.intp).reshape(-1, d)
    rows = rows[np.abs(np.linalg.det(matrix[rows])) > SLACK]
    points = np.linalg.solve(matrix[rows], -vector[rows][..., np.newaxis])[..., 0]
    slack = GUARD * EPS * (1.0 + np.abs(points).max(axis=1, initial=0.0))
    inside = (points @ matrix.T + vector >= -slack[:, np.newaxis]).all(axis=1)
    found: list[Array] = []
    for s, off in zip(points[inside], slack[inside], strict=True):
        if not any(np.abs(s - other).max() <= off for other in found):
            found.append(s)
    return np.array(found).reshape(-1, d)


#: Options of HiGHS: the least tolerances, and no presolve, which fails without a largest value.
TIGHT = {
    "primal_feasibility_tolerance": 1e-10,
    "dual_feasibility_tolerance": 1e-10,
    "presolve": False,
}
#: Factors that magnify the values of inequalities in turn: the tolerance of the last is rounding.
MAGNIFIED = (1.0, 2.0**16)
#: The status of scipy for a program without a largest value.
UNBOUNDED = 3
#: Least multiplier that is not zero; the sum of all multipliers is 1.
LEAST_MULTIPLIER = 1e-6


@final
@dataclass(frozen=True, slots=True, eq=False)
class Polyhedron:
    """The points {w : matrix w + vector >= 0}, where the matrix has the shape (k, q).

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import Polyhedron
    >>> Polyhedron(np.array([[1.0], [-2.0]]), np.array([1.0, 4.0])).ends()
    (-1.0, 2.0)
    """

    matrix: Array
    vector: Array

    @classmethod
    def of(cls, matrix: Array, vector: Array, rounding: float) -> Polyhedron | None:
        """Return a polyhedron without trivial inequalities, None if an inequality holds nowhere.

        ``rounding``: a row of the matrix with smaller entries does not depend on w.
        """
        moves = np.abs(matrix).max(axis=1, initial=0.0) > rounding
        if (vector[~moves] < -rounding).any():
            return None
        return cls(matrix[moves], vector[moves])

    def moved(self, point: Array) -> Polyhedron:
        """Return the polyhedron in coordinates with a given point as origin."""
        return Polyhedron(self.matrix, self.vector + self.matrix @ point)

    def farthest(self, way: Array) -> Array | None:
        """Return a point with the largest ``way @ w``, None where ``way @ w`` grows without end.

        The point may violate inequalities by 1e-10, and the polyhedron may be empty.
        """
        found = self._largest(way)
        return None if found is None else found[0]

    def is_unbounded(self, way: Array) -> bool:
        """Tell whether ``way @ w`` grows without end."""
        return bool(self._program(way, self.vector).status == UNBOUNDED)

    def inside(self, rounding: float) -> tuple[Array, Array] | None:
        """Return a point inside and, shape (q, d), an orthonormal basis of the directions there.

        d is less than q if inequalities hold with equality only. None if no point satisfies all
        inequalities, whose error is ``rounding``.
        """
        if self.matrix.shape[1] == 1:
            return self._inside_line(rounding)
        (k, q), last = self.matrix.shape, np.eye(self.matrix.shape[1] + 1)[-1]
        rows = np.vstack([np.column_stack([self.matrix, -np.ones(k)]), -last])
        found = Polyhedron(rows, np.append(self.vector, 1.0))._largest(last)
        if found is None:
            return None
        point, multipliers = found[0][:q], found[1][:k]
        least = (self.matrix @ point + self.vector).min(initial=1.0)
        off = rounding * (1.0 + np.abs(point).max(initial=0.0))
        if least > off:
            return point, np.eye(q)
        return None if least < -off else self._flat(point, multipliers > LEAST_MULTIPLIER, rounding)

    def ends(self) -> tuple[float, float]:
        """Return the least and the largest w of a polyhedron of dimension 1."""
        slopes, values = self.matrix[:, 0], self.vector
        rises, falls = slopes > 0.0, slopes < 0.0
        lo = (-values[rises] / slopes[rises]).max(initial=-np.inf)
        return float(lo), float((-values[falls] / slopes[falls]).min(initial=np.inf))

    def _inside_line(self, rounding: float) -> tuple[Array, Array] | None:
        """Return :meth:`inside` of a polyhedron of dimension 1."""
        lo, hi = self.ends()
        finite = [end for end in (lo, hi) if np.isfinite(end)]
        steepest = np.abs(self.matrix).min(initial=1.0)
        off = rounding * (1.0 + max(map(abs, finite), default=0.0)) / steepest
        if hi - lo < -off:
            return None
        middle = sum(finite) / len(finite) if finite else 0.0
        if hi - lo <= off:
            return np.array([middle]), np.zeros((1, 0))
        beside = float(np.isneginf(lo)) * -1.0 + float(np.isposinf(hi))
        return np.array([middle + beside]), np.eye(1)

    def _flat(self, point: Array, equal: Any, rounding: float) -> tuple[Array, Array] | None:
        """Return the inside of the part in which some inequalities hold with equality."""
        basis = null_space(self.matrix[equal])
        if not basis.shape[1]:
            return point, basis
        others = self.matrix[~equal] @ basis, self.moved(point).vector[~equal]
        rest = Polyhedron.of(*others, rounding)
        found = rest and rest.inside(rounding)
        return found and (point + basis @ found[0], basis @ found[1])

    def _largest(self, way: Array) -> tuple[Array, Array] | None:
        """Return a point with the largest ``way @ w``, and the multipliers of the inequalities."""
        point, way = np.zeros(len(way)), way / max(float(np.abs(way).max()), TINY)
        multipliers = np.zeros(len(self.vector))
        for factor in MAGNIFIED:
            found = self._program(way, factor * self.moved(point).vector)
            if found.x is None:
                return None if factor == 1.0 else (point, multipliers)
            point, multipliers = point + found.x / factor, -found.ineqlin.marginals
        return point, multipliers

    def _program(self, way: Array, vector: Array) -> Any:
        """Return scipy's answer for the largest ``way @ w`` with matrix w + vector >= 0."""
        from scipy.optimize import linprog  # noqa: PLC0415  the import takes as long as all the rest

        free, A = [(None, None)] * len(way), -self.matrix
        return linprog(-way, A_ub=A, b_ub=vector, bounds=free, method="highs", options=TIGHT)
