"""Smooth folds, inside of a cell and at the ends of the interval.

The place where the curve turns is known to the square root of rounding only; the place where the
slope of alpha vanishes is well known, and serves the rays on both sides. At an end of the interval
the tangent of a fold leads along the end: it leans into the interval by as much as its own
rounding. A fold beyond the end cuts the curve at the end, unless alpha is equal to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, partial
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason, Kind
from pwscont.basics.rounding import CONVERGED, EPS, GUARD, HALF_DIGITS, SAME_ALPHA
from pwscont.curve.corrector import polished
from pwscont.curve.crossing import CLOSE_TO_CROSSING, FULL_RANK, crossing_near, may_lose_rank
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import MOST_NEWTON, uncertainty_beside
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.transitions import detector
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import NEARBY, Ray, beside
from pwscont.transitions.zeros import NARROW_BRACKET, locate_sign_change

#: Slopes below this part of the turn of a step are polished where a fold is located: the tangents
#: of other states are known well enough to tell the side of the fold.
NEARLY_LEVEL = 1e-3
#: A dip of the slope of alpha below zero by less than this part of the slope is left alone.
SHALLOW_TURN = 1e-4


@final
@dataclass(frozen=True, slots=True)
class SmoothFolds(TransitionDetector):
    """Watches the alpha component of the tangent, which is proportional to det(dH/dz)."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the component and the negative component; zero to rounding counts as zero."""
        return Reading(curve.slope(state) * detector.BOTH_SIGNS, detector.UNKNOWN)

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Say that alpha is level at the end of a segment, or turns twice along the cubic.

        - A segment that ends level must be shorter; if every shorter segment ends level, the branch
          is flat. A vertical piece is level everywhere, and alpha is the same at both ends.
        - The slope of alpha along the cubic is a parabola. A parabola that barely reaches zero is
          left alone, and so is a segment on which alpha is constant to rounding, as around the zero
          of z^5. The first segment after a fold begins level, and alpha may turn once there.
        """
        begins_level, ends_level = not start.values[0], not end.values[0]
        if ends_level:
            rise = abs(segment.end.alpha - segment.start.alpha)
            is_vertical = begins_level and rise <= CONVERGED * segment.curve.metric.width
            return None if is_vertical else Failure(FailureReason.FLAT)
        return Failure(FailureReason.HIDDEN_FOLDS) if _turns_twice(segment) else None

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find where the tangent has no alpha component."""
        assert isinstance(segment, CurvedSegment)  # straight segments have no smooth folds
        sign, curve = 1.0 if index == 0 else -1.0, segment.curve
        turn = abs(float(segment.end.tangent[-1] - segment.start.tangent[-1]))
        finer = cache(partial(polished, curve))  # states are polished once

        def slope(state: State) -> float:
            return sign * float(state.tangent[-1])

        def exact_slope(state: State) -> float:
            if abs(slope(state)) > NEARLY_LEVEL * turn:
                return slope(state)
            state, off = finer(state)
            return slope(state) if abs(slope(state)) > off * curve.metric.width else 0.0

        narrow = _place(segment, GUARD * EPS)
        found = locate_sign_change(segment, exact_slope, bracket, narrow)
        if isinstance(found, Failure):  # right at an end the change may be polished away
            narrow = max(narrow, NARROW_BRACKET)
            found = locate_sign_change(segment, slope, bracket, narrow)
        if isinstance(found, Failure):
            return found
        fold, off = finer(found)
        # an exactly vertical tangent: rounding would be found as a fold again
        narrow, level = max(narrow, _place(segment, off)), _with_slope(fold, 0.0, fold.error)
        along = max(narrow * segment.length, _uncertain(curve, fold.x)) * level.tangent
        # alpha is stationary at a fold: its error is of second order
        return replace(level, error=np.vstack([fold.error, uncertainty_beside(curve, fold), along]))

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve."""
        return fold_point(curve, state)


def _uncertain(curve: Curve, fold: Array) -> float:
    """Return how far along the curve a fold at the alpha of a branch point is uncertain.

    Next to a branch point tangents are rounding.
    """
    reach = 1.0 / CLOSE_TO_CROSSING
    found = crossing_near(curve, fold, reach) if may_lose_rank(curve, fold) else None
    if found is None or abs(found.x[-1] - fold[-1]) > SAME_ALPHA * curve.metric.width:
        return 0.0
    return float(max(curve.metric.norm(found.x - fold), FULL_RANK))


def fold_point(curve: Curve, fold: State, where: str = "") -> SpecialPointFound:
    """Return a fold as a special point, from which the same curve goes on."""
    forth, message = Ray(curve, fold), f'fold within "{curve.selection.label}"{where}'
    return SpecialPointFound(Kind.FOLD, fold.x, message, (forth.reversed(), forth))


def _turns_twice(segment: CurvedSegment) -> bool:
    first, chord, last = segment.slopes_of_alpha()
    a, b = 3.0 * (first + last - 2.0 * chord), 6.0 * chord - 4.0 * first - 2.0 * last
    if first * last < 0.0 or not 0.0 < -b / (2.0 * a or np.inf) < 1.0:
        return False
    least, largest = first - 0.25 * b * b / a, max(abs(first), abs(last))
    steepest = max(largest, abs(chord))  # from fold to fold both ends are level
    if segment.length * steepest <= GUARD * EPS * segment.curve.metric.width:
        return False  # both folds would be at one alpha
    return bool(least * (first + last) < -SHALLOW_TURN * largest * abs(first + last))


def _place(segment: CurvedSegment, off: float) -> float:
    """Return the accuracy of the place of a fold, as a part of the segment, from the tangent's."""
    turn = abs(segment.curve.slope(segment.end) - segment.curve.slope(segment.start))
    return min(off / turn, 1.0) if turn else 1.0


