"""Vertical pieces of systems without derivatives: errors of differences are no folds.

On the middle piece of three alpha is zero, whatever z. The equations are mixed by matrices that
depend on (z, alpha) and are always regular, so that no derivative is exact and the solutions stay
what they are.
"""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, trace

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command


class Mixed(PiecewiseSystem):
    """alpha = y_0 below 0, 0 up to 1 and y_0 - 1 beyond; the other y_k follow y_0; z = Q^T y."""

    def __init__(self, size, seed, narrow, bent):
        rng = np.random.default_rng(seed)
        self.size, self.bent = size, bent
        self.turn = np.linalg.qr(rng.normal(size=(size, size)))[0]
        self.mix = 2.0 * np.linalg.qr(rng.normal(size=(size, size)))[0]
        self.waves = narrow * rng.normal(size=(size, size, size))
        self.phases = rng.normal(size=(2, size, size))
        self.slopes = rng.normal(size=size - 1)

    def beside(self, y):
        return self.slopes * (np.sin(2.0 * y) if self.bent else y)

    def test_functions(self, z, alpha):
        y = self.turn[0] @ z
        return np.array([y, y - 1.0])

    def residual(self, z, alpha, character):
        y = self.turn @ z
        above, beyond = character.array
        level = y[0] - 1.0 if beyond else 0.0 if above else y[0]
        plain = np.append(level - alpha, y[1:] - self.beside(y[0]))
        waves = np.sin(self.waves @ z + alpha * self.phases[0] + self.phases[1])
        return (self.mix + 0.5 * waves / self.size) @ plain

    def start(self):
        return self.turn.T @ np.append(-1.0, self.beside(-1.0)), -1.0


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("narrow", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(36)
def test_a_vertical_piece_by_differences_has_no_folds(seed, narrow, bent):
    system = Mixed(2 + seed, seed, narrow, bent)
    graph = trace(system, system.start(), (-2.0, 2.0))
    kinds = sorted(point.kind for point in graph.special_points() if point.kind != "start")
    assert kinds == ["end", "end", "transition", "transition"]
    (middle,) = (piece for piece in graph.pieces if piece.is_vertical)
    y = system.turn @ middle.points[:, :-1].T
    np.testing.assert_allclose(np.sort(y[0, [0, -1]]), [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(y[1:], system.beside(y[:1].T).T, atol=1e-9)
    np.testing.assert_array_equal(middle.alpha, middle.alpha[0])
    assert middle.alpha[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_folds_of_the_smallest_waves_that_differences_see_are_found():
    """On alpha = 1e-7 sin(z) slopes change sign at odd multiples of pi / 2."""

    class Waves(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z - 20.0

        def residual(self, z, alpha, character):
            return (1e-7 * np.sin(z) - alpha) * (2.0 + np.cos(0.3 * z))

    graph = trace(Waves(), ([0.0], 0.0), (-1.0, 1.0))
    folds = np.sort([point.z[0] for point in graph.special_points("fold") if point.z[0] > 0.0])
    np.testing.assert_allclose(folds, np.pi * (0.5 + np.arange(len(folds))), rtol=1e-5)
    assert len(folds) >= 6


class Cubic(PiecewiseSystem):
    """alpha = z^3 - 3 d^2 z, with folds at -d and d; a step may lead from one to the other."""

    size = 1

    def __init__(self, d):
        self.d = d

    def test_functions(self, z, alpha):
        return z - 9.0

    def residual(self, z, alpha, character):
        return z**3 - 3.0 * self.d**2 * z - alpha


class ExactCubic(Cubic):
    def jacobian(self, z, alpha, character):
        return np.array([[3.0 * z[0] ** 2 - 3.0 * self.d**2, -1.0]])


@pytest.mark.parametrize("system", [Cubic, ExactCubic])
@pytest.mark.parametrize("d", [0.02, 0.01, 0.005, 0.0025])
@pytest.mark.parametrize("start", [-1.13, -1.07, -1.0])
@pytest.mark.sweep(9)
def test_a_step_from_fold_to_fold_is_no_vertical_piece(system, d, start):
    graph = trace(system(d), ([start], start**3 - 3.0 * d**2 * start), (-1.5, 1.5))
    folds = sorted(point.z[0] for point in graph.special_points("fold"))
    np.testing.assert_allclose(folds, [-d, d], rtol=1e-6)
    assert [piece.det_sign for piece in graph.pieces] == [1, -1, 1]
    assert graph.count(0.0) == 3


class Bent(PiecewiseSystem):
    """alpha = z below zero and beyond -z^2, or what else is given: alpha turns where they meet."""

    size = 1

    def __init__(self, beyond):
        self.beyond = beyond

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return (self.beyond(z) if character.array[0] else z) - alpha


@pytest.mark.parametrize(
    "beyond",
    [lambda z: -(z**2), lambda z: -z, lambda z: -1e-9 * z - z**3, lambda z: -1e-12 * z - z**3],
    ids=["parabola", "roof", "cubic", "flat cubic"],
)
def test_a_kink_at_which_alpha_turns_is_a_nonsmooth_fold(beyond):
    """Also where the slope beyond is zero at the kink, or no more than rounding."""
    graph = trace(Bent(beyond), ([-0.5], -0.5), (-0.75, 1.0))
    (kink,) = [point for point in graph.special_points() if point.kind not in ("start", "end")]
    assert kink.kind == "nonsmooth fold"
    assert [piece.det_sign for piece in graph.pieces] == [1, -1]
    assert kink.alpha == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("start", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("bend", [0.0, 1.0])
def test_a_vertical_piece_on_an_end_of_the_interval_is_followed(bend, start, unit):
    def formula(z, alpha, sw):
        above = sw.relu(z / unit - 1.0)
        return above + bend * above**2 - sw.relu(-z / unit) - alpha

    for interval, beyond in (((0.0, 1.0), 0.5), ((-1.0, 0.0), -0.5)):
        graph = trace(Switched(1, formula), ([start * unit], 0.0), interval)
        assert graph.count(beyond) == 1
        assert graph.count(0.0) == np.inf
