"""The first event on a segment.

Failure modes and answers
-------------------------
- A cell thinner than the step: the character is frozen, so the far end of the step lies
  outside the cell whatever is beyond it (docs/theory, F7).
- A test that dips below zero and comes back within one step: its slopes at both ends differ in
  sign, and where the tangent lines at both ends cross below zero, the dip is searched. A dip
  that the slopes do not show is seen by the tests at points inside the step: at thirds of a long
  step, at one point of a short one.
- A fold is at an interface but for rounding: of events that only errors tell apart the one that was
  located first counts. A piece that begins with a test below zero never meets it again.
- The test that was just crossed starts at zero, with a sign that is rounding: the slope of the test
  says that the step is inside, and a bracket starts where the value of the test is positive.
"""

from __future__ import annotations

import math

import numpy as np

from pwscont.basics.arrays import largest, smallest
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE
from pwscont.curve.curve import State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.system.promises import BENT, refuse_bent_ray, refuse_stray_ray
from pwscont.transitions.detector import TransitionDetector
from pwscont.transitions.location import MOST_HALVINGS, locate_sign_change
from pwscont.transitions.watch import Event, Joined, Readings, Watch, broken

#: A function that is positive after this part of a step, by its slope, is watched from there on.
RISES = 1e-3


def first_on_ray(watch: Watch, segment: Segment, reading: Readings) -> Event | Failure:
    """Return the first event on a straight segment."""
    start = reading.joined()
    if np.isnan(start.values).any():
        watch.check(start, start)
        return Failure(FailureReason.NOT_FINITE)
    distances = watch.falls(segment, start)
    first = int(np.argmin(distances))
    if np.isinf(best := float(distances[first])):
        return Failure(FailureReason.UNBOUNDED)
    detector, index = watch.owner(start, first)
    state = _located(detector, segment, index, (best, best))
    _check_straight(segment, best, state)
    return state if isinstance(state, Failure) else Event(detector, index, best, state)


def _check_straight(segment: Segment, s: float, found: State | Failure) -> None:
    """Refuse a selection that leaves its ray: the correction was more than rounding."""
    start, end, metric = segment.start.x, segment.near(s), segment.curve.metric
    if isinstance(found, State) and metric.relative(found.x - end, end) <= BENT:
        return
    refuse_bent_ray(segment.curve.selection, start, end - start, metric.scale)
    refuse_stray_ray(segment.curve.selection, start, end - start, metric.scale)


def first_on_curve(
    watch: Watch,
    segment: CurvedSegment,
    before: Readings,
    after: Readings,
    first: Event | None = None,
) -> Event | Failure | None:
    """Return the first event on a curved segment, None where there is none.

    ``first`` is an event that is known at the end: others there are none of their own.

    Once an event is found, the segment is cut there: a function that keeps its sign on the shorter
    segment falls to zero later, and is not located. So of each detector the function that seems to
    vanish first is located first.
    """
    if first is None and watch.is_quiet(segment, before, after):
        return None  # nearly every step
    start, end = before.joined(), after.joined()
    if len(start.values) != len(end.values):
        watch.check(start, end)
    if math.isnan(smallest(end.values) + largest(end.values)):  # nan, or opposite infinities
        watch.check(start, end)
        return Failure(FailureReason.NOT_FINITE)
    end = _before(end) if first else end
    if too_long := watch.needs_shorter_step(segment, start, end):
        return too_long
    located: set[int] = set()
    while suspects := set(_suspects(start, end, segment.length)) - located:
        event = _event(watch, suspect := _soonest(suspects, start, end), segment, start, end)
        if isinstance(event, Failure):
            return event
        located.add(suspect)
        if event is None or (first is not None and _is_at_end(event, segment)):
            continue
        first = event
        if event.position <= 0.0:
            break
        segment = segment.until(event.state)
        end = _before(watch.read(segment.curve, event.state).joined())
    return first


def _is_at_end(event: Event, segment: CurvedSegment) -> bool:
    """Tell whether an event is at the end of a segment, or before it by no more than its error."""
    state = event.state
    error = CONFIDENCE * segment.curve.metric.norm(state.size)
    return state is segment.end or event.position >= segment.length - error


