"""The step to a place instead of beyond it: to a given alpha, or to where a function vanishes.

A load path may be undefined outside the interval, so no residual is evaluated there. Where a test
function vanishes, the step is the location of the transition as well.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import Border
from pwscont.curve.step_size import StepSize
from pwscont.curve.zero import zero
from pwscont.stepping.acceptance import accepted
from pwscont.stepping.stepper import CurvedSegment

#: The end is stepped to where it is no farther than this many times the step that overshoots it.
STRETCH = 1.5
#: A prediction farther away than this, in the metric, is not looked at: H may overflow there.
FAR = 10.0
#: A zero that is closer than this, in the metric, is found in a longer step: the direction of a
#: chord this short is known to few digits.
CLOSE = 1e-6


def land_on_end(
    curve: Curve,
    interval: tuple[float, float],
    state: State,
    direction: Array,
    length: float,
    step_size: StepSize,
) -> CurvedSegment | Failure:
    """Return the step to the end of the interval that one of ``length`` overshoots."""
    end = interval[1] if direction[-1] > 0.0 else interval[0]
    if abs(end - state.alpha) > STRETCH * length * abs(direction[-1]):
        return Failure(FailureReason.OUTSIDE)
    return land_on(curve, state, direction, end, step_size)


def land_on_zero(
    curve: Curve, state: State, predicted: Array, border: Border, step_size: StepSize
) -> CurvedSegment | None:
    """Return the step to a zero of ``border`` next to a prediction, None where it is not true."""
    length = curve.metric.norm(predicted - state.x)
    if not (CLOSE <= length <= FAR and curve.metric.admits(predicted)):
        return None
    corrected = zero(curve, border, predicted)
    if isinstance(corrected, Failure):
        return None
    segment = accepted(curve, state, predicted, corrected, length, step_size)
    return None if isinstance(segment, Failure) else segment


def land_on(
    curve: Curve, state: State, direction: Array, alpha: float, step_size: StepSize
) -> CurvedSegment | Failure:
    """Return the step to ``alpha``, predicted from ``state`` along ``direction``."""
    if direction[-1] * (alpha - state.alpha) <= 0.0:
        return Failure(FailureReason.NO_TURN)
    predicted = state.x + (alpha - state.alpha) / direction[-1] * direction
    predicted[-1] = alpha
    length = curve.metric.norm(predicted - state.x)
    if not length <= FAR:
        return Failure(FailureReason.JUMP)
    along_alpha = np.zeros_like(predicted)
    along_alpha[-1] = np.copysign(curve.metric.scale[-1], direction[-1])
    corrected = BorderedNewton().correct(curve, predicted, along_alpha)
    if isinstance(corrected, Failure):
        return corrected
    corrected.state.x[-1] = alpha  # equal but for rounding in the border
    return accepted(curve, state, predicted, corrected, length, step_size)
