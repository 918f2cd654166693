"""Predictors against curves in closed form: their order, and what a step costs."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from pwscont import Hermite, PiecewiseSystem, PseudoArclength, Secant, StepSize, Tangent, trace
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.system.selection import Selection


class Wave(PiecewiseSystem):
    """z = sin(alpha), and how often it was asked; alpha in typical magnitudes of one."""

    size = 1

    def __init__(self):
        self.calls = Counter()

    def test_functions(self, z, alpha):
        return np.array([z[0] + 2.0])

    def residual(self, z, alpha, character):
        self.calls["residual"] += 1
        return z - np.sin(alpha)

    def jacobian(self, z, alpha, character):
        self.calls["jacobian"] += 1
        return np.array([[1.0, -np.cos(alpha)]])

    def test_jacobian(self, z, alpha):
        return np.array([[1.0, 0.0]])


WAVE = Wave()
CURVE = Curve(Selection(WAVE, WAVE.character(np.zeros(1), 0.0)), Metric(np.ones(2)))


def wave(alpha):
    """A state of the wave in closed form."""
    tangent = np.array([np.cos(alpha), 1.0])
    x = np.array([np.sin(alpha), alpha])
    return State(x, tangent / np.linalg.norm(tangent), np.zeros((1, 2)), 1)


def off(predictor, step, earlier, alpha=1.2):
    """How far a prediction is from the wave, after steps of one length in alpha.

    Lengths of arcs are taken from chords and angles, as steppers do.
    """
    states = [wave(alpha - k * step) for k in range(2 + earlier)]
    for state, behind in pairwise(states):
        chord = state.x - behind.x
        turn = np.linalg.norm(state.tangent - behind.tangent) ** 2
        state.comes_from(behind, float(np.linalg.norm(chord) * (1.0 + turn / 24.0)))
    x, _ = predictor.predict(CURVE, states[1], states[0], step)
    return abs(x[0] - np.sin(x[1])) / np.hypot(1.0, np.cos(x[1]))


@pytest.mark.parametrize(
    ("predictor", "earlier", "order"),
    [(Tangent(), 0, 2), (Secant(), 0, 2), (Hermite(), 0, 4), (Hermite(), 1, 6)],
)
def test_the_order_of_a_prediction(predictor, earlier, order):
    long, short = (off(predictor, step, earlier) for step in (0.02, 0.01))
    assert np.log2(long / short) == pytest.approx(order, abs=0.35)


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1])
def test_a_straight_line_goes_on_as_a_straight_line(step):
    tangent = np.array([0.6, 0.8])
    states = [State(-k * step * tangent, tangent, np.zeros((1, 2)), 1) for k in range(3)]
    for state, behind in pairwise(states):
        state.comes_from(behind, step)
    x, direction = Hermite().predict(CURVE, states[1], states[0], step)
    np.testing.assert_allclose(x, step * tangent, rtol=0, atol=1e-15)
    assert direction is states[0].tangent


def test_states_that_do_not_know_where_they_come_from_are_predicted_by_the_cubic():
    state, behind = wave(0.7), wave(0.65)
    x, _ = Hermite().predict(CURVE, behind, state, 0.05)
    chord = np.linalg.norm(state.x - behind.x)
    turn = np.linalg.norm(state.tangent - behind.tangent) ** 2
    state.comes_from(behind, chord * (1.0 + turn / 24.0))
    known, _ = Hermite().predict(CURVE, behind, state, 0.05)
    np.testing.assert_allclose(x, known, rtol=0, atol=1e-14)
    assert abs(x[0] - np.sin(x[1])) < 2e-6  # 0.05**4 is 6e-6


@pytest.mark.parametrize("ratio", [1e-3, 0.2, 5.0, 1e3])
def test_a_step_of_another_size_long_ago_is_left_out(ratio):
    """A quintic through it would be off by more than the cubic, or see rounding only."""
    last, before, earlier = wave(0.7), wave(0.65), wave(0.4)
    last.comes_from(before, 0.06)
    cubic, _ = Hermite().predict(CURVE, before, last, 0.05)
    before.comes_from(earlier, 0.06 * ratio)
    x, _ = Hermite().predict(CURVE, before, last, 0.05)
    np.testing.assert_array_equal(x, cubic)


def test_tangents_by_differences_are_too_rough_for_a_quintic():
    """They may be off by a hundredth, which the quintic takes a few dozen times."""

    class Rough(Wave):
        jacobian = PiecewiseSystem.jacobian

    last, before, earlier = wave(0.7), wave(0.65), wave(0.6)
    last.comes_from(before, 0.06)
    rough = Curve(Selection(Rough(), CURVE.selection.character), CURVE.metric)
    cubic, _ = Hermite().predict(rough, before, last, 0.05)
    before.comes_from(earlier, 0.06)
    x, _ = Hermite().predict(rough, before, last, 0.05)
    np.testing.assert_array_equal(x, cubic)
    x, _ = Hermite().predict(CURVE, before, last, 0.05)
    assert (x != cubic).any()


def test_no_more_than_two_states_back_are_kept():
    states = [wave(0.1 * k) for k in range(5)]
    for behind, state in pairwise(states):
        state.comes_from(behind, 0.1)
    assert states[4].behind is states[3]
    assert states[3].behind is states[2]
    assert states[2].behind is None


def test_a_short_step_costs_one_jacobian_and_two_residuals():
    """One at the prediction, and one residual inside the step to see whether it is true."""
    system = Wave()
    stepper = PseudoArclength(step_size=StepSize(largest=0.002))
    graph = trace(system, (np.zeros(1), 0.0), (0.0, 3.0), stepper=stepper)
    points = sum(len(piece.alpha) for piece in graph.pieces)
    assert points > 500
    assert system.calls["jacobian"] <= 1.1 * points
    assert system.calls["residual"] <= 2.1 * points
    for piece in graph.pieces:
        np.testing.assert_allclose(piece.z[:, 0], np.sin(piece.alpha), rtol=0, atol=1e-14)
