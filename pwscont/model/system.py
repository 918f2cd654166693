"""The seam that a new problem plugs into."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, final

import numpy as np

from pwscont.foundation.arrays import Array, Indices, Matrix
from pwscont.foundation.character import Character
from pwscont.foundation.errors import InvalidSystemError
from pwscont.model.differences import central_differences, exact_differences
from pwscont.model.reduction import Reduction

#: The default of ``cells`` tries every sign pattern; beyond this many tests it asks for help.
MANY_TESTS = 16


class PiecewiseSystem(ABC):
    """A system H(z, alpha) = 0 that is continuous and smooth on each cell.

    The zero sets of ``m`` smooth test functions cut the space of ``(z, alpha)`` into cells,
    each named by its :class:`~pwscont.Character`. On a cell, H equals one smooth *selection*.
    Selections of neighbouring cells must agree on the interface between them, and each must
    stay evaluable a little beyond its own cell: Newton freezes the character.

    A subclass sets ``size`` and writes :meth:`test_functions` and :meth:`residual`;
    everything else has a default. Try it with :func:`pwscont.check_system`.

    Attributes
    ----------
    size : int
        n, the number of equations and of unknowns z.
    domain : tuple of float
        Values of the parameter for which the system makes sense; default all.
    degree : int or None
        The sum of the signs of det(dH/dz) over all solutions at any regular alpha, where it is
        known to be one and the same; default None, not known.
    unique : bool
        The promise that there is never more than one solution at one alpha (a P-matrix, a convex
        problem); default False. One found is then all, and two are an error in the promise.
    """

    size: int
    domain: tuple[float, float] = (-np.inf, np.inf)
    degree: int | None = None
    unique: bool = False

    @abstractmethod
    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return kappa(z, alpha), shape (m,)."""

    @abstractmethod
    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the selection H_chi(z, alpha), shape (n,), also outside the cell of chi."""

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return d H_chi / d(z, alpha), shape (n, n + 1), dense or scipy.sparse."""
        return central_differences(
            lambda x: self.residual(x[:-1], float(x[-1]), character), np.append(z, alpha)
        )

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return d kappa / d(z, alpha), shape (m, n + 1)."""
        return central_differences(
            lambda x: self.test_functions(x[:-1], float(x[-1])), np.append(z, alpha)
        )

    def some_tests(self, z: Array, alpha: float, which: Indices) -> Array:
        """Return only some of the test functions, shape (len(which),).

        Along a piece only the tests that bound its cell are asked for. Default: all are
        evaluated, and some taken; override it, and :meth:`some_test_gradients`, where each test
        costs something of its own.
        """
        return self.test_functions(z, alpha)[which]

    def some_test_gradients(self, z: Array, alpha: float, which: Indices) -> Matrix:
        """Return only some rows of :meth:`test_jacobian`, shape (len(which), n + 1)."""
        return self.test_jacobian(z, alpha)[which]

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return the indices of the tests whose zero sets bound this cell; default all.

        All characters that agree with this one on these tests must name the same selection.
        """
        return range(len(character.signs))

    def describe(self, character: Character) -> str:
        """Return all that a user may want to know of a cell, in words."""
        return f"cell {character}"

    def label(self, character: Character) -> str:
        """Return the short name of a cell for tables and pictures; default the description."""
        return self.describe(character)

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return what a user reads at the transition from one cell to another."""
        return f"{self.label(before)} → {self.label(after)}"

    def end(self, character: Character, tests: frozenset[int]) -> str | None:
        """Return why a curve in this cell ends where all of ``tests`` vanish.

        Default None: it goes on in another cell. A system that means nothing beyond some of its
        tests, such as the locus of a transition, says so here.
        """
        return None

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical magnitudes of z over the interval, shape (n,); default ones.

        They make arc length, and with it every result, independent of units.
        """
        return np.ones(self.size)

    def bounds(self) -> tuple[Any, Any]:
        """Return between which values z makes sense, each broadcastable to (n,); default all.

        Solutions outside are no starts, and a branch that leaves the bounds ends there: a
        negative voltage, a concentration above one.
        """
        return -np.inf, np.inf

    def periods(self) -> Any:
        """Return after what each unknown repeats itself, broadcastable to (n,); default infinite.

        A promise about H and the tests, such as 2 pi for an angle: solutions that differ by
        whole periods are one. Infinite, or zero, is not periodic.
        """
        return np.inf

    def names(self) -> tuple[str, ...]:
        """Return a label for each component of z, for tables and axes."""
        return tuple(f"z[{i}]" for i in range(self.size))

    def cells(self) -> Iterator[Character]:
        """Yield one character for each selection; default by trying all sign patterns.

        Raises
        ------
        InvalidSystemError
            If there are too many tests to try all patterns: override this method.
        """
        m = _number_of_tests(self)
        if has_too_many_tests(self):
            raise InvalidSystemError(
                f"{type(self).__name__} has {m} test functions, too many to try all 2^{m} sign "
                "patterns; override cells() to yield one character for each selection"
            )
        seen = set()
        for signs in product((True, False), repeat=m):
            character = Character(signs)
            if (key := self.cell(character)) not in seen:
                seen.add(key)
                yield character

    def essential(self, character: Character) -> Indices | None:
        """Return which components of z determine the others on this selection, None for all.

        Only these are stored of special points; default None.
        """
        return None

    def completed(self, values: Array, alpha: float, character: Character) -> Array:
        """Return z, shape (n,), from the components that :meth:`essential` names.

        Affine in them, each other component a multiple of one of them and a constant.
        """
        return values

    def reduction(self, lo: float, hi: float) -> Reduction | None:
        """Return a smaller system with the same solutions for alpha in [lo, hi], if there is one.

        Only what provably stays in one mode on the whole interval may be left out; default
        None.
        """
        return None

    def test_name(self, test: int) -> str:
        """Return what a user calls a test function."""
        return f"test function {test}"

    def searches(self) -> tuple[Any, ...]:
        """Return searches (:class:`~pwscont.search.Search`) made for this kind of system.

        They are added to the default of :func:`pwscont.explore` where trying every cell would
        take too long; default none.
        """
        return ()

    def character(self, z: Array, alpha: float) -> Character:
        """Return the character of the point."""
        return Character.of(self.test_functions(z, alpha))

    def cell(self, character: Character) -> bytes:
        """Return the signs that matter: characters with equal cells name one selection.

        One byte per test function: 0 for a test that does not bound the cell, else its sign.
        """
        signs = character.signs
        cell = bytearray(len(signs))
        for i in self.bounding_tests(character):
            cell[i] = 2 if signs[i] else 1
        return bytes(cell)


