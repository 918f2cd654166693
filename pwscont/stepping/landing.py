"""The step that ends on the end of the interval instead of beyond it.

A load path may be undefined outside the interval, so no residual is evaluated there.
"""

from __future__ import annotations

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.numerics.corrector import BorderedNewton, Corrected
from pwscont.numerics.curve import Curve, State


def overshoots(interval: tuple[float, float], alpha: float) -> float | None:
    """Return the end of the interval that ``alpha`` lies on or beyond, if any."""
    lo, hi = interval
    if alpha >= hi:
        return hi
    return lo if alpha <= lo else None


def land_on(curve: Curve, state: State, direction: Array, alpha: float) -> Corrected | Failure:
    """Return the state of the curve at ``alpha``, predicted from ``state`` along ``direction``."""
    if direction[-1] * (alpha - state.alpha) <= 0.0:
        return Failure(Trouble.NO_TURN)
    predicted = state.x + (alpha - state.alpha) / direction[-1] * direction
    predicted[-1] = alpha
    along_alpha = np.zeros_like(predicted)
    along_alpha[-1] = np.copysign(curve.metric.scale[-1], direction[-1])
    corrected = BorderedNewton().correct(curve, predicted, along_alpha)
    if isinstance(corrected, Corrected):
        corrected.state.x[-1] = alpha  # equal but for rounding in the border
    return corrected
