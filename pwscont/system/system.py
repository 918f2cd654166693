"""The system that a user writes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from inspect import isfunction
from itertools import chain, product
from math import prod
from types import MappingProxyType
from typing import Any, Self, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Matrix, by_rows, indices, joined
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.printing import card, counted, short
from pwscont.system.differences import Differences
from pwscont.system.values import GUARDED, checked_array, guard


@final
@dataclass(frozen=True, slots=True)
class Block:
    """A part of a system with several modes, independent of the modes of other parts.

    Attributes
    ----------
    tests : tuple of int
        The test functions whose signs choose the mode.
    rows : tuple of int
        The rows of H that depend on the mode.
    modes : tuple of tuple of bool
        For every mode the signs of the tests in some character with this mode.

    Examples
    --------
    >>> from pwscont import Block
    >>> Block(tests=(0,), rows=(1,), modes=((True,), (False,)))
    Block(tests=(0,), rows=(1,), modes=((True,), (False,)))
    """

    tests: tuple[int, ...]
    rows: tuple[int, ...]
    modes: tuple[tuple[bool, ...], ...]


def number_of_cells(blocks: Iterable[Block]) -> int:
    """Return the number of combinations of the modes of some blocks."""
    return prod(len(block.modes) for block in blocks)


def _some_of(system: PiecewiseSystem, rows: Any, alpha: float, which: Indices) -> Any:
    """Return some rows of the tests, or say that there are fewer here than elsewhere."""
    try:
        return rows.take(which, 0) if isinstance(rows, np.ndarray) else by_rows(rows)[which]
    except IndexError as error:
        raise InvalidSystemError(
            f"{type(system).__name__} has {rows.shape[0]} test functions at alpha = "
            f"{alpha:.10g}, and more elsewhere: their number must not change"
        ) from error


#: Most tests for which the default of ``cells`` tries every sign pattern; with more tests the
#: default asks for help.
MOST_TESTS_TO_TRY = 16
#: Slots that ``within`` does not copy.
OWN = ("__weakref__", "_differences_of_run")


class PiecewiseSystem(ABC):
    """A system H(z, alpha) = 0 that is continuous and smooth on each cell.

    The zero sets of ``m`` smooth test functions cut the space of ``(z, alpha)`` into cells; each
    cell has a name, the :class:`~pwscont.Character`. On a cell, H equals a smooth *selection*.
    Selections of neighbouring cells must agree on the interface between the cells, and each
    selection must stay evaluable a little beyond the cell: Newton freezes the character.

    A subclass sets ``size`` and writes :meth:`test_functions` and :meth:`residual`; everything else
    has a default. Try a system with :func:`pwscont.check_system`.

    Attributes
    ----------
    size : int
        n, the number of equations and of unknowns z.
    domain : tuple of float
        Values of the parameter for which the system makes sense; default all.
    degree : int or None
        The sum of the signs of det(dH/dz) over all solutions, if known to be the same at every
        regular alpha; default None, not known.
    unique : bool
        The promise that no alpha has two solutions (a P-matrix, a convex problem); default
        False. A solution found is then all solutions, and two solutions are an error in the
        promise.
    line_styles : mapping of str to matplotlib's line styles
        How pictures draw the pieces of a label; default the styles in turn, in the order in which
        labels occur.

    Examples
    --------
    >>> from pwscont import PiecewiseSystem, explore
    >>> class ArchOverStop(PiecewiseSystem):
    ...     size = 1
    ...     def test_functions(self, z, alpha):
    ...         return z - 1.0
    ...     def residual(self, z, alpha, character):
    ...         stop = 5.0 * (z - 1.0) if character.signs[0] else 0.0
    ...         return z * (z - 1.0) * (z - 2.0) + stop - alpha
    >>> explore(ArchOverStop(), (-0.5, 1.0)).count(0.2)
    3
    """

    __slots__ = ("__dict__", "__weakref__", "_differences_of_run")

    size: int
    domain: tuple[float, float] = (-np.inf, np.inf)
    degree: int | None = None
    _differences_of_run: Differences
    unique: bool = False
    line_styles: Mapping[str, Any] = MappingProxyType({})

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name in GUARDED:
            method = vars(cls).get(name)
            if isfunction(method) and not hasattr(method, "__isabstractmethod__"):
                setattr(cls, name, guard(method, name))

    @abstractmethod
    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return kappa(z, alpha), shape (m,)."""

    @abstractmethod
    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the selection H_chi(z, alpha), shape (n,), also outside the cell of chi."""

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return d H_chi / d(z, alpha), shape (n, n + 1), dense or scipy.sparse.

        Default: by :meth:`differences`, exact where a class promises that H is affine.
        """

        def residual(x: Array) -> Array:
            value = self.residual(x[:-1], float(x[-1]), character)
            return checked_array(self, "residual", value, (self.size,))

        return self._default_jacobian_of(residual, joined(z, alpha))

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return d kappa / d(z, alpha), shape (m, n + 1); default as of :meth:`jacobian`."""
        tests = self.test_functions
        return self._default_jacobian_of(lambda x: tests(x[:-1], float(x[-1])), joined(z, alpha))

    def _default_jacobian_of(self, function: Callable[[Array], Array], x: Array) -> Array:
        """Return the Jacobian at x of a function that is as smooth as a selection."""
        return self.differences(float(x[-1])).jacobian(function, x)

    def differences(self, alpha: float) -> Differences:
        """Return the object that differentiates functions of (z, alpha), in steps that fit.

        In a run the steps fit the run's interval, and become finer where Newton converges slowly.
        Outside a run the steps fit :meth:`scale` at this alpha, stay in :attr:`domain`, and take
        max(1, abs(alpha)) for a typical change of alpha.
        """
        if self._is_fitted:
            return self._differences_of_run
        scale = np.append(self.scale(alpha, alpha), max(1.0, abs(alpha)))
        return Differences(scale, *self.domain)

    def within(self, lo: float, hi: float, magnitudes: Array | None = None) -> Self:
        """Return the same system for work on an interval of alpha.

        The returned system shares all attributes with this system, except that :meth:`differences`
        fits the interval. ``magnitudes``: of z, for a system that does not know any.
        """
        twin: Self = object.__new__(type(self))
        for name in _slots(type(self)):
            if hasattr(self, name):
                object.__setattr__(twin, name, getattr(self, name))
        scale = self.scale(lo, hi) if magnitudes is None else magnitudes
        differences = Differences(joined(scale, hi - lo), lo, hi)
        object.__setattr__(twin, "_differences_of_run", differences)
        return twin

    def refine_differences(self, part: float) -> None:
        """Multiply the usual steps of the :meth:`differences` of this run by ``part``."""
        if self._is_fitted and part != self._differences_of_run.part:
            finer = replace(self._differences_of_run, part=part)
            object.__setattr__(self, "_differences_of_run", finer)

    @property
    def gives_scale(self) -> bool:
        """Whether typical magnitudes are given, or were found."""
        own = type(self).scale is not PiecewiseSystem.scale or "scale" in vars(self)
        return own or bool((PiecewiseSystem.scale(self, 0.0, 0.0) != 1.0).any())

    @property
    def knows_jacobian(self) -> bool:
        """Whether the derivatives are the system's own, which no typical magnitude changes."""
        own = getattr(self.jacobian, "__func__", None) is not PiecewiseSystem.jacobian
        return own or isinstance(self, SlicewiseLinearSystem)

    @property
    def knows_derivatives(self) -> bool:
        """Whether the derivatives of H and of the tests are the system's own."""
        own = getattr(self.test_jacobian, "__func__", None) is not PiecewiseSystem.test_jacobian
        return self.knows_jacobian and (own or isinstance(self, SlicewiseLinearSystem))

    @property
    def _is_fitted(self) -> bool:
        return hasattr(self, "_differences_of_run")

    def some_tests(self, z: Array, alpha: float, which: Indices) -> Array:
        """Return only some of the test functions, shape (len(which),).

        Along a piece the run asks only for the tests that bound the piece's cell. Default: take
        some of all; override this method, and :meth:`some_test_gradients`, if tests cost time.
        """
        return _some_of(self, self.test_functions(z, alpha), alpha, which)

    def some_test_gradients(self, z: Array, alpha: float, which: Indices) -> Matrix:
        """Return only some rows of :meth:`test_jacobian`, shape (len(which), n + 1)."""
        return _some_of(self, self.test_jacobian(z, alpha), alpha, which)

    def bounding_tests(self, character: Character) -> Sequence[int] | Indices:
        """Return the indices of the tests whose zero sets bound this cell; default all.

        All characters that agree with this character on the returned tests must name the same
        selection.
        """
        return range(character.array.size)

    def describe(self, character: Character) -> str:
        """Return all that a user may want to know of a cell, in words."""
        return f"cell {character}"

    def label(self, character: Character) -> str:
        """Return the short name of a cell for tables and pictures; default the description."""
        return self.describe(character)

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return the words for a transition from a cell to another cell."""
        return f"{self.label(before)} → {self.label(after)}"

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical magnitudes of z over the interval, shape (n,).

        Typical magnitudes make arc length, and with arc length every result, independent of units.
        Default: 1.0 for all, or the magnitudes of the solutions that a run finds.
        """
        return self._differences_of_run.scale[:-1] if self._is_fitted else np.ones(self.size)

    def bounds(self) -> tuple[Any, Any]:
        """Return between which values z makes sense, each broadcastable to (n,); default all.

        Solutions outside the bounds are no starts, and a branch that leaves the bounds ends there.
        """
        return -np.inf, np.inf

    def periods(self) -> Any:
        """Return after what each unknown repeats itself, broadcastable to (n,); default infinite.

        A promise about H and the tests, such as 2 pi for an angle: solutions that differ by whole
        periods are the same solution. Infinite, or zero, is not periodic.
        """
        return np.inf

    def names(self) -> tuple[str, ...]:
        """Return a label for each component of z, for tables and axes."""
        return tuple(f"z[{i}]" for i in range(self.size))

    def __repr__(self) -> str:
        size = getattr(self, "size", None)  # half a system has a repr, too
        return f"{type(self).__name__}({counted(size, 'unknown') if isinstance(size, int) else ''})"

    def _repr_html_(self) -> str:
        return card(type(self).__name__, [("system", short(repr(self)))])

    def cells(self) -> Iterator[Character]:
        """Yield a character for each selection; default by trying all sign patterns.

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

    def test_name(self, test: int) -> str:
        """Return a user's name for a test function."""
        return f"test function {test}"

    @property
    def somewhere(self) -> float:
        """A value of alpha for which the system is defined: in a run, a value in the interval."""
        anywhere = Differences(np.ones(1), *self.domain)
        return (self._differences_of_run if self._is_fitted else anywhere).base

    def character(self, z: Array, alpha: float) -> Character:
        """Return the character of the point."""
        return Character.of(self.test_functions(z, alpha))

    def cell(self, character: Character) -> bytes:
        """Return the signs that matter: characters with equal cells name the same selection.

        A byte for each test function: 0 for a test that does not bound the cell, else the sign of
        the test.
        """
        return character.among(indices(self.bounding_tests(character)))


