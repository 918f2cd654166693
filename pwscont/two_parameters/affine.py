"""Families that are affine in z, alpha and mu together, in a window of the two parameters.

In every cell H = A z + b s + c t + d, with (s, t) the point of the window's square; test functions
have the same form.

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

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from pwscont import InvalidInputError, PiecewiseLinearSystem, PiecewiseSystem
from pwscont.extending import EPS, Array, Box, affine_forms, balanced, dense, finite_array
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
    forms : list of (ndarray, ndarray)
        H in every mode, then the tests, as functions of (z, s, t).
    necessary : (ndarray, ndarray)
        The functions of (z, s, t) that are not negative at solutions, then the sides of the square.
    scale : ndarray, shape (n,)
        Typical magnitudes of z.
    typical : ndarray, shape (2,)
        Magnitudes of s and t by which the unknowns are scaled.
    """

    system: PiecewiseLinearSystem
    window: Window
    forms: list[Form]
    necessary: Form
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
        if not system.gives_scale:
            rough = _forms(family, window, np.zeros(system.size))
            family = family.with_magnitudes(_magnitudes(rough, system.size))
            system = _checked(family.sample)
        scale = family.scale(window.mus)
        forms, necessary = _forms(family, window, scale), _necessary(family, window, scale)
        return cls(system, window, forms, necessary, scale, _typical(forms, scale))


def _forms(family: Family, window: Window, scale: Array) -> list[Form]:
    """Return H in every mode, and the tests, from both ends of mu and a third value."""
    (alpha, _), (lo, hi) = window.centre.tolist(), window.mus
    reach = np.append(scale, THIRD * window.half[0])
    values = (lo, hi, lo + THIRD * (hi - lo))
    below, above, third = (affine_forms(_checked(family.at(mu)), alpha, reach) for mu in values)
    forms: list[Form] = []
    for (J, low), (K, high), (L, inside) in zip(below, above, third, strict=True):
        rate = (high - low)[:, np.newaxis]
        bent = _is_off(inside, low, rate, np.array([THIRD]))
        if bent or any(_differ(J, other, reach) for other in (K, L)):
            what = "the test functions" if J is below[-1][0] else "H"
            raise InvalidInputError(
                f"{what} of {type(family.sample).__name__} is not affine in z, alpha and the "
                "second parameter together, so modes have no polygons; a PlaneScene follows loci "
                "instead"
            )
        matrix = np.hstack([J[:, :-1], window.half[0] * J[:, -1:], 0.5 * rate])
        forms.append((matrix, 0.5 * (low + high)))
    return forms


def _necessary(family: Family, window: Window, scale: Array) -> Form:
    """Return the systems' own inequalities, if affine, and the sides of the square."""
    square = np.hstack([np.zeros((4, len(scale))), np.kron([[1.0], [-1.0]], np.eye(2))])
    corners = window.inside(np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]))
    said = [_inequalities(family.at(mu), alpha) for alpha, mu in corners.tolist()]
    (A, b), (_, by_s), (_, by_t), (_, last) = said
    if len({matrix.shape for matrix, _ in said}) > 1:
        return square, np.ones(4)
    s, t = 0.5 * (by_s - b)[:, np.newaxis], 0.5 * (by_t - b)[:, np.newaxis]
    bent = _is_off(last, b, np.hstack([s, t]), np.array([2.0, 2.0]))
    if bent or any(_differ(A, matrix, scale) for matrix, _ in said):
        return square, np.ones(4)
    own = np.hstack([A, s, t])
    return np.vstack([own, square]), np.append(0.5 * (by_s + by_t), np.ones(4))


def _magnitudes(forms: Iterable[Form], n: int) -> Array:
    """Return magnitudes of z that balance the terms of all rows and tests over the window."""
    rows = [
        np.column_stack([matrix[:, :n], np.abs([*matrix[:, n:].T, vector]).max(axis=0)])
        for matrix, vector in forms
    ]
    return balanced(np.vstack(rows), n)[0]


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


def _inequalities(system: PiecewiseSystem, alpha: float) -> Form:
    A, b = _checked(system).necessary(alpha)
    return np.array(dense(A), dtype=float), np.array(b, dtype=float)


def _differ(one: Array, other: Array, magnitudes: Array) -> bool:
    """Tell whether matrices differ by more than the rounding of the terms of a row."""
    if one.shape != other.shape:
        return True
    limit = HALF_OF_DIGITS * ((np.abs(one) + np.abs(other)) @ magnitudes)
    return bool((np.abs(one - other) @ magnitudes > limit).any())


def _is_off(value: Array, origin: Array, rates: Array, way: Array) -> bool:
    """Tell whether a value is not ``origin + rates @ way`` to half of the digits of the terms."""
    terms = np.abs(value) + np.abs(origin) + np.abs(rates) @ way
    return not bool((np.abs(value - origin - rates @ way) <= HALF_OF_DIGITS * terms).all())
