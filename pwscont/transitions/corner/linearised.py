"""The equations near a point where test functions vanish, to first order: H'(x; d) = e.

They are piecewise linear in the direction d. With e = 0 their solutions are the rays that leave the
point (:mod:`pwscont.transitions.corner.cone`); with a small generic e they tell how the solution
behaves under small changes of H (:mod:`pwscont.transitions.corner.index`).
"""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix, are_finite, by_rows, dense, generic
from pwscont.basics.character import Character
from pwscont.basics.looks import at
from pwscont.curve.metric import Metric
from pwscont.enumeration import FEW_CELLS, Table, aside, is_regular, most_cells
from pwscont.linear.factorise import last_unit
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.system.contract import jacobian_at
from pwscont.system.shapes import refuse_infinite
from pwscont.system.system import Block, PiecewiseSystem, SlicewiseLinearSystem, number_of_cells
from pwscont.transitions.corner.simple import MANY_TESTS, Admits, all_cells, names_its_cells

#: All cells at a corner are tried up to this number: eight contact nodes.
MANY_CELLS = 4**8

#: So many Jacobians are kept: those of blocks of a few modes.
FEW_KNOWN = 4


@final
class Linearised(SlicewiseLinearSystem):
    """H'(x; d) = e together with c . d = alpha, for the unknown direction d.

    Parameters
    ----------
    system : PiecewiseSystem
    metric : Metric
    x : ndarray, shape (n + 1,)
    zero : frozenset of int
        The tests that vanish; their signs along d choose the cell.
    signs : ndarray of bool
        The signs of the other tests.
    row : ndarray, shape (n + 1,), optional
        c; default a generic one.
    right : ndarray, shape (n,), optional
        e; default zero.
    """

    def __init__(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        x: Array,
        zero: frozenset[int],
        signs: npt.NDArray[np.bool_],
        row: Array | None = None,
        right: Array | None = None,
    ) -> None:
        self.size = len(x)
        self._system, self._x, self._zero = system, x, zero
        self._row = generic(len(x)) / metric.scale if row is None else row
        self._right = np.zeros(len(x) - 1) if right is None else right
        self._scale = metric.scale
        self._constant = np.where(signs, 1.0, -1.0)
        self._constant[list(zero)] = 0.0
        self._known: dict[Character, Matrix] = {}  # each cell is asked for several times in a row

    @cached_property
    def _gradients(self) -> Array:
        rows = self._system.test_jacobian(self._x[:-1], float(self._x[-1]))
        gradients = +dense(rows)
        gradients[self._constant != 0.0] = 0.0
        return gradients

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return grad(kappa_i) . d for the tests that vanish, their sign for the others."""
        values: Array = self._gradients @ z + self._constant
        return values

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients by (d, alpha)."""
        return np.column_stack([self._gradients, np.zeros(len(self._gradients))])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return (J_chi d - e, c . d - alpha)."""
        return np.append(self._rows(character) @ z - self._right, self._row @ z - alpha)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant Jacobian."""
        rows = self._rows(character)
        matrix = np.zeros((self.size, self.size + 1))
        matrix[:-1, :-1] = dense(rows)
        matrix[-1, :-1], matrix[-1, -1] = self._row, -1.0
        return matrix

    def _rows(self, character: Character) -> Matrix:
        if character not in self._known:
            if len(self._known) == FEW_KNOWN:
                self._known.clear()
            self._known[character] = self._jacobian_of(character)
        return self._known[character]

    def _jacobian_of(self, character: Character) -> Matrix:
        """Return dH/dx of a cell that meets at the corner, or refuse one that is not finite."""
        system, z, alpha = self._system, self._x[:-1], float(self._x[-1])
        jacobian = jacobian_at(system, z, alpha, character)
        if _is_finite(jacobian):
            return jacobian
        why = f"this cell meets others at {at(self._x)}, where H is continued into it"
        refuse_infinite(system, f"jacobian in {system.label(character)}", jacobian, why)
        return jacobian

    def bounding_tests(self, character: Character) -> list[int]:
        """Return the bounding tests of the cell that vanish at the corner."""
        return [i for i in self._system.bounding_tests(character) if i in self._zero]

    def scale(self, lo: float, hi: float) -> Array:
        """Return the metric's scale."""
        return self._scale

    @property
    def is_small(self) -> bool:
        """Whether all cells that meet at the point can be tried."""
        if not names_its_cells(self._system):
            return len(self._zero) <= MANY_TESTS
        blocks = self.blocks()
        if number_of_cells(blocks) <= MANY_CELLS:
            return True
        return most_cells(self.table.parts(), blocks) <= MANY_CELLS

    @cached_property
    def table(self) -> Table:
        """Return the problem as matrices, whose pattern shows its independent parts."""
        return Table.of(self, 0.0, aside(self._scale))

    def blocks(self) -> tuple[Block, ...]:
        """Return the system's blocks, with only the modes of the cells that meet at the point."""
        if not isinstance(self._system, SlicewiseLinearSystem) or not names_its_cells(self._system):
            return (self._one_block(),)
        return tuple(
            Block(block.tests, block.rows, tuple(filter(self._admits(block), block.modes)))
            for block in self._system.blocks()
        )

    def _admits(self, block: Block) -> Admits:
        signs = self._constant >= 0.0
        return Admits(self._system, block, signs.tolist(), self._zero)

    def _one_block(self) -> Block:
        """Return all cells that meet at the point as the modes of one block."""
        here = Character.of(np.where(self._constant >= 0.0, 1.0, -1.0))
        cells = [cell.signs for cell in all_cells(self._system, here, self._zero)]
        rows = tuple(range(self.size - 1))
        return Block(tuple(range(len(here.signs))), rows, tuple(cells))


def _is_finite(jacobian: Matrix) -> bool:
    """Tell whether all entries are finite; those of a structured Jacobian are not at hand."""
    if isinstance(jacobian, StructuredJacobian):
        return True
    entries = by_rows(jacobian).data if sp.issparse(jacobian) else jacobian.ravel()
    return not len(entries) or are_finite(entries)


def in_parts(
    system: PiecewiseSystem,
    metric: Metric,
    x: Array,
    zero: frozenset[int],
    signs: npt.NDArray[np.bool_],
) -> Linearised | None:
    """Return the cone problem with the length of d fixed by its alpha alone: it falls into parts.

    None where that does not help, or where a ray may be vertical and would not be seen. No ray is
    vertical if all parts are regular in all cells.
    """
    cone = Linearised(system, metric, x, zero, signs, last_unit(len(x)))
    if not names_its_cells(system):
        return None
    if number_of_cells(cone.blocks()) <= FEW_CELLS:
        return None
    parts = cone.table.parts()
    return cone if len(parts) > 1 and is_regular(cone.table, parts, metric.scale) else None
