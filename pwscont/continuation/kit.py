"""Do a stepper, a detector, a search of one's own keep their contracts? For implementers.

Each is tried on small systems whose curves are known: a circle with a kink that changes nothing, a
cubic in two unknowns of different size, and a straight line. What is wrong is a defect with its
place, as for :func:`pwscont.check_system`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.guarantee import SearchScope
from pwscont.basics.outcome import Failure
from pwscont.continuation.plan import checked_kind
from pwscont.curve.corrector import BorderedNewton, Corrected
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.root import joined
from pwscont.linear.factorise import bordered, last_unit
from pwscont.search import Search
from pwscont.stepping import Stepper
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.system.check import Report
from pwscont.system.inspection import Defect
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector

#: H is zero where its correction is below this; a slope agrees with differences to this part.
ON_CURVE, AGREES = 1e-8, 1e-3
#: Steps that are tried on each curve, and how much longer than allowed one may be.
STEPS, LONGER = 40, 1.5
#: An end of the interval is reached when it is nearer than this.
AT_THE_END = 1e-9


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


def check_stepper(stepper: Stepper) -> Report:
    """Check what a stepper promises, along known curves.

    - It returns a segment of the curve that begins at the state it was given, or a Failure.
    - Both ends solve the frozen selection, and tangents go on in the direction of travel.
    - No step is longer than ``longest`` by much, and no end lies outside the interval.
    - The end of the interval is reached.

    Returns
    -------
    Report
    """
    checked_kind("stepper", stepper, Stepper)
    tried = [(sample, direction) for sample in samples() for direction in (1.0, -1.0)]
    defects = [d for pair in tried for d in _wrong_steps(stepper, *pair)]
    return Report(tuple(defects), len(tried))


def _wrong_steps(stepper: Stepper, sample: StateSample, direction: float) -> Iterator[Defect]:
    curve, state, before = sample.curve, sample.state(direction), None
    for longest in [0.05, *[np.inf] * STEPS]:
        if np.abs(np.subtract(sample.interval, state.alpha)).min() < AT_THE_END:
            return
        step = stepper.step(curve, sample.interval, state, before, longest)
        if isinstance(step, Failure):
            yield _defect(f"step() ends in '{step}' before the end of the interval", state.x)
            return
        if not isinstance(step, Segment):
            yield _defect(f"step() must return a Segment or a Failure, got {step!r}", state.x)
            return
        if not isinstance(step, CurvedSegment):
            return  # a ray has no end to check
        if wrong := _wrong_step(curve, sample, state, step, longest):
            yield _defect(wrong, step.end.x)
            return
        state, before = step.end, step


def _wrong_step(
    curve: Curve, sample: StateSample, state: State, step: CurvedSegment, longest: float
) -> str | None:
    """Return what is wrong with a step, None where nothing is."""
    (lo, hi), end = sample.interval, step.end
    if not np.array_equal(step.start.x, state.x):
        return "the segment does not begin at the state that was given"
    if not lo <= end.alpha <= hi:
        return "the step leaves the interval"
    if step.length > LONGER * longest:
        return f"the step is {step.length:.3g} long, longest is {longest:.3g}"
    row = curve.metric.covector(end.tangent)
    if not (off := _off(curve, end.x, row)) <= ON_CURVE:
        return f"the end of the step is off the curve by {off:.1e}"
    if not row.dot(step.chord) > 0.0:
        return "the tangent at the end points back"
    return None


def check_detector(detector: TransitionDetector) -> Report:
    """Check what a detector promises, along known curves.

    - ``read`` returns as many finite values and slopes at every point of a piece.
    - Slopes that are not zero agree with differences along the curve.
    - ``arrive`` returns a SpecialPointFound whose first ray points back.

    Returns
    -------
    Report
    """
    checked_kind("detector", detector, TransitionDetector)
    defects = [d for sample in samples() for d in _wrong_readings(detector, sample)]
    return Report(tuple(defects), len(samples()))


def _wrong_readings(detector: TransitionDetector, sample: StateSample) -> Iterator[Defect]:
    curve, state = sample.curve, sample.state(1.0)
    near = 1e-6
    ahead = State(state.x + near * state.tangent, state.tangent, state.error, state.orientation)
    first = detector.read(curve, state)
    wrong = _wrong_reading(first, None)
    second = first if wrong else detector.read(curve, ahead)
    if wrong := wrong or _wrong_reading(second, len(first.values)):
        yield _defect(wrong, state.x)
        return
    rates = (second.values - first.values) / near
    known = (first.slopes != 0.0) & (first.values != 0.0) & (second.values != 0.0)
    size = np.abs(rates).max(initial=0.0) + np.abs(first.slopes).max(initial=0.0)
    if (known & (np.abs(rates - first.slopes) > AGREES * size)).any():
        yield _defect("slopes do not match differences of the values", state.x)
    for index in range(len(first.values)):
        if wrong := _wrong_arrival(detector.arrive(curve, state, index), state):
            yield _defect(f"arrive(..., {index}): {wrong}", state.x)


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
        return f"must return an SpecialPointFound, got {arrival!r}"
    if not arrival.rays:
        return "the first ray must be the one back"
    back = arrival.rays[0]
    row = back.curve.metric.covector(back.state.tangent)
    return None if row.dot(state.tangent) < 0.0 else "the first ray does not point back"


def check_search(search: Search) -> Report:
    """Check what a search promises, on known systems.

    - ``starts`` yields points, shape (n + 1,), in the interval, with errors of a shape like it.
    - They solve the system in their cell, as far as the error says.
    - ``searched`` returns a :class:`~pwscont.extending.SearchScope`.

    Returns
    -------
    Report
    """
    checked_kind("search", search, Search)
    defects = [d for sample in samples() for d in _wrong_starts(search, sample)]
    return Report(tuple(defects), len(samples()))


def _wrong_starts(search: Search, sample: StateSample) -> Iterator[Defect]:
    (lo, hi), metric, size = sample.interval, sample.curve.metric, sample.system.size
    system = sample.system.within(lo, hi)
    if not isinstance(search.searched(system), SearchScope):
        yield _defect("searched() must return a SearchScope", sample.x)
    for x, error in search.starts(system, metric, sample.interval):
        point, samples_of_error = np.asarray(x), np.atleast_2d(error)
        if point.shape != (size + 1,) or samples_of_error.shape[1:] != (size + 1,):
            yield _defect(f"a start has shapes {np.shape(x)} and {np.shape(error)}", sample.x)
            return
        if not lo <= point[-1] <= hi:
            yield _defect("a start lies outside the interval", point)
            return
        selection = Selection(system, system.character(point[:-1], float(point[-1])))
        off = _off(Curve(selection, metric), point, last_unit(size + 1))
        if not off <= ON_CURVE + 10.0 * max(metric.norm(e) for e in samples_of_error):
            yield _defect(f"a start is off the curve by {off:.1e}, and its error is less", point)


def _off(curve: Curve, x: Array, row: Array) -> float:
    """Return how far a point is off a curve, within the hyperplane of a row."""
    factor = bordered(curve.selection.jacobian(x), row, curve.metric.binary)
    return curve.metric.norm(factor.solve(joined(curve.selection.residual(x), 0.0)))


def _defect(what: str, x: Array) -> Defect:
    return Defect(what, x[:-1], float(x[-1]), 1.0)
