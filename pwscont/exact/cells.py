"""All solutions of a system of linear pieces at one alpha, with a certificate for every cell.

A cell is one choice of a mode for every part of the system. Its equations are solved in floating
point, with a bound of the error from the residual and an approximate inverse (Rump 2010, section
10): an inequality that is certainly violated excludes the cell; a cell with no other than certainly
strict inequalities has one solution. Every other cell is solved in rational numbers.

Failure modes and answers
-------------------------
- Two cells share a solution: solutions whose enclosures meet are compared as rational points.
- The equations of a cell are singular and can be solved: solutions may be infinitely many, and the
  cell stays open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice, product
from math import prod
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.intervals.interval import SMALLEST, ULP
from pwscont.system.abilities import ExactMode

#: Most cells that are tried.
MOST_CELLS = 4**8
#: Numbers of the matrices of cells that are worked on at once.
TOGETHER = 2**22
#: The least radius of an enclosure, far above all numbers that underflow.
LEAST = 1e-290
Choice = tuple[int, ...]
Point = tuple[Fraction, ...]


@final
@dataclass(slots=True, eq=False)
class ProvedCells:
    """What is proved of all cells.

    Attributes
    ----------
    boxes : dict of choice to (centre, radius)
        Cells with one solution inside, off all inequalities, proved in floating point.
    points : set of tuple of Fraction
        Solutions in rational numbers.
    open : list of tuple of int
        Cells that are not decided.
    """

    boxes: dict[Choice, tuple[Array, Array]] = field(default_factory=dict)
    points: set[Point] = field(default_factory=set)
    open: list[Choice] = field(default_factory=list)


def proved_cells(common: Array, parts: Sequence[Sequence[ExactMode]], alpha: float) -> ProvedCells:
    """Return what is proved of all cells of exact rows, as :class:`ExactData` hands them over."""
    found = ProvedCells()
    choices = product(*(range(len(modes)) for modes in parts))
    size = common.shape[1] - 2
    while some := list(islice(choices, max(TOGETHER // (size + 2) ** 2, 1))):
        undecided = _in_doubles(common, parts, alpha, some, found)
        for choice in undecided:
            _in_rationals(common, parts, alpha, choice, found)
    for choice in list(_meeting(found)):
        del found.boxes[choice]
        _in_rationals(common, parts, alpha, choice, found)
    return found


def number_of_cells(parts: Sequence[Sequence[ExactMode]]) -> int:
    """Return the number of choices of modes."""
    return prod(len(modes) for modes in parts)


def rows_of(parts: Sequence[Sequence[ExactMode]], choice: Choice, name: str) -> list[Any]:
    """Return the rows of the modes of a choice."""
    return [getattr(modes[k], name) for modes, k in zip(parts, choice, strict=True)]


def _in_doubles(
    common: Array,
    parts: Sequence[Sequence[ExactMode]],
    alpha: float,
    choices: list[Choice],
    found: ProvedCells,
) -> list[Choice]:
    """Exclude cells, or note the solutions of cells; return the cells that are not decided."""
    systems = [np.concatenate([common, *rows_of(parts, each, "equations")]) for each in choices]
    square = [len(rows) == common.shape[1] - 2 for rows in systems]
    if not all(square):
        return choices
    equations = np.array(systems)
    with np.errstate(all="ignore"):
        (centre,), (radius,) = solved(equations, np.array([alpha]))
    known: Signs = np.all(np.isfinite(radius), axis=1)
    left = [choice for choice, is_known in zip(choices, known, strict=True) if not is_known]
    for i in np.flatnonzero(known):
        sides = np.concatenate(rows_of(parts, choices[i], "sides"))
        value, error = value_of(sides, alpha, centre[i])
        error = upper(error + np.abs(sides[:, :-2]) @ radius[i], len(radius[i]))
        if (value > error).all():
            found.boxes[choices[i]] = centre[i], radius[i]
        elif not (value < -error).any():
            left.append(choices[i])
    return left


def upper(x: Array, terms: int) -> Array:
    """Return upper bounds of rounded sums of products that are not negative."""
    bound: Array = x * (1.0 + 4.0 * (terms + 4) * ULP) + (terms + 4) * SMALLEST
    return bound


def value_of(rows: Array, alpha: float | Array, x: Array) -> tuple[Array, Array]:
    """Return rows times (x, alpha, 1), rounded, and a bound of the error; shapes (..., k)."""
    sizes = (np.abs(rows[..., :-2]) @ np.abs(x)[..., np.newaxis])[..., 0]
    sizes = sizes + np.abs(rows[..., -2] * alpha) + np.abs(rows[..., -1])
    value = (rows[..., :-2] @ x[..., np.newaxis])[..., 0] + (rows[..., -2] * alpha + rows[..., -1])
    terms = rows.shape[-1]
    return value, upper((terms + 2) * ULP * sizes, terms) + terms * SMALLEST


def solved(equations: Array, alphas: Array) -> tuple[Array, Array]:
    """Return solutions of B systems (B, n, n + 2) at k alphas, and bounds of the errors.

    Solutions and bounds have shape (k, B, n); the bound is infinite if no solution is known.

    With R about the inverse of K, the error e of x solves e = (I - R K) e - R (K x + k): a radius v
    with |R (K x + k)| + |I - R K| v < v bounds the error, and K is regular.
    """
    matrix, size = equations[..., :-2], equations.shape[-1] - 2
    regular = np.linalg.slogdet(matrix)[0] != 0.0
    inverse = np.linalg.inv(np.where(regular[:, np.newaxis, np.newaxis], matrix, np.eye(size)))
    alpha = alphas[:, np.newaxis, np.newaxis]
    rest = equations[..., -2] * alpha + equations[..., -1]
    x = -(inverse @ rest[..., np.newaxis])[..., 0]
    for _ in range(2):
        x = x - (inverse @ value_of(equations, alpha, x)[0][..., np.newaxis])[..., 0]
    value, error = value_of(equations, alpha, x)
    sizes = np.abs(inverse)
    start = upper((sizes @ (np.abs(value) + error)[..., np.newaxis])[..., 0], size)
    terms = (size + 2) * ULP * (sizes @ np.abs(matrix) + 1.0)
    off = upper(np.abs(np.eye(size) - inverse @ matrix) + terms, size)
    more = (off @ (2.0 * start)[..., np.newaxis])[..., 0]
    radius = 2.0 * (start + more) + LEAST
    image = upper(start + (off @ radius[..., np.newaxis])[..., 0], size)
    holds = regular & (image < radius).all(axis=-1)
    return x, np.where(holds[..., np.newaxis], radius, np.inf)


def _meeting(found: ProvedCells) -> Iterator[Choice]:
    """Yield the cells with solutions that may be the solution of another cell."""
    known = [*found.boxes.values(), *((np.array(p, dtype=float), None) for p in found.points)]
    for choice, (x, r) in found.boxes.items():
        for y, s in known:
            if y is not x and _may_meet(x, r, y, s):
                yield choice
                break


def _may_meet(x: Array, r: Array, y: Array, s: Array | None) -> bool:
    s = 4.0 * ULP * np.abs(y) + SMALLEST if s is None else s
    slack = upper(r + s, 2) + 4.0 * ULP * (np.abs(x) + np.abs(y))
    return bool((np.abs(x - y) <= slack).all())


# -- rational numbers -----------------------------------------------------------------------------


def _in_rationals(
    common: Array,
    parts: Sequence[Sequence[ExactMode]],
    alpha: float,
    choice: Choice,
    found: ProvedCells,
) -> None:
    """Decide a cell: note the solution, or that the cell stays open."""
    rows = np.concatenate([common, *rows_of(parts, choice, "equations")])
    solution = eliminated(exact(rows, alpha))
    if solution is None:
        return
    if not solution:
        found.open.append(choice)
        return
    sides = exact(np.concatenate(rows_of(parts, choice, "sides")), alpha)
    if all(at(side, solution) >= 0 for side in sides):
        found.points.add(solution)


def exact(rows: Array, alpha: float) -> list[list[Fraction]]:
    """Return rows (z, constant) in rational numbers, alpha put in."""
    exact = [[Fraction(float(value)) for value in row] for row in rows]
    return [[*row[:-2], row[-2] * Fraction(alpha) + row[-1]] for row in exact]


def at(row: list[Fraction], x: Point) -> Fraction:
    """Return the value of a row (z, constant) at a point."""
    return sum((a * b for a, b in zip(row, x, strict=False) if a and b), row[-1])


def eliminated(rows: list[list[Fraction]]) -> Point | None:
    """Return the solution of equations; None where there is none, () where there are several."""
    left, size = [list(row) for row in rows], len(rows[0]) - 1
    done: list[tuple[list[Fraction], int]] = []
    for column in range(size):
        pivot = next((row for row in left if row[column]), None)
        if pivot is None:
            continue
        left.remove(pivot)
        pivot = [value / pivot[column] for value in pivot]
        left = [without(row, pivot, column) for row in left]
        done = [(without(row, pivot, column), place) for row, place in done]
        done.append((pivot, column))
    if any(row[-1] for row in left):
        return None
    if len(done) < size:
        return ()
    return tuple(-row[-1] for row, _ in sorted(done, key=lambda each: each[1]))


def without(row: list[Fraction], pivot: list[Fraction], column: int) -> list[Fraction]:
    """Return a row without a column, by a row that has 1 there."""
    factor = row[column]
    if not factor:
        return row
    return [a - factor * b if b else a for a, b in zip(row, pivot, strict=True)]
