"""The affine forms of a problem, and which sign each option asks of each form.

Equations and inequalities of all options, and those that hold in every cell, are affine forms of
the unknowns; many appear several times, with either sign. Each form is listed once. To choose an
option is to ask more signs: a form asked to be >= 0 and <= 0 has to vanish.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeAlias, final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array
from pwscont.enumeration.choices import Subspace
from pwscont.enumeration.options import Option, Problem

Asked: TypeAlias = npt.NDArray[np.int8]

#: What may be asked of a form, as bits: both of them mean that it vanishes.
ANY, NOT_NEGATIVE, NOT_POSITIVE, ZERO = 0, 1, 2, 3
#: Digits to which rows of unit length agree that are one form.
DIGITS = 12


@final
@dataclass(frozen=True, slots=True, eq=False)
class Forms:
    """Affine forms ``rows @ s + constants`` of q unknowns s.

    Attributes
    ----------
    rows, constants : ndarray, shapes (N, q) and (N,)
        Rows have length one, or zero; the last q forms are the unknowns themselves.
    always : ndarray of int8, shape (N,)
        The signs that every solution has.
    options : ndarray of int8, shape (k, m, N)
        The signs that each option of each block asks; blocks may have less than m options.
    numbers : ndarray of int, shape (k,)
        How many options each block has.
    """

    rows: Array
    constants: Array
    always: Asked
    options: Asked
    numbers: npt.NDArray[np.intp]

    @classmethod
    def of(cls, problem: Problem, blocks: Sequence[Sequence[Option]], space: Subspace) -> Forms:
        """Return the forms of some blocks of a problem on a subspace."""
        table = _Table(space)
        always = table.asked([(problem.A, problem.b, NOT_NEGATIVE)])
        asked = [
            [table.asked([(o.E, o.e, ZERO), (o.G, o.g, NOT_NEGATIVE)]) for o in options]
            for options in blocks
        ]
        rows, constants = table.forms()
        options = np.zeros((len(blocks), max(map(len, blocks)), len(rows)), dtype=np.int8)
        for k, block in enumerate(asked):
            for m, signs in enumerate(block):
                options[k, m] = _bits(signs, len(rows))
        return cls(
            rows, constants, _bits(always, len(rows)), options, np.array([*map(len, blocks)])
        )

    def values(self, points: Array) -> Array:
        """Return all forms at points, shapes (M, q) and (M, N)."""
        values: Array = points @ self.rows.T + self.constants
        return values


@final
class _Table:
    """Forms met so far on a subspace."""

    def __init__(self, space: Subspace) -> None:
        self._space = space
        self._places: dict[bytes, int] = {}
        self._rows: list[Array] = []

    def asked(self, groups: Iterable[tuple[Array, Array, int]]) -> list[tuple[int, int]]:
        """Return the place of each form of some groups, with the signs asked of it."""
        return list(chain.from_iterable(self._group(*group) for group in groups))

    def _group(self, matrix: Array, vector: Array, sign: int) -> list[tuple[int, int]]:
        rows = np.column_stack(
            [matrix @ self._space.directions, matrix @ self._space.start + vector]
        )
        lengths = np.linalg.norm(rows[:, :-1], axis=1)
        lengths[lengths <= 10.0**-DIGITS] = 1.0
        return [self._place(row, sign) for row in rows / lengths[:, np.newaxis]]

    def _place(self, row: Array, sign: int) -> tuple[int, int]:
        rounded = np.round(row, DIGITS) + 0.0
        if (place := self._places.get(rounded.tobytes())) is not None:
            return place, sign
        if (place := self._places.get((0.0 - rounded).tobytes())) is not None:
            return place, _negated(sign)
        self._places[rounded.tobytes()] = len(self._rows)
        self._rows.append(row)
        return len(self._rows) - 1, sign

    def forms(self) -> tuple[Array, Array]:
        """Return the rows and constants of all forms, then of the unknowns."""
        q = self._space.directions.shape[1]
        forms = np.vstack([*self._rows, np.eye(q, q + 1)])
        return forms[:, :-1].copy(), forms[:, -1].copy()


def _negated(sign: int) -> int:
    return {NOT_NEGATIVE: NOT_POSITIVE, NOT_POSITIVE: NOT_NEGATIVE}.get(sign, sign)


def _bits(asked: Iterable[tuple[int, int]], number: int) -> Asked:
    signs = np.zeros(number, dtype=np.int8)
    for place, sign in asked:
        signs[place] |= sign
    return signs
