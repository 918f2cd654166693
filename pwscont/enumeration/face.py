"""Faces: infinitely many solutions of one singular cell at one alpha."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import final

import numpy as np
from scipy.optimize import linprog

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.choices import SLACK, Choices
from pwscont.enumeration.options import Option, Problem

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
    if not has_interior(matrix, vector):
        return []
    corners = _corners(matrix, vector)
    y = start + corners @ directions.T
    z = problem.origin + y @ problem.basis.T
    return [Face(character, dimension, np.column_stack([z, np.full(len(z), alpha)]), span)]


def satisfies(chosen: Sequence[Option], y: Array) -> bool:
    """Tell whether a point satisfies the equations of a singular cell, but for rounding."""
    E = np.vstack([option.E for option in chosen])
    e = np.concatenate([option.e for option in chosen])
    terms = np.abs(E) @ np.abs(y) + np.abs(e)
    return bool((np.abs(E @ y + e) <= GUARD * EPS * (terms + terms.max())).all())


def has_interior(matrix: Array, vector: Array) -> bool:
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
