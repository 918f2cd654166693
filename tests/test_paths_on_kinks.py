"""Paths that run along a kink: curves of single cells that cross the path, and curved kinks."""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, explore, trace


def on_kink(t, a, sw, above, below):
    """Return H with the path t = 0 on a kink, and the curves ``above = 0`` and ``below = 0``."""
    return sw.max(t, 0.0) * above(t, a) + sw.min(t, 0.0) * below(t, a)


def one(t, a):
    return 1.0 + 0.0 * t


#: The factors above and below the kink, and the number of solutions.
PATHS = {
    "above": (lambda t, a: t - a, one, lambda a: 1 + (a > 0.0)),
    "below": (one, lambda t, a: t - a, lambda a: 1 + (a < 0.0)),
    "both at different alphas": (
        lambda t, a: t - a + 0.3,
        lambda t, a: t - a - 0.4,
        lambda a: 1 + (a > 0.3) + (a < -0.4),
    ),
    "a parabola": (lambda t, a: t - a * a + 0.25, one, lambda a: 1 + (abs(a) > 0.5)),
    "a fold from the path": (lambda t, a: t * t - a, one, lambda a: 1 + (a > 0.0)),
    "a product close to zero between": (
        lambda t, a: t - a - 0.78,
        lambda t, a: t + a + 0.68,
        lambda a: 1 + (a > -0.78) + (a > -0.68),
    ),
}
ALPHAS = (-0.93, -0.61, -0.13, 0.07, 0.44, 0.77)


#: Where the kink lies: straight, oblique and curved.
KINKS = {
    "straight": lambda a: 0.0 * a,
    "oblique": lambda a: 0.37 * a + 0.21,
    "curved": np.sin,
}


