"""The check of a stepper's contract."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.given import checked_kind
from pwscont.basics.outcome import Failure
from pwscont.continuation.kit.samples import (
    ON_CURVE,
    STEPS,
    StateSample,
    defect,
    off_curve,
    report,
    samples,
)
from pwscont.curve.curve import Curve, State
from pwscont.linear.factorise import last_unit
from pwscont.stepping import Stepper
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.system.check import Report
from pwscont.system.inspection import Defect

#: How much longer than allowed a step may be.
LONGER = 1.5
#: An end of the interval is reached when it is nearer than this.
AT_THE_END = 1e-9
#: How far ahead the zero of a function is that is aimed at.
AHEAD = 0.01


def check_stepper(stepper: Stepper) -> Report:
    """Check what a stepper promises, along known curves.

    - A step is a segment of the curve that begins at the given state, or a Failure.
    - Both ends solve the frozen selection, and tangents go on in the direction of travel.
    - No step is longer than ``longest`` by much, and no end lies outside the interval.
    - The end of the interval is reached.
    - A step that ``aim`` returns ends where the function vanishes that it was given.

    Returns
    -------
    Report

    Examples
    --------
    >>> from pwscont import ExactLinear, check_stepper
    >>> check_stepper(ExactLinear())
    Report(0 defects at 6 points)
    """
    checked_kind("stepper", stepper, Stepper)
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
    (lo, hi), end, long = sample.interval, step.end, step.length
    begins, ends = (curve.metric.covector(s.tangent) for s in (state, end))
    off = off_curve(curve, end.x, ends)
    wrong = {
        "the segment does not begin at the state given": not np.array_equal(step.start.x, state.x),
        "the step leaves the interval": not lo <= end.alpha <= hi,
        f"the step is {long:.3g} long, longest is {longest:.3g}": long > LONGER * longest,
        f"the end of the step is off the curve by {off:.1e}": not off <= ON_CURVE,
        "the segment has no length": not long > 0.0,
        "the step goes back, against the tangent given": not begins.dot(step.chord) > 0.0,
        "the tangent at the end points back": not ends.dot(step.chord) > 0.0,
    }
    return next((words for words, is_wrong in wrong.items() if is_wrong), None)
