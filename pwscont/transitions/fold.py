"""Smooth folds, inside the interval and at its ends.

Failure modes and answers
-------------------------
- Where the curve turns at an end, the turning place along the curve is known to the square root of
  rounding only: the rays to the end on both sides would make two ends. The place where the slope of
  alpha vanishes is well known, and serves both rays.
- A fold beyond the end: the curve is cut at the end, however close the fold is, unless alpha at the
  fold is the end's alpha to rounding.
- From a fold at an end the tangent leads along the end, and a prediction to either side of the end:
  the tangent leans into the interval by as much as the tangent's own rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason, Kind
from pwscont.basics.rounding import CONVERGED, EPS, GUARD, SAME_ALPHA
from pwscont.curve.corrector import BorderedNewton, polished
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import uncertainty_beside
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import UNKNOWN, Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import NARROW_BRACKET, locate_sign_change
from pwscont.transitions.rays import Ray

#: A dip of the slope of alpha below zero by less than this part of the slope is left alone.
SHALLOW_TURN = 1e-4


@final
@dataclass(frozen=True, slots=True)
class SmoothFolds(TransitionDetector):
    """Watches the alpha component of the tangent, which is proportional to det(dH/dz)."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the component and the negative component; zero to rounding counts as zero."""
        slope = curve.slope(state)
        return Reading(np.array([slope, -slope]), UNKNOWN)

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Say that alpha turns twice on the cubic of the segment, or has slope zero at its end.

        The slope of the cubic is a parabola; a parabola that barely reaches zero is left alone. On
        the step after a fold, which begins with slope zero, alpha may turn once. A step that ends
        with slope zero must be shorter, except along a vertical piece, on which alpha is the same
        at both ends; if every shorter step ends with slope zero, the branch is flat.
        """
        first, last = float(start.values[0]), float(end.values[0])
        if not last:
            return Failure(FailureReason.FLAT) if first or _rises(segment) else None
        return Failure(FailureReason.HIDDEN_FOLDS) if _turns_twice(segment) else None

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find where the tangent has no alpha component."""
        assert isinstance(segment, CurvedSegment)  # straight segments have no smooth folds
        sign = 1.0 if index == 0 else -1.0

        def slope(state: State) -> float:
            return sign * float(state.tangent[-1])

        def exact_slope(state: State) -> float:
            return slope(polished(segment.curve, state)[0])

        narrow = _place(segment, GUARD * EPS)
        found = locate_sign_change(segment, exact_slope, bracket, narrow)
        if isinstance(found, Failure):  # right at an end the change may be polished away
            narrow = max(narrow, NARROW_BRACKET)
            found = locate_sign_change(segment, slope, bracket, narrow)
        return found if isinstance(found, Failure) else _settled(segment, found, narrow)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve."""
        forth = Ray(curve, state)
        message = f'fold within "{curve.selection.label}"'
        return SpecialPointFound(Kind.FOLD, state.x, message, (forth.reversed(), forth))


def _rises(segment: CurvedSegment) -> bool:
    """Tell whether alpha at both ends of a segment differs by more than Newton's remainder."""
    rise = segment.end.alpha - segment.start.alpha
    return abs(rise) > CONVERGED * segment.curve.metric.width


def _turns_twice(segment: CurvedSegment) -> bool:
    first, chord, last = segment.slopes_of_alpha()
    a, b = 3.0 * (first + last - 2.0 * chord), 6.0 * chord - 4.0 * first - 2.0 * last
    if first * last < 0.0 or not 0.0 < -b / (2.0 * a or np.inf) < 1.0:
        return False
    least, largest = first - 0.25 * b * b / a, max(abs(first), abs(last))
    return bool(least * (first + last) < -SHALLOW_TURN * largest * abs(first + last))


def _place(segment: CurvedSegment, off: float) -> float:
    """Return the accuracy of the place of a fold on a segment, as a part of the segment.

    The tangent may be off by so much, and the place along the curve by that over the rate at which
    the tangent turns.
    """
    turn = abs(segment.curve.slope(segment.end) - segment.curve.slope(segment.start))
    return min(off / turn, 1.0) if turn else 1.0


