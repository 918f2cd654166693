"""Enumeration part by part, along the graph of rows and the unknowns in each row.

The strongly connected components of this graph, in topological order, are the parts: each part
depends on earlier parts only, and a search over all modes is exponential in the largest part only.
For each solution of the parts before, a part is a small slice, whose constants have the error of
that solution. A part with a single unknown is solved mode by mode, by a division: in a chain of
such parts magnitudes may fall until no typical magnitude can be told. If a part cannot be decided,
the whole slice is solved at once. A solution found part by part is refined in the whole system, and
must lie in the closed cell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from itertools import product
from typing import final

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from pwscont.basics.arrays import Array, Indices, Matrix, Signs
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.curve.error_samples import zero_up_to
from pwscont.curve.newton import Root
from pwscont.enumeration.options import Table
from pwscont.enumeration.polyhedron import Cells, Point, Slice
from pwscont.system.system import Block, SlicewiseLinearSystem, number_of_cells


@final
@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Rows and unknowns that depend on each other."""

    rows: Indices  # shape (k,)
    unknowns: Indices
    blocks: tuple[int, ...]  # the blocks with rows in the part; empty for a linear part


def parts_of_table(table: Table) -> list[Part]:
    """Return the parts of a slice, each part after the parts on which the part depends."""
    pattern = np.any([matrix != 0.0 for matrix, _ in table.rows], axis=0)
    tests, blocks, n = table.tests[0] != 0.0, table.blocks, len(pattern)
    whole = [Part(np.arange(n), np.arange(n), tuple(range(len(blocks))))]
    if len(blocks) < 2 or not all(block.rows for block in blocks):
        return whole
    unknown_of = maximum_bipartite_matching(sp.csr_matrix(pattern), perm_type="column")
    if (unknown_of < 0).any():
        return whole
    needs = pattern.copy()
    for block in blocks:
        own = list(block.rows)
        needs[own] |= tests[list(block.tests)].any(axis=0) | pattern[own].any(axis=0)
        needs[np.ix_(own, unknown_of[own])] = True
    needs = needs[:, unknown_of]  # row by row
    _, label = connected_components(sp.csr_matrix(needs), directed=True, connection="strong")
    needed_by = {int(number): set[int]() for number in np.unique(label)}
    for part, needed in label[np.argwhere(needs)].tolist():
        if part != needed:
            needed_by[part].add(needed)
    parts = []
    for number in TopologicalSorter(needed_by).static_order():
        rows = np.flatnonzero(label == number)
        inside = tuple(i for i, block in enumerate(blocks) if label[block.rows[0]] == number)
        parts.append(Part(rows, unknown_of[rows], inside))
    return parts


def most_cells(parts: Sequence[Part], blocks: Sequence[Block]) -> int:
    """Return the largest number of combinations of modes in a part."""
    return max(number_of_cells(blocks[i] for i in part.blocks) for part in parts)


#: Constants below this fraction of typical constants are as good as zero: typical magnitudes stay.
TINY_CONSTANTS = 1e-150
#: Most cells of a part that is checked for regularity, to bound the time.
MOST_CELLS_CHECKED = 4**6


@final
@dataclass(frozen=True, slots=True, eq=False)
class Partial:
    """A solution of some parts."""

    z: Array  # zero for the unknowns of later parts, shape (n,)
    error: Array  # samples of the error of z, shape (k, n)
    #: For each part the cells of that part in whose closure the solution lies.
    cells: tuple[Sequence[Character], ...] = ()
    #: Whether rounding leaves open, in some part, in which cells the solution lies.
    in_doubt: bool = False

    def with_part(self, part: Part, point: Point) -> Partial:
        """Return the solution with the unknowns of a further part."""
        z, error = self.z.copy(), np.zeros((len(point.error), len(self.z)))
        z[part.unknowns] = point.x[:-1]
        error[-len(self.error) :] = self.error  # the last samples come from the parts before
        error[:, part.unknowns] = point.error[:, :-1]
        in_doubt = self.in_doubt or bool(point.in_doubt)
        return Partial(z, error, (*self.cells, point.characters), in_doubt)


