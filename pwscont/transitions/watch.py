"""All detectors of a run, and the first event on a segment.

Failure modes and answers
-------------------------
- A cell thinner than the step: the character is frozen, so the far end of the step lies
  outside the cell whatever lies beyond the cell (docs/theory, F7).
- A test dips below zero and comes back within a step: where the slopes at the two ends differ in
  sign, and the two tangent lines cross below zero, the dip is searched. Other dips are seen by the
  tests at points inside the step.
- A fold lies at an interface up to rounding: of events that only errors tell apart the event that
  was located first counts. A piece that begins with a test below zero never meets that test again.
- The test that was just crossed starts at zero, with a sign that is rounding: the slope of the test
  says that the step is inside, and a bracket starts where the value of the test is positive.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arguments import wrong_result
from pwscont.basics.arrays import Array, are_finite, largest, smallest
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, FailureReason, Kind
from pwscont.basics.rounding import CONFIDENCE, EPS, TINY
from pwscont.curve.corrector import corrected_again
from pwscont.curve.curve import Curve, State
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.system.promises import AFFINE_DEFECT, refuse_wrong_ray
from pwscont.transitions.detector import HIDDEN, Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.zeros import MOST_BRACKET_HALVINGS, NARROW_BRACKET, locate_sign_change

#: Closer to the beginning of a piece than this, in the metric and times 1 + |x|, the event of a
#: user's detector is rounding.
AT_BEGINNING = 1e-10
#: A function that is zero at the start of a step is watched if the slope makes that function
#: positive after this part of the step.
RISES = 1e-3


@final
@dataclass(frozen=True, slots=True)
class Event:
    """A watched function that vanishes on a segment."""

    detector: TransitionDetector
    index: int
    position: float
    state: State

    def arrive(self, curve: Curve) -> SpecialPointFound:
        """Return the special point that the event makes."""
        found = self.detector.arrive(curve, self.state, self.index)
        if not (isinstance(found, SpecialPointFound) and found.rays):
            what = "a SpecialPointFound with at least the ray back"
            raise broken(self.detector, "arrive", what, found)
        if np.shape(found.x) != self.state.x.shape or not are_finite(found.x):
            what = f"a special point at {len(self.state.x)} finite numbers (z, alpha)"
            raise broken(self.detector, "arrive", what, found.x)
        back = float(curve.metric.covector(self.state.tangent).dot(found.rays[0].state.tangent))
        if back > 0.0 and found.kind != Kind.BRANCH_POINT:  # where a tangent may be rounding
            raise broken(self.detector, "arrive", "the ray back before all others", found)
        return found


@final
class Watch:
    """All detectors of a run, in order; the ``added`` detectors are those that a user gave."""

    def __init__(
        self, detectors: Sequence[TransitionDetector], added: Sequence[TransitionDetector] = ()
    ) -> None:
        self._detectors, self._added = detectors, added

    def read(self, curve: Curve, state: State) -> Reading:
        """Return what all detectors read at a state, in new arrays; refuse wrong readings."""
        parts = [detector.read(curve, state) for detector in self._detectors]
        for detector, part in zip(self._detectors, parts, strict=True) if self._added else ():
            if not isinstance(part, Reading):
                raise broken(detector, "read", "a Reading", part)
            if np.ndim(part.values) != 1 or np.shape(part.values) != np.shape(part.slopes):
                raise broken(detector, "read", "values and slopes that are vectors alike", part)
        joined = np.concatenate([part.values for part in parts] + [part.slopes for part in parts])
        values, slopes = joined.reshape(2, -1)
        reading = Reading(values, slopes, parts)
        return reading.having(values, slopes) if self._added else reading  # in new arrays

    def is_rounding(self, event: Event, curve: Curve) -> bool:
        """Tell whether the event of a user's detector is the beginning of the piece, to rounding.

        Right after its own special point a function is zero, up to rounding that may be positive.
        """
        reach = AT_BEGINNING * (1.0 + curve.metric.norm(event.state.x))
        return event.detector in self._added and event.position <= reach

    def without(self, reading: Reading, event: Event) -> Reading:
        """Return a reading in which the function of an event is zero, with slope zero.

        The function is watched again once it is positive. With a negative slope, the same zero
        would be found again.
        """
        values, slopes = reading.values.copy(), reading.slopes.copy()
        values[self._index(reading, event)] = slopes[self._index(reading, event)] = 0.0
        return reading.having(values, slopes)

    def before(self, reading: Reading, event: Event) -> Reading:
        """Return the reading just before an event: functions that vanish there are positive."""
        values = np.where(reading.values == 0.0, TINY, reading.values)
        values[self._index(reading, event)] = TINY
        return reading.having(values, reading.slopes)

    def _index(self, reading: Reading, event: Event) -> int:
        return reading.begins[self._detectors.index(event.detector)] + event.index

    def check(self, start: Reading, end: Reading) -> None:
        """Refuse detectors whose number of functions changed, or whose values are nan."""
        for i, detector in enumerate(self._detectors):
            first, last = start.parts[i].values, end.parts[i].values
            if len(first) != len(last):
                what = f"{len(first)} functions all along a piece"
                raise broken(detector, "read", what, end.parts[i])
            if detector in self._added and np.isnan(last).any():
                raise broken(detector, "read", "finite values", end.parts[i])

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Return the reason for which a detector asks for a shorter step, None without one."""
        for i, detector in enumerate(self._detectors):
            failure = detector.needs_shorter_step(segment, start.parts[i], end.parts[i])
            if isinstance(failure, Failure):
                return failure
            if failure is not None:
                raise broken(detector, "needs_shorter_step", "a Failure or None", failure)
        return None

    def look_inside(self, segment: CurvedSegment) -> Event | Failure | None:
        """Return a special point within a segment that no reading tells, None without one.

        A Failure if a detector asks for a shorter step.
        """
        for detector in self._detectors:
            found = detector.look_inside(segment)
            if isinstance(found, Failure):
                return found
            if isinstance(found, State):
                return Event(detector, HIDDEN, segment.position(found.x), found)
            if found is not None:
                raise broken(detector, "look_inside", "a State, a Failure or None", found)
        return None

    def ahead(self, reading: Reading) -> tuple[float, TransitionDetector, int] | None:
        """Return the distance at which a function with a gradient seems to vanish first, and which.

        The distance is along the tangent. None where no such function falls.
        """
        soonest = None
        for part, detector in zip(reading.parts, self._detectors, strict=True):
            values, slopes = part.values, part.slopes
            if type(detector).border is TransitionDetector.border or not len(values):
                continue
            rates = slopes / np.where(values > 0.0, values, np.inf)
            fastest = rates.argmin()
            if (rate := rates.item(fastest)) < 0.0:
                distance = -1.0 / rate
                if soonest is None or distance < soonest[0]:
                    soonest = distance, detector, int(fastest)
        return soonest

    def falls(self, segment: Segment, start: Reading) -> Array:
        """Return the distance at which each function falls to zero on a straight segment.

        Each detector looks only as far as the nearest zero of the detectors before it.
        """
        distances, farthest = [], np.inf
        for i, detector in enumerate(self._detectors):
            distances.append(detector.falls(segment, start.parts[i], farthest))
            farthest = min(farthest, distances[-1].min(initial=np.inf))
        return np.concatenate(distances)

    def owner(self, reading: Reading, index: int) -> tuple[TransitionDetector, int]:
        """Return the detector of a function, and the number of the function in that detector."""
        place = bisect_right(reading.begins, index) - 1
        return self._detectors[place], index - reading.begins[place]


