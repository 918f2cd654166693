"""All detectors of a run, and the first event on a segment.

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
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, largest, smallest
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE
from pwscont.curve.curve import Curve, State
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.system.promises import BENT, refuse_bent_ray, refuse_stray_ray
from pwscont.transitions.detector import (
    Reading,
    SpecialPointFound,
    TransitionDetector,
    ratio_test,
)
from pwscont.transitions.location import MOST_HALVINGS, locate_sign_change

#: Closer to its beginning than this, in intervals, a piece has no event of a user's detector.
CLOSE = 1e-10
TINY = float(np.finfo(float).tiny)


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
        if float(curve.metric.covector(self.state.tangent).dot(found.rays[0].state.tangent)) > 0.0:
            raise broken(self.detector, "arrive", "the ray back before all others", found)
        return found


@final
class Watch:
    """All detectors of a run as one: their readings are joined end to end."""

    def __init__(
        self, detectors: Sequence[TransitionDetector], added: Sequence[TransitionDetector] = ()
    ) -> None:
        self._detectors, self._added = detectors, added
        self._copied = [detector in added for detector in detectors]
        self._are_affine = all(detector.is_affine for detector in detectors)
        self._looking = [
            (i, detector)
            for i, detector in enumerate(detectors)
            if type(detector).needs_shorter_step is not TransitionDetector.needs_shorter_step
        ]
        self._aimed_at = [
            (i, detector)
            for i, detector in enumerate(detectors)
            if type(detector).border is not TransitionDetector.border
        ]

    def read(self, curve: Curve, state: State) -> Readings:
        """Return what all detectors read at ``state``, each when it is asked for."""
        return Readings(self._detectors, self._copied, curve, state)

    def first(self, curve: Curve, state: State) -> Readings:
        """Return what all detectors read where a piece begins, and check those of users' own.

        Raises
        ------
        InvalidInputError
            If a detector returns something else than its contract says.
        """
        reading = self.read(curve, state)
        for i, detector in enumerate(self._detectors):
            if not self._copied[i]:
                continue
            part = detector.read(curve, state)
            if not isinstance(part, Reading):
                raise broken(detector, "read", "a Reading", part)
            if np.ndim(part.values) != 1 or np.shape(part.values) != np.shape(part.slopes):
                what = "values and slopes that are vectors alike"
                raise broken(detector, "read", what, part)
            reading.keep(i, part)
        return reading

    def is_rounding(self, event: Event, curve: Curve) -> bool:
        """Tell whether the event of a user's detector is so close to where the piece begins.

        Right after its own special point a function is zero, but for rounding that is positive.
        """
        reach = CLOSE * (1.0 + curve.metric.norm(event.state.x))
        return event.detector in self._added and event.position <= reach

    def without(self, reading: Readings, event: Event) -> Readings:
        """Return a reading in which the function of an event is zero, and level.

        It is watched once it is positive. Falling from zero, it would be found again.
        """
        return self._with(reading, event, 0.0, 0.0)

    def before(self, reading: Readings, event: Event) -> Readings:
        """Return the reading at an event as it was just before: the function is still positive."""
        part = reading.part(self._detectors.index(event.detector))
        return self._with(reading, event, TINY, float(part.slopes[event.index]))

    def _with(self, reading: Readings, event: Event, value: float, slope: float) -> Readings:
        """Return a reading with another value and slope of the function of an event."""
        place = self._detectors.index(event.detector)
        part = reading.part(place)
        values, slopes = np.array(part.values), np.array(part.slopes)
        values[event.index], slopes[event.index] = value, slope
        return reading.having(place, Reading(values, slopes))

    def check(self, start: Joined, end: Joined) -> None:
        """Refuse detectors whose number of functions changed, or whose values are nan.

        Raises
        ------
        InvalidInputError
        """
        parts = zip(self._detectors, start.parts, end.parts, strict=True)
        for detector, first, last in parts:
            if len(first.values) != len(last.values):
                what = f"{len(first.values)} functions all along a piece"
                raise broken(detector, "read", what, last)
            if detector in self._added and np.isnan(last.values).any():
                raise broken(detector, "read", "finite values", last)

    def is_quiet(self, segment: CurvedSegment, start: Readings, end: Readings) -> bool:
        """Tell that nothing happens on a step, by what little tells it of nearly every step."""
        for i, detector in enumerate(self._detectors):
            if detector.is_quiet(segment):
                continue
            first, last = start.part(i), end.part(i)
            if not _keeps_signs(first, last) or detector.needs_shorter_step(segment, first, last):
                return False
        return True

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Joined, end: Joined
    ) -> Failure | None:
        """Say why a shorter step must be taken, if a detector asks for one."""
        for i, detector in self._looking:
            if failure := detector.needs_shorter_step(segment, start.parts[i], end.parts[i]):
                return failure
        return None

    def ahead(self, reading: Readings) -> tuple[float, TransitionDetector, int] | None:
        """Return the distance at which a function with a gradient seems to vanish first, and which.

        None where none falls.
        """
        soonest = None
        for i, detector in self._aimed_at:
            part = reading.part(i)
            values, slopes = part.values, part.slopes
            if not len(values):
                continue
            if part.least > 0.0:  # nearly always
                rates = slopes / values
            else:
                rates = np.divide(slopes, values, out=np.zeros(len(values)), where=values > 0.0)
            fastest = rates.argmin()
            if (rate := rates.item(fastest)) < 0.0:
                distance = -1.0 / rate
                if soonest is None or distance < soonest[0]:
                    soonest = distance, detector, int(fastest)
        return soonest

    def falls(self, segment: Segment, start: Joined) -> Array:
        """Return the distance at which each function falls to zero on a straight segment.

        Each detector looks only as far as the nearest zero found by the detectors before it.
        """
        if self._are_affine:
            return ratio_test(start.values, start.slopes)
        distances, farthest = [], np.inf
        for detector, part in zip(self._detectors, start.parts, strict=True):
            distances.append(detector.falls(segment, part, farthest))
            farthest = min(farthest, distances[-1].min(initial=np.inf))
        return np.concatenate(distances)

    def ended(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return a special point, or the end of the branch if a detector ends it there."""
        for detector in self._detectors:
            arrival = detector.ended(arrival)
        return arrival

    def owner(self, reading: Joined, index: int) -> tuple[TransitionDetector, int]:
        """Return the detector that an index of a joined reading belongs to, and its own index."""
        for detector, part in zip(self._detectors, reading.parts, strict=True):
            if index < len(part.values):
                return detector, index
            index -= len(part.values)
        raise IndexError(index)


