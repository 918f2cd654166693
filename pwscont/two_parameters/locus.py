"""Systems whose branches are the loci of transitions and smooth folds along a second parameter.

The transition at which test i vanishes is the point {H(z, alpha) = 0, kappa_i(z, alpha) = 0} of the
curve. While a second parameter mu varies, the transition moves along a curve in the unknowns (z,
alpha), the *locus* of the transition. The locus is piecewise smooth, too: where another test
vanishes, H changes the selection and the locus has a kink.

At a fold of one selection dH/dz has a null vector v. Point and null vector together solve a larger
system (Moore and Spence 1980), which is regular at an ordinary fold. Moore and Spence fix the
length of v by a linear condition l . v = 1; here the condition is |v| = 1 in the metric of the
system, because no l is known in advance to which v never becomes orthogonal. Each of the solutions
v and -v gives the whole locus.

Failure modes and answers
-------------------------
- On the locus the sign of kappa_i is rounding: the two selections agree on the locus, so the
  selection for kappa_i >= 0 is solved, and kappa_i is no test function of the locus.
- Beyond some tests kappa_i bounds no cell (friction bounds mean nothing once contact is lost): the
  locus ends with a message, although the equations have solutions beyond.
- alpha may run off to infinity while mu stays finite: the locus ends where alpha leaves a range.
- At an interface dH/dz and the equation for v jump: a smooth fold that reaches an interface goes on
  as a non-smooth fold, or not at all. The locus ends with a message.
- Systems give no second derivatives: second derivatives along v are differences of the Jacobian.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Self, final

import numpy as np
import scipy.sparse as sp

from pwscont import Character, InvalidInputError, PiecewiseSystem
from pwscont.extending import Array, Ending, Matrix, all_names, dense, finite_array, jacobian_at
from pwscont.two_parameters.family import ALL, AlphaRange, Family, MakeSystem

#: The side of kappa_i = 0 whose selection is solved.
SIDE = True


class LocusSystem(PiecewiseSystem, Ending):
    """A system whose equations are those of a family, whose unknowns begin with z.

    Where the family gives no typical magnitudes, those of the locus are looked for, and hold for
    the systems of the family as well.
    """

    family: Family

    @property
    def gives_scale(self) -> bool:
        """Whether the family gives typical magnitudes."""
        return self.family.sample.gives_scale

    def within(self, lo: float, hi: float, magnitudes: Array | None = None) -> Self:
        """Return the same locus for work on an interval of mu."""
        twin = super().within(lo, hi, magnitudes)
        if magnitudes is not None:
            twin.family = self.family.with_magnitudes(magnitudes[: self.family.sample.size])
        return twin


@final
class TransitionLocus(LocusSystem):
    """The system whose branch is the locus of a transition along a second parameter.

    The unknowns are (z, alpha), the parameter is mu:

        H_chi(z, alpha; mu) = 0,   kappa_test(z, alpha; mu) = 0.

    Facts F1 and F2 hold for the locus because F1 and F2 hold for H: across another test j the first
    n rows change by c grad(kappa_j)^T, and the last row does not change.

    Parameters
    ----------
    family : callable
        mu -> :class:`~pwscont.PiecewiseSystem`; all systems have equal sizes and the same tests.
    test : int
        The test function that vanishes at the transition.
    mu : float, optional
        A value of mu whose system gives sizes and names.
    alphas : tuple of float, optional
        The range (lo, hi) of alpha, at whose ends the locus ends; default no limit.

    Attributes
    ----------
    test : int
    limits : AlphaRange

    Raises
    ------
    InvalidInputError
        If there is no such test, or the range is empty.
    InvalidSystemError
        If the family does not return systems.

    Examples
    --------
    >>> from pwscont import Switched, TransitionLocus, trace
    >>> def family(mu):  # kink where z = 0, at alpha = mu
    ...     return Switched(1, lambda z, t, sw: z + sw.relu(z) - (t - mu))
    >>> locus = TransitionLocus(family, test=0, mu=1.0, alphas=(-5.0, 5.0))
    >>> moved = trace(locus, ([0.0, 1.0], 1.0), (0.0, 2.0), parameter="mu")
    >>> round(float(moved.solutions(2.0)[0].z[-1]), 6)
    2.0
    """

    def __init__(
        self,
        family: MakeSystem,
        test: int,
        mu: float = 1.0,
        alphas: tuple[float, float] = ALL,
    ) -> None:
        self.limits = AlphaRange(alphas)
        self.family = Family(family, mu, self.limits)
        sample = self.family.sample
        self.size = sample.size + 1
        somewhere = self.limits.lo if self.limits.are_finite else 0.0
        self._tests = len(sample.test_functions(np.zeros(sample.size), somewhere))
        if not 0 <= test < self._tests:
            raise InvalidInputError(f"test must be one of 0 to {self._tests - 1}, got {test}")
        self.test = int(test)

    def at(self, mu: float) -> PiecewiseSystem:
        """Return the system in (z, alpha) at a value of mu, whose transition is followed."""
        return self.family.at(float(mu))

    def sides(self, character: Character) -> tuple[Character, Character]:
        """Return the two characters of the original system that meet at the transition."""
        original = Character(character.signs[: self._tests])
        return original.with_sign(self.test, False), original.with_sign(self.test, True)

    def is_transition(self, character: Character) -> bool:
        """Tell whether the selections of the two sides differ."""
        below, above = self.sides(character)
        return self.family.sample.cell(below) != self.family.sample.cell(above)

    # -- the contract --------------------------------------------------------------------

    def test_functions(self, y: Array, mu: float) -> Array:
        """Return the tests of the system, 1 in place of ``test``, then the limits of alpha."""
        alpha = float(y[-1])
        tests = self.at(mu).test_functions(y[:-1], alpha)
        values = np.concatenate([tests, self.limits.tests(alpha)])
        values[self.test] = 1.0
        return values

    def test_jacobian(self, y: Array, mu: float) -> Matrix:
        """Return the gradients of the tests by (z, alpha, mu)."""
        z, alpha = y[:-1], float(y[-1])
        rows = self.at(mu).test_jacobian(z, alpha)
        column = self.differences(mu).by_parameter(
            lambda other: self.at(other).test_functions(z, alpha), mu
        )
        mask = np.ones(self._tests)
        mask[self.test] = 0.0
        limits = self.limits.gradients(self.size)
        if sp.issparse(rows):
            gradients = sp.diags(mask) @ with_column(rows, column)
            return sp.vstack([gradients, sp.csr_matrix(limits)]).tocsr()
        return np.vstack([mask[:, np.newaxis] * with_column(rows, column), limits])

    def residual(self, y: Array, mu: float, character: Character) -> Array:
        """Return (H_chi, kappa_test), shape (n + 1,)."""
        return self._equations(self.at(mu), y, self._selection(character))

    def _equations(self, system: PiecewiseSystem, y: Array, selection: Character) -> Array:
        z, alpha = y[:-1], float(y[-1])
        test = system.test_functions(z, alpha)[self.test]
        return np.append(system.residual(z, alpha, selection), test)

    def jacobian(self, y: Array, mu: float, character: Character) -> Matrix:
        """Return the Jacobian by (z, alpha, mu); the last column comes from differences."""
        z, alpha, selection = y[:-1], float(y[-1]), self._selection(character)
        system = self.at(mu)
        rows = jacobian_at(system, z, alpha, selection)
        row = system.test_jacobian(z, alpha)[[self.test]]
        column = self.differences(mu).by_parameter(
            lambda other: self._equations(self.at(other), y, selection), mu
        )
        if sp.issparse(rows):
            return with_column(sp.vstack([rows, row]), column)
        return with_column(np.vstack([dense(rows), dense(row)]), column)

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return the tests that bound the cell of either side, then the limits of alpha."""
        sample = self.family.sample
        found = {int(i) for side in self.sides(character) for i in sample.bounding_tests(side)}
        limits = range(self._tests, self._tests + len(self.limits))
        return [*sorted(found - {self.test}), *limits]

    def end(self, character: Character, tests: frozenset[int]) -> str | None:
        """Return why the locus ends where ``tests`` vanish, None if the locus goes on."""
        if any(i >= self._tests for i in tests):
            return str(self.limits)
        if not all(self.is_transition(character.flip(i)) for i in tests):
            return (
                f"the loci of several transitions meet: test functions "
                f"{', '.join(map(str, sorted({*tests, self.test})))} vanish"
            )
        return None

    def _selection(self, character: Character) -> Character:
        return self.sides(character)[SIDE]

    # -- in words ------------------------------------------------------------------------

    def describe(self, character: Character) -> str:
        """Return the cells of the two sides in the words of the system."""
        return self._words(*(self.family.sample.describe(side) for side in self.sides(character)))

    def label(self, character: Character) -> str:
        """Return the labels of the two sides, such as ``slip- | no contact``."""
        return self._words(*(self.family.sample.label(side) for side in self.sides(character)))

    def _words(self, below: str, above: str) -> str:
        return f"{below} | {above}" if below != above else f"{below} (no transition)"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return the changes at a kink of the locus, in the words of the system."""
        changes = [
            self.family.sample.describe_transition(old, new)
            for old, new in zip(self.sides(before), self.sides(after), strict=True)
        ]
        return ", ".join(filter(None, dict.fromkeys(changes)))

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical magnitudes of (z, alpha) for mu between ``lo`` and ``hi``."""
        return np.append(self.family.scale((lo, hi)), self.limits.width)

    def names(self) -> tuple[str, ...]:
        """Return the names of z, and alpha."""
        return (*all_names(self.family.sample), "alpha")

    def cells(self) -> Iterator[Character]:
        """Yield the pairs of cells between which there is a transition."""
        return filter(self.is_transition, super().cells())


