"""Functions of users that raise errors where they are not defined, or have wrong derivatives."""

import math

import numpy as np
import pytest
import scipy.sparse as sp

from pwscont import InvalidSystemError, Limits, PiecewiseSystem, explore, trace


class Formula(PiecewiseSystem):
    """f(z) = alpha with a kink at z = 2."""

    size = 1

    def __init__(self, f, test=lambda z: z - 2.0):
        self.f, self.test = f, test

    def test_functions(self, z, alpha):
        return np.array([self.test(float(z[0]))])

    def residual(self, z, alpha, character):
        z = float(z[0])
        return np.array([self.f(z) - alpha + character.signs[0] * (z - 2.0)])


def divided(z):
    return 2.0 - 1.0 / z


@pytest.mark.parametrize(
    ("f", "inverse"),
    [
        (lambda z: math.exp(300.0 * z) - 1.0, lambda a: math.log(1.0 + a) / 300.0),
        (lambda z: 10.0 ** (400.0 * z) - 1.0, lambda a: math.log10(1.0 + a) / 400.0),
        (math.log, math.exp),
        (divided, lambda a: 1.0 / (2.0 - a)),
        (lambda z: math.sqrt(z) - 0.5, lambda a: (0.5 + a) ** 2),
        (math.asin, math.sin),
    ],
)
def test_errors_of_arithmetic_say_that_h_is_not_defined(f, inverse):
    graph = trace(Formula(f), ([inverse(0.5)], 0.5), (-0.3, 0.6))
    for alpha in (-0.2, 0.1, 0.55):
        (solution,) = graph.solutions(alpha)
        assert solution.z[0] == pytest.approx(inverse(alpha), rel=1e-9)


def test_a_mistake_is_not_taken_for_an_end_of_the_model():
    with pytest.raises(ValueError, match="broadcast"):
        explore(Formula(lambda z: (np.zeros(2) + np.zeros(3))[0]), (-0.3, 0.6))


def test_a_function_that_is_defined_nowhere_is_refused_in_words():
    with pytest.raises(InvalidSystemError, match="is finite at none of"):
        explore(Formula(lambda z: math.log(-1.0)), (-0.3, 0.6))
    with pytest.raises(InvalidSystemError, match="test_functions raises ValueError: math domain"):
        explore(Formula(lambda z: z, lambda z: math.log(-1.0)), (-0.3, 0.6))


# -- wrong derivatives ---------------------------------------------------------------------------


class Wrong(PiecewiseSystem):
    """A x + z^3 + k max(w.z, 0) = c alpha + alpha^2, whose Jacobian may be wrong in one number."""

    def __init__(self, seed, spoil=None, sparse=False):
        rng = np.random.default_rng(seed)
        self.size = n = 2 + seed % 3
        self.A, self.w = 3.0 * np.eye(n) + rng.uniform(-0.5, 0.5, (n, n)), rng.normal(size=n)
        self.k, self.c = rng.uniform(0.2, 0.9, n), rng.uniform(0.5, 1.0, n)
        self.spoil, self.sparse = spoil, sparse

    def test_functions(self, z, alpha):
        return np.array([self.w @ z])

    def residual(self, z, alpha, character):
        kink = character.signs[0] * self.k * (self.w @ z)
        return self.A @ z + z**3 + kink - self.c * alpha - alpha**2

    def jacobian(self, z, alpha, character):
        by_z = self.A + np.diag(3.0 * z**2) + character.signs[0] * np.outer(self.k, self.w)
        J = np.column_stack([by_z, -self.c - 2.0 * alpha])
        if self.spoil:
            self.spoil(J, character, z)
        return sp.csr_array(J) if self.sparse else J


def sign_of_alpha(J, character, z):
    J[0, -1] *= -1.0


def no_slope_of_alpha(J, character, z):
    J[-1, -1] = 0.0


def one_entry(J, character, z):
    J[0, 1] += 0.3


def one_selection(J, character, z):
    J[1, 0] += 0.2 * character.signs[0]


def without_the_cube(J, character, z):
    J[0, 0] -= 3.0 * z[0] ** 2


def constant(J, character, z):
    J[:] = 1.0


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "spoil",
    [sign_of_alpha, no_slope_of_alpha, one_entry, one_selection, without_the_cube, constant],
)
@pytest.mark.sweep(3)
def test_a_wrong_jacobian_is_named(spoil, seed, sparse):
    with pytest.raises(InvalidSystemError, match=r"jacobian in cell . is wrong in row \d"):
        explore(Wrong(seed, spoil, sparse), (-1.0, 1.0), limits=Limits(seconds=20.0))


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.sweep(2)
def test_a_right_jacobian_raises_no_alarm(unit):
    class Scaled(Wrong):
        def residual(self, z, alpha, character):
            return super().residual(z / unit, alpha, character)

        def jacobian(self, z, alpha, character):
            J = super().jacobian(z / unit, alpha, character)
            J[:, :-1] /= unit
            return J

        def test_functions(self, z, alpha):
            return super().test_functions(z / unit, alpha)

    graph = trace(Scaled(1), (np.zeros(3), 0.0), (-0.4, 0.6))
    assert graph.count(0.5) == 1


def test_wrong_gradients_of_tests_are_named():
    class Gradients(Wrong):
        def test_jacobian(self, z, alpha):
            return np.append(-self.w, 0.0)[np.newaxis]

    with pytest.raises(InvalidSystemError, match="test_jacobian is wrong in row 0"):
        trace(Gradients(1), (np.zeros(3), 0.0), (-0.4, 0.6))


class Oscillating(PiecewiseSystem):
    """z0 + sin(z1), z1 = alpha, with a magnitude of z that is far too large."""

    size = 2

    def __init__(self, slope):
        self.slope = slope

    def scale(self, lo, hi):
        return np.array([1e11, 1e11])

    def test_functions(self, z, alpha):
        return z[:1] - 1e14

    def residual(self, z, alpha, character):
        return np.array([z[0] + np.sin(z[1]), z[1] - alpha])

    def jacobian(self, z, alpha, character):
        return np.array([[1.0, self.slope * np.cos(z[1]), 0.0], [0.0, 1.0, -1.0]])


def test_a_jacobian_is_right_although_h_oscillates_within_the_steps_of_the_check():
    graph = trace(Oscillating(1.0), ([0.0, 0.0], 0.0), (0.0, 1.0))
    assert graph.solutions(0.7)[0].z[0] == pytest.approx(-np.sin(0.7), abs=1e-9)
    with pytest.raises(InvalidSystemError, match="is wrong in row 0"):
        trace(Oscillating(1.5), ([0.0, 0.0], 0.0), (0.0, 1.0))