@final
class PartSlice(SlicewiseLinearSystem):
    """A part of a slice, where all parts before have a known solution."""

    def __init__(self, table: Table, part: Part, before: Partial) -> None:
        self.size, self.unknowns = len(part.unknowns), part.unknowns
        old_blocks = [table.blocks[i] for i in part.blocks]
        old_tests = [test for block in old_blocks for test in block.tests]
        place, row = ({int(i): k for k, i in enumerate(some)} for some in (old_tests, part.rows))
        blocks = tuple(
            Block(tuple(place[t] for t in b.tests), tuple(row[r] for r in b.rows), b.modes)
            for b in old_blocks
        )
        bounding = [[[place[t] for t in tests] for tests in table.bounding[i]] for i in part.blocks]
        rows = [(J[part.rows], r[part.rows]) for J, r in table.rows]
        K, tests = (values[old_tests] for values in table.tests)
        *forms, last = ((J[:, part.unknowns], J @ before.z + r) for J, r in [*rows, (K, tests)])
        #: The part in numbers.
        self.table = Table(forms, last, blocks, bounding)
        known = np.abs(before.z)
        #: Sizes of the terms of the constants, the largest of all modes.
        self._terms = np.max([np.abs(J) @ known + np.abs(r) for J, r in rows], axis=0)
        #: For every mode, the errors that the samples of the error before make on the right side.
        self._errors = [-J @ before.error.T for J, _ in rows]
        #: How far from zero tests may be because of the error of the parts before.
        self.inherited_slack: Array = zero_up_to(K, known, before.error)
        self.inherited_slack += CONFIDENCE * EPS * np.abs(tests)

    @classmethod
    def whole(cls, table: Table) -> PartSlice:
        """Return exact rows as one part, without inherited errors; tests in the blocks' order."""
        n, every = len(table.rows[0][1]), tuple(range(len(table.blocks)))
        nothing = Partial(np.zeros(n), np.zeros((0, n)))
        part = cls(table, Part(np.arange(n), np.arange(n), every), nothing)
        part._terms = np.zeros(n)
        return part

    def blocks(self) -> tuple[Block, ...]:
        """Return the blocks of the part."""
        return self.table.blocks

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the tests of the blocks of the part."""
        return self.table.tests[0] @ z + self.table.tests[1]

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients of these tests, with a column of zeros for the idle parameter."""
        return _with_zeros(self.table.tests[0])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows of the part."""
        matrix, constants, _ = self._in_cell(character)
        return matrix @ z + constants

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant Jacobian, with a column of zeros for the idle parameter."""
        return _with_zeros(self._in_cell(character)[0])

    def bounding_tests(self, character: Character) -> list[int]:
        """Return the tests of each block that bound the block's mode."""
        bounding = zip(self.table.bounding, self._modes(character), strict=True)
        return [test for bounds, mode in bounding for test in bounds[mode]]

    def _modes(self, character: Character) -> list[int]:
        """Return the number of the mode of each block."""
        signs, blocks = character.signs, self.table.blocks
        return [block.modes.index(tuple(signs[i] for i in block.tests)) for block in blocks]

    def _in_cell(self, character: Character) -> list[Array]:
        """Return the rows of a cell: the matrix, the constants and the errors of the right side."""
        modes, rows = self._modes(character), [block.rows for block in self.table.blocks]
        parts = *zip(*self.table.rows, strict=True), self._errors
        return [in_modes(part, rows, modes) for part in parts]

    def scalar_root(self, character: Character, scale: float) -> _Root | None:
        """Solve a mode for the only unknown; None if the mode leaves the unknown free."""
        matrix, constants, inherited = self._in_cell(character)
        slope = float(matrix[0, 0])
        if slope == 0.0:
            return None
        x = -float(constants[0]) / slope
        errors = np.append(EPS * self._terms[0], inherited[0])  # those of parts before come last
        error = np.append(EPS * abs(x), errors / slope)
        gradients, values = self.table.tests[0][:, 0], self.table.tests[1]
        column, sizes = gradients[:, np.newaxis], np.array([abs(x) + scale / CONFIDENCE])
        slack = self.inherited_slack + zero_up_to(column, sizes, error[:, np.newaxis])
        return _Root(x, error, 1 if slope > 0.0 else -1, gradients * x + values, slack)

    def inherited_error(self, root: Root, character: Character) -> Array:
        """Return the errors of a root by the errors of the parts before, shape (k, size + 1)."""
        own = np.diag(EPS * self._terms)[self._terms > 0.0]
        residual = _with_zeros(np.vstack([own, self._in_cell(character)[2].T]))
        return root.factor.solve_all(residual) if len(residual) else residual

    def magnitudes(self, scale: Array) -> Array:
        """Return typical magnitudes of the unknowns, small where the constants of the part are."""
        usual = np.abs(self.table.rows[0][0]) @ scale
        part = float((self._terms / np.where(usual > 0.0, usual, 1.0)).max(initial=0.0))
        return scale * part if TINY_CONSTANTS < part < 1.0 else scale


def _with_zeros(rows: Array) -> Array:
    """Return rows with a zero for the idle parameter."""
    return np.column_stack([rows, np.zeros(len(rows))])


