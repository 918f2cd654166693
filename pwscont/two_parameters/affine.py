"""Families that are affine in z, alpha and mu together, in a window of the two parameters.

In every cell H = A z + b s + c t + d, with (s, t) the point of the window's square; test functions
have the same form. A row depends only on the mode of the row's block, so a matrix for each k
suffices: the matrix of H with every block in mode k.

Failure modes and answers
-------------------------
- The family is not affine in mu, as with a coefficient of friction: H, the Jacobian and the tests
  are compared with the affine model at a third value of mu, which is not the middle.
- The window is small: terms of s and t are small, and hardly more than rounding where terms of z
  cancel, as in a singular cell. So the unknowns are scaled as in a window in which s and t weigh as
  much as z.
- The matrix of the inequalities that every solution satisfies varies: these inequalities, which
  only make the search shorter, are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from pwscont import Character, InvalidInputError, PiecewiseLinearSystem, PiecewiseSystem
from pwscont.enumeration.options import Problem, aside, most_modes, problem_of
from pwscont.extending import EPS, Array, Box, dense, finite_array, jacobian_at, residual_at
from pwscont.system.promises import (
    check_blocks,
    is_bent,
    refuse_bent,
    refuse_bent_tests,
)
from pwscont.two_parameters.family import AlphaRange, Family, MakeSystem


@final
@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A rectangle of the plane, whose points are centre + half * s with s in the square [-1, 1]^2.

    Attributes
    ----------
    centre, half : ndarray, shape (2,)
        The middle (alpha, mu), and half the width of each range.
    """

    centre: Array
    half: Array

    @classmethod
    def of(cls, alphas: tuple[float, float], mus: tuple[float, float]) -> Window:
        """Return the window between two values of alpha and of mu.

        Raises
        ------
        InvalidInputError
            If a range is no pair of finite numbers lo < hi.
        """
        ends = np.array([finite_array(n, r, (2,)) for n, r in (("alphas", alphas), ("mus", mus))])
        for name, (lo, hi) in zip(("alphas", "mus"), ends.tolist(), strict=True):
            if not lo < hi:
                raise InvalidInputError(f"{name} need lo < hi, got ({lo}, {hi})")
        return cls(0.5 * ends.sum(axis=1), 0.5 * np.diff(ends)[:, 0])

    @property
    def alphas(self) -> tuple[float, float]:
        """The range of alpha."""
        return float(self.centre[0] - self.half[0]), float(self.centre[0] + self.half[0])

    @property
    def mus(self) -> tuple[float, float]:
        """The range of mu."""
        return float(self.centre[1] - self.half[1]), float(self.centre[1] + self.half[1])

    def inside(self, squared: Array) -> Array:
        """Return points (alpha, mu), shape (..., 2), from points (s, t) of the square."""
        points: Array = self.centre + self.half * squared
        return points

    def squared(self, points: Array) -> Array:
        """Return points (s, t) of the square, shape (..., 2), from points (alpha, mu)."""
        square: Array = (points - self.centre) / self.half
        return square


#: Matrix and constant of affine forms of (z, s, t).
Form: TypeAlias = tuple[Array, Array]
#: What two values may differ by, as a part of their terms: half of the digits.
HALF_OF_DIGITS = EPS**0.5
#: The third value of mu, as a part of the way from the lower to the upper end.
THIRD = 0.37


