"""Folds far closer together than a step: bumps in alpha(z), against a fine sampling of alpha(z)."""

from itertools import pairwise

import numpy as np
import pytest

import pwscont.transitions.smooth_folds
from pwscont import (
    BranchGraph,
    PiecewiseSystem,
    PseudoArclength,
    StepSize,
    Switched,
    explore,
    trace,
)

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
@pytest.mark.sweep(3)
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


def test_a_formula_that_sums_over_all_entries_keeps_both_folds():
    """alpha = z + 2 w exp(-((z - c) / w)^2), with a sum over all entries of z in the formula."""
    w, c = 0.01, 1.7137

    def f(z, alpha, sw):
        return z + 2.0 * w * np.exp(-np.sum((z - c) ** 2) / w**2) - alpha + sw.relu(z - 50.0)

    assert trace(Switched(1, f), ([-2.0], -2.0), (-2.0, 2.0)).count(1.73269) == 3


@pytest.mark.parametrize(("e", "c"), [(1e-6, 0.0), (1e-5, 0.3), (1e-7, -0.2), (1e-6, 0.7)])
@pytest.mark.sweep(2)
def test_a_piece_that_passed_over_two_folds_is_replaced(e, c):
    """alpha = y^3 - e y + c, y = z - c: steps pass over both folds; a start is between."""
    graph = explore(Switched(1, lambda z, t, sw: (z - c) ** 3 - e * (z - c) + c - t), (-1.0, 1.1))
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    rise = 2.0 * (e / 3.0) ** 1.5
    assert folds == pytest.approx([c - rise, c + rise], rel=0.0, abs=1e-15)
    assert [graph.count(t) for t in (-0.7, c, 0.9)] == [1, 3, 1]


@pytest.mark.parametrize("power", [5, 7])
def test_a_flat_stretch_between_rises_is_no_end(power):
    """alpha = z^5: alpha is level to rounding around z = 0, and no step length ends beside it."""
    graph = trace(Switched(1, lambda z, t, sw: z**power - t), ([1.0], 1.0), (-1.0, 1.2))
    assert len(graph.pieces) == 1
    for t in (-0.9, -1e-9, 1e-4, 1.1):
        (solution,) = graph.solutions(t)
        assert solution.z[0] == pytest.approx(np.copysign(abs(t) ** (1.0 / power), t), rel=1e-9)


@pytest.mark.parametrize("c", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.sweep(10)
def test_no_step_crosses_a_pole(sign, c):
    """z - alpha - c / z: two branches turn next to z = 0 within sqrt(c), or fold there."""
    system = Switched(1, lambda z, t, sw: z - t - sign * c / z)
    graph = explore(system, (-1.0, 1.3))
    for t in (-0.7, -0.1, 0.0, 0.3, 1.0):
        inside = t * t + 4.0 * sign * c
        far = 0.5 * (t + np.copysign(np.sqrt(abs(inside)), t))
        truth = sorted([far, -sign * c / far]) if inside > 0.0 else []
        found = sorted(float(solution.z[0]) for solution in graph.solutions(t))
        assert found == pytest.approx(truth, rel=1e-6, abs=0.0)


def five_solutions(e, c):
    """Return alpha = c + u^5 - e u^3 + e^2 u / 5, u = z - c, the alphas of folds, and a start."""
    f = Switched(1, lambda z, t, sw: (u := z - c) ** 5 - e * u**3 + 0.2 * e * e * u + c - t)
    turns = np.sqrt(0.1 * e * (3.0 + np.sqrt(5.0) * np.array([-1.0, 1.0])))
    rise = abs(turns**5 - e * turns**3 + 0.2 * e * e * turns)
    alphas = sorted(c + sign * h for sign in (-1.0, 1.0) for h in rise)
    roots = np.roots([1.0, 0.0, -e, 0.0, 0.2 * e * e, c + 1.0])
    return f, alphas, c + roots[np.abs(roots.imag) < 1e-12].real.min()


@pytest.mark.parametrize(("e", "c"), [(3.26e-4, -0.728), (1e-3, 0.0), (3.26e-4, 0.0)])
def test_two_pairs_of_folds_at_nearly_one_alpha(e, c):
    system, folds, start = five_solutions(e, c)
    graph = trace(system, ([start], -1.0), (-1.0, 1.0))
    found = sorted(point.alpha for point in graph.special_points("fold"))
    assert found == pytest.approx(folds, rel=0.0, abs=1e-14)
    assert [graph.count(t) for t in (-0.9, c, 0.9)] == [1, 5, 1]


def test_a_piece_on_which_alpha_turns_is_said(monkeypatch):
    """Where one fold of a pair was passed over, alpha falls and rises on the next piece."""
    usual = pwscont.transitions.smooth_folds._turns_twice

    def passes_over(segment):
        """Return whether alpha turns twice by clearly more than the folds differ."""
        rise = segment.length * max(map(abs, segment.slopes_of_alpha()))
        return rise > 1e-11 * segment.curve.metric.width and usual(segment)

    monkeypatch.setattr(pwscont.transitions.smooth_folds, "_turns_twice", passes_over)
    system, _, start = five_solutions(1e-4, -0.5)
    graph = trace(system, ([start], -1.0), (-1.0, 1.0))
    assert len(graph.special_points("fold")) % 2 == 1
    assert "a fold was passed over" in graph.guarantee


class Warm(PiecewiseSystem):
    """y(z) = alpha with y^3 + y = z, by Newton from the last y, which stays in a list."""

    size = 1

    def __init__(self):
        self.kept = [1.0]

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        y = self.kept[0]
        for _ in range(40):
            y = y - (y**3 + y - z[0]) / (3.0 * y**2 + 1.0)
        self.kept[0] = y
        return np.array([y - alpha])


def test_places_inside_a_step_do_not_disturb_what_h_keeps():
    graph = trace(Warm(), ([0.0], 0.0), (-2.0, 2.0))
    np.testing.assert_allclose([s.z[0] for s in graph.solutions(1.0)], [2.0], rtol=1e-12)


def test_folds_of_a_narrow_bump_of_a_formula_are_found():
    """alpha = z + 0.01 exp(-((z - 0.3) / 0.004)^2) has two folds beside the bump."""

    def bump(z, a, sw):
        return z + 0.01 * np.exp(-(((z - 0.3) / 0.004) ** 2)) - a

    graph = trace(Switched(1, bump), ([-1.0], -1.0), (-1.0, 1.0))
    assert len(graph.special_points("fold")) == 2
    assert graph.count(0.308) == 3
