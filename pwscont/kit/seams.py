"""Checks of a user's detector, stepper and search."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import final

import numpy as np

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, SearchScope
from pwscont.curve.corrector import BorderedNewton, Corrected
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.pseudo_arclength import PseudoArclength
from pwscont.curve.stepper import CurvedSegment, Segment, Stepper, StraightSegment
from pwscont.kit.inspection import Defect
from pwscont.kit.system import Report
from pwscont.linear.factorise import bordered, last_unit
from pwscont.search import Search
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import (
    Reading,
    SpecialPointFound,
    TransitionDetector,
    values_on,
)

#: A point is on a curve if its correction is below the first number, a slope is right if it agrees
#: with differences to the second.
ON_CURVE, AGREES = 1e-8, 1e-3
#: Steps that are tried on each curve.
STEPS = 40


@final
@dataclass(frozen=True, slots=True)
class StateSample:
    """A system, an interval, and a point of its curve."""

    system: PiecewiseSystem
    interval: tuple[float, float]
    x: Array

    @property
    def curve(self) -> Curve:
        """The curve through the point, in the metric of a run."""
        system = self.system.within(*self.interval)
        character = system.character(self.x[:-1], float(self.x[-1]))
        return Curve(Selection(system, character), Metric.of(system, self.interval))

    def state(self, direction: float) -> State:
        """Return the state at the point, travelling up or down in alpha."""
        found = BorderedNewton().correct(self.curve, self.x, direction * last_unit(len(self.x)))
        assert isinstance(found, Corrected)  # the points are on regular curves
        return found.state


@final
class _Circle(PiecewiseSystem):
    size = 1

    def test_functions(self, z: Array, alpha: float) -> Array:
        return z - 0.5

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        return z**2 + alpha**2 - 1.0


@final
class _Cubic(PiecewiseSystem):
    size = 2

    def test_functions(self, z: Array, alpha: float) -> Array:
        return np.array([z[1] - 900.0])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        return np.array([z[0] ** 3 + z[0] - alpha, z[1] - 1e3 * z[0] ** 2])

    def scale(self, lo: float, hi: float) -> Array:
        return np.array([1.0, 1e3])


@final
class _Line(PiecewiseSystem):
    size = 1

    def test_functions(self, z: Array, alpha: float) -> Array:
        return z - 0.25

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        return z - 0.5 * alpha


def samples() -> tuple[StateSample, ...]:
    """Return the curves on which an implementation is tried."""
    return (
        StateSample(_Circle(), (-0.9, 0.9), np.array([0.8, 0.6])),
        StateSample(_Cubic(), (-1.0, 1.5), np.array([0.0, 0.0, 0.0])),
        StateSample(_Line(), (-1.0, 1.0), np.array([0.0, 0.0])),
    )


def report(defects: Iterable[Defect], tried: int) -> Report:
    """Return a report in which each defect stands once."""
    return Report(tuple({defect.what: defect for defect in defects}.values()), tried)


def off_curve(curve: Curve, x: Array, row: Array) -> float:
    """Return how far a point is off a curve, within the hyperplane of a row."""
    factor = bordered(curve.selection.jacobian(x), row, curve.metric.binary)
    return curve.metric.norm(factor.solve(curve.selection.residual_and(x, 0.0)))


def defect(what: str, x: Array) -> Defect:
    """Return a broken promise and the point where the promise was seen to be broken."""
    return Defect(what, x[:-1], float(x[-1]), np.nan)


def check_detector(detector: TransitionDetector) -> Report:
    """Check what a detector promises, along known curves.

    - ``read`` returns as many finite values and slopes at every point of a piece.
    - Slopes that are not zero agree with differences along the curve.
    - ``border``, where it returns something, gives the values of ``read``, and gradients that agree
      with its slopes.
    - Where a function falls to zero, on a step or on a ray, ``locate`` returns a point of the
      curve at which the function vanishes, or a Failure.
    - ``arrive`` returns a SpecialPointFound whose first ray points back.
    - Along a ray no value is negative at first, and all are what their slopes say, where
      ``is_affine`` promises that.

    Returns
    -------
    Report

    Raises
    ------
    InvalidInputError
        If ``detector`` is no :class:`~pwscont.TransitionDetector`: a class is none.

    Examples
    --------
    >>> from pwscont import check_detector
    >>> from pwscont.transitions import SmoothFolds
    >>> bool(check_detector(SmoothFolds()))
    True
    """
    checked_kind("detector", detector, TransitionDetector, is_needed=True)
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


def check_search(search: Search) -> Report:
    """Check what a search promises, on known systems.

    - ``starts`` yields points, shape (n + 1,), in the interval, with errors that fit this shape.
    - The points solve the system in their cell, to within these errors.
    - ``searched`` returns a :class:`~pwscont.extending.SearchScope`.

    Returns
    -------
    Report

    Raises
    ------
    InvalidInputError
        If ``search`` is no :class:`~pwscont.Search`: a class is none.

    Examples
    --------
    >>> from pwscont import EndPoints, check_search
    >>> bool(check_search(EndPoints()))
    True
    """
    checked_kind("search", search, Search, is_needed=True)
    return report(
        (d for sample in samples() for d in _wrong_starts(search, sample)), len(samples())
    )


def _wrong_starts(search: Search, sample: StateSample) -> Iterator[Defect]:
    (lo, hi), metric, size = sample.interval, sample.curve.metric, sample.system.size
    system = sample.system.within(lo, hi)
    if not isinstance(search.searched(system), SearchScope):
        yield defect("searched() must return a SearchScope", sample.x)
    starts = search.starts(system, metric, sample.interval)
    if not isinstance(starts, Iterable):
        yield defect(f"starts() must yield pairs (x, error), got {starts!r}", sample.x)
        return
    for x, error in starts:
        point, samples_of_error = np.asarray(x), np.atleast_2d(error)
        if point.shape != (size + 1,) or samples_of_error.shape[1:] != (size + 1,):
            shapes = f"a start has shapes {np.shape(x)} and {np.shape(error)}"
            yield defect(f"{shapes}, where x = (z, alpha) has {size + 1} entries", sample.x)
            return
        if not lo <= point[-1] <= hi:
            yield defect("a start lies outside the interval", point)
            return
        selection = Selection(system, system.character(point[:-1], float(point[-1])))
        off = off_curve(Curve(selection, metric), point, last_unit(size + 1))
        if not off <= ON_CURVE + 10.0 * max(metric.norm(e) for e in samples_of_error):
            yield defect(f"a start is off the curve by {off:.1e}, and its error is less", point)


#: How much longer than allowed a step may be.
LONGER = 1.5
#: An end of the interval is reached when the end is nearer than this.
AT_THE_END = 1e-9
#: How far ahead a function vanishes whose zero is aimed at.
AHEAD = 0.01


def check_stepper(stepper: Stepper) -> Report:
    """Check what a stepper promises, along known curves.

    - A step is a segment of the curve that begins at the given state, or a Failure.
    - Both ends solve the frozen selection, and tangents go on in the direction of travel.
    - No step is longer than ``longest`` by much, and no end lies outside the interval.
    - The end of the interval is reached.
    - A step that ``aim`` returns ends where the given function vanishes.

    Returns
    -------
    Report

    Raises
    ------
    InvalidInputError
        If ``stepper`` is no :class:`~pwscont.Stepper`: a class is none.

    Examples
    --------
    >>> from pwscont import ExactLinear, check_stepper
    >>> check_stepper(ExactLinear())
    Report(0 defects at 6 points)
    """
    checked_kind("stepper", stepper, Stepper, is_needed=True)
    tried = [(sample, direction) for sample in samples() for direction in (1.0, -1.0)]
    steps = (d for pair in tried for d in _wrong_steps(stepper, *pair))
    aims = (d for pair in tried for d in _wrong_aim(stepper, *pair))
    return report(chain(steps, aims), len(tried))


def _wrong_steps(stepper: Stepper, sample: StateSample, direction: float) -> Iterator[Defect]:
    curve, state, before = sample.curve, sample.state(direction), None
    for longest in [0.05, *[np.inf] * STEPS]:
        if np.abs(np.subtract(sample.interval, state.alpha)).min() < AT_THE_END:
            return
        step = stepper.step(curve, sample.interval, state, before, longest)
        if isinstance(step, Failure):
            yield defect(f"step() ends in '{step}' before the end of the interval", state.x)
            return
        if not isinstance(step, Segment):
            yield defect(f"step() must return a Segment or a Failure, got {step!r}", state.x)
            return
        if not isinstance(step, CurvedSegment):
            return  # a ray has no end to check
        if wrong := _wrong_step(curve, sample, state, step, longest):
            yield defect(wrong, step.end.x)
            return
        state, before = step.end, step


def _wrong_aim(stepper: Stepper, sample: StateSample, direction: float) -> Iterator[Defect]:
    """Yield what is wrong with a step to a value of alpha, given as a function that falls."""
    curve, state = sample.curve, sample.state(direction)
    target = float((state.x + AHEAD * state.tangent)[-1])
    row = -direction * last_unit(len(state.x))

    def border(x: Array) -> tuple[float, Array]:
        return direction * (target - float(x[-1])), row

    step = stepper.aim(curve, state, None, AHEAD, border)
    if step is None:
        return
    if not isinstance(step, CurvedSegment):
        yield defect(f"aim() must return a CurvedSegment or None, got {step!r}", state.x)
    elif wrong := _wrong_step(curve, sample, state, step, np.inf):
        yield defect(f"aim(): {wrong}", step.end.x)
    elif not abs(border(step.end.x)[0]) <= ON_CURVE:
        yield defect("aim(): the function does not vanish at the end of the step", step.end.x)


def _wrong_step(
    curve: Curve, sample: StateSample, state: State, step: CurvedSegment, longest: float
) -> str | None:
    """Return what is wrong with a step, None where nothing is."""
    if not np.array_equal(step.start.x, state.x):
        return "the segment does not begin at the state given"
    (lo, hi), end, long = sample.interval, step.end, step.length
    begins, ends = (curve.metric.covector(s.tangent) for s in (state, end))
    off = off_curve(curve, end.x, ends)
    wrong = {
        "the step leaves the interval": not lo <= end.alpha <= hi,
        f"the step is {long:.3g} long, longest is {longest:.3g}": long > LONGER * longest,
        f"the end of the step is off the curve by {off:.1e}": not off <= ON_CURVE,
        "the segment has no length": not long > 0.0,
        "the step goes back, against the tangent given": not begins.dot(step.chord) > 0.0,
        "the tangent at the end points back": not ends.dot(step.chord) > 0.0,
    }
    return next((words for words, is_wrong in wrong.items() if is_wrong), None)
