"""The detectors of every run."""

from __future__ import annotations

from pwscont.curve.stepper import Stepper
from pwscont.curve.steppers import ExactLinear
from pwscont.transitions import (
    BoundingTests,
    IntervalEnds,
    SmoothBranchPoints,
    SmoothFolds,
    StraightTests,
    TransitionDetector,
)


def default_detectors(
    stepper: Stepper, interval: tuple[float, float]
) -> tuple[TransitionDetector, ...]:
    """Return the detectors of every run: straight pieces neither fold nor branch in a cell.

    Branch points come before folds, for alpha may turn at a branch point.
    """
    ends = IntervalEnds(*interval)
    if isinstance(stepper, ExactLinear):
        return ends, StraightTests()
    return ends, BoundingTests(), SmoothBranchPoints(), SmoothFolds()
