"""Differences in the units of the problem, within the interval; against derivatives by hand."""

from dataclasses import replace
from itertools import product
from zlib import crc32

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import (
    BranchGraph,
    FoldLocus,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    TransitionLocus,
    check_system,
    enumerate_solutions,
    explore,
    trace,
)
from pwscont.basics.rounding import EPS
from pwscont.system.differences import FINE_STEP, REFINEMENT, STEP, Differences

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

UNITS = [1e-12, 1e-9, 1e-5, 1.0, 1e5, 1e12]


def in_units(length, force, time):
    """Return z^3 - z = alpha, with a kink at z = 0.3, in three units; scale() knows the first."""

    class System(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z / length - 0.3

        def residual(self, z, alpha, character):
            y = z / length
            kink = 0.0 if character.signs[0] else 0.5 * (y - 0.3)
            return force * (y**3 - y - alpha / time + kink)

        def scale(self, lo, hi):
            return np.array([length])

    return System()


@pytest.fixture(scope="module")
def reference():
    return explore(in_units(1.0, 1.0, 1.0), (-1.0, 1.0))


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("which", ["length", "force", "time"])
@pytest.mark.sweep(20)
def test_the_same_system_in_other_units_gives_the_same_graph(unit, which, reference):
    units = {"length": 1.0, "force": 1.0, "time": 1.0, which: unit}
    time = units["time"]
    graph = explore(in_units(**units), (-time, time))
    kinds = [point.kind for point in graph.special_points()]
    assert kinds == [point.kind for point in reference.special_points()]
    alphas = [point.alpha / time for point in graph.special_points()]
    expected = [point.alpha for point in reference.special_points()]
    np.testing.assert_allclose(alphas, expected, rtol=1e-9, atol=1e-9)
    for alpha in np.linspace(-0.93, 0.93, 7):
        z = sorted(s.z[0] / units["length"] for s in graph.solutions(time * alpha))
        np.testing.assert_allclose(z, np.sort(roots(alpha)), rtol=1e-9)


def roots(alpha):
    """Return all z by the roots of both polynomials, each on its own side of the kink."""
    above = [r.real for r in np.roots([1, 0, -1, -alpha]) if abs(r.imag) < 1e-9 and r.real >= 0.3]
    below = np.roots([1, 0, -0.5, -alpha - 0.15])
    return above + [r.real for r in below if abs(r.imag) < 1e-9 and r.real < 0.3]


# -- the formulas --------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("at", [0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0])
def test_jacobian_of_a_smooth_function_in_any_units(unit, at):
    """Steps fit the units, and stay in the interval of alpha."""
    differences = Differences(np.array([unit, 2.0 * unit]), 0.0, 2.0 * unit)
    seen = []

    def function(x):
        seen.append(x[1])
        return np.array([np.sin(x[0] / unit) * np.exp(x[1] / unit)])

    x = np.array([0.7 * unit, 2.0 * at * unit])
    expected = np.exp(2.0 * at) / unit * np.array([[np.cos(0.7), np.sin(0.7)]])
    np.testing.assert_allclose(differences.jacobian(function, x), expected, rtol=1e-9)
    assert min(seen) >= 0.0
    assert max(seen) <= 2.0 * unit


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9])
def test_steps_far_from_the_origin_balance_truncation_and_cancellation(ratio):
    """sin(x) + x at x = ratio: its terms cancel with EPS x; the step grows like the cube root."""
    differences = Differences(np.array([1.0, 1.0]))
    found = differences.jacobian(lambda x: np.array([np.sin(x[0]) + x[0]]), np.array([ratio, 0.0]))
    error = (STEP * ratio ** (1.0 / 3.0)) ** 2 + EPS ** (2.0 / 3.0) * ratio ** (2.0 / 3.0)
    assert abs(found[0, 0] - np.cos(ratio) - 1.0) <= error


def test_an_interval_far_from_zero_and_one_of_a_few_floats():
    lo = 1e6
    for hi in (lo + 6.28, lo + 64 * np.spacing(lo)):
        differences = Differences(np.array([1.0, hi - lo]), lo, hi)
        for alpha in (lo, 0.5 * (lo + hi), hi):
            slope = differences.by_parameter(lambda a: np.array([3.0 * (a - lo)]), alpha)
            np.testing.assert_allclose(slope, [3.0], rtol=1e-8)