def _before(reading: Joined) -> Joined:
    """Return the reading just before an event: functions that are zero at it are positive."""
    values = np.where(reading.values == 0.0, np.finfo(float).tiny, reading.values)
    return Joined(reading.parts, values, reading.slopes)


def _suspects(before: Joined, after: Joined, length: float) -> list[int]:
    """Return the functions that vanish on the segment or may dip below zero within it."""
    turned, soon = before.slopes * after.slopes, before.values + (RISES * length) * before.slopes
    above, below = np.maximum(before.values, soon), np.negative(after.values)
    if largest(np.minimum(above, below)) < 0.0 <= smallest(turned):
        return []
    crossed = (above > 0.0) & (below >= 0.0)
    dips = (turned < 0.0) & (before.slopes < 0.0) & (after.values > 0.0)
    # where both tangent lines meet; a convex function stays above that point
    run = after.slopes - before.slopes
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (before.values - after.values + after.slopes * length) / run
        dips &= before.values + before.slopes * s < 0.0
    return [int(i) for i in np.flatnonzero(crossed | dips)]


def _soonest(suspects: set[int], before: Joined, after: Joined) -> int:
    """Return the function that vanishes first if all are straight, of the first detector with any.

    Where functions of several detectors vanish at one place, it is that detector's.
    """
    ends = np.cumsum([len(part.values) for part in before.parts])
    last = ends[np.searchsorted(ends, min(suspects), side="right")]
    some = np.array(sorted(i for i in suspects if i < last), dtype=np.intp)
    falls, values = before.values[some] - after.values[some], before.values[some]
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.where(falls > 0.0, values / falls, np.inf)
    return int(some[np.argmin(parts)])


def _event(
    watch: Watch, suspect: int, segment: CurvedSegment, before: Joined, after: Joined
) -> Event | Failure | None:
    """Return the located event, None for a dip that stays above zero."""
    detector, index = watch.owner(before, suspect)
    bracket: tuple[float, float] | Failure | None = (0.0, segment.length)
    if after.values[suspect] > 0.0:
        bracket = _bracket_of_dip(detector, index, segment)
    elif before.slopes[suspect] > 0.0:
        bracket = _bracket_of_return(detector, index, segment)
    if bracket is None or isinstance(bracket, Failure):
        return bracket
    state = _located(detector, segment, index, bracket)
    if isinstance(state, Failure):
        return state
    return Event(detector, index, segment.position(state.x), state)


def _located(
    detector: TransitionDetector, segment: Segment, index: int, bracket: tuple[float, float]
) -> State | Failure:
    state = detector.locate(segment, index, bracket)
    if not isinstance(state, State | Failure):
        raise broken(detector, "locate", "a State or a Failure", state)
    return state


def _bracket_of_dip(
    detector: TransitionDetector, index: int, segment: CurvedSegment
) -> tuple[float, float] | Failure | None:
    """Return a bracket of the first zero of a function that is positive at both ends."""

    def slope(state: State) -> float:
        return float(detector.read(segment.curve, state).slopes[index])

    lowest = locate_sign_change(segment, slope, (0.0, segment.length))
    if isinstance(lowest, Failure):
        return lowest
    if not _value(detector, segment, lowest, index) < 0.0:
        return None
    return 0.0, segment.position(lowest.x)


def _value(detector: TransitionDetector, segment: CurvedSegment, state: State, index: int) -> float:
    """Return the value of a function, also where a reading takes it to be level at zero."""
    if border := detector.border(segment.curve, index):
        return float(border(state.x)[0])
    return float(detector.read(segment.curve, state).values[index])


def _bracket_of_return(
    detector: TransitionDetector, index: int, segment: CurvedSegment
) -> tuple[float, float] | Failure:
    """Return a bracket of the zero of a function that starts at zero, rises and falls back."""
    lo = hi = segment.length
    for _ in range(MOST_HALVINGS):
        lo *= 0.5
        state = segment.at(lo)
        if isinstance(state, Failure):
            return state
        if detector.read(segment.curve, state).values[index] > 0.0:
            return lo, hi
        hi = lo
    return Failure(FailureReason.SINGULAR)
