"""Vertical pieces of systems without derivatives: errors of differences are no folds.

On the middle piece of three alpha is zero, whatever z. The equations are mixed by matrices that
depend on (z, alpha) and are always regular, so that no derivative is exact and the solutions stay
what they are.
"""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, trace


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