@pytest.mark.parametrize("alpha", [-1.0, -1.0 + FINE_STEP, 0.0, 1.0 - 0.5 * FINE_STEP, 1.0])
@pytest.mark.parametrize("length", [-1.0, 1.0, 1e4])
def test_derivative_along_a_direction_is_of_fourth_order_everywhere(alpha, length):
    differences = Differences(np.array([1.0, 2.0]), -1.0, 1.0)
    seen = []

    def function(x):
        seen.append(x[1])
        return np.array([np.sin(x[0] + 2.0 * x[1])])

    direction = length * np.array([0.6, 0.8])
    found = differences.along(function, np.array([0.3, alpha]), direction)
    assert found[0] / length == pytest.approx(2.2 * np.cos(0.3 + 2.0 * alpha), abs=1e-10)
    assert -1.0 <= min(seen) <= max(seen) <= 1.0


@pytest.mark.parametrize(
    ("lo", "hi"), [(-np.inf, np.inf), (0.0, np.inf), (-np.inf, -3.0), (1e6, 1e6 + 4.0), (-0.5, 0.5)]
)
def test_affine_functions_are_differenced_to_rounding(lo, hi):
    matrix, seen = np.array([[3.0, -2.0], [0.1, 7.0]]), []

    def function(x):
        seen.append(x[1])
        return matrix @ x + 1.0

    found = Differences(np.array([0.125, 1.0]), lo, hi).exact(function)
    terms = 7.0 * max(abs(end) for end in (lo, hi, 1.0) if np.isfinite(end)) + 1.0
    np.testing.assert_allclose(found, matrix, rtol=0, atol=8.0 * EPS * terms / 0.125)
    assert lo <= min(seen) <= max(seen) <= hi


# -- in a run ------------------------------------------------------------------------------------


def test_the_system_of_a_run_is_the_same_object_in_all_but_its_differences():
    class Counting(PiecewiseSystem):
        __slots__ = ("slot",)
        size = 1
        calls = 0

        def __init__(self):
            self.slot = 2.0

        def test_functions(self, z, alpha):
            return z - 5.0

        def residual(self, z, alpha, character):
            self.calls += 1
            return z - self.slot * alpha

    system = Counting()
    within = system.within(0.0, 1e-6)
    within.residual(np.zeros(1), 0.0, within.character(np.zeros(1), 0.0))
    assert system.calls == within.calls == 1
    assert within.differences(0.0).hi == 1e-6
    assert system.differences(0.0).hi == np.inf
    jacobian = system.jacobian(np.zeros(1), 0.0, system.character(np.zeros(1), 0.0))
    np.testing.assert_allclose(jacobian, [[1.0, -2.0]], rtol=1e-9)
    assert trace(system, ([0.0], 0.0), (0.0, 1.0)).count(0.5) == 1
    assert system.calls > 3


LENGTHS = [(0.0, 6.28e-6), (1e6, 1e6 + 6.28), (0.0, 6.28), (0.0, 6.28e9)]


@pytest.mark.parametrize("interval", LENGTHS)
def test_a_load_path_without_derivative_in_any_interval(interval):
    """The unit square of the paper, dragged once round: as the same path in natural units."""
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    lo, hi = interval

    def path(alpha):
        assert lo <= alpha <= hi
        t = 6.28 * (alpha - lo) / (hi - lo)
        return np.array([1.0 + 0.3 * np.sin(t), 2.0 * np.cos(t)])

    def natural(t):
        return np.array([1.0 + 0.3 * np.sin(t), 2.0 * np.cos(t)])

    graph = explore(CoulombLoad(body, path, 0.5), interval)
    reference = explore(CoulombLoad(body, natural, 0.5), (0.0, 6.28))
    assert [p.kind for p in graph.special_points()] == [p.kind for p in reference.special_points()]
    for t in np.linspace(0.1, 6.2, 9):
        alpha = lo + t / 6.28 * (hi - lo)
        found = [s.z for s in graph.solutions(alpha)]
        expected = [s.z for s in reference.solutions(t)]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_a_linear_system_is_not_evaluated_outside_its_interval():
    seen = []

    class Straight(PiecewiseLinearSystem):
        size = 1

        def test_functions(self, z, alpha):
            seen.append(alpha)
            return z - 2.5

        def residual(self, z, alpha, character):
            seen.append(alpha)
            return z - alpha + (0.5 * (z - 2.5) if character.signs[0] else 0.0)

    graph = explore(Straight(), (2.0, 3.0))
    assert [point.alpha for point in graph.special_points("transition")] == [pytest.approx(2.5)]
    assert 2.0 <= min(seen) <= max(seen) <= 3.0


