"""F7: no transition is jumped over, however thin the cell and however long the step."""

from itertools import pairwise

import numpy as np
import pytest
from sweeps import swept

from pwscont import NaturalParameter, PiecewiseSystem, PseudoArclength, Switched, trace
from pwscont.curve.stepper import StepSize

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

WIDTH = 2.0**-27  # 7.5e-9; 1 + WIDTH is exact, so the closed form below is, too
STEP_SIZES = [
    StepSize(first=length, largest=length) for length in (1e-2, 0.1, 0.7, 3.0, 10.0, 1e-3)
] + [StepSize(first=1e-3, largest=10.0)]
STEPPERS = [
    kind(step_size=size) for kind in (PseudoArclength, NaturalParameter) for size in STEP_SIZES
]


def stepper_name(stepper):
    size = stepper.step_size
    return f"{type(stepper).__name__}-{size.first:g}-{size.largest:g}"


ALL_STEPPERS = pytest.mark.parametrize("stepper", STEPPERS, ids=stepper_name)


class ThinCell(PiecewiseSystem):
    """alpha = z + c (max(z - 1, 0) - max(z - 1 - WIDTH, 0)): slope 1 + c on a thin cell."""

    size = 1

    def __init__(self, c):
        self.c = c

    def test_functions(self, z, alpha):
        return np.array([z[0] - 1.0, z[0] - 1.0 - WIDTH])

    def residual(self, z, alpha, character):
        first, second = self.test_functions(z, alpha)
        above, beyond = character.signs
        return np.array([z[0] + self.c * (above * first - beyond * second) - alpha])

    def jacobian(self, z, alpha, character):
        above, beyond = character.signs
        return np.array([[1.0 + self.c * (above - float(beyond)), -1.0]])

    def test_jacobian(self, z, alpha):
        return np.array([[1.0, 0.0], [1.0, 0.0]])


# steep, folding steeply, folding within rounding of the width, hardly bent
@pytest.mark.parametrize("c", [2.0**24, -(2.0**24), -3.0, 1.0, -(2.0**10)])
@ALL_STEPPERS
@pytest.mark.sweep(8)
def test_both_transitions_of_a_thin_cell_are_found(c, stepper):
    graph = trace(ThinCell(c), ([0.0], 0.0), (0.0, 2.0), stepper=stepper)
    entry, exit_ = 1.0, 1.0 + WIDTH * (1.0 + c)
    kind = "nonsmooth fold" if 1.0 + c < 0.0 else "transition"
    nodes = graph.special_points(kind)
    assert len(graph.pieces) == 3
    np.testing.assert_allclose([node.z[0] for node in nodes], [1.0, 1.0 + WIDTH], rtol=1e-15)
    # alpha cannot be told better than z times the slope
    slack = 4e-16 * (1.0 + abs(c)) + 1e-14
    np.testing.assert_allclose([n.alpha for n in nodes], [entry, exit_], rtol=0, atol=slack)
    assert [piece.det_sign for piece in graph.pieces] == [1, int(np.sign(1.0 + c)), 1]


def test_count_in_a_thin_folding_cell():
    """Slope 1 - 2^24 over 2^-27 takes alpha back by nearly 1/8: three solutions there."""
    graph = trace(ThinCell(-(2.0**24)), ([0.0], 0.0), (0.0, 2.0), stepper=PseudoArclength())
    assert [count for _, _, count in graph.multiplicity()] == [1, 3, 1]
    lower, middle, upper = sorted(s.z[0] for s in graph.solutions(0.95))
    assert lower == pytest.approx(0.95, abs=1e-12)
    assert upper == pytest.approx(0.95 + 0.125, abs=1e-12)
    assert 1.0 < middle < 1.0 + WIDTH
    assert graph.balances() == [1, 1, 1]


