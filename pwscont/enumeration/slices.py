"""All solutions of one slice alpha = constant.

Failure modes and answers
-------------------------
- Two solutions 1e-12 apart next to a fold, or none just beyond it: every candidate is refined
  on the full system, and accepted by the signs of its tests to within the rounding of their
  own terms, not by a fixed tolerance.
- One solution found in several cells, on whose common boundary it lies: counted once, and its
  cells are kept.
- A cell with infinitely many solutions: a face, with its dimension and its corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import final

import numpy as np
from scipy.optimize import linprog

from pwscont.enumeration.options import Problem, reduce
from pwscont.enumeration.tree import SLACK, Leaf, leaves
from pwscont.foundation.arrays import Array
from pwscont.foundation.character import Character
from pwscont.foundation.outcome import Failure
from pwscont.foundation.rounding import CONFIDENCE, EPS, GUARD
from pwscont.model.selection import Selection
from pwscont.model.system import SlicewiseLinearSystem
from pwscont.numerics.curve import Curve
from pwscont.numerics.linalg import last_unit
from pwscont.numerics.metric import Metric
from pwscont.numerics.newton import newton
from pwscont.numerics.uncertainty import magnitude, magnitude_of_values, uncertainty

#: Newton iterations on an affine selection: one, and one more against rounding.
REFINEMENTS = 3
#: Corners of a face are listed up to this dimension.
MOST_DIMENSIONS = 3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """An isolated solution.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
        The point (z, alpha).
    error : ndarray, shape (k, n + 1)
        Samples of its error.
    characters : tuple of Character
        The cells in whose closure it lies; one unless it lies on an interface.
    det_signs : tuple of int
        Sign of det(dH/dz) in each of them.
    """

    x: Array
    error: Array
    characters: tuple[Character, ...]
    det_signs: tuple[int, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """Infinitely many solutions in one cell.

    Attributes
    ----------
    character : Character
    dimension : int
    corners : ndarray, shape (k, n + 1)
        Its extreme points, as far as they are finite and the dimension is at most three.
    """

    character: Character
    dimension: int
    corners: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """All solutions at one alpha."""

    points: tuple[Point, ...]
    faces: tuple[Face, ...]


def solve_slice(system: SlicewiseLinearSystem, metric: Metric, alpha: float) -> Slice:
    """Return all solutions of a system at ``alpha``.

    Parameters
    ----------
    system : SlicewiseLinearSystem
    metric : Metric
    alpha : float
    """
    problem = reduce(system, metric.scale[:-1], alpha)
    points: list[Point] = []
    faces: list[Face] = []
    for leaf in leaves(problem):
        character = problem.character(leaf.chosen)
        if leaf.directions.shape[1]:
            faces += _face(problem, leaf, character, alpha)
            continue
        start = np.append(problem.origin + problem.basis @ leaf.start, alpha)
        point = _refined(Curve(Selection(system, character), metric), start)
        if point is not None:
            _add(points, point, metric)
    return Slice(tuple(points), tuple(faces))


def _refined(curve: Curve, start: Array) -> Point | None:
    """Return the solution of one selection at the alpha of ``start``, if in its closed cell."""
    selection, alpha = curve.selection, float(start[-1])
    row = last_unit(len(start))
    root = newton(curve, lambda x: (float(x[-1]) - alpha, row), start, REFINEMENTS)
    if isinstance(root, Failure):
        return None
    root.x[-1], error = alpha, uncertainty(root)
    uncertain = magnitude_of_values(selection.test_gradients(root.x), root.x, error)
    if (selection.tests(root.x) < -CONFIDENCE * uncertain).any():
        return None
    return Point(root.x, error, (selection.character,), (root.factor.sign,))


def _add(points: list[Point], new: Point, metric: Metric) -> None:
    """Add a point, or its cell to the same point found before."""
    for i, old in enumerate(points):
        if _same(metric, old, new):
            characters = (*old.characters, *new.characters)
            points[i] = Point(old.x, old.error, characters, (*old.det_signs, *new.det_signs))
            return
    points.append(new)


def _same(metric: Metric, a: Point, b: Point) -> bool:
    """Tell whether two solutions differ by no more than their errors."""
    errors = (metric.norm(magnitude(point.x, point.error)) for point in (a, b))
    return metric.norm(a.x - b.x) <= CONFIDENCE * sum(errors)


def _face(problem: Problem, leaf: Leaf, character: Character, alpha: float) -> list[Face]:
    """Return the face of a singular cell, if it has more than one point."""
    if not _satisfies(leaf):
        return []
    G = np.vstack([option.G for option in leaf.chosen])
    g = np.concatenate([option.g for option in leaf.chosen])
    matrix, vector = G @ leaf.directions, G @ leaf.start + g
    dimension = leaf.directions.shape[1]
    if dimension > MOST_DIMENSIONS:
        return [Face(character, dimension, np.zeros((0, len(problem.origin) + 1)))]
    if not _has_interior(matrix, vector):
        return []
    corners = _corners(matrix, vector)
    y = leaf.start + corners @ leaf.directions.T
    z = problem.origin + y @ problem.basis.T
    return [Face(character, dimension, np.column_stack([z, np.full(len(z), alpha)]))]


def _satisfies(leaf: Leaf) -> bool:
    """Tell whether the equations of a singular cell really have solutions, but for rounding."""
    E = np.vstack([option.E for option in leaf.chosen])
    e = np.concatenate([option.e for option in leaf.chosen])
    terms = np.abs(E) @ np.abs(leaf.start) + np.abs(e)
    return bool((np.abs(E @ leaf.start + e) <= GUARD * EPS * (terms + terms.max())).all())


def _has_interior(matrix: Array, vector: Array) -> bool:
    """Tell whether {s : matrix s + vector >= 0} has more than one point, bounded or not."""
    q = matrix.shape[1]
    moving = np.abs(matrix).max(axis=1) > SLACK
    if (vector[~moving] < -SLACK).any():
        return False
    rows = np.column_stack([-matrix[moving], np.ones(int(moving.sum()))])
    result = linprog(
        np.append(np.zeros(q), -1.0),
        A_ub=rows,
        b_ub=vector[moving],
        bounds=[(None, None)] * q + [(None, 1.0)],
        method="highs",
    )
    return bool(result.status == 0 and -result.fun > SLACK)


def _corners(matrix: Array, vector: Array) -> Array:
    """Return the extreme points of {s : matrix s + vector >= 0}, shape (k, q)."""
    q = matrix.shape[1]
    found: list[Array] = []
    for rows in map(list, combinations(range(len(matrix)), q)):
        if abs(np.linalg.det(matrix[rows])) <= SLACK:
            continue
        s = np.asarray(np.linalg.solve(matrix[rows], -vector[rows]), dtype=float)
        slack = GUARD * EPS * (1.0 + np.abs(s).max())
        inside = (matrix @ s + vector >= -slack).all()
        if inside and not any(np.abs(s - other).max() <= slack for other in found):
            found.append(s)
    return np.array(found).reshape(-1, q)
