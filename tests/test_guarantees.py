"""Guarantees tell apart what is wrong with a graph, and where."""

from dataclasses import replace

import numpy as np
import pytest
from pwscont_coulomb.scenes import fig7

from pwscont import (
    LCP,
    BranchGraph,
    EndPoints,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    Switched,
    explore,
    trace,
)
from pwscont.extending import Ending

NAMED = ("branch missing", "stands twice", "was stopped", "ends on purpose", "model")


def assert_says(graph, start, *parts):
    """The guarantee begins like this, and of all causes it names the one given."""
    assert graph.guarantee.startswith(start)
    named = {words for words in NAMED if words in graph.guarantee}
    assert named == {words for words in NAMED if any(words in part for part in parts)}
    for part in parts:
        assert part in graph.guarantee


class Wall(PiecewiseLinearSystem, Ending):
    """z = alpha, which means nothing beyond z = 1/2."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.5

    def residual(self, z, alpha, character):
        return z - alpha

    def end(self, character, tests):
        return "nothing is known beyond the wall"

    def cells(self):
        yield self.character(np.zeros(1), 0.0)


def test_a_branch_that_ends_on_purpose_is_not_missing():
    graph = trace(Wall(), (np.zeros(1), 0.0), (0.0, 1.0))
    assert_says(graph, "balanced", "a branch ends on purpose at alpha = 0.5")
    assert graph.is_balanced()
    graph = explore(Wall(), (0.0, 1.0), search=EndPoints())
    assert_says(graph, "complete but for closed loops", "a branch ends on purpose at alpha = 0.5")


def test_one_of_two_branches_ends_on_purpose():
    class Two(Wall):
        """Another branch z = 3 + alpha / 10, which goes on."""

        def test_functions(self, z, alpha):
            return np.array([z[0] - 0.5, z[0] - 2.0])

        def residual(self, z, alpha, character):
            return z - alpha if not character.signs[1] else z - 3.0 - 0.1 * alpha

        def cells(self):
            yield from (self.character(np.array([z]), 0.0) for z in (0.0, 3.0))

        def bounding_tests(self, character):
            return [0] if not character.signs[1] else [1]

    whole = explore(Two(), (0.0, 1.0), search=EndPoints())
    assert_says(whole, "complete but for closed loops", "ends on purpose at alpha = 0.5")
    assert sorted(whole.count(alpha) for alpha in (0.3, 0.8)) == [1, 2]


def test_a_solution_that_stands_twice():
    graph = fig7().run()
    piece = graph.pieces[1]
    ends = [replace(graph.point(piece.start), id=100), replace(graph.point(piece.end), id=101)]
    points = [point for point in graph.special_points() if point.id >= 0]
    again = replace(piece, id=50, start=100, end=101)
    twice = BranchGraph(
        [*points, *ends],
        [*graph.pieces, again],
        graph.interval,
        system=graph.system,
        searched=graph.searched,
    )
    lo, hi = piece.interval
    assert_says(twice, "not balanced", f"a solution stands twice in ({lo:.8g}, {hi:.8g})")


def test_curves_that_touch_amid_a_stretch_do_not_stand_twice():
    """|z| = alpha^2: two solutions for each alpha except 0, in the middle of the only stretch."""
    graph = explore(Switched(1, lambda z, t, sw: sw.abs(z) - t**2), (-1.0, 1.0))
    assert_says(graph, "balanced")
    assert [graph.count(alpha) for alpha in (-0.7, -1e-3, 1e-3, 0.7)] == [2, 2, 2, 2]


def test_a_branch_that_is_missing():
    graph = fig7().run()
    points = [point for point in graph.special_points() if point.id >= 0]
    less = BranchGraph(
        points,
        graph.pieces[1:],
        graph.interval,
        system=graph.system,
        searched=graph.searched,
    )
    assert_says(less, "not balanced", "at least one branch missing in (-2, -0.5)")


class Saturating(PiecewiseSystem):
    """alpha = tanh(z): the branch runs to infinity at alpha = 1."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.5

    def residual(self, z, alpha, character):
        return np.tanh(z) - alpha


def test_a_piece_that_was_stopped():
    graph = trace(Saturating(), ([0.0], 0.0), (-0.5, 2.0))
    (stopped,) = graph.special_points("stopped")
    # up to where differences, of a dozen digits, do not tell any more whether alpha changes
    assert stopped.alpha == pytest.approx(1.0, abs=1e-11)
    assert_says(graph, "not balanced", "a piece was stopped at alpha = 1 (")


class Root(PiecewiseSystem):
    """sqrt(z) = 1 + alpha, which is defined from alpha = -1 on."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        with np.errstate(invalid="ignore"):
            return np.sqrt(z) - 1.0 - alpha


def test_a_model_that_ends():
    graph = trace(Root(), ([1.5], 0.2), (-2.0, 2.0))
    (stopped,) = graph.special_points("stopped")
    # the finest differences of z reach the end up to h = 3e-8, and alpha up to sqrt(h)
    assert stopped.alpha == pytest.approx(-1.0, abs=5e-4)
    assert_says(graph, "not balanced", f"the model ends at alpha = {stopped.alpha:.8g}")


class PowerFlow(PiecewiseSystem):
    """Two buses in polar coordinates; without load the lower voltage is 0, its angle any."""

    size = 2

    def test_functions(self, z, alpha):
        return z[1:] - 0.9

    def residual(self, z, alpha, character):
        angle, voltage = z
        active = 0.8 * alpha + 2.0 * voltage * np.sin(angle)
        return np.array(
            [active, 0.3 * alpha + 2.0 * voltage * voltage - 2.0 * voltage * np.cos(angle)]
        )


def test_a_power_flow_whose_voltage_collapses():
    graph = trace(PowerFlow(), ([-1.0, 0.3], 0.3), (0.0, 3.0))
    assert "branch missing" not in graph.guarantee
    assert all(stopped.alpha < 1e-6 for stopped in graph.special_points("stopped"))
    assert graph.count(0.0) == np.inf
    assert "infinitely many solutions at alpha = 0" in graph.guarantee


@pytest.mark.parametrize("degree", [0, 5])
def test_a_wrong_degree_is_named(degree):
    """The signs of the solutions of this problem sum to 1."""
    problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0], degree=degree)
    graph = explore(problem, (-1.0, 2.0))
    assert f"degree = {degree} is wrong, for the balance is 1 everywhere" in graph.guarantee
