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
    """Infinitely many solutions in one cell.

    Attributes
    ----------
    character : Character
    dimension : int
    corners : ndarray, shape (k, n + 1)
        The finite extreme points; none are listed where the dimension is above three.
    directions : ndarray, shape (n, d)
        Vectors that span the face.
    """

    character: Character
    dimension: int
    corners: Array
    directions: Array


def face_of(problem: Problem, one: Choices, alpha: float) -> list[Face]:
    """Return the face of a singular cell, if it has more than one point."""
    start, directions, picks = one.starts[0], one.directions[0], one.picks[:, 0]
    chosen, character = problem.chosen(picks), problem.character(picks)
    if not satisfies(chosen, start):
        return []
    G = np.vstack([option.G for option in chosen])
    g = np.concatenate([option.g for option in chosen])
    matrix, vector = G @ directions, G @ start + g
    dimension = directions.shape[1]
    span = problem.basis @ directions
    if dimension > MOST_DIMENSIONS:
        return [Face(character, dimension, np.zeros((0, len(problem.origin) + 1)), span)]
    rounding = min(GUARD * float(one.rounding[0]), SLACK)
    around = Polyhedron.of(matrix, vector, rounding)
    inside = around and around.inside(rounding)
    if inside is None or inside[1].shape[1] < dimension:
        return []
    corners = _corners(matrix, vector)
    y = start + corners @ directions.T
    z = problem.origin + y @ problem.basis.T
    return [Face(character, dimension, np.column_stack([z, np.full(len(z), alpha)]), span)]


def satisfies(chosen: Sequence[Option], y: Array, growth: float = GUARD) -> bool:
    """Tell whether a point satisfies the equations of a singular cell, but for rounding.

    By how much rounding may have grown is said by ``growth``.
    """
    E = np.vstack([option.E for option in chosen])
    e = np.concatenate([option.e for option in chosen])
    terms = np.abs(E) @ np.abs(y) + np.abs(e)
    return bool((np.abs(E @ y + e) <= growth * EPS * (1.0 + terms + terms.max())).all())


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
