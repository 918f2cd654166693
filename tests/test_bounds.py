"""Branches on the bounds of unknowns: a bound that holds with equality is not left."""

from itertools import combinations

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, explore, trace
from pwscont.search import MultiStart


def curve(f, size=1, bounds=(0.0, 9.0)):
    return Switched(size, f, bounds=bounds)


@pytest.mark.parametrize("rate", [0.5, 1.0, 7.0])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.sweep(8)
def test_a_branch_that_leaves_its_bounds_on_another_is_named(rate, unit):
    """An epidemic: nobody is ill, or a part 1 - rate / b of all, of which b < rate makes none."""
    f = lambda z, b, sw: (b * (1.0 - z / unit) - rate) * z  # noqa: E731
    starts = [([0.0], 0.1 * rate), ([0.0], 3.0 * rate), ([unit * 2.0 / 3.0], 3.0 * rate)]
    system, interval = curve(f, bounds=(0.0, unit)), (0.1 * rate, 3.0 * rate)
    graph = explore(system, interval, starts=starts, search=MultiStart(count=1))
    assert [graph.count(b * rate) for b in (0.5, 1.5, 2.9)] == [1, 2, 2]
    assert "missing" not in graph.guarantee
    (point,) = graph.special_points("branch point")
    assert point.alpha == pytest.approx(rate)
    assert "a branch ends on its bound" in point.message


@pytest.mark.parametrize("start", [0.0, 1e-16, -9e-17, 3e-12])
@pytest.mark.parametrize("share", [0.025, 0.1, 1.0 / 3.0])
@pytest.mark.sweep(5)
def test_wash_out_of_a_reactor_is_one_branch(start, share):
    def f(z, t, sw):
        made = 10.0**t * z[0] * z[1] ** 2
        return [1.0 - z[0] - made, made - z[1] - 10.0**t * share * z[1]]

    graph = trace(curve(f, 2, (0.0, 2.0)), ([1.0, start], 0.0), (0.0, 4.0))
    assert [(lo, hi, count) for lo, hi, count in graph.multiplicity()] == [(0.0, 4.0, 1)]
    assert graph.guarantee == "balanced"


def equilibria(A, r):
    """Return all equilibria of x_i (r_i - (A x)_i) = 0 with x >= 0."""
    found, n = [], len(r)
    for some in (list(c) for k in range(n + 1) for c in combinations(range(n), k)):
        x = np.zeros(n)
        x[some] = np.linalg.solve(A[np.ix_(some, some)], r[some]) if some else 0.0
        if (x[some] > 0.0).all():
            found.append(x)
    return found


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(4)
def test_communities_of_species(seed):
    """Lotka and Volterra: species come and go where branches cross on a bound."""
    rng = np.random.default_rng(seed)
    A = 1.5 * np.eye(2) + rng.uniform(-0.5, 1.2, (2, 2)) * (1.0 - np.eye(2))
    r, s = rng.uniform(-0.5, 1.0, 2), rng.uniform(0.3, 1.0, 2)
    interval = (-1.0, 2.0)
    starts = [(x, alpha) for alpha in interval for x in equilibria(A, r + alpha * s)]
    system = curve(lambda z, t, sw: z * (r + t * s - A @ z), 2, (0.0, 50.0))
    graph = explore(system, interval, starts=starts, search=MultiStart(count=1))
    for alpha in rng.uniform(-0.95, 1.95, 6):
        assert graph.count(alpha) == len(equilibria(A, r + alpha * s))
    assert "missing" not in graph.guarantee


def test_a_bound_that_is_touched_is_not_left():
    graph = trace(curve(lambda z, t, sw: z - (t - 0.3) ** 2), ([1.69], -1.0), (-1.0, 1.0))
    assert [p.kind for p in graph.special_points()] == ["start", "end"]
    assert graph.count(0.9) == 1