@final
class Readings:
    """What all detectors read at a state, each when it is first asked for.

    Values depend on the state alone: read late, they are what they were. Those of users' detectors,
    which may use the same arrays for the next state, are copied.
    """

    __slots__ = ("_copied", "_curve", "_detectors", "_parts", "_state")

    def __init__(
        self,
        detectors: Sequence[TransitionDetector],
        copied: Sequence[bool],
        curve: Curve,
        state: State,
    ) -> None:
        self._detectors, self._copied = detectors, copied
        self._curve, self._state = curve, state
        self._parts: list[Reading | None] = [None] * len(detectors)

    def part(self, place: int) -> Reading:
        """Return what one of the detectors reads."""
        part = self._parts[place]
        if part is None:
            part = self.keep(place, self._detectors[place].read(self._curve, self._state))
        return part

    def keep(self, place: int, part: Reading) -> Reading:
        """Keep what one of the detectors has read, and return it."""
        if self._copied[place]:
            part = Reading(np.array(part.values), np.array(part.slopes))
        self._parts[place] = part
        return part

    @property
    def parts(self) -> list[Reading]:
        """What each of the detectors reads."""
        return [self.part(place) for place in range(len(self._parts))]

    def having(self, place: int, part: Reading) -> Readings:
        """Return the same with another reading of one detector."""
        other = Readings(self._detectors, self._copied, self._curve, self._state)
        other._parts = [*self._parts[:place], part, *self._parts[place + 1 :]]
        return other

    def joined(self) -> Joined:
        """Return what all of them read, end to end."""
        return Joined.of(self.parts)


@final
@dataclass(slots=True, eq=False)
class Joined:
    """The readings of all detectors, and their values and slopes end to end."""

    parts: Sequence[Reading]
    values: Array
    slopes: Array

    @classmethod
    def of(cls, parts: Sequence[Reading]) -> Joined:
        """Join readings."""
        both = np.concatenate([part.values for part in parts] + [part.slopes for part in parts])
        half = len(both) // 2
        return cls(parts, both[:half], both[half:])


def _keeps_signs(first: Reading, last: Reading) -> bool:
    """Tell that no function may vanish on a step: all are positive, and no slope changes sign."""
    before, after = first.values, last.values
    if not before.shape == after.shape == first.slopes.shape == last.slopes.shape:
        return False
    if not len(after):
        return True
    if not (first.least > 0.0 < last.least):
        return False
    return smallest(first.slopes * last.slopes) >= 0.0


def broken(detector: TransitionDetector, method: str, what: str, got: object) -> InvalidInputError:
    """Return the error that says what a detector returned instead of what it must."""
    return InvalidInputError(
        f"{type(detector).__name__}.{method} must return {what}, got {got!r}; check_detector tells "
        "what else is wrong"
    )


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
