"""Smooth folds, inside the interval and at its ends.

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
from pwscont.transitions.location import NARROW, locate_sign_change
from pwscont.transitions.rays import Ray

#: A dip of the slope of alpha below zero by less than this part of the slope is left alone.
SHALLOW = 1e-4


@final
@dataclass(frozen=True, slots=True)
class SmoothFolds(TransitionDetector):
    """Watches the alpha component of the tangent, which is proportional to det(dH/dz)."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the component and its negative; zero to rounding counts as zero."""
        slope = curve.slope(state)
        return Reading(np.array([slope, -slope]), UNKNOWN)

    def is_quiet(self, segment: CurvedSegment) -> bool:
        """Tell that alpha goes the same way at both ends, and does not turn between them."""
        curve = segment.curve
        if curve.slope(segment.start) * curve.slope(segment.end) <= 0.0:
            return False
        return curve.selection.is_straight or not _turns_twice(segment)

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Say that alpha turns twice on the cubic of the segment, or does not change at its end.

        The slope of the cubic is a parabola; a parabola that barely reaches zero is left alone.
        On the step after a fold, which begins with slope zero, alpha may turn once. A step that
        ends with slope zero must be shorter, but along a vertical piece, on which alpha is the same
        at both ends; where every shorter one does, the branch is flat.
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
            return slope(polished(segment.curve, state).state)

        narrow = _place(segment, GUARD * EPS)
        found = locate_sign_change(segment, exact_slope, bracket, narrow)
        if isinstance(found, Failure):  # right at an end the change may be polished away
            narrow = max(narrow, NARROW)
            found = locate_sign_change(segment, slope, bracket, narrow)
        return found if isinstance(found, Failure) else _settled(segment, found, narrow)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve."""
        forth = Ray(curve, state)
        message = f'fold within "{curve.selection.label}"'
        return SpecialPointFound(Kind.FOLD, state.x, message, (forth.reversed(), forth))


def _rises(segment: CurvedSegment) -> bool:
    """Tell whether alpha at both ends of a segment differs by more than Newton leaves."""
    rise = segment.end.alpha - segment.start.alpha
    return abs(rise) > CONVERGED * segment.curve.metric.width


def _turns_twice(segment: CurvedSegment) -> bool:
    first, chord, last = segment.slopes_of_alpha()
    a, b = 3.0 * (first + last - 2.0 * chord), 6.0 * chord - 4.0 * first - 2.0 * last
    if first * last < 0.0 or not 0.0 < -b / (2.0 * a or np.inf) < 1.0:
        return False
    least, largest = first - 0.25 * b * b / a, max(abs(first), abs(last))
    return bool(least * (first + last) < -SHALLOW * largest * abs(first + last))


def _place(segment: CurvedSegment, off: float) -> float:
    """Return to what part of a segment the place of a fold on it is known.

    The tangent may be off by so much, and the place along the curve by that over the rate at which
    the tangent turns.
    """
    turn = abs(segment.curve.slope(segment.end) - segment.curve.slope(segment.start))
    return min(off / turn, 1.0) if turn else 1.0


def _settled(segment: CurvedSegment, state: State, narrow: float) -> State:
    """Return a located fold with an exactly vertical tangent and an estimate of its error.

    Alpha is stationary there: its error is of second order.
    """
    state, off = polished(segment.curve, state)
    narrow, tangent = max(narrow, _place(segment, off)), state.tangent.copy()
    tangent[-1] = 0.0  # by definition of a fold; rounding in its place would be a fold again
    beside = uncertainty_beside(segment.curve, state)
    error = np.vstack([state.error, beside, narrow * segment.length * tangent])
    return State(state.x, tangent, error, state.orientation)


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
