"""Solutions of curved systems that fill a curve or more at one alpha."""

import numpy as np
import pytest

from pwscont import LCP, AllTransitions, PiecewiseSystem, Switched, explore
from pwscont.curve.metric import Metric


def copied(z, alpha, _):
    """(z0 + z1)^3 = alpha, twice."""
    row = (z[0] + z[1]) ** 3 - alpha
    return np.array([row, 2.0 * row])


def circle(z, alpha, _):
    """All points of a circle, for alpha > -1."""
    return np.array([z[0] ** 2 + z[1] ** 2 - 1.0 - alpha, 0.0 * z[0]])


def sum_of_two(z, alpha, _):
    """Only z1 + z2 is given, at the crossings of a circle with a line."""
    both = z[1] + z[2]
    row = z[0] - both * alpha
    return np.array([z[0] ** 2 + both**2 - 1.0 - alpha, row, row])


def above_zero(z, alpha, switch):
    """|z0 + z1| = 1 + alpha, twice, with a kink."""
    row = switch.abs(z[0] + z[1]) - 1.0 - alpha
    return np.array([row, row])


@pytest.mark.parametrize("equal", [copied, circle, sum_of_two, above_zero])
@pytest.mark.sweep(4)
def test_infinitely_many_solutions_are_counted_as_such(equal):
    graph = explore(Switched(3 if equal is sum_of_two else 2, equal), (-0.5, 1.0))
    assert [(lo, hi, count) for lo, hi, count in graph.multiplicity()] == [(-0.5, 1.0, np.inf)]
    assert all(graph.count(alpha) == np.inf for alpha in (-0.5, -0.3, 0.0, 0.123, 1.0))
    assert "infinitely many solutions" in graph.guarantee
    assert "nothing found" not in graph.guarantee


@pytest.mark.slow
def test_infinitely_many_solutions_end_where_a_branch_begins():
    """max(z, 0)^3 = max(alpha, 0): all z <= 0 for alpha <= 0, and the root of third order above."""
    cubic = Switched(1, lambda z, alpha, sw: [sw.relu(z[0]) ** 3 - sw.relu(alpha)])
    graph = explore(cubic, (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-1.0, -0.3, -1e-3, 0.3, 1.0)] == [np.inf] * 3 + [1, 1]


@pytest.mark.slow
def test_a_branch_point_and_a_double_root_are_no_continua():
    """z (alpha - z^2) = 0 and (z - 1)^2 = alpha^2, the two in turned unknowns."""

    def equations(z, alpha, _):
        y = np.array([0.6 * z[0] + 0.8 * z[1], 0.8 * z[0] - 0.6 * z[1]])
        return np.array([y[0] * (alpha - y[0] ** 2), (y[1] - 1.0) ** 2 - (1.0 + alpha) ** 2])

    graph = explore(Switched(2, equations), (-0.9, 1.0))
    assert graph.count(-0.5) == 2
    assert graph.count(0.5) == 6
    assert "infinitely" not in graph.guarantee


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.sweep(2)
def test_a_corner_that_several_faces_share_is_one_start(n):
    """sum(z) = 1 - alpha, z >= 0, for alpha < 1: all faces of the simplex end at z = 0."""
    system = LCP(np.ones((n, n)), -np.ones(n), np.ones(n))
    metric = Metric.of(system, (-2.0, 2.0))
    starts = [x for x, _ in AllTransitions().starts(system, metric, (-2.0, 2.0))]
    [end] = [x for x in starts if x[-1] > -2.0]
    np.testing.assert_allclose(end, [0.0] * n + [1.0], atol=1e-12)
    graph = explore(system, (-2.0, 2.0))
    assert [graph.count(alpha) for alpha in (-2.0, 0.5, 1.0, 1.5)] == [np.inf, np.inf, 1, 1]


@pytest.mark.parametrize("factor", [lambda z: np.exp(3.0 * z[0]), lambda z: np.exp(-0.5 * (z @ z))])
@pytest.mark.slow
def test_what_underflows_is_no_continuum(factor):
    """Far out the factor is zero in floating point: the solutions are those without the factor."""

    def competing(z, alpha, _):
        rows = np.array([z[0] * (1.0 - z[0] - 0.5 * z[1]), z[1] * (alpha - z[1] - 0.5 * z[0])])
        return factor(z) * rows

    graph = explore(Switched(2, competing), (0.6, 1.5))
    assert not graph.infinite
    assert [graph.count(alpha) for alpha in (0.7, 1.0, 1.4)] == [4, 4, 4]


