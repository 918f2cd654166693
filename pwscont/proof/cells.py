"""Systems of linear pieces, cell by cell: solutions in floating point with bounds, or rational.

A cell is one choice of a mode for every part of the system; its solutions lie on a line, along
which every inequality is affine in alpha. With R about the inverse of the matrix K of a cell, the
error e of a solution x solves e = (I - R K) e - R (K x + k): a radius v with
|R (K x + k)| + |I - R K| v < v bounds the error, and K is regular (Rump 2010, section 10). The rows
that all cells have in common are solved once for some of the unknowns.

Failure modes and answers
-------------------------
- Modes of a part have different numbers of equations, or data are so large or small that bounds
  are no numbers: cells are left to rational numbers.
- A cell has a line without end or an area of solutions, at one alpha more than a point: the cell
  stays open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import prod
from typing import Any, final

import numpy as np
from scipy.linalg import qr

from pwscont.basics.arrays import Array, Indices
from pwscont.proof.interval import SMALLEST, ULP
from pwscont.system.abilities import ExactMode

#: Most cells that are tried.
MOST_CELLS = 4**8
#: Numbers of the matrices of cells that are worked on at once.
TOGETHER = 2**20
#: The least radius of an enclosure, far above all numbers that underflow.
LEAST = 1e-290
Choice = tuple[int, ...]
Point = tuple[Fraction, ...]


# -- floating point -------------------------------------------------------------------------------


@final
@dataclass(frozen=True, slots=True, eq=False)
class Balls:
    """Numbers within a radius of others; without a radius the numbers are exact."""

    mid: Array
    rad: Any = None

    def __getitem__(self, key: Any) -> Balls:
        return Balls(self.mid[key], None if self.rad is None else self.rad[key])

    def __add__(self, other: Balls) -> Balls:
        mid = self.mid + other.mid
        rad = ULP * np.abs(mid) + sum(x.rad for x in (self, other) if x.rad is not None)
        return Balls(mid, upper(rad, 2))

    def __matmul__(self, other: Balls) -> Balls:
        sizes = np.abs(other.mid)
        terms = int(np.count_nonzero(self.mid, axis=-1).max(initial=0))  # others add nothing
        width = (terms + 2) * ULP * sizes + (0.0 if other.rad is None else other.rad)
        rad = np.abs(self.mid) @ width
        if self.rad is not None:
            rad = rad + self.rad @ (sizes + width)
        terms = self.mid.shape[-1]
        return Balls(self.mid @ other.mid, upper(rad, terms) + terms * SMALLEST)

    def largest(self) -> Array:
        """Return upper bounds of magnitudes."""
        return upper(np.abs(self.mid) + (0.0 if self.rad is None else self.rad), 2)

    def signs(self) -> Indices:
        """Return the signs, zero where not certain."""
        signs: Indices = (self.mid > self.rad).astype(np.intp) - (self.mid < -self.rad)
        return signs


def upper(x: Array, terms: int) -> Array:
    """Return upper bounds of rounded sums of products that are not negative."""
    bound: Array = x * (1.0 + 4.0 * (terms + 4) * ULP) + (terms + 4) * SMALLEST
    return bound


def solved(matrix: Balls, right: Balls) -> Balls:
    """Return x with matrix x + right = 0 for B systems, shapes (B, n, n) and (B, n, m).

    The radius is infinite where no solution is known.
    """
    inverse = _inverses(matrix.mid)
    x = -(inverse @ right.mid)
    x = x - inverse @ (matrix.mid @ x + right.mid)
    about = Balls(inverse)
    start = (about @ _residual(matrix, x, right)).largest()
    off = (about @ matrix + Balls(-np.eye(matrix.mid.shape[-1]))).largest()
    radius = 2.0 * (start + off @ (2.0 * start)) + LEAST
    image = upper(start + off @ radius, len(x[0]) + 1)
    holds = (image < radius).all(axis=(-2, -1), keepdims=True)
    return Balls(x, np.where(holds, radius, np.inf))


def _residual(matrix: Balls, x: Array, right: Balls) -> Balls:
    """Return matrix x + right; of exact numbers, to about twice the digits (Ozaki et al. 2012).

    The product of the leading bits has no rounding, whatever the order of sums.
    """
    if matrix.rad is not None:
        return matrix @ Balls(x) + right
    terms = len(x[0])
    bits = (53 - int(np.ceil(np.log2(terms + 1)))) // 2
    one, other = _leading(matrix.mid, -1, bits), _leading(x, -2, bits)
    exact = Balls(one @ other, np.array(terms * SMALLEST)) + right
    return exact + (Balls(one) @ Balls(x - other) + Balls(matrix.mid - one) @ Balls(x))


def _leading(x: Array, axis: int, bits: int) -> Array:
    """Return the leading bits of numbers, counted from the largest along an axis."""
    largest = np.abs(x).max(axis=axis, keepdims=True)
    shift = 2.0 ** (np.ceil(np.log2(largest + LEAST)) + 53 - bits)
    leading: Array = (x + shift) - shift
    return leading


def _inverses(matrices: Array) -> Array:
    """Return the inverses of matrices to rounding, nan for singular matrices."""
    try:
        inverses: Any = np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        regular = np.linalg.slogdet(matrices)[0] != 0.0
        inverses = np.full_like(matrices, np.nan)
        inverses[regular] = np.linalg.inv(matrices[regular])
    found: Array = inverses
    return found


@final
class ExactCells:
    """All cells, ``number`` of them, of exact rows, as :class:`ExactData` hands them over.

    ``rows`` (r, size + 2) are coefficients of (z, alpha, 1): the equations of all cells, the row of
    the inequality 1 >= 0, then the equations and inequalities of all modes. ``modes`` has of every
    mode of every part the places of equations and inequalities.
    """

    def __init__(self, common: Array, parts: Sequence[Sequence[ExactMode]]) -> None:
        self.size, self._common = common.shape[1] - 2, len(common)
        self._sizes = [len(modes) for modes in parts]
        self.number = prod(self._sizes)
        blocks, self.modes = [common, np.eye(1, self.size + 2, self.size + 1)], []
        place = len(common) + 1
        for modes in parts:
            own = []
            for mode in modes:
                first, last = np.cumsum([place + len(mode.equations), len(mode.sides)]).tolist()
                own.append((np.arange(place, first), np.arange(first, last)))
                blocks += [mode.equations, mode.sides]
                place = last
            self.modes.append(own)
        self.rows = np.concatenate(blocks)
        self._equations, self._sides = ([self._table(m, k) for m in self.modes] for k in (0, 1))
        owned = sum(table.shape[1] for table in self._equations)
        ragged = any(len({len(m[0]) for m in modes}) > 1 for modes in self.modes)
        self._is_square = not ragged and owned + len(common) == self.size
        with np.errstate(all="ignore"):
            self._order, self._others, self._reduced = self._condensed()

    def _table(self, modes: list[Any], which: int) -> Indices:
        """Return the rows of the modes of a part; the row 1 >= 0 fills the table."""
        table = np.full((len(modes), max(len(mode[which]) for mode in modes)), self._common)
        for row, mode in zip(table, modes, strict=True):
            row[: len(mode[which])] = mode[which]
        return table

    def _condensed(self) -> tuple[Indices, Balls, Balls]:
        """Return an order of unknowns, the first ones by the others, and rows of the others."""
        count, columns = self._common, np.arange(self.size + 2)
        if 0 < count <= self.size and np.isfinite(self.rows).all():
            order = np.append(qr(self.rows[:count, :-2], mode="r", pivoting=True)[1], columns[-2:])
            own, rest = self.rows[:, order[:count]], self.rows[:, order[count:]]
            first = solved(Balls(own[np.newaxis, :count]), Balls(rest[np.newaxis, :count]))[0]
            if np.isfinite(first.rad).all():
                parts = np.where(np.arange(len(own)) < count, 0.0, own.T).T
                return order, first, Balls(parts) @ first + Balls(rest)
        return columns, Balls(np.zeros((0, self.size + 2))), Balls(self.rows)

    def portions(self, number: int) -> Iterator[slice]:
        """Yield slices of so many cells that are worked on at once."""
        many = max(TOGETHER // self._reduced.mid.shape[1] ** 2, 1)
        return (slice(k, min(k + many, number)) for k in range(0, number, many))

    def choices(self) -> Iterator[Indices]:
        """Yield all cells, some at once, shape (B, parts)."""
        sizes = np.array(self._sizes, dtype=np.intp)
        strides = np.append(np.cumprod(sizes[:0:-1], dtype=np.intp)[::-1], 1)[: len(sizes)]
        for some in self.portions(self.number):
            yield np.arange(some.start, some.stop)[:, np.newaxis] // strides % sizes

    def of(self, choice: Any) -> tuple[Array, Array]:
        """Return the equations and the inequalities of a cell."""
        pairs = [modes[k] for modes, k in zip(self.modes, choice, strict=True)]
        equations, sides = (
            self.rows[np.concatenate([np.zeros(0, dtype=np.intp), *each])]
            for each in zip(*pairs, strict=True)
        )
        return np.concatenate([self.rows[: self._common], equations]), sides

    def side(self, choice: Any, number: int) -> Array:
        """Return an inequality of a cell by its place among :meth:`lines`."""
        tables = zip(self._sides, choice, strict=True)
        row: Array = self.rows[np.concatenate([table[k] for table, k in tables])[number]]
        return row

    def lines(self, choices: Indices) -> tuple[Balls, Balls]:
        """Return unknowns and inequalities of B cells as functions of alpha, (B, k, 2)."""
        own, sides = (
            np.concatenate([table[k] for table, k in zip(each, choices.T, strict=True)], axis=1)
            for each in (self._equations, self._sides)
        )
        if not self._is_square:
            nothing = Balls(np.zeros((*sides.shape, 2)), np.full((*sides.shape, 2), np.inf))
            return nothing, nothing
        if not len(self._others.mid):
            every = np.broadcast_to(np.arange(self._common), (len(own), self._common))
            own = np.concatenate([every, own], axis=1)
        with np.errstate(all="ignore"):
            equations, rows = self._reduced[own], self._reduced[sides]
            x = solved(equations[..., :-2], equations[..., -2:])
            return x, rows[..., :-2] @ x + rows[..., -2:]

    def unknowns(self, line: Balls, alpha: float) -> tuple[Array, Array]:
        """Return all unknowns of a cell, and bounds of the errors, from some of the unknowns."""
        some = line @ Balls(np.array([alpha, 1.0]))
        known = Balls(np.append(some.mid, [alpha, 1.0]), np.append(some.rad, [0.0, 0.0]))
        others = self._others @ known
        x, radius = np.zeros(self.size), np.zeros(self.size)
        x[self._order[:-2]] = np.append(others.mid, some.mid)
        radius[self._order[:-2]] = np.append(others.rad, some.rad)
        return x, radius


def at(lines: Balls, alphas: Array) -> Balls:
    """Return what is affine in alpha, (B, k, 2), at alphas (j,) or (B, j), shape (B, k, j)."""
    with np.errstate(all="ignore"):
        return lines @ Balls(np.stack([alphas, np.ones_like(alphas)], axis=-2))


@final
@dataclass(slots=True, eq=False)
class ProvedCells:
    """What is proved of all cells at one alpha.

    ``boxes`` are centres and radii of solutions, of the cells that are proved in floating point to
    have one solution, off all inequalities; ``points`` are other solutions.
    """

    boxes: dict[Choice, tuple[Array, Array]] = field(default_factory=dict)
    points: set[Point] = field(default_factory=set)
    open: list[Choice] = field(default_factory=list)

    def decide(self, cells: ExactCells, choice: Choice, alpha: float) -> None:
        """Decide a cell in rational numbers: note the solution, or that the cell stays open."""
        ends = segment_of(*cells.of(choice), (alpha, alpha))
        if ends is not None and len(set(ends)) == 1:
            self.points.add(ends[0][:-1])
        elif ends is not None:
            self.open.append(choice)

    def meeting(self) -> Iterator[Choice]:
        """Yield the cells with solutions that may be the solution of another cell."""
        points = [np.array(point, dtype=float) for point in self.points]
        known = [*self.boxes.values(), *((x, ULP * np.abs(x) + SMALLEST) for x in points)]
        for choice, (x, r) in self.boxes.items():
            for y, s in known:
                slack = upper(r + s, 2) + 4.0 * ULP * (np.abs(x) + np.abs(y))
                if y is not x and (np.abs(x - y) <= slack).all():
                    yield choice
                    break


def proved_cells(cells: ExactCells, alpha: float) -> ProvedCells:
    """Return what is proved of all cells at alpha."""
    found = ProvedCells()
    for choices in cells.choices():
        x, sides = cells.lines(choices)
        signs = at(sides, np.array([alpha])).signs()[..., 0]
        least = signs.min(axis=1, initial=1)
        for i in np.flatnonzero(least >= 0):
            choice = tuple(choices[i].tolist())
            if least[i] > 0:
                found.boxes[choice] = cells.unknowns(x[i], alpha)
            else:
                found.decide(cells, choice, alpha)
    for choice in list(found.meeting()):
        del found.boxes[choice]
        found.decide(cells, choice, alpha)
    return found


# -- rational numbers -----------------------------------------------------------------------------


def rational(rows: Array) -> list[list[Fraction]]:
    """Return rows of doubles as the numbers that they are."""
    return [[Fraction(number) for number in row] for row in rows.tolist()]


def value(row: list[Fraction], x: Sequence[Fraction]) -> Fraction:
    """Return the value of a row (x, constant) at a point."""
    return sum((a * b for a, b in zip(row, x, strict=False) if a and b), row[-1])


def eliminated(rows: list[list[Fraction]]) -> dict[int, list[Fraction]] | None:
    """Return unit columns with their rows (x, constant); None where no x solves all rows."""
    left, done = rows, dict[int, list[Fraction]]()
    for column in range(len(rows[0]) - 1):
        pivot = next((row for row in left if row[column]), None)
        if pivot is not None:
            unit = [number / pivot[column] for number in pivot]
            left = [_without(row, unit, column) for row in left if row is not pivot]
            done = {place: _without(row, unit, column) for place, row in done.items()}
            done[column] = unit
    return None if any(row[-1] for row in left) else done


def _without(row: list[Fraction], unit: list[Fraction], column: int) -> list[Fraction]:
    """Return a row without a column, by a row that has 1 there."""
    factor = row[column]
    if not factor:
        return row
    return [a - factor * b if b else a for a, b in zip(row, unit, strict=True)]


def segment_of(equations: Array, sides: Array, interval: tuple[float, float]) -> Any:
    """Return both ends (z, alpha) of all solutions of a cell over an interval of alpha.

    None where there are no solutions, () where they are not a segment or a point.
    """
    done, columns = eliminated(rational(equations)), equations.shape[1] - 1
    if done is None or len(done) < columns - 1:
        return None if done is None else ()
    free = next((column for column in range(columns) if column not in done), None)
    base = [-done[k][-1] if k in done else Fraction(0) for k in range(columns)]
    along = [Fraction(k == free) if free in (None, k) else -done[k][free] for k in range(columns)]
    ends = np.zeros((2, columns + 1))
    ends[:, -2], ends[:, -1] = (1.0, -1.0), (-interval[0], interval[1])
    first: Fraction | None = None if free is not None else Fraction(0)
    last = first
    for row in rational(np.vstack([sides, ends])):
        start = value(row, base)
        slope = value([*row[:-1], Fraction(0)], along)
        if slope > 0:
            first = -start / slope if first is None else max(first, -start / slope)
        elif slope < 0:
            last = -start / slope if last is None else min(last, -start / slope)
        elif start < 0:
            return None
    if first is None or last is None:
        return ()
    if first > last:
        return None
    return tuple(tuple(a + b * s for a, b in zip(base, along, strict=True)) for s in (first, last))


def spans(rows: Array, others: Array) -> bool:
    """Tell whether other rows are sums of multiples of rows."""
    used = (rows != 0.0).any(axis=0) | (others != 0.0).any(axis=0)
    left, both = (
        [[*row, Fraction(0)] for row in rational(each[:, used])]
        for each in (rows, np.vstack([rows, others]))
    )
    return len(eliminated(left) or ()) == len(eliminated(both) or ())
