"""The first event on a segment.

Failure modes and answers
-------------------------
- A cell thinner than the step: the character is frozen, so the far end of the step lies
  outside the cell whatever is beyond it (F7 of the design).
- A test that dips below zero and comes back within one step: its slopes at both ends differ in
  sign, and where the tangent lines at both ends cross below zero, the dip is searched.
- The test that was just crossed starts at zero, with a sign that is rounding: its slope says
  that it is inside, and a bracket starts where its value is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.numerics.curve import Curve, State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import Arrival, Reading, TransitionDetector
from pwscont.transitions.location import MOST_HALVINGS, locate_sign_change


@final
@dataclass(frozen=True, slots=True)
class Event:
    """A watched function that vanishes on a segment."""

    detector: TransitionDetector
    index: int
    position: float
    state: State

    def arrive(self, curve: Curve) -> Arrival:
        """Return the special point that the event makes."""
        return self.detector.arrive(curve, self.state, self.index)


Readings = list[Reading]


def read_all(detectors: Sequence[TransitionDetector], curve: Curve, state: State) -> Readings:
    """Return what every detector reads at ``state``."""
    return [detector.read(curve, state) for detector in detectors]


def first_on_ray(
    detectors: Sequence[TransitionDetector], segment: Segment, start: Readings
) -> Event | Failure:
    """Return the first event on a straight segment, by the ratio test."""
    best, which = np.inf, None
    for detector, reading in zip(detectors, start, strict=True):
        distances = _ratios(reading)
        if distances.size and distances[j := int(np.argmin(distances))] < best:
            best, which = float(distances[j]), (detector, j)
    if which is None:
        return Failure(Trouble.UNBOUNDED)
    state = which[0].locate(segment, which[1], (best, best))
    return state if isinstance(state, Failure) else Event(*which, best, state)


def _ratios(reading: Reading) -> Array:
    """Return the distance at which each affine function falls to zero, infinite if never."""
    falling = reading.slopes < 0.0
    distances = np.full(len(falling), np.inf)
    np.divide(np.maximum(reading.values, 0.0), -reading.slopes, out=distances, where=falling)
    return distances


def first_on_curve(
    detectors: Sequence[TransitionDetector], segment: CurvedSegment, start: Readings, end: Readings
) -> Event | Failure | None:
    """Return the first event on a curved segment, None where there is none."""
    first: Event | None = None
    for detector, before, after in zip(detectors, start, end, strict=True):
        for index in _suspects(before, after, segment.length):
            event = _event(detector, index, segment, before, after)
            if isinstance(event, Failure):
                return event
            if event and (first is None or event.position < first.position):
                first = event
    return first


def _suspects(before: Reading, after: Reading, length: float) -> list[int]:
    """Return the functions that vanish on the segment or may dip below zero within it."""
    crossed = (after.values <= 0.0) & ((before.values > 0.0) | (before.slopes > 0.0))
    dips = (before.slopes < 0.0) & (after.slopes > 0.0) & (after.values > 0.0)
    if not (crossed.any() or dips.any()):
        return []
    # where both tangent lines meet; a convex function stays above that point
    run = after.slopes - before.slopes
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (before.values - after.values + after.slopes * length) / run
        dips &= before.values + before.slopes * s < 0.0
    return [int(i) for i in np.flatnonzero(crossed | dips)]


def _event(
    detector: TransitionDetector,
    index: int,
    segment: CurvedSegment,
    before: Reading,
    after: Reading,
) -> Event | Failure | None:
    """Return the located event, None for a dip that stays above zero."""
    bracket: tuple[float, float] | Failure | None = (0.0, segment.length)
    if after.values[index] > 0.0:
        bracket = _bracket_of_dip(detector, index, segment)
    elif before.values[index] <= 0.0 or before.slopes[index] > 0.0:
        bracket = _bracket_of_return(detector, index, segment)
    if bracket is None or isinstance(bracket, Failure):
        return bracket
    state = detector.locate(segment, index, bracket)
    if isinstance(state, Failure):
        return state
    return Event(detector, index, segment.position(state.x), state)


def _bracket_of_dip(
    detector: TransitionDetector, index: int, segment: CurvedSegment
) -> tuple[float, float] | Failure | None:
    """Return a bracket of the first zero of a function that is positive at both ends."""

    def slope(state: State) -> float:
        return float(detector.read(segment.curve, state).slopes[index])

    lowest = locate_sign_change(segment, slope, (0.0, segment.length))
    if isinstance(lowest, Failure):
        return lowest
    if detector.read(segment.curve, lowest).values[index] > 0.0:
        return None
    return 0.0, segment.position(lowest.x)


def _bracket_of_return(
    detector: TransitionDetector, index: int, segment: CurvedSegment
) -> tuple[float, float] | Failure:
    """Return a bracket of the zero to which a function returns that starts at zero, rising."""
    lo = hi = segment.length
    for _ in range(MOST_HALVINGS):
        lo *= 0.5
        state = segment.at(lo)
        if isinstance(state, Failure):
            return state
        if detector.read(segment.curve, state).values[index] > 0.0:
            return lo, hi
        hi = lo
    return Failure(Trouble.SINGULAR)
