"""Selections: the smooth function of one cell, and all cells at one point."""

from __future__ import annotations

from functools import cached_property
from typing import cast, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Matrix, Signs, dense, indices, is_anywhere
from pwscont.basics.character import Character
from pwscont.basics.looks import named, short
from pwscont.basics.rounding import EPS
from pwscont.system.contract import jacobian_at, kink_at, lent_jacobian_at, residual_at
from pwscont.system.shapes import checked_array, own_matrix
from pwscont.system.system import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    characters,
    number_of_cells,
)

#: The side of a test that is negative, and of one that is not.
SIDES = np.array([-1.0, 1.0])
#: Constant gradients of no more entries are kept.
FEW = 4096


@final
class Selection:
    """The selection H_chi of a system together with the tests that bound its cell.

    Test values are signed so that they are positive inside the cell.

    Parameters
    ----------
    system : PiecewiseSystem
    character : Character
        The frozen character chi.
    adjacent_cells : tuple of Character
        For a curve along an interface, all cells that it belongs to: their tests end it as well.
    """

    def __init__(
        self,
        system: PiecewiseSystem,
        character: Character,
        adjacent_cells: tuple[Character, ...] = (),
    ) -> None:
        self.system = system
        self.character = character
        self.adjacent_cells = adjacent_cells
        tests, inside = _bounds(system, character)
        if adjacent_cells:
            every = [(tests, inside), *(_bounds(system, cell) for cell in adjacent_cells)]
            tests, inside = (np.concatenate(parts) for parts in zip(*every, strict=True))
            first = np.sort(np.unique(tests, return_index=True)[1])
            tests, inside = tests[first], inside[first]
        self._cell: bytes | None = None
        self._gradients: Matrix | None = None
        self.bounding: Indices = tests
        #: +1 or -1 for each bounding test, by which it is positive inside.
        self.side: Array = SIDES.take(inside.view(np.uint8))

    def __repr__(self) -> str:
        return named(self, short(self.label), f"of {type(self.system).__name__}")

    @cached_property
    def is_straight(self) -> bool:
        """Whether the selection and its tests are affine, so that its curve is a straight line."""
        return isinstance(self.system, PiecewiseLinearSystem)

    @cached_property
    def knows_jacobian(self) -> bool:
        """Whether the system gives derivatives of its own, and not differences."""
        return knows_jacobian(self.system)

    @property
    def cell(self) -> bytes:
        """The signs that name this selection."""
        if self._cell is None:
            own = self.adjacent_cells or type(self.system).cell is not PiecewiseSystem.cell
            named = self.system.cell(self.character) if own else None
            self._cell = self.character.among(self.bounding) if named is None else named
        return self._cell

    @cached_property
    def adjacent_names(self) -> tuple[bytes, ...]:
        """The signs that name each of the cells that a curve along an interface belongs to."""
        return tuple(self.system.cell(character) for character in self.adjacent_cells)

    @cached_property
    def label(self) -> str:
        """The name of the cell in the user's words."""
        return self.system.label(self.character)

    def is_bounded_by(self, test: int) -> bool:
        """Tell whether a test bounds the cell."""
        return bool(len(self.bounding)) and is_anywhere(self.bounding == test)

    def residual(self, x: Array) -> Array:
        """Return H_chi(x), shape (n,), in an array of its own."""
        return residual_at(self.system, x[:-1], float(x[-1]), self.character)

    def residual_and(self, x: Array, value: float) -> Array:
        """Return H_chi(x) and one value more, shape (n + 1,): the bordered equations at x."""
        both = np.empty(len(x))
        value_there = self.system.residual(x[:-1], float(x[-1]), self.character)
        both[:-1] = checked_array(self.system, "residual", value_there, (len(both) - 1,))
        both[-1] = value
        return both

    def jacobian(self, x: Array) -> Matrix:
        """Return dH_chi/dx, shape (n, n + 1)."""
        return jacobian_at(self.system, x[:-1], float(x[-1]), self.character)

    def lent_jacobian(self, x: Array) -> Matrix:
        """Return the same, of use until the system is asked for anything else."""
        return lent_jacobian_at(self.system, x[:-1], float(x[-1]), self.character)

    def kink(self, before: Selection, test: int) -> Array:
        """Return c, shape (n,), by which H differs from another selection, as the system knows."""
        system = cast("PiecewiseLinearSystem", self.system)  # asking it takes a while
        return kink_at(system, before.character, self.character, test)

    def tests(self, x: Array) -> Array:
        """Return the bounding tests, positive inside, shape (len(bounding),)."""
        return self.side * self.system.some_tests(x[:-1], float(x[-1]), self.bounding)

    def test(self, x: Array, index: int) -> float:
        """Return one of :meth:`tests`."""
        which = self.bounding[index : index + 1]
        values = self.system.some_tests(x[:-1], float(x[-1]), which)
        return float(self.side[index] * values[0])

    def unsigned_gradients(self, x: Array) -> Matrix:
        """Return the gradients of the bounding tests themselves, without their :attr:`side`.

        Those of a straight cell are constant, and a few are kept: not to be written to.
        """
        if self._gradients is not None:
            return self._gradients
        rows = self.system.some_test_gradients(x[:-1], float(x[-1]), self.bounding)
        if self.is_straight and rows.size <= FEW:
            self._gradients = own_matrix(rows)
        return rows

    def test_gradients(self, x: Array) -> Matrix:
        """Return the gradients of :meth:`tests`, shape (len(bounding), n + 1)."""
        rows, side = self.unsigned_gradients(x), self.side[:, np.newaxis]
        return side * rows if isinstance(rows, np.ndarray) else rows.multiply(side).tocsr()

    def test_gradient(self, x: Array, index: int) -> Array:
        """Return the gradient of one of :meth:`tests`, shape (n + 1,)."""
        which = self.bounding[index : index + 1]
        rows = self.system.some_test_gradients(x[:-1], float(x[-1]), which)
        gradient: Array = self.side[index] * dense(rows)[0]
        return gradient


