"""The detectors of a run, and the words of users' detectors at special points of other kinds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONFIDENCE, CONVERGED
from pwscont.continuation.discovery import Discovery
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import Stepper
from pwscont.curve.steppers import ExactLinear
from pwscont.system.system import PiecewiseSystem
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


def keep_words(
    discovery: Discovery,
    system: PiecewiseSystem,
    metric: Metric,
    detectors: Sequence[TransitionDetector],
) -> None:
    """Add to nodes of other kinds the words of the detectors that would have marked them."""
    for edge in discovery.edges if detectors else ():
        curve, points = edge.followed.curve(system, metric), edge.track.points
        for number, place, inner in (
            (edge.start, edge.track.start, points[1]),
            (edge.end, edge.track.end, points[-2]),
        ):
            node = discovery.nodes[number]
            for detector in detectors:
                words = _words(detector, curve, place.x, place.error, inner)
                node.also += [word for word in words if word not in (str(node.kind), *node.also)]


def _words(
    detector: TransitionDetector, curve: Curve, x: Array, error: Array, inner: Array
) -> list[str]:
    """Return the kinds of the special points that a detector sees where a piece ends."""
    metric, way = curve.metric, x - inner
    if not (length := metric.norm(way)):
        return []
    here = State(x, metric.normalised(way), error[np.newaxis], 1)
    before = State(inner, here.tangent, 0.0 * here.error, 1)
    # functions may be read into the same array
    inside = np.array(detector.read(curve, before).values)
    values = np.array(detector.read(curve, here).values)
    reach = metric.slack(x, CONVERGED) + CONFIDENCE * metric.norm(error)
    vanish = (inside > 0.0) & (np.abs(values) <= (inside - values) * reach / length)
    return [str(detector.arrive(curve, here, int(i)).kind) for i in np.flatnonzero(vanish)]