#: A curve steeper than this at an end has no fold there.
STEEPEST_AT_FOLD = 1e-2


def fold_at_end(curve: Curve, state: State) -> State | None:
    """Return the fold that ``state`` is, if alpha there is an end of the interval to rounding.

    None if the state is not at an end, or alpha goes on beyond the end.
    """
    side = _side(curve, state)
    if not side or abs(slope := curve.slope(state)) > STEEPEST_AT_FOLD:
        return None
    inwards = NEARBY if side * slope > 0.0 else -NEARBY
    here, there = beside(curve, state, 0.0), beside(curve, state, inwards)
    if isinstance(here, Failure) or isinstance(there, Failure) or _side(curve, there):
        return None
    steepness = before = curve.slope(there)
    r, s, slope, fold = inwards, 0.0, curve.slope(here), here
    for _ in range(MOST_NEWTON):  # to where the slope of alpha vanishes
        if slope in (0.0, before):
            break
        r, s, before = s, s - slope * (s - r) / (slope - before), slope
        found = abs(s) <= NEARBY and beside(curve, state, s)
        if not isinstance(found, State):
            return None
        fold, slope = found, curve.slope(found)
    if not _side(curve, fold):
        return None
    along = max(abs(s), GUARD * EPS * NEARBY / abs(steepness))
    return _with_slope(fold, 0.0, np.vstack([state.error, fold.error, along * fold.tangent]))


def leads_outside(ray: Ray) -> bool:
    """Tell whether a ray along an end of the interval bends out of the interval."""
    curve, state = ray.curve, ray.state
    if not _side(curve, state) or abs(curve.slope(state)) > STEEPEST_AT_FOLD:
        return False
    found = beside(curve, state, NEARBY)
    return isinstance(found, Failure) and found.trouble is FailureReason.OUTSIDE


def _with_slope(state: State, slope: float, error: Array) -> State:
    """Return a state with another component of the tangent along alpha, and another error."""
    tangent = state.tangent.copy()
    tangent[-1] = slope
    return State(state.x, tangent, error, state.orientation)


def leaning(ray: Ray) -> Ray:
    """Return a ray along an end of the interval, leant so that the ray leads into the interval.

    A vertical piece on the end does not lean.
    """
    curve, state = ray.curve, ray.state
    side = _side(curve, state)
    if not side or curve.slope(state):
        return ray
    there = beside(curve, state, NEARBY)
    if isinstance(there, State) and not curve.slope(there):
        return ray
    slope = side * HALF_DIGITS * float(curve.metric.scale[-1])
    return replace(ray, state=_with_slope(state, slope, state.error))


def _side(curve: Curve, state: State) -> int:
    """Return the sign with which alpha enters the interval at an end of a curved piece, else 0."""
    if curve.selection.is_straight:
        return 0
    (lo, hi), alpha = curve.metric.interval, state.alpha
    same = SAME_ALPHA * max(hi - lo, abs(alpha))
    return (abs(alpha - lo) <= same) - (abs(alpha - hi) <= same)
