"""Small smooth and curved problems whose answers are known in closed form or independently."""

from __future__ import annotations

import math
from typing import final

import numpy as np
from scipy.optimize import brentq

from pwscont import BandedJacobian, Character, PiecewiseSystem
from pwscont.bench.truth.known_answer import TruePiece
from pwscont.extending import EPS, Array

SMOOTH = Character(())


@final
class Circle(PiecewiseSystem):
    """z^2 + alpha^2 = 1: a smooth closed loop with two folds."""

    size = 1

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return no tests: there is a single cell."""
        return np.zeros(0)

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return nothing."""
        return np.zeros((0, 2))

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return z^2 + alpha^2 - 1."""
        return z * z + alpha * alpha - 1.0

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return [2 z, 2 alpha]."""
        return np.array([[2.0 * float(z[0]), 2.0 * alpha]])


def circle_pieces() -> list[TruePiece]:
    """Return the upper and the lower half, with the angle as parameter."""

    def at(angle: float) -> Array:
        return np.array([math.sin(angle), math.cos(angle)])

    def angle(x: Array) -> float:
        return math.atan2(x[0], x[1])

    cell = Circle().cell(SMOOTH)
    return [
        TruePiece(cell, 1, (0.0, math.pi), at, angle),
        TruePiece(cell, -1, (-math.pi, 0.0), at, angle),
    ]


@final
class TwoCurves(PiecewiseSystem):
    """alpha = z^2 + 2 z below z = 0 and z^3 - z above: two folds and a non-smooth fold."""

    size = 1

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return z."""
        return z.copy()

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the gradient of z."""
        return np.array([[1.0, 0.0]])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the side's polynomial less alpha."""
        return (z**3 - z if character.signs[0] else z**2 + 2.0 * z) - alpha

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the slope of the side's polynomial, and -1."""
        y = float(z[0])
        return np.array([[3.0 * y * y - 1.0 if character.signs[0] else 2.0 * y + 2.0, -1.0]])


def two_curves_pieces() -> list[TruePiece]:
    """Return the pieces for alpha from -2 to 2, with z as parameter."""

    def at(z: float) -> Array:
        return np.array([z, z**3 - z if z >= 0.0 else z**2 + 2.0 * z])

    system = TwoCurves()
    below, above = system.cell(Character((False,))), system.cell(Character((True,)))
    top = float(brentq(lambda z: z**3 - z - 2.0, 1.0, 2.0, xtol=EPS, rtol=4.0 * EPS))
    # cell, sign of dH/dz, and ends in z
    spans = [
        (below, -1, -1.0 - math.sqrt(3.0), -1.0),
        (below, 1, -1.0, 0.0),
        (above, -1, 0.0, 1.0 / math.sqrt(3.0)),
        (above, 1, 1.0 / math.sqrt(3.0), top),
    ]
    return [TruePiece(cell, sign, (a, b), at, lambda x: float(x[0])) for cell, sign, a, b in spans]


@final
class Bratu(PiecewiseSystem):
    """u'' + alpha exp(u) = 0 on (0, 1), u(0) = u(1) = 0, by differences at n points.

    Parameters
    ----------
    n : int
        Number of points, odd, so that a point is the middle.
    """

    def __init__(self, n: int = 31) -> None:
        self.size, self.squared = n, 1.0 / (n + 1) ** 2

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return no tests: there is a single cell."""
        return np.zeros(0)

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return nothing."""
        return np.zeros((0, self.size + 1))

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return h^2 (u'' + alpha exp(u)) at every point."""
        rest: Array = alpha * self.squared * np.exp(z) - 2.0 * z
        rest[1:] += z[:-1]
        rest[:-1] += z[1:]
        return rest

    def jacobian(self, z: Array, alpha: float, character: Character) -> BandedJacobian:
        """Return the derivatives, tridiagonal except for the last column."""
        growth = self.squared * np.exp(z)
        bands = np.ones((3, self.size))
        bands[1] = alpha * growth - 2.0
        return BandedJacobian(bands, 1, 1, growth)

    def scale(self, lo: float, hi: float) -> Array:
        """Return magnitudes of u that grow with n, so that arc length does not depend on n."""
        return np.full(self.size, 4.0 * math.sqrt(self.size))


def bratu_pieces(system: Bratu, lo: float) -> list[TruePiece]:
    """Return the two pieces for alpha >= ``lo``; the parameter is c, u in the middle."""
    n, middle = system.size, system.size // 2

    def at(c: float) -> Array:
        return _at_height(system, c)

    def height(x: Array) -> float:
        return float(x[middle])

    def end(a: float, b: float) -> float:
        return float(brentq(lambda c: at(c)[-1] - lo, a, b, xtol=EPS, rtol=4.0 * EPS))

    top = height(bratu_fold(system))
    low, high = end(1e-3, top), end(top, 12.0)
    cell = system.cell(SMOOTH)
    sign = -1 if n % 2 else 1  # dH/dz is negative definite on the lower piece
    return [
        TruePiece(cell, sign, (low, top), at, height),
        TruePiece(cell, -sign, (top, high), at, height),
    ]


def _differential(n: int, theta: float) -> Array:
    """Return the solution of the differential equation, u = 2 ln(cosh theta / cosh(...))."""
    y = theta * (1.0 - 2.0 * np.arange(1, n + 1) / (n + 1))
    return np.append(2.0 * np.log(np.cosh(theta) / np.cosh(y)), 8.0 * (theta / np.cosh(theta)) ** 2)


def _at_height(system: Bratu, c: float) -> Array:
    """Return the discrete solution with u = c in the middle, by Newton from the continuous."""
    x = _differential(system.size, math.acosh(math.exp(0.5 * c)))
    border = np.zeros(system.size + 1)
    border[system.size // 2] = 1.0
    for _ in range(6):
        u, alpha = x[:-1], float(x[-1])
        matrix = np.vstack([system.jacobian(u, alpha, SMOOTH).toarray(), border])
        rest = np.append(system.residual(u, alpha, SMOOTH), border @ x - c)
        x = x - np.linalg.solve(matrix, rest)
    return x


def bratu_fold(system: Bratu) -> Array:
    """Return the fold by Newton on the extended system {H = 0, H_u v = 0, v_middle = 1}."""
    n = system.size
    theta = brentq(lambda t: t * math.tanh(t) - 1.0, 1.0, 1.5)
    v = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    y = np.concatenate([_differential(n, theta), v])
    for _ in range(12):
        y = y - _extended_correction(system, y[:n], float(y[n]), y[n + 1 :])
    return y[: n + 1]


def _extended_correction(system: Bratu, u: Array, alpha: float, v: Array) -> Array:
    n, middle = system.size, system.size // 2
    whole = system.jacobian(u, alpha, SMOOTH).toarray()
    by_u, growth = whole[:, :n], whole[:, n]
    matrix = np.zeros((2 * n + 1, 2 * n + 1))
    matrix[:n, : n + 1] = whole
    matrix[n : 2 * n, :n] = np.diag(alpha * growth * v)
    matrix[n : 2 * n, n], matrix[n : 2 * n, n + 1 :] = growth * v, by_u
    matrix[2 * n, n + 1 + middle] = 1.0
    rest = np.concatenate([system.residual(u, alpha, SMOOTH), by_u @ v, [v[middle] - 1.0]])
    correction: Array = np.linalg.solve(matrix, rest)
    return correction