@final
@dataclass(frozen=True, slots=True, eq=False)
class AffineFamily:
    """The systems of all points of a window of the plane, as one problem.

    Attributes
    ----------
    system : PiecewiseLinearSystem
        The system in the middle of the window, with the blocks, labels and names of all systems.
    window : Window
    problem : Problem or None
        Blocks, options and bounds of options, with unknowns (z, s, t); None if no solution exists.
    scale : ndarray, shape (n,)
        Typical magnitudes of z.
    typical : ndarray, shape (2,)
        Magnitudes of s and t by which the unknowns of the problem are scaled.
    """

    system: PiecewiseLinearSystem
    window: Window
    problem: Problem | None
    scale: Array
    typical: Array

    @classmethod
    def of(cls, make: MakeSystem, window: Window) -> AffineFamily:
        """Return the matrices of a family over a window.

        Raises
        ------
        InvalidInputError
            If the systems are not piecewise linear, have bounds, or are not affine in mu, or the
            window is so narrow that rounding hides the differences of a parameter.
        InvalidSystemError
            If the family returns no systems, or a system breaks the promise to be affine in (z,
            alpha).
        """
        _check_widths(window)
        family = Family(make, float(window.centre[1]), AlphaRange(window.alphas))
        system = _checked(family.sample)
        _check_sizes(family, window)
        scale = family.scale(window.mus)
        coefficients = _Coefficients(family, system, window, scale)
        modes = range(most_modes(system.blocks()))
        rows = [coefficients.form(_residuals(coefficients, k), "H") for k in modes]
        tests = coefficients.form(coefficients.tests, "the test functions")
        check_blocks(system, len(tests[1]))
        sizes = np.append(scale, _typical([*rows, tests], scale))
        problem = problem_of(system, rows, tests, coefficients.necessary(), sizes)
        return cls(system, window, problem, scale, sizes[-2:])


def _typical(forms: Iterable[Form], scale: Array) -> Array:
    """Return magnitudes of (s, t), at least 1, at which s and t weigh as much as z in some row.

    The magnitude 1 is half the width of the window; larger magnitudes make singularity independent
    of the size of a small window.
    """
    most = np.zeros(2)
    for matrix, _ in forms:
        terms = np.abs(matrix[:, :-2]) @ scale
        some = terms > 0.0
        weights = np.abs(matrix[some, -2:]) / terms[some, np.newaxis]
        most = np.maximum(most, weights.max(axis=0, initial=0.0))
    most[most <= EPS] = 1.0  # rounding: no row depends on s or t
    typical: Array = np.maximum(1.0, 1.0 / most)
    return typical


def is_affine(make: MakeSystem, window: Window) -> bool:
    """Tell whether alpha and mu enter a family affinely, so that cells have polygons."""
    try:
        AffineFamily.of(make, window)
    except InvalidInputError:
        return False
    return True


def _checked(system: PiecewiseSystem) -> PiecewiseLinearSystem:
    if not isinstance(system, PiecewiseLinearSystem):
        raise InvalidInputError(
            "an exact map needs a family of PiecewiseLinearSystems, and "
            f"{type(system).__name__} is none: both parameters must enter affinely; a PlaneScene "
            "follows loci instead"
        )
    box = Box.of(system)
    if np.isfinite([box.lower, box.upper, box.period]).any():
        raise InvalidInputError(
            f"{type(system).__name__} has bounds or periods, which an exact map does not know: "
            "leave them out, and look at the solutions"
        )
    return system


def _check_widths(window: Window) -> None:
    """Refuse a window in which half of a parameter's digits are equal everywhere."""
    for name, ends in (("alphas", window.alphas), ("mus", window.mus)):
        if ends[1] - ends[0] < HALF_OF_DIGITS * max(map(abs, ends)):
            raise InvalidInputError(
                f"{name} = {ends} differ by less than {HALF_OF_DIGITS:.1g} of their size, so "
                "rounding leaves too few digits of the difference: take a wider window, or count "
                "the parameter from the middle"
            )


def _check_sizes(family: Family, window: Window) -> None:
    """Refuse a family whose numbers of unknowns or tests change between the ends of mu."""
    alpha, (lo, hi) = float(window.centre[0]), window.mus
    known = _sizes(family.sample, alpha)
    for mu in (lo, hi):
        if (here := _sizes(family.at(mu), alpha)) != known:
            raise InvalidInputError(
                f"the family has {here[0]} unknowns and {here[1]} tests at {mu:g}, but {known[0]} "
                f"and {known[1]} in the middle of the window; where two switches coincide there, "
                "move the end"
            )


def _sizes(system: PiecewiseSystem, alpha: float) -> tuple[int, int]:
    return system.size, len(system.test_functions(np.zeros(system.size), alpha))