class Dip(PiecewiseSystem):
    """y = x^2 and x + m min(y - d^2, 0) = alpha: the test y - d^2 dips below zero at |x| < d."""

    size = 2

    def __init__(self, depth, m):
        self.depth, self.m = depth, m

    def test_functions(self, z, alpha):
        return np.array([z[1] - self.depth**2])

    def residual(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m * (z[1] - self.depth**2)
        return np.array([z[1] - z[0] ** 2, z[0] + bend - alpha])


@pytest.mark.parametrize("depth", [0.5, 0.1, 1e-2, 1e-4])
@pytest.mark.parametrize("first", [1e-2, 0.3, 1.0, 10.0])
@pytest.mark.sweep(12)
def test_a_test_that_dips_within_one_step_is_seen(depth, first):
    """Steps of any length and turn are accepted here; both zeros of the test are found."""
    size = StepSize(first=first, largest=10.0, least_cosine=-1.0)
    start = ([-0.9, 0.81], -0.9)
    graph = trace(Dip(depth, 0.3), start, (-1.0, 1.0), stepper=PseudoArclength(step_size=size))
    alphas = sorted(node.alpha for node in graph.special_points("transition"))
    np.testing.assert_allclose(alphas, [-depth, depth], rtol=0, atol=1e-12)
    assert [len(component) for component in graph.components()] == [3]


@pytest.mark.parametrize("first", [0.3, 1.0, 10.0])
def test_a_test_that_only_comes_near_zero_is_no_transition(first):
    """The lowest value of y + 1e-6 is 1e-6: the tangent lines suggest a dip, there is none."""
    size = StepSize(first=first, largest=10.0, least_cosine=-1.0)

    class Near(Dip):
        def test_functions(self, z, alpha):
            return np.array([z[1] + 1e-6])

    start = ([-0.9, 0.81], -0.9)
    graph = trace(Near(0.0, 0.3), start, (-1.0, 1.0), stepper=PseudoArclength(step_size=size))
    assert len(graph.pieces) == 1
    assert not graph.special_points("transition")


class Staircase(PiecewiseSystem):
    """alpha = z + 2 sum_i (-1)^i max(z - c_i, 0) over many close kinks c_i."""

    size = 1

    def __init__(self, kinks):
        self.kinks = np.array(kinks)
        self.weights = 2.0 * (-1.0) ** np.arange(len(kinks))

    def test_functions(self, z, alpha):
        return z[0] - self.kinks

    def residual(self, z, alpha, character):
        bends = self.weights * np.array(character.signs) * (z[0] - self.kinks)
        return np.array([z[0] + bends.sum() - alpha])

    def alpha_of(self, z):
        return z + (self.weights * np.maximum(z - self.kinks, 0.0)).sum()


@ALL_STEPPERS
@pytest.mark.sweep(7)
def test_a_row_of_kinks_within_one_step(stepper):
    kinks = 0.5 + np.array([0.0, 1e-9, 2e-6, 2e-6 + 1e-9, 1e-3, 0.2])
    system = Staircase(kinks)
    graph = trace(system, ([0.1], 0.1), (0.0, 2.0), stepper=stepper)
    expected = [system.alpha_of(kink) for kink in kinks]
    found = [node.alpha for node in graph.special_points("transition")]
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    assert all(a.end == b.start for a, b in pairwise(graph.pieces))


class DipInOtherUnits(PiecewiseSystem):
    """z = alpha outside a dip of the first test, and z = alpha + 1.3 exp(-s^2) - 1 in it.

    s = (alpha - centre) / 0.04. The second test vanishes nowhere.
    """

    size = 1

    def __init__(self, centre, units):
        self.centre, self.units = centre, np.array(units)

    def test_functions(self, z, alpha):
        dip = 1.0 - 1.3 * np.exp(-(((alpha - self.centre) / 0.04) ** 2))
        return self.units * np.array([dip + 0.01 * (z[0] - alpha), z[0] + 5.0])

    def residual(self, z, alpha, character):
        first = self.test_functions(z, alpha)[0] / self.units[0]
        return z - alpha - (0.0 if character.signs[0] else first)


@pytest.mark.parametrize(
    ("units", "centres"),
    swept([((1e-6, 1e6), 6)], [(units, 30) for units in ((1.0, 1.0), (1e-6, 1e6), (1e6, 1e-6))]),
)
def test_a_dip_is_seen_whatever_the_units_of_other_tests(units, centres):
    for centre in np.linspace(-0.8, 0.8, centres):
        graph = trace(DipInOtherUnits(centre, units), ([-1.0], -1.0), (-1.0, 1.0))
        assert len(graph.special_points("transition")) == 2


def test_a_test_that_returns_to_zero_late_within_the_first_step():
    """y - alpha (1 - (alpha / h)^8) vanishes; with c max(-y, 0) there are kinks at 0, h and -h."""
    h = 0.017

    def kinked(z, a, sw):
        return z[0] + 0.2 * sw.max(-z[0], 0.0) - a * (1.0 - (a / h) ** 8)

    graph = trace(Switched(1, kinked), ([0.0], 0.0), (-0.5, 0.5))
    kinks = [point.alpha for point in graph.special_points("transition")]
    assert sorted(kinks) == pytest.approx([-h, 0.0, h], abs=1e-12)
    assert [graph.count(alpha) for alpha in (-0.3, -0.01, 0.01, 0.3)] == [1, 1, 1, 1]
