"""The true pieces of a system with straight pieces, in rational arithmetic, without rounding.

Every floating-point number that the system returns is taken as an exact rational number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import TypeAlias

import numpy as np

from pwscont import Character, PiecewiseLinearSystem
from pwscont.bench.truth.known_answer import TruePiece
from pwscont.extending import Array, dense

Row = list[Fraction]
#: (matrix, right sides) -> the solution, a row per unknown, and the sign of the determinant.
Solver: TypeAlias = Callable[[Array, Array], tuple[list[Row], int]]


def straight_pieces(
    system: PiecewiseLinearSystem, interval: tuple[float, float]
) -> list[TruePiece]:
    """Return the pieces of all cells; a cell without isolated solutions has no piece."""
    found = (straight_piece(system, cell, interval) for cell in system.cells())
    return [piece for piece in found if piece is not None]


def straight_piece(
    system: PiecewiseLinearSystem, character: Character, interval: tuple[float, float]
) -> TruePiece | None:
    """Return the piece of a cell, None without isolated solutions in the interval."""
    line, sign = line_of(system, character, solve)
    return piece_on(system, character, line, sign, interval) if sign else None


def line_of(
    system: PiecewiseLinearSystem, character: Character, solver: Solver
) -> tuple[list[Row], int]:
    """Return the line z0 + alpha z1 that solves a selection, and the sign of det(dH/dz).

    The line has a row (z0, z1) for each unknown, and is empty if the sign is 0.
    """
    origin = np.zeros(system.size)
    jacobian = dense(system.jacobian(origin, 0.0, character))
    rhs = -np.column_stack([system.residual(origin, 0.0, character), jacobian[:, -1]])
    return solver(jacobian[:, :-1], rhs)


def piece_on(
    system: PiecewiseLinearSystem,
    character: Character,
    line: list[Row],
    sign: int,
    interval: tuple[float, float],
) -> TruePiece | None:
    """Return the part of a line that lies in the cell of a character, None if empty."""
    lo, hi = _admissible(tests_along(system, character, line), interval)
    if lo >= hi:
        return None

    def at(alpha: float) -> Array:
        exact = Fraction(alpha)
        return np.array([*(float(z0 + exact * z1) for z0, z1 in line), alpha])

    span = float(lo), float(hi)
    return TruePiece(system.cell(character), sign, span, at, lambda x: float(x[-1]))


def tests_along(
    system: PiecewiseLinearSystem, character: Character, line: list[Row]
) -> Iterator[tuple[Fraction, Fraction]]:
    """Yield value at alpha = 0 and rate of every bounding test along a line, positive inside."""
    origin = np.zeros(system.size)
    values, rates = system.test_functions(origin, 0.0), dense(system.test_jacobian(origin, 0.0))
    for i in system.bounding_tests(character):
        side, gradient = (1 if character.signs[i] else -1), _exact(rates[i])
        value = side * (Fraction(float(values[i])) + _dot(gradient, [z0 for z0, _ in line]))
        yield value, side * (gradient[-1] + _dot(gradient, [z1 for _, z1 in line]))


def _admissible(
    tests: Iterable[tuple[Fraction, Fraction]], interval: tuple[float, float]
) -> tuple[Fraction, Fraction]:
    """Return the alphas at which no test is negative."""
    lo, hi = Fraction(interval[0]), Fraction(interval[1])
    for value, rate in tests:
        if rate > 0:
            lo = max(lo, -value / rate)
        elif rate < 0:
            hi = min(hi, -value / rate)
        elif value < 0:
            return hi, lo
    return lo, hi


def solve(matrix: Array, rhs: Array) -> tuple[list[Row], int]:
    """Return the solution, a row per unknown, and the sign of the determinant.

    The method is Gauss-Jordan elimination; the solution is empty if the sign is 0.
    """
    size, sign = len(matrix), 1
    rows = [_exact(row) for row in np.column_stack([matrix, rhs])]
    for k in range(size):
        pivot = next((i for i in range(k, size) if rows[i][k] != 0), None)
        if pivot is None:
            return [], 0
        if pivot != k:
            rows[k], rows[pivot], sign = rows[pivot], rows[k], -sign
        sign = sign if rows[k][k] > 0 else -sign
        rows[k] = [value / rows[k][k] for value in rows[k]]
        _eliminate(rows, k)
    return [row[size:] for row in rows], sign


def _eliminate(rows: list[Row], k: int) -> None:
    for i, row in enumerate(rows):
        if i != k and row[k] != 0:
            rows[i] = [a - row[k] * b for a, b in zip(row, rows[k], strict=True)]


def _exact(values: Array) -> Row:
    return [Fraction(float(value)) for value in values]


def _dot(a: Row, b: Row) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=False) if x), Fraction(0))