@final
class _Coefficients:
    """Affine forms of (z, s, t), computed at the ends of mu and checked at a third value."""

    def __init__(
        self, family: Family, system: PiecewiseLinearSystem, window: Window, scale: Array
    ) -> None:
        self.family, self.system, self._window = family, system, window
        self._alpha = float(window.centre[0])
        self.x = np.append(np.zeros(system.size), self._alpha)
        self.dx = aside(scale)
        self.dx[-1] = THIRD * window.half[0]

    def form(self, at: Callable[[float], Form], what: str) -> Form:
        """Return the affine form of ``at``, mu -> Jacobian, shape (k, n + 1), and value."""
        lo, hi = self._window.mus
        (J, low), (K, high), (L, third) = map(at, (lo, hi, lo + THIRD * (hi - lo)))
        along, rate = (hi - lo) * THIRD, (high - low)[:, np.newaxis] / (hi - lo)
        bent = is_bent(third, low, rate, np.array([along]))
        if bent or any(_differ(J, other, self.dx) for other in (K, L)):
            raise InvalidInputError(
                f"{what} of {type(self.system).__name__} is not affine in z, alpha and the second "
                "parameter together, so modes have no polygons; a PlaneScene follows loci instead"
            )
        columns = [J[:, :-1], self._window.half[0] * J[:, -1:], 0.5 * (high - low)[:, np.newaxis]]
        return np.hstack(columns), 0.5 * (low + high)

    def tests(self, mu: float) -> Form:
        """Return gradients and values of the tests at mu, in the middle of alpha."""
        system, z = self.family.at(mu), self.x[:-1]
        values = np.array(system.test_functions(z, self._alpha), dtype=float)
        gradients = dense(system.test_jacobian(z, self._alpha))
        refuse_bent_tests(system, self.x, self.dx, values, gradients)
        return gradients, values

    def necessary(self) -> Form:
        """Return the forms that are not negative at solutions, then the sides of the square."""
        square = np.hstack([np.zeros((4, self.system.size)), np.kron([[1.0], [-1.0]], np.eye(2))])
        known = self._necessary()
        if known is None:
            return square, np.ones(4)
        return np.vstack([known[0], square]), np.append(known[1], np.ones(4))

    def _necessary(self) -> Form | None:
        """Return the systems' own inequalities, from three corners; None if not affine."""
        corners = self._window.inside(
            np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
        )
        said = [_inequalities(self.family.at(mu), alpha) for alpha, mu in corners.tolist()]
        (A, b), (_, by_s), (_, by_t), (_, last) = said
        if len({matrix.shape for matrix, _ in said}) > 1:
            return None
        s, t = 0.5 * (by_s - b)[:, np.newaxis], 0.5 * (by_t - b)[:, np.newaxis]
        bent = is_bent(last, b, np.hstack([s, t]), np.array([2.0, 2.0]))
        if bent or any(_differ(A, matrix, self.dx) for matrix, _ in said):
            return None
        return np.hstack([A, s, t]), 0.5 * (by_s + by_t)


def _residuals(coefficients: _Coefficients, k: int) -> Callable[[float], Form]:
    """Return the function from mu to Jacobian and value of H with every block in mode k."""
    system, x = coefficients.system, coefficients.x
    signs = [True] * len(system.test_functions(x[:-1], float(x[-1])))
    for block in system.blocks():
        for test, sign in zip(block.tests, block.modes[min(k, len(block.modes) - 1)], strict=True):
            signs[test] = sign
    character = Character(tuple(signs))

    def at(mu: float) -> Form:
        own = coefficients.family.at(mu)
        value = residual_at(own, x[:-1], float(x[-1]), character)
        jacobian = dense(jacobian_at(own, x[:-1], float(x[-1]), character))
        refuse_bent(own, character, x, coefficients.dx, value, jacobian)
        return jacobian, value

    return at


def _inequalities(system: PiecewiseSystem, alpha: float) -> Form:
    A, b = _checked(system).necessary(alpha)
    return np.array(dense(A), dtype=float), np.array(b, dtype=float)


def _differ(one: Array, other: Array, dx: Array) -> bool:
    """Tell whether matrices differ by more than the rounding of the terms of a row."""
    if one.shape != other.shape:
        return True
    sizes = np.abs(dx[: one.shape[1]])
    return bool(
        (
            np.abs(one - other) @ sizes > HALF_OF_DIGITS * ((np.abs(one) + np.abs(other)) @ sizes)
        ).any()
    )