@pytest.mark.parametrize("kink", KINKS)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("begin", [-1.0, 1.0])
@pytest.mark.sweep(9)
def test_curves_of_one_cell_cross_a_path_on_a_kink(path, kink, begin):
    """The path is followed by the selection of one cell; a curve of another cell crosses."""
    above, below, count = PATHS[path]
    place = KINKS[kink]
    system = Switched(1, lambda z, a, sw: on_kink(z - place(a), a, sw, above, below))
    graph = trace(system, ([place(begin)], begin), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in ALPHAS] == [count(alpha) for alpha in ALPHAS]
    assert graph.is_balanced()


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS)
def test_search_finds_the_path_and_the_curves(path):
    above, below, count = PATHS[path]
    system = Switched(1, lambda z, a, sw: on_kink(1.3 * z - 0.4 * a, a, sw, above, below))
    graph = explore(system, (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in ALPHAS] == [count(alpha) for alpha in ALPHAS]
    assert graph.is_balanced()


def test_a_path_among_other_unknowns():
    """The kink is oblique, so that the test is zero to rounding only."""

    def equations(z, a, sw):
        t = z[0] - 2.0 * z[1] / 3.0 + 0.1
        return [on_kink(t, a, sw, lambda t, a: t - a, one), z[1] - a / 3.0 - 0.1 * z[0]]

    start = np.linalg.solve([[1.0, -2.0 / 3.0], [-0.1, 1.0]], [-0.1, -1.0 / 3.0])
    graph = trace(Switched(2, equations), (start, -1.0), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in ALPHAS] == [1 + (alpha > 0.0) for alpha in ALPHAS]
    assert graph.is_balanced()


#: Equations whose curves cross on a kink at a point, and the numbers of solutions before and after.
CROSSINGS = {
    "pitchfork": (lambda z, a, sw: z * (sw.abs(z) - a), 0.0, 0.0, (1, 3)),
    "transcritical": (lambda z, a, sw: sw.abs(z) * (z - a), 0.0, 0.0, (2, 2)),
    "one side steeper": (
        lambda z, a, sw: z * (2.0 * sw.relu(z) + sw.relu(-z) - a),
        0.0,
        0.0,
        (1, 3),
    ),
    "bent": (lambda z, a, sw: z * (sw.abs(z) - np.sin(a)), 0.0, 0.0, (1, 3)),
    "elsewhere": (lambda z, a, sw: (z - 0.3) * (sw.abs(z - 0.3) - a + 0.2), 0.3, 0.2, (1, 3)),
}


@pytest.mark.parametrize("name", CROSSINGS)
@pytest.mark.parametrize("part", ["all", "before", "after"])
@pytest.mark.sweep(4)
def test_the_point_where_curves_cross_on_a_kink_is_a_start(name, part):
    """Inside the interval, and at either end: a start there is followed on every curve."""
    equation, z, alpha, (before, after) = CROSSINGS[name]
    lo, hi = {"all": (-1.0, 1.0), "before": (-1.0, alpha), "after": (alpha, 1.0)}[part]
    graph = trace(Switched(1, equation), ([z], alpha), (lo, hi))
    if lo < alpha:
        assert graph.count(-0.7) == before
    if alpha < hi:
        assert graph.count(0.7) == after
    assert graph.is_balanced()


@pytest.mark.slow
@pytest.mark.parametrize("c", [0.04, 0.25, 0.7])
def test_arms_that_form_a_loop_between_two_crossings(c):
    """At both crossings z = 0 is the only solution, wherever between their errors a piece ends."""
    graph = explore(Switched(1, lambda z, a, sw: z * (sw.abs(z) + a * a - c)), (-1.0, 1.0))
    end = np.sqrt(c)
    assert [graph.count(alpha) for alpha in (-0.9, -end, 0.0, end, 0.9)] == [1, 1, 3, 1, 1]
    assert graph.is_balanced()


class OnSine(PiecewiseSystem):
    """The path z = sin(alpha) on a curved kink; all derivatives are differences."""

    size, number_of_tests = 1, 1

    def test_functions(self, z, alpha):
        return np.array([z[0] - np.sin(alpha)])

    def residual(self, z, alpha, character):
        t = z[0] - np.sin(alpha)
        return np.array([t * (t - alpha + (0.3 if character.signs[0] else -0.4))])


class OnSineWithTests(OnSine):
    def test_jacobian(self, z, alpha):
        return np.array([[1.0, -np.cos(alpha)]])


class OnSineWithJacobian(OnSine):
    def jacobian(self, z, alpha, character):
        t, c = z[0] - np.sin(alpha), np.cos(alpha)
        slope = 2.0 * t - alpha + (0.3 if character.signs[0] else -0.4)
        return np.array([[slope, -c * slope - t]])


@pytest.mark.parametrize("system", [OnSine, OnSineWithTests, OnSineWithJacobian])
@pytest.mark.parametrize("begin", [-1.0, -0.1, "explore"])
@pytest.mark.sweep(4)
def test_derivatives_by_differences_on_a_curved_kink(system, begin):
    """Slopes of the test along the path are errors of differences, and larger than rounding."""
    if begin == "explore":
        graph = explore(system(), (-1.0, 1.0))
    else:
        graph = trace(system(), ([np.sin(begin)], begin), (-1.0, 1.0))
    alphas = (-0.9, -0.5, -0.1, 0.2, 0.33, 0.8)
    wanted = [1 + (alpha > 0.3) + (alpha < -0.4) for alpha in alphas]
    assert [graph.count(alpha) for alpha in alphas] == wanted
    assert graph.is_balanced()
    assert len(graph.special_points("branch point")) == 2


#: H on a path t = 0 along a kink, the curve that crosses at s = 0, and the numbers of solutions
#: before, at and after the crossing.
ARMS = {
    "pitchfork": (lambda t, s, sw: t * (t * t - s) * (1.0 + sw.max(t, 0.0)), np.sqrt, (1, 1, 3)),
    "both smooth": (lambda t, s, sw: t * (t * t - s) + 0.0 * sw.abs(t), np.sqrt, (1, 1, 3)),
    "quartic": (lambda t, s, sw: t * (t**4 - s) + 0.0 * sw.abs(t), lambda s: s**0.25, (1, 1, 3)),
    "transcritical": (lambda t, s, sw: t * (t - s) * (1.0 + sw.max(t, 0.0)), float, (2, 1, 2)),
    "of one cell": (
        lambda t, s, sw: on_kink(t, s, sw, lambda t, s: t * t - s, lambda t, s: 2.0 + s),
        np.sqrt,
        (1, 1, 2),
    ),
    "sharp": (lambda t, s, sw: t * (sw.abs(t) - s), float, (1, 1, 3)),
}


@pytest.mark.parametrize("kink", KINKS)
@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("begin", [0.07, 0.25, 0.44, 0.5])
@pytest.mark.sweep(9)
def test_a_curve_that_crosses_a_path_on_a_kink_is_told_from_the_path(arm, kink, begin):
    """Where the curve meets the kink, Newton's method also converges on the path."""
    function, state, counts = ARMS[arm]
    place = KINKS[kink]
    system = Switched(1, lambda z, a, sw: function(z - place(a), a - 0.3, sw))
    graph = trace(system, ([state(begin) + place(begin + 0.3)], begin + 0.3), (-0.6, 0.99))
    assert [graph.count(alpha) for alpha in (-0.01, 0.3, 0.61)] == list(counts)
    assert graph.is_balanced()


def by_differences(arm, place, size):
    """Return a class whose derivatives are differences, with a curved kink among unknowns."""
    mix = 2.0 * np.eye(size) + 0.3 * np.cos(np.arange(size**2)).reshape(size, size)

    class OnCurve(PiecewiseSystem):
        number_of_tests = 1

        def test_functions(self, z, alpha):
            return np.array([(mix @ z)[0] - place(alpha)])

        def residual(self, z, alpha, character):
            sign = 1.0 if character.signs[0] else -1.0
            y = mix @ z
            t, s = y[0] - place(alpha), alpha - 0.3
            value = t * (sign * t - s) if arm == "sharp" else t * (t * t - s) * (2.0 + sign * t)
            return mix.T @ np.append(value, y[1:] + 0.1 * y[:-1] - 0.2)

    OnCurve.size = size
    return OnCurve(), mix


@pytest.mark.parametrize("arm", ["sharp", "pitchfork"])
@pytest.mark.parametrize("kink", KINKS)
@pytest.mark.parametrize("size", [1, 2, 3])
@pytest.mark.parametrize("begin", [0.1, 0.32, 0.55])
@pytest.mark.sweep(9)
def test_the_same_with_derivatives_by_differences(arm, kink, size, begin):
    place = KINKS[kink]
    system, mix = by_differences(arm, place, size)
    y = [place(begin + 0.3) + ARMS[arm][1](begin)]
    for _ in range(size - 1):
        y.append(0.2 - 0.1 * y[-1])
    graph = trace(system, (np.linalg.solve(mix, y), begin + 0.3), (-0.6, 0.99))
    assert [graph.count(alpha) for alpha in (-0.01, 0.61)] == [1, 3]
    assert graph.is_balanced()


@pytest.mark.parametrize("beside", [1e-2, 2e-3, 1e-4, 1e-5, 1e-7])
@pytest.mark.parametrize("begin", [0.31, 0.77])
@pytest.mark.parametrize("tilt", [0.0, 0.2])
@pytest.mark.sweep(4)
def test_a_kink_next_to_a_branch_point_is_no_path(beside, begin, tilt):
    """The curve z = alpha meets the kink close to z = 0, where curves cross inside a cell."""
    system = Switched(
        1, lambda z, a, sw: z * (z - a) * (1.0 + 0.3 * sw.max(z - beside - tilt * a, 0.0))
    )
    graph = trace(system, ([begin], begin), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.9, -0.4, 0.2, 0.6)] == [2, 2, 2, 2]
    assert graph.is_balanced()


