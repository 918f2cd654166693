"""Systems of linear pieces, cell by cell: where in an interval of alpha a cell has solutions.

A cell is one choice of a mode for every part of the system; its solutions lie on a line.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from math import prod
from typing import Any, final

import numpy as np
from scipy.linalg import qr

from pwscont.basics.arrays import Array, Indices, Signs, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.curve.metric import Range
from pwscont.enumeration.echelon import Echelon, independent, integers
from pwscont.proof.interval import INF, Interval, solved, together
from pwscont.system.abilities import ExactMode

#: Most cells that are tried.
MOST_CELLS = 4**8
#: Numbers of the matrices of cells that are worked on at once: they fit into a processor's cache.
TOGETHER = 2**16
Choice = tuple[int, ...]
Point = tuple[Fraction, ...]


@np.errstate(all="ignore")
def ends_of(sides: Interval, interval: Range) -> tuple[Interval, Signs]:
    """Return inequalities of B cells at both ends of an interval of alpha, and where all fail.

    A cell is empty if one of its ``sides`` (B, k, 2), affine in alpha, is violated at both ends, or
    a rising side holds only beyond the alpha up to which a falling side does.
    """
    ends, slope = sides @ Interval(np.array([interval, (1.0, 1.0)])), sides[..., 0]
    roots = -sides[..., 1] / slope
    first = np.where(slope.lo > 0.0, roots.lo, -INF).max(axis=1, initial=interval[0])
    last = np.where(slope.hi < 0.0, roots.hi, INF).min(axis=1, initial=interval[1])
    fails: Signs = np.any(np.all(ends.hi < 0.0, axis=2), axis=1)
    return ends, fails | (first > last)


def exact_array(name: str, given: Any) -> Array:
    """Return numbers as doubles, or refuse numbers that are not finite doubles."""
    array, own = finite_array(name, given), np.asarray(given)
    if own.dtype != array.dtype and (array.astype(object) != own.astype(object)).any():
        raise InvalidInputError(f"{name}: some numbers are no doubles, and would be rounded")
    return array


def _jumps(modes: Sequence[ExactMode]) -> bool:
    """Tell whether two modes on both sides of one test differ where the test is zero."""
    sides = [mode.sides for mode in modes]
    if [len(each) for each in sides] != [1, 1] or (sides[0] != -sides[1]).any():
        return False
    pair = [mode.equations for mode in modes]
    return any(
        any(independent(np.vstack([sides[0], one, other]))[1 + len(one) :])
        for one, other in (pair, pair[::-1])
    )


@final
class ExactCells:
    """All cells, ``number`` of them, of exact rows, as :class:`ExactData` hands them over.

    ``rows`` (r, size + 2) are coefficients of (z, alpha, 1). ``equations`` and ``sides`` have for
    every part a table of the places of rows, a mode in each line, filled by 0 = 0, and by 1 >= 0.
    """

    def __init__(self, common: Array, parts: Sequence[Sequence[ExactMode]]) -> None:
        common = exact_array("exact rows", common)
        self.size, self._common = common.shape[1] - 2, len(common)
        parts = [list(modes) for modes in parts] or [[ExactMode(common[:0], common[:0])]]
        self.number = prod(map(len, parts))
        fillers = np.zeros((2, self.size + 2))
        fillers[1, -1] = 1.0
        blocks = [common, fillers]

        def table(own: list[Array], filler: int) -> Indices:
            places = np.full((len(own), max(map(len, own))), self._common + filler)
            for line, rows in zip(places, own, strict=True):
                line[: len(rows)] = sum(map(len, blocks)) + np.arange(len(rows))
                blocks.append(exact_array("exact rows", rows).reshape(len(rows), self.size + 2))
            return places

        self.equations = [table([mode.equations for mode in modes], 0) for modes in parts]
        self.sides = [table([mode.sides for mode in modes], 1) for modes in parts]
        self.rows = np.concatenate(blocks)
        if any(map(_jumps, parts)):
            raise InvalidInputError("H jumps where a test is zero, so that nothing can be proved")
        #: Whether cells have as many equations as unknowns: others go to rational numbers.
        self._is_square = self.size == len(common) + sum(each.shape[1] for each in self.equations)
        with np.errstate(all="ignore"):
            self._order, self._others, self._reduced = self._condensed()

    def _condensed(self) -> tuple[Indices, Interval, Interval]:
        """Return an order of unknowns, the first ones by the others, and rows of the others."""
        count = self._common * self._is_square
        unknowns = self.rows[:, :-2]
        pivots = qr(unknowns[:count], mode="r", pivoting=True)[1] if count else range(self.size)
        order = np.append(pivots, [self.size, self.size + 1]).astype(np.intp)
        own, rest = Interval(self.rows[:, order[:count]]), Interval(self.rows[:, order[count:]])
        first = solved(own[np.newaxis, :count], rest[np.newaxis, :count])[0]
        return order, first, own @ first + rest

    def portions(self, number: int) -> Iterator[slice]:
        """Yield slices of so many cells that are worked on at once."""
        many = max(TOGETHER // self._reduced.lo.shape[1] ** 2, 1)
        return (slice(k, min(k + many, number)) for k in range(0, number, many))

    def left(self, interval: Range) -> Iterator[tuple[Choice, Interval, bool]]:
        """Yield the cells that may have solutions, their lines, and whether that is proved."""
        is_regular = np.isfinite(self._others.width()).all()
        for some in self.portions(self.number):
            each = np.arange(some.start, some.stop)
            choices = np.array(np.unravel_index(each, [len(table) for table in self.sides])).T
            x, sides = self.lines(choices)
            ends, is_empty = ends_of(sides, interval)
            holds: Signs = np.all(ends.lo > 0.0, axis=(1, 2)) & np.all(x.lo > -INF, axis=(1, 2))
            for i in np.flatnonzero(~is_empty):
                yield tuple(choices[i].tolist()), x[i], bool(holds[i] and is_regular)

    def of(self, choice: Any) -> tuple[Array, Array]:
        """Return the equations and the inequalities of a cell."""
        equations, sides = (self.rows[each[0]] for each in self._places(np.array([choice])))
        return np.concatenate([self.rows[: self._common], equations]), sides

    def _places(self, choices: Indices) -> list[Indices]:
        """Return the places (B, k) of the rows of B cells: of equations, and of inequalities."""
        modes = [zip(each, choices.T, strict=True) for each in (self.equations, self.sides)]
        return [np.concatenate([table[k] for table, k in each], axis=1) for each in modes]

    @np.errstate(all="ignore")
    def lines(self, choices: Indices) -> tuple[Interval, Interval]:
        """Return unknowns and inequalities of B cells as functions of alpha, (B, k, 2)."""
        equations, rows = (self._reduced[each] for each in self._places(choices))
        x = solved(equations[..., :-2], equations[..., -2:]).where(self._is_square)
        return x, rows[..., :-2] @ x + rows[..., -2:]

    def unknowns(self, line: Interval, alphas: Interval) -> Interval:
        """Return all unknowns of a cell at alphas (k,), shape (size, k), from some unknowns."""
        points = together(np.vstack, alphas, Interval(np.ones_like(alphas.lo)))
        some = line @ points
        others = self._others @ together(np.vstack, some, points)
        return together(np.vstack, others, some)[np.argsort(self._order[:-2])]


def value(row: Array, x: Sequence[Fraction]) -> Fraction:
    """Return the value of a row of doubles (x, constant) at a point."""
    terms = zip(row.tolist(), (*x, Fraction(1)), strict=True)
    return sum((Fraction(a) * b for a, b in terms if a and b), Fraction(0))


def holds(equations: Array, sides: Array, x: Point) -> bool:
    """Tell whether a point is a solution of a cell."""
    return all(value(row, x) >= 0 for row in sides) and not any(value(row, x) for row in equations)


def as_doubles(points: Any) -> Array:
    """Return rational numbers as doubles, not numbers where a double cannot hold all of them."""
    try:
        return np.array(points, dtype=float)
    except OverflowError:
        return np.full(np.shape(points), np.nan)


def segment_of(equations: Array, sides: Array, interval: Range) -> tuple[Point, ...] | None:
    """Return both ends (z, alpha) of all solutions of a cell over an interval of alpha, exactly.

    Of a ray without end, one end; () where solutions may be more, None where there are none.
    """
    size = equations.shape[1] - 1
    echelon = Echelon(size)
    for row in map(integers, equations):
        longer = echelon.extended([row])
        if longer is None and echelon.reduced(row)[-1]:
            return None
        echelon = longer or echelon
    if len(echelon.rows) < size - 1:
        return ()
    whole = echelon.determinant
    free = [whole * (column not in echelon.columns) for column in range(size)]
    base = [Fraction(y, whole) for y in echelon.solved(size)]
    along = [Fraction(y, whole) for y in echelon.solved(size, 0, free)]
    ends = np.zeros((2, size + 1))
    ends[:, -2], ends[:, -1] = (1.0, -1.0), (-interval[0], interval[1])
    first, last = ([] if any(free) else [Fraction(0)] for _ in range(2))
    for row in np.vstack([sides, ends]):
        start, slope = value(row, base), value(np.append(row[:-1], 0.0), along)
        if slope:
            (first if slope > 0 else last).append(-start / slope)
        elif start < 0:
            return None
    places = [largest(some) for largest, some in ((max, first), (min, last)) if some]
    if len(places) == 2 and places[0] > places[1]:
        return None
    return tuple(tuple(a + b * s for a, b in zip(base, along, strict=True)) for s in places)