def broken(detector: TransitionDetector, method: str, what: str, got: object) -> InvalidInputError:
    """Return the error that names what a detector returned and what it should return."""
    return wrong_result(detector, method, what, got, "check_detector")


def first_on_ray(watch: Watch, segment: Segment, start: Reading) -> Event | Failure:
    """Return the first event on a straight segment, from the readings at the start."""
    if np.isnan(start.values).any():
        watch.check(start, start)
        return Failure(FailureReason.NOT_FINITE)
    distances = watch.falls(segment, start)
    first = int(np.argmin(distances))
    if np.isinf(best := float(distances[first])):
        return Failure(FailureReason.UNBOUNDED)
    detector, index = watch.owner(start, first)
    state = _located(detector, segment, index, (best, best))
    if state is None:
        raise broken(detector, "locate", "a State or a Failure on a ray", state)
    begin, end, metric = segment.start.x, segment.near(best), segment.curve.metric
    if not (isinstance(state, State) and metric.relative(state.x - end, end) <= AFFINE_DEFECT):
        # the correction was more than rounding
        refuse_wrong_ray(segment.curve.selection, begin, end - begin, metric.scale)
    return state if isinstance(state, Failure) else Event(detector, index, best, state)


def first_on_curve(
    watch: Watch, segment: CurvedSegment, start: Reading, end: Reading, first: Event | None = None
) -> Event | Failure | None:
    """Return the first event on a curved segment, None where there is none.

    Once an event is found, the segment is cut there: a function that keeps its sign on the shorter
    segment falls to zero later, and is not located. So of each detector the function that seems to
    vanish first is located first. Last the detectors look for what no reading tells.

    ``start``, ``end``: what is read at the start and at the end of the segment.
    ``first``: a known event at the end of the segment: another function that vanishes at the end is
    no event of its own.
    """
    is_nan = math.isnan(smallest(end.values) + largest(end.values))  # or opposite infinities
    if is_nan or len(start.values) != len(end.values):
        watch.check(start, end)
        return Failure(FailureReason.NOT_FINITE)
    end = watch.before(end, first) if first else end
    if too_long := watch.needs_shorter_step(segment, start, end):
        return too_long
    located: set[int] = set()
    while suspects := set(_suspects(start, end, segment.length)) - located:
        event = _event(watch, suspect := _soonest(suspects, start, end), segment, start, end)
        if isinstance(event, Failure):
            return event
        located.add(suspect)
        if event is None:
            continue
        error = CONFIDENCE * segment.curve.metric.norm(event.state.size)
        is_at_end = event.state is segment.end or event.position >= segment.length - error
        if first is not None and is_at_end:
            continue
        first = event
        if event.position <= 0.0:
            return first
        ends = segment.start, event.state
        segment = CurvedSegment.between(segment.curve, *ends, segment.suggestion)
        end = watch.before(watch.read(segment.curve, event.state), event)
    return watch.look_inside(segment) or first


