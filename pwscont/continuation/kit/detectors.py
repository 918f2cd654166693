"""The check of a detector's contract."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from pwscont.basics.given import checked_kind
from pwscont.basics.outcome import Failure
from pwscont.continuation.kit.samples import (
    AGREES,
    ON_CURVE,
    STEPS,
    StateSample,
    defect,
    off_curve,
    report,
    samples,
)
from pwscont.curve.curve import Curve, State
from pwscont.stepping import PseudoArclength
from pwscont.stepping.stepper import CurvedSegment, Segment, StraightSegment
from pwscont.system.check import Report
from pwscont.system.inspection import Defect
from pwscont.transitions.detector import (
    Reading,
    SpecialPointFound,
    TransitionDetector,
    values_on,
)


def check_detector(detector: TransitionDetector) -> Report:
    """Check what a detector promises, along known curves.

    - ``read`` returns as many finite values and slopes at every point of a piece.
    - Slopes that are not zero agree with differences along the curve.
    - ``is_quiet`` is not true of a step on which a function vanishes,
    - ``border``, where it returns something, gives the values of ``read``, and gradients that agree
      with its slopes.
    - Where a function falls to zero, on a step or on a ray, ``locate`` returns a point of the
      curve at which it vanishes, or a Failure.
    - ``arrive`` returns a SpecialPointFound whose first ray points back.
    - Along a ray no value is negative at first, and all are what their slopes say, where
      ``is_affine`` promises that.

    Returns
    -------
    Report

    Examples
    --------
    >>> from pwscont import check_detector
    >>> from pwscont.transitions import SmoothFolds
    >>> bool(check_detector(SmoothFolds()))
    True
    """
    checked_kind("detector", detector, TransitionDetector)
    curved = (d for sample in samples() for d in _wrong_readings(detector, sample))
    ways = [(sample, direction) for sample in samples() for direction in (1.0, -1.0)]
    located = (d for way in ways for d in _wrong_locations(detector, *way))
    straight = (d for way in ways[-2:] for d in _wrong_on_ray(detector, *way))
    return report(chain(curved, located, straight), len(samples()))


def _wrong_readings(detector: TransitionDetector, sample: StateSample) -> Iterator[Defect]:
    curve, state = sample.curve, sample.state(1.0)
    near = 1e-6
    ahead = State(state.x + near * state.tangent, state.tangent, state.error, state.orientation)
    first = detector.read(curve, state)
    wrong = _wrong_reading(first, None)
    second = first if wrong else detector.read(curve, ahead)
    if wrong := wrong or _wrong_reading(second, len(first.values)):
        yield defect(wrong, state.x)
        return
    rates = (second.values - first.values) / near
    known = (first.slopes != 0.0) & (first.values != 0.0) & (second.values != 0.0)
    size = np.abs(rates).max(initial=0.0) + np.abs(first.slopes).max(initial=0.0)
    if (known & (np.abs(rates - first.slopes) > AGREES * size)).any():
        yield defect("slopes do not match differences of the values", state.x)
    for index in range(len(first.values)):
        if wrong := _wrong_arrival(detector.arrive(curve, state, index), state):
            yield defect(f"arrive(..., {index}): {wrong}", state.x)
        if wrong := _wrong_border(detector, curve, state, first, index):
            yield defect(f"border(..., {index}): {wrong}", state.x)


def _wrong_border(
    detector: TransitionDetector, curve: Curve, state: State, reading: Reading, index: int
) -> str | None:
    """Return why a function with its gradient is not the one that was read."""
    border = detector.border(curve, index)
    if border is None:
        return None
    value, gradient = border(state.x)
    slope = float(np.sum(gradient @ state.tangent))
    expected = float(reading.values[index]), float(reading.slopes[index])
    size = abs(expected[0]) + abs(expected[1])
    if not abs(value - expected[0]) <= AGREES * size:
        return f"the value is {value:.6g}, read is {expected[0]:.6g}"
    if not abs(slope - expected[1]) <= AGREES * size:
        return f"the gradient gives the slope {slope:.6g}, read is {expected[1]:.6g}"
    return None


def _wrong_locations(
    detector: TransitionDetector, sample: StateSample, direction: float
) -> Iterator[Defect]:
    """Yield what is wrong with points that are located along a few steps of a curve."""
    curve, state, before = sample.curve, sample.state(direction), None
    for _ in range(STEPS):
        step = PseudoArclength().step(curve, sample.interval, state, before, np.inf)
        if not isinstance(step, CurvedSegment):
            return
        first, last = detector.read(curve, state), detector.read(curve, step.end)
        if _wrong_reading(first, None) or _wrong_reading(last, len(first.values)):
            return  # said already
        fallen = (np.asarray(first.values) > 0.0) & (np.asarray(last.values) <= 0.0)
        if fallen.any() and detector.is_quiet(step):
            yield defect("is_quiet() must not be true where a function vanishes", step.end.x)
        for index in np.flatnonzero(fallen):
            size = float(np.abs([first.values[index], last.values[index]]).max())
            bracket = (0.0, step.length)
            yield from _wrong_location(detector, step, int(index), bracket, size)
        state, before = step.end, step


def _wrong_on_ray(
    detector: TransitionDetector, sample: StateSample, direction: float
) -> Iterator[Defect]:
    """Yield what is wrong with points that are located on a ray without an end."""
    curve, state = sample.curve, sample.state(direction)
    first, ray = detector.read(curve, state), StraightSegment(curve, state)
    if _wrong_reading(first, None):
        return  # said already
    distances = np.asarray(detector.falls(ray, first, 1.0))
    if distances.shape != np.shape(first.values):
        yield defect(f"falls() must return {len(first.values)} distances", state.x)
        return
    if detector.is_affine and (wrong := _wrong_promise(detector, ray, first)):
        yield defect(f"is_affine is promised, but {wrong}", state.x)
        return
    for index in np.flatnonzero((distances > 0.0) & (distances < 1.0)):
        s, size = float(distances[index]), float(np.abs(first.values[index]))
        yield from _wrong_location(detector, ray, int(index), (s, s), size)


def _wrong_promise(
    detector: TransitionDetector, ray: StraightSegment, first: Reading
) -> str | None:
    """Return why the functions of a detector are no affine ones that are positive at first."""
    if (np.asarray(first.values) < 0.0).any():
        return "a function is negative where a piece begins: such a function falls at once"
    s = 0.5
    expected = first.values + s * first.slopes
    apart = np.abs(values_on(detector, ray, s) - expected)
    size = np.abs(expected).max(initial=0.0) + np.abs(first.values).max(initial=0.0)
    if (apart > AGREES * size).any():
        return "values on a ray are not those of the slopes where it begins"
    return None


def _wrong_location(
    detector: TransitionDetector,
    segment: Segment,
    index: int,
    bracket: tuple[float, float],
    size: float,
) -> Iterator[Defect]:
    """Yield defects of the point where one function, of this size, is said to vanish."""
    curve, where = segment.curve, segment.start.x
    found = detector.locate(segment, index, bracket)
    if isinstance(found, Failure):
        return
    if not isinstance(found, State):
        yield defect(f"locate(..., {index}) must return a State or a Failure, got {found!r}", where)
        return
    row = curve.metric.covector(found.tangent)
    if not (off := off_curve(curve, found.x, row)) <= ON_CURVE:
        yield defect(f"locate(..., {index}) is off the curve by {off:.1e}", where)
    value = float(detector.read(curve, found).values[index])
    if not abs(value) <= AGREES * size:
        yield defect(f"locate(..., {index}): the function is {value:.3g} there, not zero", found.x)
    arrival = detector.arrive(curve, found, index)
    if wrong := _wrong_arrival(arrival, found):
        yield defect(f"arrive(..., {index}): {wrong}", found.x)
    elif np.shape(arrival.x) != found.x.shape:
        wrong = f"x must have shape {found.x.shape}, got {np.shape(arrival.x)}"
        yield defect(f"arrive(..., {index}): {wrong}", found.x)


def _wrong_reading(reading: Reading, count: int | None) -> str | None:
    if not isinstance(reading, Reading):
        return f"read() must return a Reading, got {reading!r}"
    values, slopes = np.asarray(reading.values), np.asarray(reading.slopes)
    if values.ndim != 1 or values.shape != slopes.shape:
        return f"values and slopes must be vectors alike, got {values.shape} and {slopes.shape}"
    if not (np.isfinite(values).all() and np.isfinite(slopes).all()):
        return "values and slopes must be finite"
    if count is not None and len(values) != count:
        return f"read() returned {count} functions, and {len(values)} a little further on"
    return None


def _wrong_arrival(arrival: SpecialPointFound, state: State) -> str | None:
    if not isinstance(arrival, SpecialPointFound):
        return f"must return a SpecialPointFound, got {arrival!r}"
    if not arrival.rays:
        return "the first ray must be the one back"
    back = arrival.rays[0]
    row = back.curve.metric.covector(back.state.tangent)
    return None if row.dot(state.tangent) < 0.0 else "the first ray does not point back"
