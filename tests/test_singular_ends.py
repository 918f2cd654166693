"""Intervals that begin or end where dH/dz is singular: truth by closed forms, at several sizes."""

import math

import numpy as np
import pytest

from pwscont import PiecewiseSystem, explore

HALF_LINE = {
    # residual of (y, t) for t = alpha - end; numbers of solutions for t > 0, for t < 0, for t = 0
    "pitchfork": (lambda y, t: y * (t - y * y), 3, 1, 1),
    "turned pitchfork": (lambda y, t: y * (t + y * y), 1, 3, 1),
    "sine": (lambda y, t: math.sin((1.0 + t) * y) - y, 3, 1, 1),
    "cube": (lambda y, t: y**3 - t, 1, 1, 1),
    "slanted cube": (lambda y, t: y**3 - t * (1.0 + 0.3 * y), 1, 1, 1),
    "fold": (lambda y, t: y * y - t, 2, 0, 1),
    "fold beside a branch": (lambda y, t: (y * y - t) * (y - 3.0), 3, 1, 2),
    "fourth power": (lambda y, t: y**4 - t, 2, 0, None),  # a root of four: three digits
    "figure eight": (lambda y, t: (t * t + y * y) ** 2 - t * t + y * y, 2, 2, 1),
    "two lines": (lambda y, t: y * (t - y), 2, 2, 1),
    "two lines beside a branch": (lambda y, t: (y - t) * (y + t) * (y + 5.0), 3, 3, 2),
    "a line and a parabola": (lambda y, t: (y - t * t) * (t - y), 2, 2, 1),
    "loop": (lambda y, t: y * y - t * t * (1.0 - t), 2, 2, 1),
    "three of one cubic": (lambda y, t: y * (y - math.sin(t)) + 0.1 * y**3, 3, 3, 2),
}


class Curve(PiecewiseSystem):
    """One equation in y, turned into n unknowns, of which the others follow y."""

    def __init__(self, residual, end, n, size, rng):
        self.size, self._formula, self._end, self._length = n, residual, end, size
        self._frame = np.linalg.qr(rng.normal(size=(n, n)))[0] if n > 1 else np.eye(1)
        self._slopes = rng.normal(size=n)

    def scale(self, lo, hi):
        return super().scale(lo, hi) if self._length == 1.0 else np.full(self.size, self._length)

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        y = self._frame.T @ z / self._length
        first = self._formula(y[0], alpha - self._end)
        return np.array([first, *(y[1:] - self._slopes[1:] * np.sin(y[0]))])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", HALF_LINE)
@pytest.mark.sweep(64)
def test_an_interval_may_end_where_the_derivative_is_singular(name, seed):
    residual, above, below, there = HALF_LINE[name]
    rng = np.random.default_rng([seed, *name.encode()])
    n, end = seed // 2 + 1, float(rng.integers(-2, 3)) * (seed % 2)
    size = 10.0 ** rng.integers(-3, 4) if seed % 2 else 1.0
    length = rng.uniform(0.3, 0.8)
    for side, number in ((1.0, above), (-1.0, below)):
        interval = min(end, end + side * length), max(end, end + side * length)
        graph = explore(Curve(residual, end, n, size, rng), interval)
        for part in rng.uniform(0.05, 0.95, 5):
            assert graph.count(end + side * part * length) == number, (graph.guarantee, interval)
        assert there in (None, graph.count(end)), (graph.guarantee, interval)


class Kinked(PiecewiseSystem):
    size = 1

    def bounds(self):
        return -0.9, 0.9

    def test_functions(self, z, alpha):
        return z[:1]

    def residual(self, z, alpha, character):
        return (1.0 if character.signs[0] else -1.0) * z + z * z - alpha


def test_a_kink_that_turns_outside_is_one_solution():
    graph = explore(Kinked(), (-1.0, 0.0))
    assert not graph.pieces
    assert graph.count(0.0) == 1
    assert graph.count(-0.5) == 0
    assert "nothing found" not in graph.guarantee


class Periodic(PiecewiseSystem):
    """cos(z) = alpha: a fold at alpha = 1 at each multiple of 2 pi."""

    size, calls = 1, 0

    def test_functions(self, z, alpha):
        return z[:1] + 70.0

    def residual(self, z, alpha, character):
        self.calls += 1
        return np.cos(z) - alpha


@pytest.mark.slow
def test_a_hundred_folds_at_an_end_cost_little():
    """Whether a start lies on one of the many pieces is seen without following these again."""
    graph = explore(Periodic(), (0.2, 1.0))
    turned = np.array([abs(s.z[0]) for s in graph.solutions(0.5)]) % (2.0 * np.pi)
    off = np.abs(turned[:, np.newaxis] - np.arccos(0.5) * np.array([1.0, 5.0])).min(axis=1)
    assert off.max() < 1e-9
    assert graph.system.calls < 5000 * len(graph.pieces)
