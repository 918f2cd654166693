"""Elimination in integers, without rounding (Bareiss 1968).

Doubles are rational: rows are made rows of integers, and fraction-free elimination leaves integers
whose quotients are the solution. Linear dependence of rows is decided exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

from pwscont.basics.arrays import Array

Row: TypeAlias = list[int]

#: Most multiplications of integers in an elimination, which take a few seconds.
MOST_WORK = 5_000_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Echelon:
    """Eliminated rows, each row with the column of the pivot; the first n columns are unknowns'."""

    n: int
    rows: tuple[Row, ...] = ()
    columns: tuple[int, ...] = ()
    level: int = 1  # the determinant of the rows eliminated before the first row

    def extended(self, rows: Sequence[Row]) -> Echelon | None:
        """Return the echelon with more rows, None for rows that depend on each other."""
        echelon = self
        for given in rows:
            row = echelon.reduced(given)
            column = next((j for j in range(self.n) if row[j]), None)
            if column is None:
                return None
            known = (*echelon.rows, row), (*echelon.columns, column)
            echelon = Echelon(self.n, *known, self.level)
        return echelon

    def reduced(self, row: Row) -> Row:
        """Return the determinant times a row, less multiples of the eliminated rows."""
        level = before = self.level
        for known, column in zip(self.rows, self.columns, strict=True):
            pivot, factor = known[column], row[column]
            if factor:
                row = [(pivot * a - factor * b) // level for a, b in zip(row, known, strict=True)]
                level = pivot
            before = pivot
        return row if level == before else [a * before // level for a in row]

    @property
    def determinant(self) -> int:
        """The determinant of the rows in order, with the columns in the order of the pivots."""
        return self.rows[-1][self.columns[-1]] if self.rows else self.level

    def solved(self, side: int, D: int | None = None, y: Row | None = None) -> Row:
        """Return y, integers with A y + D b = 0, for the right side b in a given column.

        ``D``: a multiple of the determinant that makes y integers; default the determinant.
        ``y``: the unknowns without a pivot, among n; default zeros.
        """
        D, y = self.determinant if D is None else D, [0] * self.n if y is None else [*y]
        for row, column in zip(self.rows[::-1], self.columns[::-1], strict=True):
            rest = sum(a * b for a, b in zip(row, y, strict=False) if b)
            y[column] = -(D * row[side] + rest) // row[column]
        return y


def independent(rows: Array) -> list[bool]:
    """Tell for each row, shape (k, n), whether the row is independent of the rows before."""
    echelon, found = Echelon(rows.shape[1]), []
    for row in rows:
        longer = echelon.extended([integers(row)])
        echelon = longer or echelon
        found.append(longer is not None)
    return found


def integers(values: Array) -> Row:
    """Return a row times the least power of two that makes all entries integers."""
    ratios = [float(value).as_integer_ratio() for value in values]
    common = max(denominator for _, denominator in ratios)
    return [numerator * (common // denominator) for numerator, denominator in ratios]
