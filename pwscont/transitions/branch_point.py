"""Smooth branch points: two curves of the same selection cross, and both curves are followed.

Failure modes and answers
-------------------------
- Near the point [J; t^T] is nearly singular, so that points of the curve can hardly be computed:
  the point is the regular solution of an extended system (:mod:`pwscont.curve.crossing`), and
  the curve is bisected only while the step is too long for that.
- The sign of a state next to the point is rounding: a point just outside the step counts as well.
- The step jumped from one curve to another that passes close by: the sign flips without a branch
  point. Such a jump is a failure, on which the step is shortened until the steps follow the bend.
- Two branch points within one step flip the sign twice and go unseen: allow shorter steps. Points
  where the sign does not flip go unseen, too: where an even number of eigenvalues vanishes
  together, as under symmetry, and where curves touch.
- Several branch points lie within one step, and Newton leads to a later one: the sign half way to
  the point found has flipped already, and the bisection goes on before the point.
- Curves that cross to higher order flip the sign but have no two directions to tell apart: the
  piece stops there and says that two branches meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason, Kind
from pwscont.basics.rounding import EPS
from pwscont.curve.crossing import Crossing, crossing
from pwscont.curve.curve import Curve, State
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.linear.factorise import bordered
from pwscont.transitions.detector import UNKNOWN, Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import Ray

#: A branch point outside a step, within this part of the step's length, belongs to the step.
OUTSIDE_STEP = 0.1
MOST_BISECTIONS = 10
#: The extended system, which costs as much as many points of the curve, is solved from the middle
#: of every third bracket: from within an eighth of the bracket before.
BISECTIONS_BETWEEN = 3
#: Distance at which the sign of det[J; t^T] is evaluated if no walk carries the sign along.
DISTANCE_TO_SIGN = EPS**0.25
#: What is read, by the sign: not to be written to.
_READINGS = {sign: Reading(np.array([1.0, -1.0]) * sign, UNKNOWN) for sign in (-1, 0, 1)}


@final
@dataclass(frozen=True, slots=True)
class SmoothBranchPoints(TransitionDetector):
    """Watches the sign of det[J; t^T], which flips at simple branch points and nowhere else."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the sign and its negative."""
        return _READINGS[state.orientation]

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Solve the extended system from within the bracket."""
        assert isinstance(segment, CurvedSegment)  # straight curves cannot cross
        found = _locate(segment, bracket, before := 1 if index == 0 else -1)
        if isinstance(found, Failure):
            return found
        own = _own(segment, found)
        return State(found.x, own, found.error, before)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve, and in both directions along the crossing curve."""
        found = crossing(curve, state.x)
        if isinstance(found, Failure):  # not after the point has been located
            return SpecialPointFound(
                Kind.STOPPED, state.x, str(found), (Ray(curve, state).reversed(),)
            )
        return branch_point(curve, found, state)


def branch_point(curve: Curve, found: Crossing, state: State) -> SpecialPointFound:
    """Return a branch point with its four rays.

    The signs of det[J; t^T] on the rays, each ray seen leaving the point, alternate around the
    point: a piece that arrives on one curve with a positive sign goes on with a negative sign, and
    both halves of the other curve leave with a positive sign.

    Parameters
    ----------
    curve : Curve
    found : Crossing
    state : State
        The point as an arrival on either curve, with the sign before the point.
    """
    cosines = [abs(curve.metric.covector(state.tangent).dot(d)) for d in found.directions]
    other = found.directions[int(np.argmin(cosines))]
    sign = state.orientation
    states = [
        State(state.x, -state.tangent, state.error, -sign),
        State(state.x, state.tangent, state.error, -sign),
        State(state.x, other, state.error, sign),
        State(state.x, -other, state.error, sign),
    ]
    message = f"two curves cross on {curve.selection.label}"
    return SpecialPointFound(
        Kind.BRANCH_POINT, state.x, message, tuple(Ray(curve, s) for s in states)
    )


def at_branch_point(curve: Curve, x: Array) -> SpecialPointFound | None:
    """Return the branch point near a rough start, None if the start is none."""
    found = crossing(curve, x)
    if isinstance(found, Failure) or not found.meets:
        return None
    tangent = found.directions[0]
    differences = curve.selection.system.differences(float(found.x[-1]))
    if not differences.contains(found.x[-1] - DISTANCE_TO_SIGN * tangent[-1]):
        tangent = -tangent
    near = curve.selection.jacobian(found.x - DISTANCE_TO_SIGN * tangent)
    sign = bordered(near, curve.metric.covector(tangent), curve.metric.binary).sign
    return branch_point(curve, found, State(found.x, tangent, found.error, sign))


def _locate(
    segment: CurvedSegment, bracket: tuple[float, float], before: int
) -> Crossing | Failure:
    """Return the branch point on a segment, bisecting until Newton finds the point."""
    lo, hi = bracket
    for number in range(MOST_BISECTIONS):
        middle = 0.5 * (lo + hi)
        point = _point_near(segment, middle) if number % BISECTIONS_BETWEEN == 0 else None
        if point is not None:
            if not point.meets:
                return Failure(FailureReason.SINGULAR)
            middle = 0.5 * (lo + segment.position(point.x))
            if middle <= lo:
                return point
        state = segment.at(middle)
        if point is not None and (isinstance(state, Failure) or state.orientation == before):
            return point  # the sign has not flipped on the way to the point
        if isinstance(state, Failure):
            return state
        lo, hi = (middle, hi) if state.orientation == before else (lo, middle)
    return Failure(FailureReason.SINGULAR)


def _point_near(segment: CurvedSegment, s: float) -> Crossing | None:
    """Return the branch point to which Newton leads from a place, None if not on the segment."""
    found = crossing(segment.curve, segment.near(s))
    return found if isinstance(found, Crossing) and _belongs(segment, found.x) else None


def _belongs(segment: CurvedSegment, x: Array) -> bool:
    """Tell whether a branch point lies on the segment, or too close to its ends to decide."""
    s, slack = segment.position(x), OUTSIDE_STEP * segment.length
    aside = segment.curve.metric.norm(x - segment.near(s))
    return bool(-slack <= s <= segment.length + slack and aside <= segment.length)


def _own(segment: CurvedSegment, found: Crossing) -> Array:
    """Return the direction of the segment's own curve, pointing forward.

    Of the two directions, return the direction closest to the slope of the cubic through the
    segment's ends.
    """
    covector = segment.curve.metric.covector(_slope(segment, segment.position(found.x)))
    cosines = [float(covector.dot(direction)) for direction in found.directions]
    best = int(np.argmax(np.abs(cosines)))
    forward: Array = np.sign(cosines[best]) * found.directions[best]
    return forward


def _slope(segment: CurvedSegment, s: float) -> Array:
    """Return the slope at distance ``s`` of the cubic Hermite interpolant."""
    r = s / segment.length
    start, end = segment.start.tangent, segment.end.tangent
    slope: Array = (
        (1.0 - r) * (1.0 - 3.0 * r) * start
        + r * (3.0 * r - 2.0) * end
        + 6.0 * r * (1.0 - r) * segment.chord
    )
    return slope
