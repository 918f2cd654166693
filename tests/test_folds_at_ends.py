"""A circle whose folds lie at the ends of the interval, or beside them by next to nothing."""

import numpy as np
import pytest

from pwscont import (
    NaturalParameter,
    PiecewiseSystem,
    PseudoArclength,
    StartNotFoundError,
    StepSize,
    Switched,
    Tangent,
    explore,
    trace,
)

pytestmark = pytest.mark.sweep(4)  # the others take too long for the README's command


class Circle(PiecewiseSystem):
    """(z / size)^2 + ((alpha - 3) / 2)^2 = 1: two solutions at alpha between 1 and 5."""

    size = 1

    def __init__(self, radius=1.0):
        self.radius = radius

    def test_functions(self, z, alpha):
        return z - 5.0 * self.radius

    def residual(self, z, alpha, character):
        return (z / self.radius) ** 2 + (0.5 * alpha - 1.5) ** 2 - 1.0


STEPPERS = [None, PseudoArclength(predictor=Tangent(), step_size=StepSize(largest=0.03))]
#: By how much the folds lie inside the interval, beyond its ends if negative.
WITHIN_ROUNDING = [0.0, 2e-15, -2e-15, 2e-14, -2e-14]
CLEARLY = [1e-12, 1e-9, 1e-6]


def all_ways(system, apart, stepper=None):
    """Return what is found by a search, from both halves of the circle, and from one of them."""
    interval, r = (1.0 - apart, 5.0 + apart), system.radius
    yield explore(system, interval, stepper=stepper)
    yield explore(system, interval, stepper=stepper, starts=[([r], 3.0), ([-r], 3.0)])
    yield trace(system, ([r], 3.0), interval, stepper=stepper)


@pytest.mark.parametrize("stepper", STEPPERS, ids=["default", "tangent"])
@pytest.mark.parametrize("apart", [*WITHIN_ROUNDING, *CLEARLY])
@pytest.mark.sweep(36)
def test_the_whole_circle_is_found(apart, stepper):
    for graph in all_ways(Circle(), apart, stepper):
        first, second = sorted(graph.special_points("fold"), key=lambda point: point.alpha)
        assert [first.alpha, second.alpha] == pytest.approx([1.0, 5.0], abs=1e-13)
        assert np.abs([first.z, second.z]).max() < 1e-9
        assert [graph.count(alpha) for alpha in (1.5, 3.0, 4.5)] == [2, 2, 2]
        assert len(graph.pieces) == 2
        assert graph.guarantee == "balanced"


@pytest.mark.parametrize("radius", [1e-3, 1.0, 5.0])
@pytest.mark.parametrize("apart", WITHIN_ROUNDING)
@pytest.mark.sweep(36)
def test_a_fold_at_an_end_is_one_solution_there(apart, radius):
    for graph in all_ways(Circle(radius), apart):
        assert [graph.count(end) for end in graph.interval] == [1, 1]
        assert {point.kind for point in graph.special_points() if point.id >= 0} == {"fold"}


@pytest.mark.slow
@pytest.mark.parametrize("stepper", STEPPERS, ids=["default", "tangent"])
@pytest.mark.parametrize("apart", CLEARLY)
@pytest.mark.sweep(8)
def test_an_interval_that_ends_before_the_folds_cuts_the_circle(apart, stepper):
    *whole, half = all_ways(Circle(), -apart, stepper)
    for graph in whole:
        assert [graph.count(alpha) for alpha in (1.0 + apart, 3.0, 5.0 - apart)] == [2, 2, 2]
        assert len(graph.components()) == 2
    z = np.sqrt(apart)  # in first order
    ends = half.special_points("end")
    assert [abs(point.z[0]) for point in ends] == pytest.approx([z, z], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.0, 1e-9])
def test_a_stepper_that_cannot_turn_says_so(apart):
    for graph in all_ways(Circle(), apart, NaturalParameter()):
        assert "this stepper cannot turn at a fold" in graph.guarantee