def with_column(rows: Matrix, column: Array) -> Matrix:
    """Return the matrix [rows | column], sparse if the rows are sparse."""
    if sp.issparse(rows):
        return sp.hstack([rows, sp.csr_matrix(column[:, np.newaxis])]).tocsr()
    return np.column_stack([rows, column])


@final
class FoldLocus(LocusSystem):
    """The system whose branch is the locus of a smooth fold along a second parameter.

    The unknowns are (z, v, alpha), the parameter is mu:

        H_chi = 0,   (dH_chi/dz) v = 0,   |v / scale|^2 = 1.

    Parameters
    ----------
    family, mu, alphas
        As for :class:`~pwscont.TransitionLocus`.

    Attributes
    ----------
    limits : AlphaRange

    Raises
    ------
    InvalidInputError, InvalidSystemError
        As for :class:`~pwscont.TransitionLocus`.

    Examples
    --------
    >>> from pwscont import FoldLocus, Switched
    >>> def family(mu):
    ...     return Switched(1, lambda z, t, sw: z**3 - mu * z - t)
    >>> FoldLocus(family, mu=1.0, alphas=(-1.0, 1.0)).size  # z, its null vector, alpha
    3
    """

    def __init__(
        self, family: MakeSystem, mu: float = 1.0, alphas: tuple[float, float] = ALL
    ) -> None:
        self.limits = AlphaRange(alphas)
        self.family = Family(family, mu, self.limits)
        self._n = self.family.sample.size
        self.size = 2 * self._n + 1
        self._weight = self.family.scale((mu, mu)) ** -2.0

    def at(self, mu: float) -> PiecewiseSystem:
        """Return the system in (z, alpha) at a value of mu, whose fold is followed."""
        return self.family.at(float(mu))

    def start(self, z: Any, alpha: float, mu: float) -> tuple[Array, float]:
        """Return the start for :func:`pwscont.trace` from an approximate fold.

        Parameters
        ----------
        z : array_like, shape (n,)
        alpha, mu : float
        """
        z = finite_array("z of a fold", z, (self._n,))
        system = self.at(mu)
        matrix = dense(jacobian_at(system, z, alpha, system.character(z, alpha)))[:, :-1]
        # the right singular vector of the smallest singular value, in scaled unknowns
        scale = self._weight**-0.5
        v = scale * np.linalg.svd(matrix * scale)[2][-1]
        return np.concatenate([z, v, [alpha]]), mu

    # -- the contract --------------------------------------------------------------------

    def _split(self, y: Array) -> tuple[Array, Array, float]:
        return y[: self._n], y[self._n : -1], float(y[-1])

    def test_functions(self, y: Array, mu: float) -> Array:
        """Return the tests of the system, and the limits of alpha."""
        z, _, alpha = self._split(y)
        tests = self.at(mu).test_functions(z, alpha)
        return np.concatenate([tests, self.limits.tests(alpha)])

    def test_jacobian(self, y: Array, mu: float) -> Matrix:
        """Return the gradients of the tests by (z, v, alpha, mu)."""
        z, _, alpha = self._split(y)
        rows = dense(self.at(mu).test_jacobian(z, alpha))
        column = self.differences(mu).by_parameter(
            lambda other: self.at(other).test_functions(z, alpha), mu
        )
        gradients = np.zeros((len(rows), self.size + 1))
        gradients[:, : self._n] = rows[:, :-1]
        gradients[:, -2:] = np.column_stack([rows[:, -1], column])
        return np.vstack([gradients, self.limits.gradients(self.size)])

    def residual(self, y: Array, mu: float, character: Character) -> Array:
        """Return the three blocks of equations, shape (2 n + 1,)."""
        z, v, alpha = self._split(y)
        first = self._equations(self.at(mu), np.append(z, alpha), v, self._original(character))
        return np.append(first, 0.5 * (v @ (self._weight * v) - 1.0))

    def _equations(
        self, system: PiecewiseSystem, x: Array, v: Array, selection: Character
    ) -> Array:
        """Return H and (dH/dz) v, shape (2 n,)."""
        residual = system.residual(x[:-1], float(x[-1]), selection)
        return np.append(residual, _along(system, x, v, selection))

    def jacobian(self, y: Array, mu: float, character: Character) -> Matrix:
        """Return the Jacobian by (z, v, alpha, mu)."""
        z, v, alpha = self._split(y)
        n, system, selection = self._n, self.at(mu), self._original(character)
        x = np.append(z, alpha)
        rows = dense(jacobian_at(system, z, alpha, selection))
        bent = system.differences(alpha).jacobian(lambda x: _along(system, x, v, selection), x)
        by_mu = self.differences(mu).by_parameter(
            lambda other: self._equations(self.at(other), x, v, selection), mu
        )
        jacobian = np.zeros((self.size, self.size + 1))
        jacobian[:n, :n], jacobian[:n, -2] = rows[:, :-1], rows[:, -1]
        jacobian[n:-1, :n], jacobian[n:-1, -2] = bent[:, :-1], bent[:, -1]
        jacobian[n:-1, n:-2] = rows[:, :-1]
        jacobian[:-1, -1] = by_mu
        jacobian[-1, n:-2] = self._weight * v
        return jacobian

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return the tests that bound the cell, and the limits of alpha."""
        original = self._original(character)
        bounding = map(int, self.family.sample.bounding_tests(original))
        return [*bounding, *range(len(original.signs), len(character.signs))]

    def end(self, character: Character, tests: frozenset[int]) -> str | None:
        """Return why the locus ends where ``tests`` vanish."""
        if any(i >= len(character.signs) - len(self.limits) for i in tests):
            return str(self.limits)
        return f"the smooth fold reaches the interface of test function {min(tests)}"

    def _original(self, character: Character) -> Character:
        return Character(character.signs[: len(character.signs) - len(self.limits)])

    # -- in words ------------------------------------------------------------------------

    def describe(self, character: Character) -> str:
        """Return the cell in the words of the system."""
        return self.family.sample.describe(self._original(character))

    def label(self, character: Character) -> str:
        """Return the label of the cell, after ``fold of``."""
        return f"fold of {self.family.sample.label(self._original(character))}"

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical magnitudes of (z, v, alpha) for mu between ``lo`` and ``hi``."""
        scale = self.family.scale((lo, hi))
        return np.concatenate([scale, scale, [self.limits.width]])

    def names(self) -> tuple[str, ...]:
        """Return the names of z, of v, and alpha."""
        names = all_names(self.family.sample)
        return (*names, *(f"v[{name}]" for name in names), "alpha")


def _along(system: PiecewiseSystem, x: Array, v: Array, selection: Character) -> Array:
    """Return (dH/dz) v, shape (n,)."""
    jacobian = jacobian_at(system, x[:-1], float(x[-1]), selection)
    product: Array = dense(jacobian)[:, :-1] @ v
    return product