@pytest.mark.slow
def test_curves_that_cross_a_path_outside_of_all_cells_are_no_branches():
    """At -0.2 the equations of the cell (-, -) have a curve along (1, -1), outside of the cell."""

    def coupled(z, a, sw):
        first, second = z + 0.5 * sw.abs(z)
        return [z[0] ** 3 - a * z[0] + 0.4 * second, z[1] ** 3 - a * z[1] + 0.4 * first]

    graph = trace(Switched(2, coupled), ([0.0, 0.0], -0.5), (-0.5, 0.25))
    assert str(graph.guarantee) == "balanced"
    for a in (-0.4, -0.25, -0.1, 0.1, 0.23):
        # the first equation gives the second unknown, and the second equation is left
        x = np.linspace(0.001, 1.5, 100_000) * [[-1.0], [1.0]]
        w = (a * x - x**3) / 0.4
        y = np.where(w > 0.0, w / 1.5, w / 0.5)
        rest = np.sign(y**3 - a * y + 0.4 * np.where(x > 0.0, 1.5 * x, 0.5 * x))
        assert graph.count(a) == 1 + (np.diff(rest) != 0.0).sum()


#: Slopes of |z| and z, values of alpha at which each equation branches, signs of alpha, mixing.
PAIRS = {
    "mixed": ([0.82, 0.33], [-1.3, 0.91], [-0.09, -0.39], [1, -1], [[1.11, 0.09], [0.01, 1.16]]),
    "apart": ([0.13, -0.13], [0.64, 0.1], [0.38, 0.5], [1, 1], np.eye(2)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PAIRS)
def test_curves_that_cross_a_path_along_another_kink(name):
    """Equations that are decoupled but for mixing: each branch lies where the other z is zero."""
    moduli, slopes, at, signs, mixing = map(np.array, PAIRS[name])

    def pair(z, a, sw):
        return mixing @ (z * (moduli * sw.abs(z) + slopes * z - signs * (a - at)))

    graph = trace(Switched(2, pair), ([0.0, 0.0], -1.0), (-1.0, 1.0))
    assert str(graph.guarantee) == "balanced"
    for a in (-0.8, -0.45, -0.2, 0.1, 0.5, 0.9):
        load = signs * (a - at)  # of (slope + modulus) z for z > 0, (slope - modulus) z for z < 0
        each = 1 + ((slopes + moduli) * load > 0.0) + ((slopes - moduli) * load < 0.0)
        assert graph.count(a) == each.prod()