class Pitchfork(PiecewiseSystem):
    """z (alpha - z^2) = 0, which is undefined for alpha < 0: its branch point is at an end."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 5.0

    def residual(self, z, alpha, character):
        assert alpha >= 0.0
        return z * (alpha + 0.5 * np.sqrt(alpha + 1.0) - 0.5 - z**2)


def test_a_start_next_to_the_end_of_the_interval():
    graph = trace(Pitchfork(), ([0.0], 0.5), (0.0, 1.0))
    assert graph.count(0.7) >= 1


@pytest.mark.parametrize("end", [0.0, 1e-7])
def test_loci_are_not_evaluated_beyond_their_ranges(end):
    seen = []

    def family(mu):
        class Member(PiecewiseSystem):
            size = 1

            def test_functions(self, z, alpha):
                seen.append((alpha, mu))
                return z - mu

            def residual(self, z, alpha, character):
                seen.append((alpha, mu))
                return z - alpha + (0.25 * (z - mu) if character.signs[0] else 0.0)

        return Member()

    locus = TransitionLocus(family, 0, mu=0.5, alphas=(0.0, 1.0))
    trace(locus, (np.array([0.5, 0.5]), 0.5), (end, 1.0))
    alphas, mus = np.array(seen).T
    assert mus.min() >= end
    assert mus.max() <= 1.0
    assert alphas.min() >= -1e-9


def test_a_fold_locus_in_small_units():
    """alpha = z^3 - 3 mu z folds at z = sqrt(mu): alpha = -2 mu^1.5, all in units of 1e-6."""
    unit = 1e-6

    def family(mu):
        class Member(PiecewiseSystem):
            size = 1

            def test_functions(self, z, alpha):
                return z - 100.0 * unit

            def residual(self, z, alpha, character):
                y = z / unit
                return y**3 - 3.0 * mu / unit * y - alpha / unit

            def scale(self, lo, hi):
                return np.array([unit])

        return Member()

    locus = FoldLocus(family, mu=unit, alphas=(-10.0 * unit, 10.0 * unit))
    graph = trace(locus, locus.start([unit], -2.0 * unit, unit), (0.5 * unit, 2.0 * unit))
    for mu in (0.7, 1.0, 1.7):
        (solution,) = graph.solutions(mu * unit)
        assert solution.z[0] / unit == pytest.approx(mu**0.5, rel=1e-7)
        assert solution.z[-1] / unit == pytest.approx(-2.0 * mu**1.5, rel=1e-7)


@pytest.mark.parametrize("unit", UNITS)
def test_check_system_in_any_units(unit):
    system = in_units(unit, 1.0, 1.0)
    assert check_system(system, [([0.2 * unit], 0.3), ([0.9 * unit], -0.4)])


def test_check_system_of_a_load_path():
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    assert check_system(CoulombLoad(body, AffineLoad([0, 1], [1, 0]), 0.5), [(np.ones(4), 0.3)])


# -- systems without scale() ---------------------------------------------------------------------


def coupled(length, force):
    """Return y^3 - y = alpha with a kink at y = 0.3, and w = y^2, without scale()."""

    class System(PiecewiseSystem):
        size = 2

        def test_functions(self, z, alpha):
            return z[:1] / length - 0.3

        def residual(self, z, alpha, character):
            y = z[0] / length
            kink = 0.0 if character.signs[0] else 0.5 * (y - 0.3)
            return np.array([y**3 - y - alpha + kink, z[1] / force - y**2])

    return System()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("length", "force"),
    [(1.0, 1.0), (1e-5, 1.0), (1e-9, 1e6), (1e-12, 1e-12), (1e6, 1.0), (1e9, 1e-9), (1e12, 1e12)],
)
@pytest.mark.sweep(12)
def test_magnitudes_are_taken_from_solutions(length, force, tmp_path):
    system = coupled(length, force)
    traced = trace(system, ([1.3 * length, 1.69 * force], 1.0), (-1.0, 1.0))
    explored = explore(system, (-1.0, 1.0))
    explored.save(tmp_path / "graph.npz")
    loaded = BranchGraph.load(tmp_path / "graph.npz", system)
    for graph in (traced, explored, loaded):
        kinds = {str(point.kind) for point in graph.special_points()}
        assert {"fold", "transition"} <= kinds
        for alpha in (-0.9, 0.1, 0.25, 0.9):
            found = sorted((s.z / [length, force]).tolist() for s in graph.solutions(alpha))
            expected = sorted([y, y**2] for y in roots(alpha))
            np.testing.assert_allclose(found, expected, rtol=1e-8)


@pytest.mark.slow
def test_magnitudes_of_one_are_kept_where_they_fit():
    graph = explore(coupled(0.5, 0.3), (-1.0, 1.0))
    assert graph.system.scale(-1.0, 1.0).tolist() == [1.0, 1.0]


@pytest.mark.slow
def test_magnitudes_that_the_system_gives_are_kept():
    system = coupled(1e-9, 1.0)
    system.scale = lambda lo, hi: np.array([1e-9, 3.0])
    graph = explore(system, (-1.0, 1.0))
    assert graph.system.differences(0.0).scale.tolist() == [1e-9, 3.0, 2.0]


class Steep(PiecewiseSystem):
    """sin(k (z - a sin(w alpha))) = 0: the usual step changes the argument by more than one."""

    size = 1
    k, a, w, height = 150.0, 7.0, 17.0, 2.0

    def __init__(self):
        self.asked = 0

    def test_functions(self, z, alpha):
        return z - self.height

    def residual(self, z, alpha, character):
        self.asked += 1
        return np.sin(self.k * (z - self.a * np.sin(self.w * alpha)))


@pytest.mark.slow
def test_steps_become_finer_where_newton_converges_slowly():
    system, interval = Steep(), (0.0, 2.0)
    assert system.k * system.a * system.w * STEP * 2.0 > 0.2  # radians within a step of alpha
    graph = trace(system, ([0.0], 0.0), interval)
    first, period = np.arcsin(system.height / system.a), 2.0 * np.pi
    turns = np.arange(0.0, 17.0) * period
    expected = np.sort(np.concatenate([turns + first, turns + np.pi - first])) / system.w
    found = [point.alpha for point in graph.special_points("transition")]
    np.testing.assert_allclose(found, expected[expected < 2.0], rtol=1e-9)
    assert graph.count(1.0) == 1
    assert system.asked < 600_000  # nine in ten are looks inside the steps


@pytest.mark.parametrize("at", [0.0, 0.3])
def test_finer_steps_see_narrower_functions(at):
    width = 1e-5
    differences = Differences(np.ones(2), -1.0, 1.0)
    expected = 1.0 / (width * np.cosh(at) ** 2)
    x = np.array([0.0, at * width])
    slopes = []
    for _ in range(4):
        slopes.append(float(differences.jacobian(lambda y: np.tanh(y[1:] / width), x)[0, 1]))
        differences = replace(differences, part=REFINEMENT * differences.part)
    errors = np.abs(np.array(slopes) / expected - 1.0)
    assert errors[0] > 0.05
    assert errors[1] < 2e-3
    assert (errors[2:] < 1e-5).all()


class NoisyEnd(PiecewiseSystem):
    """A cubic with two folds, right to 1e-11 only, beside a branch on which the model ends."""

    size, noise = 1, 1e-11

    def test_functions(self, z, alpha):
        return z - 50.0

    def residual(self, z, alpha, character):
        with np.errstate(invalid="ignore"):
            ending = z - 6.0 - np.sqrt(0.9 - alpha)
        noise = 2.0 * (crc32(np.append(z, alpha).tobytes()) / 2.0**32) - 1.0
        return ending * (z**3 - z - alpha) + self.noise * noise


@pytest.mark.slow
def test_where_a_model_ends_steps_do_not_become_finer():
    ending = 6.0 + np.sqrt(1.4)
    graph = explore(NoisyEnd(), (-1.0, 1.0), starts=[([ending], -0.5)])
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    np.testing.assert_allclose(folds, [-2.0 / 27.0**0.5, 2.0 / 27.0**0.5], atol=1e-10)
    assert graph.count(0.0) == 4
    assert graph.system.differences(0.0).part == 1.0


class Chained(PiecewiseLinearSystem):
    """H = A z + B max(z, 0) + c + d alpha, with unknowns and equations in units of their own."""

    def __init__(self, seed, unknowns, equations):
        rng, n = np.random.default_rng(seed), len(unknowns)
        self.size, self.unknowns, self.equations = n, unknowns, equations
        self.A, self.B = rng.normal(size=(n, n)), 1.5 * rng.normal(size=(n, n))
        self.c, self.d = rng.normal(size=(2, n))

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        y = z / self.unknowns
        rest = self.A @ y + self.B @ np.where(character.array, y, 0.0) + self.c + self.d * alpha
        return self.equations * rest

    def number_of_solutions(self, alpha):
        found = 0
        for signs in product((False, True), repeat=self.size):
            y = np.linalg.solve(self.A + self.B * signs, -self.c - self.d * alpha)
            found += np.array_equal(y > 0.0, signs)
        return found


@pytest.mark.parametrize("seed", range(12))
def test_affine_functions_in_any_units(seed):
    """Solutions of 2^60 and of 2^-60 next to constants of 1; powers of two round nothing."""
    rng = np.random.default_rng(seed + 100)
    unknowns, equations = 2.0 ** rng.choice([-60, 0, 60], (2, 1 + seed % 3))
    system = Chained(seed, unknowns, equations)
    expected = system.number_of_solutions(0.3)
    assert len(enumerate_solutions(system, 0.3)) == expected
    assert explore(system, (-1.0, 1.0)).count(0.3) == expected
