"""A smooth fold at an end of the parameter interval, to rounding of alpha.

Failure modes and answers
-------------------------
- Where the curve turns at an end, its place along the curve is known to the square root of rounding
  only: two ways to the end would be two ends. The place where the slope of alpha vanishes is known,
  and is one for both.
- A fold beyond the end cuts the curve there, however close the fold is, unless its alpha is that of
  the end to rounding.
- From a fold at an end the tangent leads along that end, and a prediction to either side of it:
  the tangent leans into the interval by as much as its own rounding.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import EPS, GUARD, SAME_ALPHA
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.transitions.rays import Ray

#: A curve steeper than this at an end has no fold there.
LEVEL = 1e-2
#: How far from the end, in the metric, the slope of alpha is compared at first.
BESIDE = 1e-4
MOST_SECANTS = 8
#: How much the tangent leans at a fold at an end.
LEAN = EPS**0.5


def fold_at_end(curve: Curve, state: State) -> State | None:
    """Return the fold that ``state`` is, if an end of the interval is its alpha to rounding.

    None where it is not at an end, or alpha goes on beyond.
    """
    if curve.selection.is_straight:
        return None
    side, slope = _side(curve, state), curve.slope(state)
    if not side or abs(slope) > LEVEL:
        return None
    inwards = BESIDE if side * slope > 0.0 else -BESIDE
    here, there = _beside(curve, state, 0.0), _beside(curve, state, inwards)
    if here is None or there is None or _side(curve, there):
        return None
    s = _level(curve, state, (inwards, curve.slope(there)), (0.0, curve.slope(here)))
    fold = None if s is None else _beside(curve, state, s)
    if fold is None or not _side(curve, fold):
        return None
    along = max(abs(s or 0.0), GUARD * EPS * BESIDE / abs(curve.slope(there)))
    return _vertical(fold, np.vstack([state.error, fold.error, along * fold.tangent]))


def leaning(ray: Ray) -> Ray:
    """Return a ray that leads along an end of the interval so that it leads into the interval."""
    curve, state = ray.curve, ray.state
    side = _side(curve, state)
    if not side or curve.slope(state) or curve.selection.is_straight:
        return ray
    tangent = state.tangent.copy()
    tangent[-1] = side * LEAN * curve.metric.scale[-1]
    return replace(ray, state=State(state.x, tangent, state.error, state.orientation))


def _side(curve: Curve, state: State) -> int:
    """Return the sign with which alpha enters the interval at an end, 0 away from its ends."""
    (lo, hi), alpha = curve.metric.interval, state.alpha
    same = SAME_ALPHA * max(hi - lo, abs(alpha))
    return (abs(alpha - lo) <= same) - (abs(alpha - hi) <= same)


def _beside(curve: Curve, state: State, s: float) -> State | None:
    """Return the state of the curve at a distance along the tangent, with a tangent of its own."""
    x = state.x + s * state.tangent
    x[-1] = np.clip(x[-1], *curve.metric.interval)
    found = BorderedNewton().correct(curve, x, state.tangent)
    return None if isinstance(found, Failure) else found.state


def _level(
    curve: Curve, state: State, first: tuple[float, float], second: tuple[float, float]
) -> float | None:
    """Return the distance at which the slope of alpha vanishes, by secants from two others."""
    for _ in range(MOST_SECANTS):
        (s, before), (t, slope) = first, second
        if slope in (0.0, before):
            break
        first, s = second, t - slope * (t - s) / (slope - before)
        there = _beside(curve, state, s) if abs(s) <= BESIDE else None
        if there is None:
            return None
        second = s, curve.slope(there)
    return second[0]


def _vertical(fold: State, error: Array) -> State:
    """Return a fold with an exactly vertical tangent."""
    tangent = fold.tangent.copy()
    tangent[-1] = 0.0
    return State(fold.x, tangent, error, fold.orientation)
