"""The step to a given alpha: to the end of the interval instead of beyond it.

A load path may be undefined outside the interval, so no residual is evaluated there.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.step_size import StepSize
from pwscont.stepping.acceptance import accepted
from pwscont.stepping.stepper import CurvedSegment

#: The end is stepped to where it is no farther than this many times the step that overshoots it.
STRETCH = 1.5
#: A prediction farther away than this, in the metric, is not looked at: H may overflow there.
FAR = 10.0


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
