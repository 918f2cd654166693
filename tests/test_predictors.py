"""Predictors against curves in closed form: their order, and what a step costs."""

from collections import Counter

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


def off(predictor, step, alpha=1.2):
    """How far a prediction is from the wave, after steps of one length in alpha."""
    x, _ = predictor.predict(CURVE, wave(alpha - step), wave(alpha), step)
    return abs(x[0] - np.sin(x[1])) / np.hypot(1.0, np.cos(x[1]))


@pytest.mark.parametrize(("predictor", "order"), [(Tangent(), 2), (Secant(), 2), (Hermite(), 4)])
def test_the_order_of_a_prediction(predictor, order):
    long, short = (off(predictor, step) for step in (0.02, 0.01))
    assert np.log2(long / short) == pytest.approx(order, abs=0.35)


def test_two_states_at_one_place_tell_no_more_than_the_tangent():
    """Next to points where many curves meet, steps may be as short as rounding."""
    here = wave(0.4)
    x, direction = Hermite().predict(CURVE, wave(0.4), here, 0.1)
    np.testing.assert_allclose(x, here.x + 0.1 * here.tangent, rtol=1e-15)
    np.testing.assert_array_equal(direction, here.tangent)


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1])
def test_a_straight_line_goes_on_as_a_straight_line(step):
    tangent = np.array([0.6, 0.8])
    here, behind = (State(-k * step * tangent, tangent, np.zeros((1, 2)), 1) for k in range(2))
    x, direction = Hermite().predict(CURVE, behind, here, step)
    np.testing.assert_allclose(x, step * tangent, rtol=0, atol=1e-15)
    assert direction is here.tangent


def test_a_short_step_costs_one_jacobian_and_two_residuals():
    """One at the prediction, and one residual inside the step to see whether it is true."""
    system = Wave()
    stepper = PseudoArclength(step_size=StepSize(largest=0.001))
    graph = trace(system, (np.zeros(1), 0.0), (0.0, 1.5), stepper=stepper)
    points = sum(len(piece.alpha) for piece in graph.pieces)
    assert points > 500
    assert system.calls["jacobian"] <= 1.1 * points
    assert system.calls["residual"] <= 2.1 * points
    for piece in graph.pieces:
        np.testing.assert_allclose(piece.z[:, 0], np.sin(piece.alpha), rtol=0, atol=1e-14)
