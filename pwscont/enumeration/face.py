"""Faces: infinitely many solutions of one singular cell at one alpha."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.choices import SLACK, Choices
from pwscont.enumeration.options import Option, Problem
from pwscont.enumeration.polyhedron import Polyhedron

#: Corners of a face are listed up to this dimension.
MOST_DIMENSIONS = 3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """Infinitely many solutions in one cell, or the only one of a singular cell.

    Attributes
    ----------
    character : Character
    dimension : int
        0 where there is one solution.
    corners : ndarray, shape (k, n + 1)
        The finite extreme points; none are listed where the dimension is above three.
    inside : ndarray, shape (n + 1,)
        A point of the face, inside of it.
    directions : ndarray, shape (n, d)
        Vectors that span the face.
    """

    character: Character
    dimension: int
    corners: Array
    inside: Array
    directions: Array

    @property
    def representatives(self) -> Array:
        """The corners, or else a point inside, shape (k, n + 1)."""
        return self.corners if len(self.corners) else self.inside[np.newaxis]


def face_of(problem: Problem, one: Choices, alpha: float) -> Face | None:
    """Return the solutions of a singular cell, None if there are none."""
    start, directions, picks = one.starts[0], one.directions[0], one.picks[:, 0]
    chosen = problem.chosen(picks)
    if not satisfies(chosen, start):
        return None
    rounding = min(GUARD * float(one.rounding[0]), SLACK)
    around = polyhedron_of(problem, one, rounding)
    inside = around and around.inside(rounding)
    if around is None or inside is None:
        return None
    point, basis = inside

    def whole(w: Array) -> Array:
        z = problem.origin + (start + w @ directions.T) @ problem.basis.T
        return np.column_stack([z, np.full(len(z), alpha)])

    corners = whole(point + _corners(around.moved(point), basis, rounding) @ basis.T)
    span = problem.basis @ directions @ basis
    return Face(problem.character(picks), basis.shape[1], corners, whole(point[None])[0], span)


def polyhedron_of(problem: Problem, one: Choices, rounding: float) -> Polyhedron | None:
    """Return the closed cell of a choice, in the coordinates of its directions."""
    start, directions = one.starts[0], one.directions[0]
    chosen = problem.chosen(one.picks[:, 0])
    G = np.vstack([problem.A, *(option.G for option in chosen)])
    g = np.concatenate([problem.b, *(option.g for option in chosen)])
    return Polyhedron.of(G @ directions, G @ start + g, rounding)


def satisfies(chosen: Sequence[Option], y: Array, growth: float = GUARD) -> bool:
    """Tell whether a point satisfies the equations of a singular cell, but for rounding.

    By how much rounding may have grown is said by ``growth``.
    """
    E = np.vstack([option.E for option in chosen])
    e = np.concatenate([option.e for option in chosen])
    terms = np.abs(E) @ np.abs(y) + np.abs(e)
    return bool((np.abs(E @ y + e) <= growth * EPS * (1.0 + terms + terms.max())).all())


def _corners(around: Polyhedron, basis: Array, rounding: float) -> Array:
    """Return the extreme points of a polyhedron around a point inside of it, shape (k, d)."""
    d = basis.shape[1]
    if d > MOST_DIMENSIONS or not d:
        return np.zeros((1 - min(d, 1), d))
    matrix, vector = around.matrix @ basis, around.vector
    moves = np.abs(matrix).max(axis=1) > rounding
    matrix, vector = matrix[moves], vector[moves]
    if d == 1:
        ends = [end for end in Polyhedron(matrix, vector).ends() if np.isfinite(end)]
        return np.array(ends).reshape(-1, 1)
    return _extreme(matrix, vector)


def _extreme(matrix: Array, vector: Array) -> Array:
    """Return the extreme points of {s : matrix s + vector >= 0}, shape (k, q)."""
    q = matrix.shape[1]
    rows = np.array([*combinations(range(len(matrix)), q)], dtype=np.intp).reshape(-1, q)
    rows = rows[np.abs(np.linalg.det(matrix[rows])) > SLACK]
    points = np.linalg.solve(matrix[rows], -vector[rows][..., np.newaxis])[..., 0]
    slack = GUARD * EPS * (1.0 + np.abs(points).max(axis=1, initial=0.0))
    inside = (points @ matrix.T + vector >= -slack[:, np.newaxis]).all(axis=1)
    found: list[Array] = []
    for s, off in zip(points[inside], slack[inside], strict=True):
        if not any(np.abs(s - other).max() <= off for other in found):
            found.append(s)
    return np.array(found).reshape(-1, q)
