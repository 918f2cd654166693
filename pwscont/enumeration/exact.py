"""Enumeration of all cells in exact arithmetic.

At fixed alpha selections and tests are affine in z with coefficients that are doubles, hence
rational: elimination in integers (:mod:`pwscont.enumeration.echelon`) rounds nothing, whatever the
condition. Cells are excluded in doubles, in batches, where floating point is certain. The integers
grow by 53 bits and more for each row: beyond MOST_WORK nothing is done, and the caller says so.

The system's own numbers are rounded, so that selections agree on an interface to rounding only. A
solution that close to an interface may lie in two cells: the two points are merged if the errors
cover the distance. Or the solution lies in no cell: a cell that misses its solution by no more than
the error counts as undecided, unless the solution was found in another cell.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from math import prod
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS
from pwscont.curve.error_samples import has_digits, is_same
from pwscont.curve.metric import Metric
from pwscont.enumeration.by_parts import in_modes
from pwscont.enumeration.echelon import MOST_WORK, Echelon, Row, integers
from pwscont.enumeration.options import Table
from pwscont.enumeration.polyhedron import Point, Slice
from pwscont.enumeration.slices import tests_of
from pwscont.linear.factor import sign_of_permutation
from pwscont.system.promises import checked_necessary
from pwscont.system.selection import Selection
from pwscont.system.system import Block, SlicewiseLinearSystem, number_of_cells

#: Number of entries of the matrices that are looked at together, to bound memory.
ENTRIES_AT_ONCE = 4**11
#: Largest condition of unit rows at which doubles decide: half of all digits are right.
WORST_IN_DOUBLES = EPS**-0.5
#: Largest negative test of a solution that may be inside such a cell, as a part of the sum of the
#: magnitudes of the test's terms: far above the error of the solution.
CERTAINLY_OUTSIDE = 1e-5


#: Largest negative test of a solution that is returned, as a part of the sum of the magnitudes of
#: the test's terms.
FAR_OUTSIDE = 0.1
#: Largest condition of unit rows at which an inverse matrix has several right digits.
WELL_CONDITIONED = EPS**-0.75


@final
class ExactSlice:
    """The rows of all modes and all tests at a fixed alpha, as integers."""

    def __init__(self, system: SlicewiseLinearSystem, scale: Array, alpha: float) -> None:
        self._n, self._scale, self._alpha = system.size, scale, alpha
        table = Table.at(system, alpha, scale)
        self._necessary = checked_necessary(system, alpha)
        self._rows = [np.column_stack(rows) for rows in table.rows]
        self._tests = np.column_stack(table.tests)
        pairs = zip(table.blocks, table.bounding, strict=True)
        few_first = sorted(pairs, key=lambda pair: len(pair[0].modes))
        self._blocks = [block for block, _ in few_first]
        self._bounding = [bounding for _, bounding in few_first]
        taken = [row for block in self._blocks for row in block.rows]
        self._common = np.setdiff1d(np.arange(system.size), taken).tolist()
        self._order = [*self._common, *taken]

    def solutions(self) -> list[tuple[Point, bool]] | None:
        """Return the solutions of regular cells, each with whether no bounding test is negative.

        Solutions far outside are left out. None for infinite numbers, or if it takes too long.
        """
        options = sum(len(block.rows) * len(block.modes) for block in self._blocks)
        c, choices = len(self._common), number_of_cells(self._blocks)
        before = (c + options) * c * self._n + choices * (self._n - c)  # the first cell is solved
        are_finite = all(np.isfinite(n).all() for n in (*self._rows, self._tests))
        if before > MOST_WORK or not are_finite:
            return None
        common = Echelon(self._n).extended([integers(self._rows[0][i]) for i in self._common])
        if common is None:
            return []
        kept, d = self._not_excluded(), self._n - c
        if len(kept) * d * d * (d + len(self._tests)) > MOST_WORK:
            return None
        self._eliminated = common

        def reduced(block: Block, k: int) -> list[Row]:
            return [common.reduced(integers(self._rows[k][i])) for i in block.rows]

        #: For every block and mode the rows, without the unknowns that the common rows decide.
        self._options = [[reduced(b, k) for k in range(len(b.modes))] for b in self._blocks]
        self._exact_tests = [integers(row) for row in self._tests]
        cells = self._descend((), Echelon(self._n, level=common.determinant), kept)
        return [found for picks, echelon in cells if (found := self._at(picks, echelon))]

    def _not_excluded(self) -> Indices:
        """Return the choices of modes, shape (N, blocks), whose solution may lie in the cell."""
        units = np.append(self._scale, 1.0)
        modes, tests = np.array(self._rows) * units, self._tests * units
        sizes = np.abs(modes[..., :-1]).max(axis=-1, keepdims=True)
        modes /= np.where(sizes > 0.0, sizes, 1.0)
        # +1 or -1 where a test bounds a mode of a block, else 0
        sides = [np.zeros((len(block.modes), len(tests))) for block in self._blocks]
        for block, bounding, side in zip(self._blocks, self._bounding, sides, strict=True):
            for k, bounds in enumerate(bounding):
                signs = [block.modes[k][block.tests.index(test)] for test in bounds]
                side[k, bounds] = np.where(signs, 1.0, -1.0)

        def excluded(picks: Indices, rows: Array) -> Signs:
            inverse = np.linalg.inv(rows[..., :-1])
            condition = np.abs(inverse).sum(axis=2).max(axis=1, initial=1.0)
            x = np.ones((len(picks), self._n + 1))
            x[:, :-1] = -(inverse @ rows[..., -1:])[..., 0]
            off = self._n * EPS * condition * np.abs(x).max(axis=1)
            slack = (CERTAINLY_OUTSIDE * (np.abs(x) + 1.0) + off[:, np.newaxis]) @ np.abs(tests).T
            side = sum(signs[k] for signs, k in zip(sides, picks.T, strict=True))
            outside = side * (x @ tests.T) < -slack
            return outside.any(axis=1) & (condition <= WORST_IN_DOUBLES)

        numbers, kept = [len(block.modes) for block in self._blocks], list[Indices]()
        most = 1 + ENTRIES_AT_ONCE // self._n**2
        for first in range(0, prod(numbers), most):
            check_budget()
            which = np.arange(first, min(first + most, prod(numbers)))
            choices = np.unravel_index(which, numbers) if numbers else np.zeros((0, 1), np.intp)
            picks = np.array(choices).T
            rows = np.repeat(modes[:1], len(picks), axis=0)
            for block, k in zip(self._blocks, picks.T, strict=True):
                rows[:, block.rows] = modes[:, block.rows][k]
            out = np.linalg.slogdet(rows[..., :-1])[0] != 0.0
            if out.any():
                out[out] = excluded(picks[out], rows[out])
            kept.append(picks[~out])
        return np.concatenate(kept)

    def _descend(
        self, picks: tuple[int, ...], echelon: Echelon, kept: Indices
    ) -> Iterator[tuple[tuple[int, ...], Echelon]]:
        """Yield the regular choices among ``kept``, which share the elimination of blocks."""
        depth = len(picks)
        if depth == len(self._blocks):
            check_budget()
            yield picks, echelon
            return
        for k, rows in enumerate(self._options[depth]):
            some = kept[kept[:, depth] == k]
            longer = echelon.extended(rows) if len(some) else None
            if longer is not None:
                yield from self._descend((*picks, k), longer, some)

    def _at(self, picks: tuple[int, ...], echelon: Echelon) -> tuple[Point, bool] | None:
        """Return the solution of a cell, None for a solution far outside."""
        D = echelon.determinant
        y = self._eliminated.solved(self._n, D, echelon.solved(self._n))
        z = np.array([_float(Fraction(value, D)) for value in y])  # correctly rounded
        worst = self._worst(picks, (*y, D), z) if np.isfinite(z).all() else -np.inf
        if worst <= -FAR_OUTSIDE or self._breaks_necessary(z):
            return None
        rows = in_modes(self._rows, [block.rows for block in self._blocks], picks)
        rounding = EPS * (np.abs(rows) @ np.append(np.abs(z), 1.0))
        error = np.zeros((self._n, self._n + 1))  # a row by the rounding of each equation
        error[:, :-1] = _inverse(rows[:, :-1], self._scale) * rounding[:, np.newaxis]
        columns = self._eliminated.columns + echelon.columns
        parity = sign_of_permutation(self._order) * sign_of_permutation(columns)
        det_sign = parity if D > 0 else -parity
        cells = (self._character(picks),)
        return Point(np.append(z, self._alpha), error, cells, det_sign), worst >= 0.0

    def _breaks_necessary(self, z: Array) -> bool:
        """Tell whether a point is no solution, although it lies in a cell, as a pull if F = 0."""
        A, b = self._necessary
        terms = np.abs(A) @ (np.abs(z) + self._scale) + np.abs(b)
        return bool((A @ z + b < -CERTAINLY_OUTSIDE * terms).any())

    def _character(self, picks: tuple[int, ...]) -> Character:
        character = Character([True] * len(self._tests))
        for block, pick in zip(self._blocks, picks, strict=True):
            character = character.with_signs(block.tests, block.modes[pick])
        return character

    def _worst(self, picks: tuple[int, ...], y: Sequence[int], z: Array) -> float:
        """Return the most negative bounding test relative to the terms; exactly 0 if none is.

        ``y``: the solution as integers, and last their denominator; ``z``: the rounded solution.
        """
        signs, worst = self._character(picks).signs, 0.0
        sizes = np.append(np.abs(z) + self._scale, 1.0)
        for tests, pick in zip(self._bounding, picks, strict=True):
            for test in tests[pick]:
                value = sum(a * b for a, b in zip(self._exact_tests[test], y, strict=True))
                if value and ((value > 0) == (y[-1] > 0)) != signs[test]:
                    row = self._tests[test]
                    off = float(abs(row[-1] + row[:-1] @ z) / (np.abs(row) @ sizes))
                    worst = min(worst, -max(off, np.finfo(float).tiny))
        return worst


def _inverse(matrix: Array, scale: Array) -> Array:
    """Return the transposed inverse of a regular matrix to a digit or more."""
    scaled = matrix * scale
    largest = np.abs(scaled).max(axis=1, keepdims=True)
    with suppress(np.linalg.LinAlgError):
        inverse = np.linalg.inv(scaled / largest)
        if np.abs(inverse).sum(axis=1).max() * len(matrix) <= WELL_CONDITIONED:
            return (inverse * scale[:, np.newaxis] / largest.T).T
    n, unit = len(matrix), np.eye(len(matrix))
    echelon = Echelon(n).extended(
        [integers(np.append(*row)) for row in zip(matrix, unit, strict=True)]
    )
    assert echelon is not None, "the cell is regular"
    columns, D = [echelon.solved(n + i) for i in range(n)], echelon.determinant
    return np.array([[_float(Fraction(y, D)) for y in column] for column in columns])


def _float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def solve_exactly(
    system: SlicewiseLinearSystem, metric: Metric, alpha: float, known: Sequence[Point] = ()
) -> Slice | None:
    """Return all isolated solutions, from every cell in exact arithmetic; None for too much work.

    The points ``known`` lie on faces: rounding in the system may put them outside of regular cells.
    """
    solutions = ExactSlice(system, metric.scale[:-1], alpha).solutions()
    if solutions is None:
        return None
    points: list[Point] = []
    for point in (point for point, is_inside in solutions if is_inside):
        if not any(_joins(metric, point, other) for other in points):
            shared = [p for p, is_inside in solutions if is_inside and _joins(metric, p, point)]
            signs = tuple(p.det_sign for p in shared)
            cells = tuple(p.characters[0] for p in shared)
            points.append(replace(point, characters=cells, det_sign=signs[0], known_signs=signs))

    def is_undecided(point: Point) -> bool:
        """Tell whether a solution misses a cell by no more than the error, and lies in no other."""
        place = point.x, point.error
        tests, slack = tests_of(Selection(system, point.characters[0]), metric, *place)
        found = any(is_same(metric, place, (p.x, p.error)) for p in (*points, *known))
        return bool((tests >= -slack).all()) and not found

    undecided = sum(is_undecided(point) for point, is_inside in solutions if not is_inside)
    return Slice(tuple(points), (), undecided, exact=True)


def _joins(metric: Metric, a: Point, b: Point) -> bool:
    """Tell whether two points are the same; if signs differ, a curve turns back between (F1).

    A point of which no digit is known is the same as points of the same kind only.
    """
    if np.array_equal(a.x, b.x):
        return True
    one, other = ((point.x, point.error) for point in (a, b))
    is_alike = has_digits(*one, metric.scale) == has_digits(*other, metric.scale)
    return a.det_sign == b.det_sign and is_alike and is_same(metric, one, other)