def knows_jacobian(system: PiecewiseSystem) -> bool:
    """Tell whether a system gives derivatives of its own, which do not hang on magnitudes."""
    given = type(system).jacobian is not PiecewiseSystem.jacobian
    return bool(getattr(system, "knows_jacobian", given))


def _bounds(system: PiecewiseSystem, character: Character) -> tuple[Indices, Signs]:
    """Return the tests that bound a cell, and their signs inside."""
    tests = indices(system.bounding_tests(character))
    return tests, character.array[tests]


#: Most cells that are tried.
MOST_CELLS = 4096
#: A test that is smaller than this part of its terms has no certain sign.
UNCERTAIN = EPS**0.5


def signs_of_solutions(system: SlicewiseLinearSystem, alpha: float) -> list[int] | None:
    """Return the signs of det(dH/dz) of all solutions at one alpha.

    None where there are too many cells, or where a matrix is singular or a solution so close to an
    interface that its cell is not certain.
    """
    blocks = system.blocks()
    if number_of_cells(blocks) > MOST_CELLS:
        return None
    signs = []
    tests = 1 + max((max(block.tests, default=-1) for block in blocks), default=-1)
    for character in characters(blocks, tests):
        sign = _sign_in_cell(system, alpha, character)
        if sign is None:
            return None
        signs += [sign] if sign else []
    return signs


def _sign_in_cell(system: SlicewiseLinearSystem, alpha: float, character: Character) -> int | None:
    """Return sign det(dH/dz) at the solution in a cell, 0 without one, None where in doubt."""
    zero = np.zeros(system.size)
    matrix = dense(system.jacobian(zero, alpha, character))[:, :-1]
    rest = np.array(system.residual(zero, alpha, character), dtype=float)
    scale = np.abs(matrix).max(axis=1, initial=0.0)
    if not scale.all() or np.linalg.cond(matrix / scale[:, np.newaxis]) * UNCERTAIN > 1.0:
        return None
    z = -np.linalg.solve(matrix, rest)
    bounds = np.array(list(system.bounding_tests(character)), dtype=np.intp)
    side = np.where(np.array(character.signs, dtype=bool)[bounds], 1.0, -1.0)
    values = side * system.test_functions(z, alpha)[bounds]
    doubt = _doubt(system, z, alpha, bounds)
    if (values < -doubt).any():
        return 0
    if (values <= doubt).any():
        return None
    return int(np.linalg.slogdet(matrix)[0])


def _doubt(system: SlicewiseLinearSystem, z: Array, alpha: float, which: Indices) -> Array:
    """Return by how much the tests may be off, shape (len(which),)."""
    gradients = np.abs(dense(system.test_jacobian(z, alpha)))[which]
    scale = np.abs(np.append(z, alpha)).max() + 1.0
    doubt: Array = UNCERTAIN * scale * gradients.sum(axis=1)
    return doubt
