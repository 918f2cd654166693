"""The cells of an affine family: where in the window's square each has its solution.

In a regular cell z is an affine function of the point (s, t) of the square, and so are the tests
that bound it: its solutions are over a convex polygon. A singular cell has infinitely many
solutions over each point of a segment, or of a polygon (:mod:`pwscont.two_parameters.strips`).

Failure modes and answers
-------------------------
- A test that does not depend on (s, t) in a cell, as one that is zero all over it: its gradient is
  rounding, and no side. The test holds all over the cell, or nowhere.
- Lines of a nearly singular cell are off by more than others: by how much is kept (``blur``), and
  lines closer than that are one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.metric import Metric
from pwscont.enumeration import det_sign
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.options import Problem
from pwscont.enumeration.tree import Prices, leaves
from pwscont.two_parameters.affine import AffineFamily
from pwscont.two_parameters.half_planes import clipped
from pwscont.two_parameters.strips import Strip, strip_of

#: A cell that is left has its polygon cut, which takes longer than a point.
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
        The part of the square over which the cell has a solution, counter-clockwise; a little
        wider where that is a point or a segment.
    blur : float
        Estimate of how far rounding moves its sides.
    rounding : float
        Estimate of the rounding error of z, in parts of its typical magnitudes.
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
    """Return the regular cells with solutions over a polygon, and the singular ones with any."""
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
    """Tell which choices are decided by (s, t), and return the coordinates that (s, t) have there.

    The second is of shape (N, 2, 2): the inverse of d(s, t) / d(free directions).
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
    """Yield the cells among regular choices that have solutions over a polygon."""
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
    """Return what sides leave of the square, in outline where it is a point or a segment."""
    polygon = clipped(sides)
    return polygon if len(polygon) > 2 else clipped(sides + np.outer(blur, [0.0, 0.0, 1.0]))


def _det_sign(
    family: AffineFamily, metric: Metric, character: Character, z: Array, polygon: Array
) -> int:
    """Return the sign of det(dH/dz), which is the same all over a cell."""
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
    """Return the inequalities of each choice in (s, t, 1), shape (N, k, 3), and their tests.

    Blocks with fewer inequalities than others are filled with 1 >= 0.
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
    """Tell which choices have no inequality that is negative all over the square."""
    most = np.abs(sides[..., :2]).sum(axis=-1) + sides[..., 2]
    holds: Signs = (most >= -GUARD * rounding[:, np.newaxis]).all(axis=1)
    return holds