def _settled(segment: CurvedSegment, state: State, narrow: float) -> State:
    """Return a located fold with an exactly vertical tangent and an estimate of the fold's error.

    Alpha is stationary at a fold: the error of alpha is of second order.
    """
    state, off = polished(segment.curve, state)
    narrow, tangent = max(narrow, _place(segment, off)), state.tangent.copy()
    tangent[-1] = 0.0  # exactly: rounding would be found as a fold again
    beside = uncertainty_beside(segment.curve, state)
    error = np.vstack([state.error, beside, narrow * segment.length * tangent])
    return State(state.x, tangent, error, state.orientation)


#: A curve steeper than this at an end has no fold there.
STEEPEST_AT_FOLD = 1e-2
#: Distance from the end, in the metric, at which the slope of alpha is compared first.
FIRST_SECANT = 1e-4
MOST_SECANTS = 8
#: The tangent of a fold at an end leans into the interval by this part of its length.
LEAN_INWARDS = EPS**0.5


def fold_at_end(curve: Curve, state: State) -> State | None:
    """Return the fold that ``state`` is, if alpha there is an end of the interval to rounding.

    None if the state is not at an end, or alpha goes on beyond the end.
    """
    if curve.selection.is_straight:
        return None
    side, slope = _side(curve, state), curve.slope(state)
    if not side or abs(slope) > STEEPEST_AT_FOLD:
        return None
    inwards = FIRST_SECANT if side * slope > 0.0 else -FIRST_SECANT
    here, there = _beside(curve, state, 0.0), _beside(curve, state, inwards)
    if here is None or there is None or _side(curve, there):
        return None
    s = _level(curve, state, (inwards, curve.slope(there)), (0.0, curve.slope(here)))
    fold = None if s is None else _beside(curve, state, s)
    if fold is None or not _side(curve, fold):
        return None
    along = max(abs(s or 0.0), GUARD * EPS * FIRST_SECANT / abs(curve.slope(there)))
    return _vertical(fold, np.vstack([state.error, fold.error, along * fold.tangent]))


def leaning(ray: Ray) -> Ray:
    """Return a ray along an end of the interval, leant so that the ray leads into the interval."""
    curve, state = ray.curve, ray.state
    side = _side(curve, state)
    if not side or curve.slope(state) or curve.selection.is_straight:
        return ray
    tangent = state.tangent.copy()
    tangent[-1] = side * LEAN_INWARDS * curve.metric.scale[-1]
    return replace(ray, state=State(state.x, tangent, state.error, state.orientation))


def _side(curve: Curve, state: State) -> int:
    """Return the sign with which alpha enters the interval at an end, 0 away from the ends."""
    (lo, hi), alpha = curve.metric.interval, state.alpha
    same = SAME_ALPHA * max(hi - lo, abs(alpha))
    return (abs(alpha - lo) <= same) - (abs(alpha - hi) <= same)


def _beside(curve: Curve, state: State, s: float) -> State | None:
    """Return the curve's own state at a distance along the tangent."""
    x = state.x + s * state.tangent
    x[-1] = np.clip(x[-1], *curve.metric.interval)
    found = BorderedNewton().correct(curve, x, state.tangent)
    return None if isinstance(found, Failure) else found.state


def _level(
    curve: Curve, state: State, first: tuple[float, float], second: tuple[float, float]
) -> float | None:
    """Return the distance at which the slope of alpha vanishes, by secants."""
    for _ in range(MOST_SECANTS):
        (s, before), (t, slope) = first, second
        if slope in (0.0, before):
            break
        first, s = second, t - slope * (t - s) / (slope - before)
        there = _beside(curve, state, s) if abs(s) <= FIRST_SECANT else None
        if there is None:
            return None
        second = s, curve.slope(there)
    return second[0]


def _vertical(fold: State, error: Array) -> State:
    """Return a fold with an exactly vertical tangent."""
    tangent = fold.tangent.copy()
    tangent[-1] = 0.0
    return State(fold.x, tangent, error, fold.orientation)
