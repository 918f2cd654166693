"""A corner, and the cells that meet there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, Signs, generic
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.selection import Selection
from pwscont.system.system import Block, PiecewiseSystem, SlicewiseLinearSystem

#: A direction d of length one in the metric, and the cells whose closures contain d.
Direction: TypeAlias = tuple[Array, tuple[Character, ...]]

#: A slope smaller than this part of the sum of the magnitudes of its terms may be zero.
SLANT = EPS**0.5
#: Error of a component of a unit direction, in typical magnitudes and divided by SLANT, because
#: SLANT multiplies this error: a component that should be zero is not compared with itself.
NOISE = GUARD * EPS / SLANT


@final
@dataclass(frozen=True, slots=True, eq=False)
class Corner:
    """A solution at which test functions vanish."""

    system: PiecewiseSystem
    metric: Metric
    x: Array  # shape (n + 1,)
    error: Array  # samples of the error of ``x``, shape (k, n + 1)
    zero: frozenset[int]  # the tests that vanish
    #: Shape (m,): whether each test is positive; the signs of vanishing tests mean nothing.
    signs: Signs

    @classmethod
    def at(
        cls,
        system: PiecewiseSystem,
        metric: Metric,
        x: Array,
        error: Array,
        zero: frozenset[int],
    ) -> Corner:
        """Return the corner at ``x``, with the signs that the tests have there."""
        signs = system.test_functions(x[:-1], float(x[-1])) >= 0.0
        return cls(system, metric, x, error, zero, signs)

    @property
    def character(self) -> Character:
        """The character of the signs of the tests, those that vanish included."""
        return Character(tuple(self.signs.tolist()))

    def all_cells(self) -> list[Character]:
        """Return a character for each cell, from all sign patterns of the vanishing tests."""
        cells: dict[bytes, Character] = {}
        here, tests = self.character, sorted(self.zero)
        for signs in product((False, True), repeat=len(tests)):
            character = here.with_signs(tests, signs)
            cells.setdefault(self.system.cell(character), character)
        return list(cells.values())

    def restricted(self, blocks: Iterable[Block]) -> list[Block]:
        """Return blocks of the system with only the modes of cells that meet at the corner."""
        here = self.character

        def meets(block: Block, mode: tuple[bool, ...]) -> bool:
            """Tell whether a mode agrees with the signs of the tests that do not vanish."""
            there, fixed = here.with_signs(block.tests, mode), set(block.tests) - self.zero
            bounding = fixed.intersection(self.system.bounding_tests(there))
            return all(there.array[i] == here.array[i] for i in bounding)

        return [Block(b.tests, b.rows, tuple(m for m in b.modes if meets(b, m))) for b in blocks]

    def direction_in(self, selection: Selection) -> Array | None:
        """Return the null vector d of J_chi, None where J_chi has several to rounding."""
        x, metric = self.x, self.metric
        factor = bordered(selection.jacobian(x), generic(len(x)) / metric.scale, metric.binary)
        return None if factor.is_singular() else metric.normalised(factor.solve(last_unit(len(x))))

    def slopes_along(self, selection: Selection, direction: Array) -> Array:
        """Return the slopes along d of vanishing bounding tests, 0 for slopes within rounding."""
        vanish = [int(test) in self.zero for test in selection.bounding]
        rows = selection.test_gradients(self.x)[np.flatnonzero(vanish)]
        slopes: Array = rows @ direction
        least = SLANT * (abs(rows) @ (np.abs(direction) + NOISE * self.metric.scale))
        return np.where(np.abs(slopes) > least, slopes, 0.0)


def has_named_cells(system: PiecewiseSystem) -> bool:
    """Tell whether a system says which cells there are, by blocks or by its own ``cells``."""
    by_blocks = (
        isinstance(system, SlicewiseLinearSystem)
        and type(system).blocks is not SlicewiseLinearSystem.blocks
    )
    return by_blocks or type(system).cells is not PiecewiseSystem.cells