def solve_scalar(part: PartSlice, scale: float) -> Slice | None:
    """Return all solutions of a part with one unknown; None if a mode leaves the unknown free."""
    modes = part.blocks()[0].modes if part.blocks() else ((),)
    found: list[_Root] = []
    for character in map(Character, modes):
        tests = np.array(part.bounding_tests(character), dtype=np.intp)
        side = character.array[tests]
        known = next((root for root in found if root.lies_in(tests, side)), None)
        if known is None:
            known = part.scalar_root(character, scale)
            if known is None:
                return None
            if not known.lies_in(tests, side):
                continue
            found.append(known)
        known.cells.append(character)
        known.in_doubt |= not known.lies_in(tests, side, inside=True)
    return Slice(tuple(root.point() for root in found), ())


@final
@dataclass(slots=True, eq=False)
class _Root:
    """The solution of a mode."""

    x: float
    error: Array
    sign: int
    tests: Array  # the values of all tests
    slack: Array  # the errors of these values
    cells: list[Character] = field(default_factory=list)
    in_doubt: bool = False

    def lies_in(self, tests: Indices, side: Signs, inside: bool = False) -> bool:
        """Tell whether the solution lies in a closed cell, or certainly inside."""
        values = np.where(side, self.tests[tests], -self.tests[tests])
        slack = self.slack[tests]
        return bool((values > slack).all() if inside else (values >= -slack).all())

    def point(self) -> Point:
        """Return the solution with an idle parameter of zero."""
        in_doubt = self.in_doubt and len(self.cells) == 1
        x, error = np.array([self.x, 0.0]), _with_zeros(self.error)
        return Point(x, error, tuple(self.cells), self.sign, (), in_doubt)


def solve_parts(
    table: Table, parts: Sequence[Part], solve: Callable[[PartSlice], Slice]
) -> list[Partial] | None:
    """Return the solutions of all parts together, None where a part cannot be decided."""
    n = len(table.rows[0][1])
    found = [Partial(np.zeros(n), np.zeros((1, n)))]
    for part in parts:
        longer: list[Partial] = []
        for before in found:
            check_budget()
            slice_ = solve(PartSlice(table, part, before))
            if slice_.faces or slice_.undecided:
                return None
            longer += [before.with_part(part, point) for point in slice_.points]
        found = longer
    return found


def cells_of(table: Table, parts: Sequence[Part], found: Partial) -> Cells:
    """Return the cells of the system in whose closure a solution lies."""
    tests = [[t for i in part.blocks for t in table.blocks[i].tests] for part in parts]

    def cell(picks: Sequence[int]) -> Character:
        character = Character([True] * len(table.tests[1]))
        for own, cells, pick in zip(tests, found.cells, picks, strict=True):
            character = character.with_signs(own, cells[pick].signs)
        return character

    return Cells([len(cells) for cells in found.cells], cell)


def is_regular(
    table: Table, parts: Sequence[Part], scale: Array, *, of_one_sign: bool = False
) -> bool:
    """Tell whether every part is small, and has a regular matrix in each cell of the part.

    Then zero is the only solution of H = 0 with all constants zero. ``of_one_sign``: the
    determinants of a part must have one sign as well: then no branch of straight pieces turns.
    """
    for part in parts:
        blocks, signs = [table.blocks[i] for i in part.blocks], set[float]()
        if number_of_cells(blocks) > MOST_CELLS_CHECKED:
            return False
        place = {int(row): i for i, row in enumerate(part.rows)}
        rows, units = [[place[row] for row in block.rows] for block in blocks], scale[part.unknowns]
        matrices = [J[np.ix_(part.rows, part.unknowns)] * units for J, _ in table.rows]
        for picks in product(*(range(len(block.modes)) for block in blocks)):
            matrix = in_modes(matrices, rows, picks)
            sizes = np.abs(matrix).max(axis=1, keepdims=True)
            unit = matrix / np.where(sizes > 0.0, sizes, 1.0)
            if np.linalg.matrix_rank(unit, tol=GUARD * EPS * len(matrix)) < len(matrix):
                return False
            signs.add(float(np.linalg.slogdet(unit).sign) if of_one_sign else 1.0)
            if len(signs) > 1:
                return False
    return True


def in_modes(wholes: Sequence[Array], rows: Sequence[Sequence[int]], modes: Sequence[int]) -> Array:
    """Return the rows of a cell; the rows of a block in mode k stand in the k-th of ``wholes``."""
    chosen = +wholes[0]
    for block, mode in zip(rows, modes, strict=True):
        chosen[list(block)] = wholes[mode][list(block)]
    return chosen
