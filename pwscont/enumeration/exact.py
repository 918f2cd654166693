"""All solutions of one slice in exact arithmetic, for the numbers that the system returns.

At fixed alpha selections and tests are affine in z with coefficients that are doubles, hence
rational. Each row is made one of integers, and Bareiss's fraction-free elimination (1968) leaves
integers whose quotients are the solution: no rounding, whatever the condition, and the sign of
the determinant as well. Choices of modes share the elimination of the blocks decided before.

Refinement with exact residuals would end at the same solution in nearly every cell, but does not
tell a singular cell from a nearly singular one, nor on which side of an interface a solution lies
that is closer to it than rounding.

Failure modes and answers
-------------------------
- Cost: the integers grow by 53 bits and more for each row, and all cells are tried. Beyond
  MOST_WORK nothing is done, and the caller says so.
- The system's own numbers are rounded: selections that agree on an interface do so to rounding
  only. A solution that close to an interface may lie in both cells: it is found twice, and merged
  by its error. Or it lies in neither cell: cells that miss their solution by no more than its
  error are counted as undecided, unless the solution was found in another cell.
- Cells with infinitely many solutions: counted, not solved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, dense
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS
from pwscont.enumeration.echelon import MOST_WORK, Echelon, Row, integers
from pwscont.enumeration.options import affine, aside, bounding, most_modes
from pwscont.system.blocks import Block
from pwscont.system.system import SlicewiseLinearSystem

#: A solution is far outside its cell if a test is negative by more than this part of its terms.
FAR = 0.1


def is_affordable(system: SlicewiseLinearSystem) -> bool:
    """Tell whether all cells can be tried in seconds."""
    cells, eliminations, n = 1, 0, system.size
    for block in _ordered(system):
        cells *= len(block.modes)
        eliminations += cells * len(block.rows) * n * n
    return eliminations + cells * n * n <= MOST_WORK


def _ordered(system: SlicewiseLinearSystem) -> list[Block]:
    return sorted(system.blocks(), key=lambda block: len(block.modes))


@final
@dataclass(frozen=True, slots=True, eq=False)
class ExactSolution:
    """The solution of the equations of one cell, which lies in the cell or not far outside.

    Attributes
    ----------
    z : ndarray, shape (n,)
        Correctly rounded.
    exactly : tuple of Fraction
        The same, not rounded.
    error : ndarray, shape (n, n)
        The error by the rounding of each equation, one row per equation.
    character : Character
    det_sign : int
    is_inside : bool
        Whether no bounding test is negative there.
    """

    z: Array
    exactly: tuple[Fraction, ...]
    error: Array
    character: Character
    det_sign: int
    is_inside: bool


@final
class ExactSlice:
    """The rows of all modes and all tests at one alpha, as integers.

    Parameters
    ----------
    system : SlicewiseLinearSystem
    scale : ndarray, shape (n,)
        Typical magnitudes of z.
    alpha : float
    """

    def __init__(self, system: SlicewiseLinearSystem, scale: Array, alpha: float) -> None:
        self._n, self._scale, self._blocks = system.size, scale, _ordered(system)
        zero = np.zeros(system.size)
        dx, modes = aside(scale), range(most_modes(self._blocks))
        slices = [affine(system, self._blocks, k, alpha, dx) for k in modes]
        self._rows = [np.column_stack([jacobian, value]) for jacobian, value in slices]
        gradients = dense(system.test_jacobian(zero, alpha))[:, :-1]
        self._tests = np.column_stack([gradients, system.test_functions(zero, alpha)])
        self._bounding = [
            [bounding(system, block, mode, len(self._tests)) for mode in block.modes]
            for block in self._blocks
        ]
        taken = [row for block in self._blocks for row in block.rows]
        self._common = np.setdiff1d(np.arange(system.size), taken).tolist()
        self._order = [*self._common, *taken]

    @property
    def is_finite(self) -> bool:
        """Whether all numbers are finite, and so rational."""
        return all(np.isfinite(rows).all() for rows in (*self._rows, self._tests))

    def solutions(self) -> Iterator[ExactSolution]:
        """Yield the solution of every regular cell that lies in it, or not far outside."""
        self._integers = [[integers(row) for row in rows] for rows in self._rows]
        self._integer_tests = [integers(row) for row in self._tests]
        start = Echelon(self._n).extended([self._integers[0][i] for i in self._common])
        for picks, echelon in self._descend((), start) if start else ():
            found = self._at(picks, echelon)
            if found is not None:
                yield found

    def _descend(
        self, picks: tuple[int, ...], echelon: Echelon
    ) -> Iterator[tuple[tuple[int, ...], Echelon]]:
        if len(picks) == len(self._blocks):
            yield picks, echelon
            return
        block = self._blocks[len(picks)]
        for k in range(len(block.modes)):
            longer = echelon.extended([self._integers[k][i] for i in block.rows])
            if longer is not None:
                yield from self._descend((*picks, k), longer)

    def _at(self, picks: tuple[int, ...], echelon: Echelon) -> ExactSolution | None:
        """Return the solution of a cell, None where it is far outside."""
        y, D = echelon.solved(self._n), echelon.determinant
        exactly = tuple(Fraction(value, D) for value in y)
        z = np.array([_float(value) for value in exactly])
        worst = self._worst(picks, y, D, z) if np.isfinite(z).all() else -np.inf
        if worst <= -FAR:
            return None
        error, signs = self._error(picks, z), self._signs(picks)
        parity = _parity(self._order) * _parity(echelon.columns)
        det_sign = parity if D > 0 else -parity
        return ExactSolution(z, exactly, error, Character(signs), det_sign, worst >= 0.0)

    def _signs(self, picks: tuple[int, ...]) -> tuple[bool, ...]:
        signs = [True] * len(self._tests)
        for block, pick in zip(self._blocks, picks, strict=True):
            for test, sign in zip(block.tests, block.modes[pick], strict=True):
                signs[test] = sign
        return tuple(signs)

    def _worst(self, picks: tuple[int, ...], y: Row, D: int, z: Array) -> float:
        """Return the most negative bounding test relative to its terms; exactly zero if none is."""
        signs, worst = self._signs(picks), 0.0
        for tests, pick in zip(self._bounding, picks, strict=True):
            for test in tests[pick]:
                row = self._integer_tests[test]
                value = sum(a * b for a, b in zip(row, (*y, D), strict=True))
                if value and ((value > 0) == (D > 0)) != signs[test]:
                    terms = np.abs(self._tests[test]) @ np.append(np.abs(z) + self._scale, 1.0)
                    exact = abs(self._tests[test][-1] + self._tests[test][:-1] @ z) / terms
                    worst = min(worst, -max(float(exact), np.finfo(float).tiny))
        return worst

    def _error(self, picks: tuple[int, ...], z: Array) -> Array:
        """Return the columns of the inverse times the rounding of the rows, as rows."""
        rows = np.array(self._rows[0])
        for block, pick in zip(self._blocks, picks, strict=True):
            rows[list(block.rows)] = self._rows[pick][list(block.rows)]
        rounding = EPS * (np.abs(rows) @ np.append(np.abs(z), 1.0))
        unit = np.eye(self._n)
        longer = [integers(np.append(row, unit[i])) for i, row in enumerate(rows)]
        echelon = Echelon(self._n).extended(longer)
        assert echelon is not None, "the cell is regular"
        D = echelon.determinant
        columns = [echelon.solved(self._n + 1 + i) for i in range(self._n)]
        inverse = np.array([[_float(Fraction(y, D)) for y in column] for column in columns])
        error: Array = inverse * rounding[:, np.newaxis]
        return error


def _float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def _parity(order: Sequence[int]) -> int:
    """Return the sign of a permutation: that of the number of its cycles of even length."""
    rest, sign = set(range(len(order))), 1
    while rest:
        length, i = 0, rest.pop()
        first = i
        while (i := order[i]) != first:
            rest.discard(i)
            length += 1
        sign = -sign if length % 2 else sign
    return sign