def _number_of_tests(system: PiecewiseSystem) -> int:
    return len(system.test_functions(np.zeros(system.size), system.somewhere))


def has_too_many_tests(system: PiecewiseSystem) -> bool:
    """Tell whether a system that does not define ``cells`` has too many sign patterns to try."""
    is_default = type(system).cells is PiecewiseSystem.cells
    return is_default and _number_of_tests(system) > MOST_TESTS_TO_TRY


class SlicewiseLinearSystem(PiecewiseSystem):
    """A system whose selections and test functions are affine in z at every fixed alpha.

    The promise lets pwscont list all solutions at a fixed alpha by solving a linear system per
    cell. A system whose cells are all combinations of the modes of independent parts (contact
    nodes, diodes) says so by overriding :meth:`blocks`, which makes the search fast.

    Examples
    --------
    >>> from pwscont import SlicewiseLinearSystem, explore
    >>> class Spring(SlicewiseLinearSystem):  # alpha multiplies z: affine in z alone
    ...     size = 1
    ...     def test_functions(self, z, alpha):
    ...         return z - 1.0
    ...     def residual(self, z, alpha, character):
    ...         return z - alpha**2 + (alpha * (z - 1.0) if character.signs[0] else 0.0)
    >>> explore(Spring(), (0.0, 2.0)).guarantee
    'complete but for closed loops'
    """

    def _default_jacobian_of(self, function: Callable[[Array], Array], x: Array) -> Array:
        """Return the Jacobian at x of a function that is affine in z."""
        return self.differences(float(x[-1])).exact_in_z(function, x)

    def blocks(self) -> tuple[Block, ...]:
        """Return the parts whose modes combine freely; default a single part with all cells."""
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

    The curves of such a system are polygons: :class:`~pwscont.ExactLinear` follows polygons from
    corner to corner without a step size. The default Jacobians are exact here, because differences
    of affine functions are.

    Examples
    --------
    >>> from pwscont import PiecewiseLinearSystem, explore
    >>> class Spring(PiecewiseLinearSystem):
    ...     size = 1
    ...     def test_functions(self, z, alpha):
    ...         return z - 1.0
    ...     def residual(self, z, alpha, character):
    ...         return z - alpha + (3.0 * (z - 1.0) if character.signs[0] else 0.0)
    >>> explore(Spring(), (0.0, 2.0)).guarantee
    'complete'
    """

    def _default_jacobian_of(self, function: Callable[[Array], Array], x: Array) -> Array:
        """Return the constant Jacobian of an affine function."""
        return self.differences(float(x[-1])).exact(function)

    def kink(self, before: Character, after: Character, test: int) -> Array | None:
        """Return c, shape (n,), where H_after - H_before = c kappa_test at every point (F11).

        The product of c and the test's gradient is all that changes from a cell to the next cell. A
        system that knows c saves a run two residuals, or a Jacobian, at every transition; default
        None: a run computes c from residuals or Jacobians. A system that overrides this method
        knows c at every interface. The cells are neighbours that differ in the sign of kappa_test.
        """
        return None

    @property
    def knows_kinks(self) -> bool:
        """Whether :meth:`kink` is the system's own."""
        return type(self).kink is not PiecewiseLinearSystem.kink


@lru_cache(maxsize=16)
def _slots(owner: type) -> tuple[str, ...]:
    """Return the names of the slots of a class that ``within`` copies, ``__dict__`` included."""
    slots = (vars(base).get("__slots__", ()) for base in owner.__mro__)
    names = chain.from_iterable((some,) if isinstance(some, str) else some for some in slots)
    return tuple(name for name in names if name not in OWN)
