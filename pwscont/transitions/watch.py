"""All detectors of a run, read as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, smallest
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure
from pwscont.curve.curve import Curve, State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import (
    Reading,
    SpecialPointFound,
    TransitionDetector,
    ratio_test,
)

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

    def read(self, curve: Curve, state: State) -> Joined:
        """Return what all detectors read at ``state``."""
        return Joined.of([detector.read(curve, state) for detector in self._detectors])

    def first(self, curve: Curve, state: State) -> Joined:
        """Return what all detectors read where a piece begins, and check those of users' own.

        Raises
        ------
        InvalidInputError
            If a detector returns something else than its contract says.
        """
        parts = [detector.read(curve, state) for detector in self._detectors]
        for detector, part in zip(self._detectors, parts, strict=True):
            if detector not in self._added:
                continue
            if not isinstance(part, Reading):
                raise broken(detector, "read", "a Reading", part)
            if np.ndim(part.values) != 1 or np.shape(part.values) != np.shape(part.slopes):
                what = "values and slopes that are vectors alike"
                raise broken(detector, "read", what, part)
        return Joined.of(parts)

    def is_rounding(self, event: Event, curve: Curve) -> bool:
        """Tell whether the event of a user's detector is so close to where the piece begins.

        Right after its own special point a function is zero, but for rounding that is positive.
        """
        reach = CLOSE * (1.0 + curve.metric.norm(event.state.x))
        return event.detector in self._added and event.position <= reach

    def without(self, reading: Joined, event: Event) -> Joined:
        """Return a reading in which the function of an event is zero, and level.

        It is watched once it is positive. Falling from zero, it would be found again.
        """
        return self._with(reading, event, 0.0, 0.0)

    def before(self, reading: Joined, event: Event) -> Joined:
        """Return the reading at an event as it was just before: the function is still positive."""
        part = reading.parts[self._detectors.index(event.detector)]
        return self._with(reading, event, TINY, float(part.slopes[event.index]))

    def _with(self, reading: Joined, event: Event, value: float, slope: float) -> Joined:
        """Return a reading with another value and slope of the function of an event."""
        parts = list(reading.parts)
        place = self._detectors.index(event.detector)
        values, slopes = np.array(parts[place].values), np.array(parts[place].slopes)
        values[event.index], slopes[event.index] = value, slope
        parts[place] = Reading(values, slopes)
        return Joined.of(parts)

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

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Joined, end: Joined
    ) -> Failure | None:
        """Say why a shorter step must be taken, if a detector asks for one."""
        for i, detector in self._looking:
            if failure := detector.needs_shorter_step(segment, start.parts[i], end.parts[i]):
                return failure
        return None

    def ahead(self, reading: Joined) -> tuple[float, TransitionDetector, int] | None:
        """Return the distance at which a function with a gradient seems to vanish first, and which.

        None where none falls.
        """
        soonest = None
        for i, detector in self._aimed_at:
            values, slopes = reading.parts[i].values, reading.parts[i].slopes
            if not len(values) or smallest(slopes) >= 0.0:
                continue
            if smallest(values) > 0.0:  # nearly always
                rates = slopes / values
            else:
                rates = np.divide(slopes, values, out=np.zeros(len(values)), where=values > 0.0)
            if (fastest := smallest(rates)) < 0.0:
                distance = -1.0 / fastest
                if soonest is None or distance < soonest[0]:
                    soonest = distance, detector, int(rates.argmin())
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


def broken(detector: TransitionDetector, method: str, what: str, got: object) -> InvalidInputError:
    """Return the error that says what a detector returned instead of what it must."""
    return InvalidInputError(
        f"{type(detector).__name__}.{method} must return {what}, got {got!r}; check_detector tells "
        "what else is wrong"
    )