def _suspects(before: Reading, after: Reading, length: float) -> list[int]:
    """Return the functions that vanish on the segment or may dip below zero within it."""
    turned, soon = before.slopes * after.slopes, before.values + (RISES * length) * before.slopes
    above, below = np.maximum(before.values, soon), np.negative(after.values)
    if largest(np.minimum(above, below)) < 0.0 <= smallest(turned):
        return []
    crossed = (above > 0.0) & (below >= 0.0)
    dips = (turned < 0.0) & (before.slopes < 0.0) & (after.values > 0.0)
    # meeting point of both tangent lines, below the whole graph of a convex function
    run = after.slopes - before.slopes
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (before.values - after.values + after.slopes * length) / run
        dips &= before.values + before.slopes * s < 0.0
    return [int(i) for i in np.flatnonzero(crossed | dips)]


def _soonest(suspects: set[int], before: Reading, after: Reading) -> int:
    """Return which function of the first detector with any vanishes first, if all are straight."""
    last = before.begins[bisect_right(before.begins, min(suspects))]
    some = np.array(sorted(i for i in suspects if i < last), dtype=np.intp)
    falls, values = before.values[some] - after.values[some], before.values[some]
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.where(falls > 0.0, values / falls, np.inf)
    return int(some[np.argmin(parts)])


def _event(
    watch: Watch, suspect: int, segment: CurvedSegment, before: Reading, after: Reading
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
    if not isinstance(state, State):
        return state
    return Event(detector, index, segment.position(state.x), state)


def _located(
    detector: TransitionDetector, segment: Segment, index: int, bracket: tuple[float, float]
) -> State | Failure | None:
    state = detector.locate(segment, index, bracket)
    if not isinstance(state, State | Failure | None):
        raise broken(detector, "locate", "a State or a Failure", state)
    return state


def _bracket_of_dip(
    detector: TransitionDetector, index: int, segment: CurvedSegment
) -> tuple[float, float] | Failure | None:
    """Return a bracket of the first zero of a function that is positive at both ends."""
    border = detector.border(segment.curve, index)

    def value_and_slope(state: State) -> tuple[float, float]:
        """Return value and slope, even where a reading calls the function level at zero."""
        if border:
            value, gradient = border(state.x)
            return float(value), float(gradient.dot(state.tangent))
        read = detector.read(segment.curve, state)
        return float(read.values[index]), float(read.slopes[index])

    lowest, least, bracket = segment.start, 0.0, (0.0, segment.length)
    for narrow in (NARROW_BRACKET, EPS):
        found = locate_sign_change(segment, lambda x: value_and_slope(x)[1], bracket, narrow)
        if isinstance(found, Failure):
            return found
        lowest, (least, steepness) = found, value_and_slope(found)
        if not 0.0 <= least <= abs(steepness) * narrow * segment.length:
            break  # otherwise the dip may be narrower than the bracket of the lowest point
    if least < 0.0:  # the last correction may be larger than the dip is deep
        least, _ = value_and_slope(corrected_again(segment.curve, lowest))
    return (0.0, segment.position(lowest.x)) if least < 0.0 else None


def _bracket_of_return(
    detector: TransitionDetector, index: int, segment: CurvedSegment
) -> tuple[float, float] | Failure:
    """Return a bracket of the zero of a function that starts at zero, rises and falls back."""
    lo = hi = segment.length
    for _ in range(MOST_BRACKET_HALVINGS):
        lo *= 0.5
        state = segment.at(lo)
        if isinstance(state, Failure):
            return state
        if detector.read(segment.curve, state).values[index] > 0.0:
            return lo, hi
        hi = lo
    return Failure(FailureReason.SINGULAR)
