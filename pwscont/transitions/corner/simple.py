"""Corners at which every cell has one ray at most: cell by cell, by a solve and some signs.

Most corners are like this, above all those of symmetric bodies, where two nodes change their modes
together: few cells meet, and in each J_chi d = 0 has one solution d but for its length. d is a ray
if the tests that vanish grow along it into the cell (docs/theory, F8). The matrices are those of
the paths themselves, so that structure and updates of factorisations serve here as well.

Failure modes and answers
-------------------------
- A cell has more than one null vector, or a test stays zero along one: the corner may be
  degenerate, and is left to the cone problem, :mod:`pwscont.transitions.corner.cone`.
- A slope is nothing but rounding: left to the cone problem, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, generic
from pwscont.basics.character import Character
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.selection import Selection
from pwscont.system.system import Block, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions.corner.complementary import NOISE, SLANT, rays_by_switches, switches

#: A direction d of length one in the metric, and the cells that it belongs to.
Direction: TypeAlias = tuple[Array, tuple[Character, ...]]

#: Corners with up to this many cells are tried cell by cell at first.
FEW_CELLS = 64
#: Most vanishing tests of a system without blocks, whose cells are gone through one by one.
MANY_TESTS = 12


def simple_corner(
    system: PiecewiseSystem, metric: Metric, x: Array, zero: frozenset[int]
) -> list[Direction] | None:
    """Return the directions of all rays, cell by cell, or None at a corner that is not simple.

    In each cell J_chi d = 0 has one solution but for its length, and the signs of the slopes of
    the tests that vanish say whether d, or -d, or neither is a ray. The corner is not simple where
    a cell has more solutions, where a slope vanishes, or where there are many cells.
    """
    if not isinstance(system, SlicewiseLinearSystem) or not zero:
        return None
    here = Character.of(system.test_functions(x[:-1], float(x[-1])))
    if not names_its_cells(system):
        if len(zero) > MANY_TESTS:
            return None
        return _cell_by_cell(system, metric, x, zero, all_cells(system, here, zero))
    blocks = [block for block in system.blocks() if not zero.isdisjoint(block.tests)]
    choices = [
        [mode for mode in block.modes if Admits(system, block, list(here.signs), zero)(mode)]
        for block in blocks
    ]
    if prod(map(len, choices)) > FEW_CELLS:
        return None
    cells = [_with_modes(here, blocks, modes) for modes in product(*choices)]
    pairs = switches(system, here, blocks, choices, zero)
    by_switches = rays_by_switches(system, metric, x, cells[0], pairs) if pairs else None
    return _cell_by_cell(system, metric, x, zero, cells) if by_switches is None else by_switches


def _cell_by_cell(
    system: PiecewiseSystem,
    metric: Metric,
    x: Array,
    zero: frozenset[int],
    cells: Sequence[Character],
) -> list[Direction] | None:
    found: list[Direction] = []
    for character in cells:
        selection = Selection(system, character)
        direction = only_direction(selection, metric, x)
        if direction is None:
            return None
        slopes = slopes_along(selection, metric, x, direction, zero)
        if not (len(slopes) and slopes.all()):
            return None
        if (slopes > 0.0).all() or (slopes < 0.0).all():
            found.append((np.copysign(1.0, slopes[0]) * direction, (character,)))
    return found


def names_its_cells(system: PiecewiseSystem) -> bool:
    """Tell whether a system says which cells there are, not only by the number of its tests."""
    by_blocks = (
        isinstance(system, SlicewiseLinearSystem)
        and type(system).blocks is not SlicewiseLinearSystem.blocks
    )
    return by_blocks or type(system).cells is not PiecewiseSystem.cells


def all_cells(system: PiecewiseSystem, here: Character, zero: frozenset[int]) -> list[Character]:
    """Return a character for each cell that meets where the tests ``zero`` vanish."""
    cells: dict[bytes, Character] = {}
    for signs in product((False, True), repeat=len(zero)):
        character = here.with_signs(sorted(zero), signs)
        cells.setdefault(system.cell(character), character)
    return list(cells.values())


def _with_modes(
    here: Character, blocks: Sequence[Block], modes: Sequence[tuple[bool, ...]]
) -> Character:
    """Return a character with the signs of some blocks replaced."""
    for block, mode in zip(blocks, modes, strict=True):
        here = here.with_signs(block.tests, mode)
    return here


def only_direction(selection: Selection, metric: Metric, x: Array) -> Array | None:
    """Return the null vector of J_chi, None where there are several to rounding."""
    factor = bordered(selection.jacobian(x), generic(len(x)) / metric.scale, metric.binary)
    return None if factor.is_singular() else metric.normalised(factor.solve(last_unit(len(x))))


def slopes_along(
    selection: Selection, metric: Metric, x: Array, direction: Array, zero: frozenset[int]
) -> Array:
    """Return the slopes along d of the bounding tests that vanish; zero for those that may be."""
    vanish = [int(test) in zero for test in selection.bounding]
    rows = selection.test_gradients(x)[np.flatnonzero(vanish)]
    slopes: Array = rows @ direction
    least = SLANT * (abs(rows) @ (np.abs(direction) + NOISE * metric.scale))
    return np.where(np.abs(slopes) > least, slopes, 0.0)


@final
@dataclass(frozen=True, slots=True)
class Admits:
    """Tells whether a mode of a block belongs to a cell that meets at the corner."""

    system: PiecewiseSystem
    block: Block
    signs: list[bool]
    zero: frozenset[int]

    def __call__(self, mode: tuple[bool, ...]) -> bool:
        """Tell whether a mode agrees with the signs of the tests that do not vanish."""
        signs = list(self.signs)
        for test, sign in zip(self.block.tests, mode, strict=True):
            signs[test] = sign
        bounding = set(self.system.bounding_tests(Character(tuple(signs)))) & set(self.block.tests)
        return all(signs[i] == self.signs[i] for i in bounding - self.zero)
