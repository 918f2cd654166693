"""Selections: the smooth function of a cell."""

from __future__ import annotations

from functools import cached_property
from typing import cast, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Matrix, Signs, dense, indices, joined
from pwscont.basics.character import Character
from pwscont.basics.printing import named, short
from pwscont.basics.rounding import EPS, GUARD
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.system.values import checked_array, own_matrix

#: The factors that make a negative test and a non-negative test positive inside.
SIDES = np.array([-1.0, 1.0])
#: Most entries of constant gradients that are kept, to bound memory.
MOST_KEPT_ENTRIES = 4096


@final
class Selection:
    """The selection H_chi of a system together with the tests that bound the cell.

    Test values are signed so that the values are positive inside the cell.

    Parameters
    ----------
    system : PiecewiseSystem
    character : Character
        The frozen character chi.
    adjacent_cells : tuple of Character
        For a curve along an interface, all cells to which the curve belongs: the tests of these
        cells end the curve, too.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import LCP, Character
    >>> from pwscont.extending import Selection
    >>> problem = LCP([[2.0]], q=[-1.0], d=[1.0])
    >>> Selection(problem, Character([True])).jacobian(np.array([0.5, 0.0])).shape
    (1, 2)
    """

    def __init__(
        self,
        system: PiecewiseSystem,
        character: Character,
        adjacent_cells: tuple[Character, ...] = (),
    ) -> None:
        self.system, self.character, self.adjacent_cells = system, character, adjacent_cells
        tests, inside = _bounds(system, character)
        if adjacent_cells:
            every = [(tests, inside), *(_bounds(system, cell) for cell in adjacent_cells)]
            tests, inside = (np.concatenate(parts) for parts in zip(*every, strict=True))
            first = np.sort(np.unique(tests, return_index=True)[1])
            tests, inside = tests[first], inside[first]
        self._gradients: Matrix | None = None
        self.bounding: Indices = tests
        #: +1 or -1 for each bounding test, the factor that makes the test positive inside.
        self.side: Array = SIDES.take(inside.view(np.uint8))
        #: Whether the selection and the tests are affine, so that the curve is a straight line.
        self.is_straight = isinstance(system, PiecewiseLinearSystem)
        #: Whether the selection is affine in z at every fixed alpha.
        self.is_slicewise = isinstance(system, SlicewiseLinearSystem)

    def __repr__(self) -> str:
        return named(self, short(self.label), f"of {type(self.system).__name__}")

    @cached_property
    def cell(self) -> bytes:
        """The signs that name this selection."""
        if self.adjacent_cells or type(self.system).cell is not PiecewiseSystem.cell:
            return self.system.cell(self.character)
        return self.character.among(self.bounding)  # without asking for these tests again

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
        return bool(np.count_nonzero(self.bounding == test))

    def residual(self, x: Array) -> Array:
        """Return a copy of H_chi(x), shape (n,)."""
        return residual_at(self.system, x[:-1], float(x[-1]), self.character)

    def vanishes(self, x: Array, sizes: Array) -> bool:
        """Tell whether H_chi(x) is rounding of terms of H, for unknowns of these sizes."""
        rounding = GUARD * EPS * (abs(self.jacobian(x)) @ sizes)
        return bool((np.abs(self.residual(x)) <= rounding).all())

    def residual_and(self, x: Array, value: float) -> Array:
        """Return H_chi(x) with ``value`` appended, shape (n + 1,): the bordered equations at x."""
        found = self.system.residual(x[:-1], float(x[-1]), self.character)
        return joined(checked_array(self.system, "residual", found, (self.system.size,)), value)

    def residuals(self, points: Array) -> Array:
        """Return H_chi at points, shape (k, n + 1), each with 0 appended."""
        system, shape, values = self.system, (self.system.size,), np.zeros(points.shape)
        states, alphas = points[:, :-1], points[:, -1].tolist()
        for value, z, alpha in zip(values[:, :-1], states, alphas, strict=True):
            found = system.residual(z, alpha, self.character)
            value[:] = checked_array(system, "residual", found, shape)
        return values

    def jacobian(self, x: Array) -> Matrix:
        """Return dH_chi/dx, shape (n, n + 1)."""
        return jacobian_at(self.system, x[:-1], float(x[-1]), self.character)

    def kink(self, before: Selection, test: int) -> Array:
        """Return c, shape (n,), by which H differs from another selection, as the system knows."""
        system = cast("PiecewiseLinearSystem", self.system)  # the answer takes a while
        c = system.kink(before.character, self.character, test)
        return checked_array(system, "kink", c, (system.size,))

    def tests(self, x: Array) -> Array:
        """Return the bounding tests, positive inside, shape (len(bounding),)."""
        return self.side * self.system.some_tests(x[:-1], float(x[-1]), self.bounding)

    def test(self, x: Array, index: int) -> float:
        """Return the value of the bounding test with this index."""
        which = self.bounding[index : index + 1]
        values = self.system.some_tests(x[:-1], float(x[-1]), which)
        return float(self.side[index] * values[0])

    def unsigned_gradients(self, x: Array) -> Matrix:
        """Return the gradients of the tests themselves, without :attr:`side`: not to be written to.

        Gradients of a straight cell are constant, and a few are kept.
        """
        if self._gradients is not None:
            return self._gradients
        rows = self.system.some_test_gradients(x[:-1], float(x[-1]), self.bounding)
        if self.is_straight and rows.size <= MOST_KEPT_ENTRIES:
            self._gradients = own_matrix(rows)
        return rows

    def test_gradients(self, x: Array) -> Matrix:
        """Return the gradients of :meth:`tests`, shape (len(bounding), n + 1)."""
        rows, side = self.unsigned_gradients(x), self.side[:, np.newaxis]
        return side * rows if isinstance(rows, np.ndarray) else rows.multiply(side).tocsr()

    def test_gradient(self, x: Array, index: int) -> Array:
        """Return the gradient of the bounding test with this index, shape (n + 1,)."""
        which = self.bounding[index : index + 1]
        rows = self.system.some_test_gradients(x[:-1], float(x[-1]), which)
        return self.side[index] * dense(rows)[0]


def _bounds(system: PiecewiseSystem, character: Character) -> tuple[Indices, Signs]:
    """Return the tests that bound a cell, and the signs inside."""
    tests = indices(system.bounding_tests(character))
    return tests, character.array.take(tests)


#: Largest H that is rounding, as a part of the terms of the same equation, or as a part of the
#: largest terms of all equations, which a solve mixes.
OWN_TERMS, ALL_TERMS = 1e-6, 1e-12
#: Factor by which an error of a point, which is an estimate, may be too small.
ESTIMATED = 10.0


def unexplained(
    system: PiecewiseSystem,
    character: Character,
    x: Array,
    scale: Array,
    error: Array | None = None,
) -> float:
    """Return the largest entry of H at a point, zero where rounding and error explain all.

    ``scale`` has typical magnitudes, and ``error``, shape (k, n + 1), samples of the point's error.
    """
    z, alpha = x[:-1], float(x[-1])
    value = residual_at(system, z, alpha, character)
    jacobian = jacobian_at(system, z, alpha, character)
    terms = abs(jacobian) @ (np.abs(x) + scale) + np.abs(value - jacobian @ x)
    explained = OWN_TERMS * terms + ALL_TERMS * terms.max()
    if error is not None:
        explained += ESTIMATED * (abs(jacobian) @ np.abs(np.atleast_2d(error)).max(axis=0))
    return 0.0 if (np.abs(value) <= explained).all() else float(np.abs(value).max())