class Underflowing(PiecewiseSystem):
    """exp(-z^2) (z - alpha) is zero in floating point where z is large."""

    size = 1

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return np.exp(-(z**2)) * (z - alpha)


@pytest.mark.slow
def test_a_factor_that_underflows_adds_no_solutions():
    graph = explore(Underflowing(), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.9, -0.6, 0.3, 0.6)] == [1, 1, 1, 1]


def bertrand(u, v):
    """Each price is the other or a bound: all prices z0 = z1 above both bounds."""
    return lambda z, a, sw: [z[0] - sw.max(z[1], u(a)), z[1] - sw.max(z[0], v(a))]


def tied(power):
    """A pair of complementarity conditions with two equal equations."""

    def rows(z, a, sw):
        gap = z[0] ** power - z[1] ** power + a
        return [sw.min(z[0], gap), sw.min(z[1], -gap)]

    return rows


@pytest.mark.parametrize(
    ("rows", "alone"),
    [
        (bertrand(lambda a: a, lambda a: -a), 0.0),
        (bertrand(lambda a: a, lambda a: -2.0 * a), 0.0),
        (bertrand(lambda a: a * a, lambda a: a), 0.0),
        (bertrand(lambda a: a - 0.3, lambda a: 0.3 - a), 0.3),
        (tied(1), 0.0),
        (tied(3), 0.0),
    ],
)
@pytest.mark.slow
def test_stretches_join_at_the_alpha_between(rows, alone):
    """At the alpha at which another bound begins to hold, there are infinitely many, too."""
    graph = explore(Switched(2, rows), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-1.0, -0.5, alone, 0.5, 1.0)] == [np.inf] * 5
    assert "infinitely many solutions for alpha in [-1, 1]" in graph.guarantee


def levels(z, a, sw):
    """(relu(z - 1))^2 - (relu(-z - 1))^2 = alpha: at alpha = 0 all z in [-1, 1]."""
    return [sw.relu(z[0] - 1.0) ** 2 - sw.relu(-z[0] - 1.0) ** 2 - a]


def payoffs(z, a, sw):
    """Two mixed strategies; at alpha = 0 the first player does not care."""
    return [
        z[0] - sw.clip(z[0] + a * (1.0 + z[1] ** 2), 0.0, 1.0),
        z[1] - sw.clip(z[1] + z[0] - 0.5, 0.0, 1.0),
    ]


@pytest.mark.parametrize(
    ("size", "rows", "interval"),
    [
        (1, lambda z, a, sw: [sw.relu(z[0]) ** 2 - a], (0.0, 1.0)),
        (1, lambda z, a, sw: [sw.relu(z[0]) ** 2 + a], (-1.0, 0.0)),
        (1, lambda z, a, sw: [sw.min(z[0], a * (1.0 + z[0] ** 2))], (0.0, 1.0)),
        (1, levels, (0.0, 1.0)),
        (1, levels, (-1.0, 1.0)),
        (2, payoffs, (0.0, 1.0)),
        (2, payoffs, (-1.0, 1.0)),
    ],
)
@pytest.mark.slow
def test_infinitely_many_solutions_at_zero_alone(size, rows, interval):
    """Zero is an end of the interval or lies inside; the guarantee names the value."""
    graph = explore(Switched(size, rows), interval)
    expected = {0.0: np.inf} | {alpha: 1 for alpha in interval if alpha}
    assert {alpha: graph.count(alpha) for alpha in expected} == expected
    assert "infinitely many solutions at alpha = 0" in graph.guarantee
    assert "model seems to end" not in graph.guarantee


@pytest.mark.parametrize("power", [3, 5])
@pytest.mark.slow
def test_a_root_of_high_order_is_no_continuum(power):
    """y^power = alpha and v = y, in turned unknowns and mixed rows: one solution everywhere."""

    def rows(z, a, _):
        y, v = 0.6 * z[0] + 0.8 * z[1], 0.8 * z[0] - 0.6 * z[1]
        one, two = y**power - a, v - y
        return [one + two, one - 2.0 * two]

    graph = explore(Switched(2, rows), (0.0, 1.0))
    assert [graph.count(alpha) for alpha in (0.0, 0.5, 1.0)] == [1, 1, 1]
    assert "infinitely" not in graph.guarantee