def test_beside_a_fold_there_is_no_solution():
    with pytest.raises(StartNotFoundError, match="nearest to the start lies outside"):
        trace(Circle(), ([0.0], 1.0 + 1e-6), (1.0 + 1e-6, 5.0))
    graph = trace(Circle(), ([0.0], 1.0 - 1e-6), (1.0 - 1e-6, 5.0))
    assert graph.count(1.0 - 1e-6) == 0
    assert graph.count(3.0) == 2


#: Where the fold lies, the stiffness, that of the kink, and the side on which the kink acts.
FOLDS_ON_KINKS = [(2.0, 0.8, 1.2, -1), (-4.2, 0.6, -0.5, 1), (-4.1, 0.6, -1.4, -1)]


@pytest.mark.sweep(1)
@pytest.mark.parametrize(("c", "q", "w", "side"), FOLDS_ON_KINKS)
def test_a_fold_at_an_end_that_lies_on_a_kink(c, q, w, side):
    """A solution at the fold is known to half of the digits, and may stand on the wrong side.

    With y = side (z - c): q (1 - cos y) = alpha where y > 0, and q (1 - cos y) - w sin y = alpha
    where y < 0, which is q - r cos(y - b) = alpha.
    """

    def fold(z, a, sw):
        return q * (1.0 - np.cos(z - c)) + w * sw.relu(side * np.sin(c - z)) - a

    graph = explore(Switched(1, fold, bounds=([c - 2.5], [c + 2.5])), (0.0, 0.3))
    r, b = np.hypot(q, w), np.arctan2(w, q)
    for alpha in (5e-5, 1e-3, 0.05, 0.2):
        lean = np.arccos((q - alpha) / r)
        right = [y for y in (b - lean, b + lean) if -2.5 < y < 0.0]
        right += [y for y in [np.arccos(1.0 - alpha / q)] if y < 2.5]
        found = sorted(side * (solution.z[0] - c) for solution in graph.solutions(alpha))
        assert found == pytest.approx(sorted(right), abs=1e-9)


@pytest.mark.parametrize("start", [-0.5, 0.3])
def test_both_ways_from_a_kink_at_an_end_where_one_side_is_level(start):
    """z^2 = alpha where z < 0, and z^2 + z = alpha where z > 0, meet at alpha = 0."""
    system = Switched(1, lambda z, a, sw: z * z + sw.relu(z) - a)
    graph = trace(system, ([start], 0.3), (0.0, 1.0))
    for alpha in (1e-6, 0.1, 0.9):
        right = [-np.sqrt(alpha), -0.5 + np.sqrt(0.25 + alpha)]
        assert sorted(s.z[0] for s in graph.solutions(alpha)) == pytest.approx(right, abs=1e-9)
    assert graph.count(0.0) == 1


@pytest.mark.parametrize(("apart", "weight"), [(5e-10, 2.0), (2e-8, -0.5), (9e-8, 0.1)])
@pytest.mark.parametrize("find", [trace, explore])
def test_a_kink_next_to_a_fold_at_an_end_fills_no_alpha(find, apart, weight):
    """y^2 + weight max(y - apart, 0) = alpha - 0.7: two solutions, and one at the fold y = 0.

    Between fold and kink alpha changes by apart^2, less than rounding. With a falling slope the way
    beyond the kink leads out of the interval at once, and begins anew where y >= -weight.
    """

    def bend(z, a, sw):
        return z * z + weight * sw.relu(z - apart) - (a - 0.7)

    start = ([-0.5], 0.95), (0.7, 1.7)
    graph = (
        trace(Switched(1, bend), *start) if find is trace else explore(Switched(1, bend), start[1])
    )
    expected = 1 if find is trace and weight < 0.0 else 2
    assert [graph.count(alpha) for alpha in (0.701, 0.95, 1.6)] == [expected] * 3
    assert np.isfinite([number for _, _, number in graph.multiplicity()]).all()
    assert "infinitely" not in graph.guarantee