def _number_of_tests(system: PiecewiseSystem) -> int:
    return len(system.test_functions(np.zeros(system.size), 0.0))


def has_too_many_tests(system: PiecewiseSystem) -> bool:
    """Tell whether a system without cells of its own has too many sign patterns to try all."""
    is_default = type(system).cells is PiecewiseSystem.cells
    return is_default and _number_of_tests(system) > MANY_TESTS


@final
@dataclass(frozen=True, slots=True)
class Block:
    """A part of a system that is in one of several modes, whatever the others do.

    Attributes
    ----------
    tests : tuple of int
        The test functions whose signs choose the mode.
    rows : tuple of int
        The rows of H that depend on the mode.
    modes : tuple of tuple of bool
        For every mode the signs of these tests in some character that has it.
    """

    tests: tuple[int, ...]
    rows: tuple[int, ...]
    modes: tuple[tuple[bool, ...], ...]


class SlicewiseLinearSystem(PiecewiseSystem):
    """A system whose selections and test functions are affine in z at every fixed alpha.

    The promise lets pwscont list all solutions at one alpha by solving one linear system per
    cell. A system whose cells are all combinations of the modes of independent parts (contact
    nodes, diodes) says so by overriding :meth:`blocks`, which makes the search fast.
    """

    def blocks(self) -> tuple[Block, ...]:
        """Return the parts whose modes combine freely; default one part with all cells."""
        modes = tuple(character.signs for character in self.cells())
        return (Block(tuple(range(len(modes[0]))), tuple(range(self.size)), modes),)

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return A, shape (k, n), and b, shape (k,): every solution has A z + b >= 0.

        The sharper these inequalities, the sooner hopeless combinations of modes are cut off;
        default none.
        """
        return np.zeros((0, self.size)), np.zeros(0)


class PiecewiseLinearSystem(SlicewiseLinearSystem):
    """A system whose selections and test functions are affine in (z, alpha) together.

    Its curves are polygons: :class:`~pwscont.stepping.ExactLinear` follows them from corner
    to corner without a step size. The default Jacobians are exact here, because differences
    of affine functions are.
    """

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant matrix d H_chi / d(z, alpha), shape (n, n + 1)."""
        return exact_differences(
            lambda x: self.residual(x[:-1], float(x[-1]), character), self.size + 1
        )

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the constant matrix d kappa / d(z, alpha), shape (m, n + 1)."""
        return exact_differences(lambda x: self.test_functions(x[:-1], float(x[-1])), self.size + 1)
