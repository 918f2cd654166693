"""The locus of a smooth fold while a second parameter moves.

At a fold of one selection dH/dz has a null vector v. Point and null vector together solve a
larger system (Moore and Spence 1980), which is regular where the fold is an ordinary one. Moore and
Spence fix the length of v by a linear condition l . v = 1; here it is |v| = 1 in the metric of the
system, because no l is known in advance to which v never becomes orthogonal. Of the two solutions
v and -v each gives the whole locus.

Failure modes and answers
-------------------------
- At an interface dH/dz jumps, and with it the equation for v: a smooth fold that reaches one
  ends there (it goes on as a non-smooth fold, or not at all). The locus ends, and says so.
- Systems have no second derivatives: those along v come from differences of the Jacobian.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, dense, finite_array
from pwscont.basics.character import Character
from pwscont.system.contract import jacobian_at
from pwscont.system.ending import Ending
from pwscont.system.hidden import all_names
from pwscont.system.system import PiecewiseSystem
from pwscont.two_parameters.alpha_range import ALL, AlphaRange
from pwscont.two_parameters.family import Family, MakeSystem


@final
class FoldLocus(PiecewiseSystem, Ending):
    """The locus of a smooth fold while a second parameter moves.

    Its unknowns are (z, v, alpha), its parameter is mu:

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
        """Return the system whose fold is followed, at one mu."""
        return self.family.at(float(mu))

    def start(self, z: Any, alpha: float, mu: float) -> tuple[Array, float]:
        """Return the start for :func:`pwscont.trace` at a fold, which may be known roughly.

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
        """Return the description of the system."""
        return self.family.sample.describe(self._original(character))

    def label(self, character: Character) -> str:
        """Return the short name of the cell."""
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