def test_a_bound_that_is_crossed_is_left():
    graph = trace(curve(lambda z, t, sw: z + t**3), ([1.0], -1.0), (-1.0, 1.0))
    assert graph.count(0.5) == 0
    assert graph.special_points("end")[0].alpha == pytest.approx(0.0, abs=1e-4)


@pytest.mark.slow
def test_a_path_that_repeats_itself_is_followed_to_its_bounds():
    system = curve(lambda z, a, sw: np.sin(z) - a, bounds=(-40.0, 40.0))
    graph = trace(system, ([0.0], 0.0), (-1.2, 1.2))
    for alpha in (-0.9, 0.3, 0.9):
        turns = 2.0 * np.pi * np.arange(-8, 9)
        right = np.hstack([np.arcsin(alpha) + turns, np.pi - np.arcsin(alpha) + turns])
        found = sorted(solution.z[0] for solution in graph.solutions(alpha))
        assert found == pytest.approx(np.sort(right[np.abs(right) < 40.0]), abs=1e-9)
    assert "repeats itself" not in graph.guarantee


@pytest.mark.parametrize("unit", [1.0, 1e-5, 1e7])
@pytest.mark.parametrize("top", [0.1, 0.3])
@pytest.mark.sweep(6)
def test_short_branches_from_bound_to_bound(unit, top):
    """A wave y = sin(9 alpha), of which bounds leave a short piece on each flank."""
    interval = (-1.4, 1.3)

    class Wave(PiecewiseSystem):
        size = 2

        def test_functions(self, z, alpha):
            return z[:1] / unit - 0.05

        def residual(self, z, alpha, character):
            assert interval[0] <= alpha <= interval[1]
            y, other = z / unit
            more = 0.5 * (y - 0.05) * character.signs[0]
            return np.array([y - np.sin(9.0 * alpha), other - y - more])

        def bounds(self):
            return np.array([0.0, -np.inf]), unit * np.array([top, 9.0])

    graph = explore(Wave(), interval)
    turns = np.arange(-9, 10) * np.pi
    flanks = [turn + (-1.0) ** k * np.arcsin([0.0, top]) for k, turn in enumerate(turns, start=-9)]
    ends = sorted(x / 9.0 for x in np.ravel(flanks) if interval[0] < x / 9.0 < interval[1])
    assert sorted(p.alpha for p in graph.special_points("end")) == pytest.approx(ends, abs=1e-9)


def test_a_curve_that_touches_a_bound_from_outside_is_no_solution():
    class Below(PiecewiseSystem):
        size = 2

        def test_functions(self, z, alpha):
            return z[:1] - 0.2

        def residual(self, z, alpha, character):
            kink = (z[0] - 0.2) * (1.0 if character.signs[0] else -1.0)
            return np.array([z[0] + (alpha - 0.3) ** 2, z[1] - kink])

        def bounds(self):
            return np.array([0.0, -np.inf]), np.inf

    graph = explore(Below(), (-1.0, 1.0))
    assert not graph.special_points()
    assert graph.guarantee.startswith("nothing found")


@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e5])
@pytest.mark.parametrize(("slope", "at"), [(-2.0, 1.0), (3.0, 0.4), (0.5, 0.2), (-4.0, 0.5)])
def test_a_straight_branch_without_a_transition_begins_on_a_bound(slope, at, unit):
    """|y| = 1 and x = slope (alpha - at), |x| <= 1, as no start at the lower end has."""

    def rows(z, a, sw):
        return [sw.abs(z[0] / unit) - 1.0, z[1] - slope * (a - at)]

    system = Switched(2, rows, linear=True, bounds=([-9.0 * unit, -1.0], [9.0 * unit, 1.0]))
    interval = -4.0, 1.0
    graph = explore(system, interval)
    for alpha in (-2.0, at - 0.9 / abs(slope), at, min(1.0, at + 0.9 / abs(slope))):
        expected = 2 if abs(slope * (alpha - at)) <= 1.0 else 0
        assert graph.count(alpha) == expected
