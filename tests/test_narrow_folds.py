"""Folds far closer together than a step: bumps in alpha(z), against a fine sampling of alpha(z)."""

from itertools import pairwise

import numpy as np
import pytest

from pwscont import BranchGraph, PiecewiseSystem, PseudoArclength, StepSize, Switched, trace
from pwscont.extending import TakesColumns

SHAPES = {
    "gauss": lambda t: np.exp(-(t**2)),
    "lorentz": lambda t: 1.0 / (1.0 + t**2),
    "sech": lambda t: 1.0 / np.cosh(np.clip(t, -300.0, 300.0)),
    "dipole": lambda t: t * np.exp(-(t**2)),
}
INTERVAL = (-2.0, 2.0)


class Bump(PiecewiseSystem):
    """alpha = y + 0.3 sin(y) + A f((y - c) / w) in the first of n rotated unknowns."""

    def __init__(self, shape, w, rng):
        self.size = int(rng.integers(1, 5))
        self.w, self.c = w, rng.uniform(-0.8, 0.8)
        self.height, self.shape = w * rng.uniform(2.5, 6.0) * rng.choice([-1, 1]), SHAPES[shape]
        self.turned = np.linalg.qr(rng.normal(size=(self.size, self.size)))[0]
        self.sway = 0.5 * rng.normal(size=self.size)

    def alpha(self, y):
        return y + 0.3 * np.sin(y) + self.height * self.shape((y - self.c) / self.w)

    def at(self, y):
        others = self.sway[1:] * np.sin(y + np.arange(1, self.size))
        return self.turned @ np.concatenate([[y], others])

    def test_functions(self, z, alpha):
        return z[:1] + 50.0

    def residual(self, z, alpha, character):
        y = self.turned.T @ z
        others = y[1:] - self.sway[1:] * np.sin(y[0] + np.arange(1, self.size))
        return self.turned @ np.concatenate([[self.alpha(y[0]) - alpha], others])

    def truth(self):
        """Return the alphas of all folds, and a function that counts solutions."""
        near = self.c + self.w * np.linspace(-12.0, 12.0, 8001)
        alpha = self.alpha(np.unique(np.concatenate([np.linspace(-2.0, 2.0, 4001), near])))
        turns = np.flatnonzero(np.diff(np.sign(np.diff(alpha)))) + 1
        return np.sort(alpha[turns]), lambda a: int((np.diff(np.sign(alpha - a)) != 0).sum())


def agrees(system, graph):
    folds, count = system.truth()
    between = [0.37 * a + 0.63 * b for a, b in pairwise(folds)]
    return len(graph.special_points("fold")) == len(folds) and all(
        graph.count(a) == count(a) for a in between
    )


def cases(widths, many):
    return [
        (shape, w, (i, j, k))
        for i, shape in enumerate(SHAPES)
        for j, w in enumerate(widths)
        for k in range(many)
    ]


@pytest.mark.parametrize(("shape", "w", "seed"), cases((0.01, 0.002), 1))
def test_both_folds_of_a_narrow_bump_are_found(shape, w, seed):
    system = Bump(shape, w, np.random.default_rng(seed))
    start = system.c + 0.5
    graph = trace(system, (system.at(start), system.alpha(start)), INTERVAL)
    assert agrees(system, graph)


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "w", "seed"), cases((0.01, 0.005, 0.003, 0.002), 25))
def test_bumps_wider_than_stated_are_found(shape, w, seed):
    test_both_folds_of_a_narrow_bump_are_found(shape, w, (7, *seed))


def test_a_smaller_gap_finds_narrower_bumps_and_the_graph_states_it(tmp_path):
    close = PseudoArclength(step_size=StepSize(gap=0.0007))
    for seed in range(2):
        system = Bump("gauss", 2e-4, np.random.default_rng(seed))
        start = system.c + 0.5
        graph = trace(system, (system.at(start), system.alpha(start)), INTERVAL, stepper=close)
        assert agrees(system, graph)
    assert "closer together along a curve than 0.0007" in graph.searched.unseen
    graph.save(tmp_path / "graph.npz")
    assert BranchGraph.load(tmp_path / "graph.npz").searched.unseen == graph.searched.unseen


class OnALine(PiecewiseSystem, TakesColumns):
    """A bump in a residual that takes columns of points, or mixes the columns."""

    size = 1

    def __init__(self, mixes):
        self.bump, self.mixes, self.calls = Bump("gauss", 0.01, np.random.default_rng(3)), mixes, []

    def test_functions(self, z, alpha):
        return z[:1] + 50.0

    def residual(self, z, alpha, character):
        return self.bump.alpha(0.0 * z + z.sum() if self.mixes else z) - alpha

    def residual_of_columns(self, z, alpha, character):
        self.calls.append(z.shape)
        return self.residual(z, alpha, character)


@pytest.mark.parametrize("mixes", [False, True])
def test_h_is_asked_at_many_places_at_once_only_where_columns_are_not_mixed(mixes):
    """A sum over all entries is right for a single point, and wrong for columns of points."""
    system = OnALine(mixes)
    start = system.bump.c + 0.5
    graph = trace(system, (np.array([start]), system.bump.alpha(start)), INTERVAL)
    folds, count = system.bump.truth()
    assert sorted(p.alpha for p in graph.special_points("fold")) == pytest.approx(folds, abs=1e-5)
    assert all(
        graph.count(a) == count(a) for a in [0.37 * a + 0.63 * b for a, b in pairwise(folds)]
    )
    assert len(system.calls) == 1 if mixes else len(system.calls) > 1


def test_a_formula_takes_columns_of_points():
    """Values of a formula with nested switches are the same for columns and one by one."""

    def f(z, alpha, sw):
        inner = sw.max(z[0] - alpha, sw.abs(z[1]) - 0.3)
        return [
            z[0] ** 3 - sw.relu(inner) + alpha,
            sw.clip(z[1] + alpha, -0.5, 0.5) - sw.min(z[0], 0.2),
        ]

    system, rng = Switched(2, f), np.random.default_rng(0)
    points = rng.normal(size=(system.size + 1, 7))
    for character in system.cells():
        together = system.residual_of_columns(points[:-1], points[-1], character)
        single = [system.residual(x[:-1], x[-1], character) for x in points.T]
        np.testing.assert_allclose(together.T, single, rtol=1e-13, atol=1e-13)
