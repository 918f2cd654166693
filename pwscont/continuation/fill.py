"""Where infinitely many solutions fill a segment or more: asked where a run has met a sign of it.

Signs are a corner at which solutions fill a cone, a piece that could not be followed, and starts
without a digit, as from cells that have no corner; or nothing is found at all, as where solutions
fill whole lines. Where none is met there are only curves.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from pwscont.basics.kind import Kind
from pwscont.basics.outcome import FILL
from pwscont.continuation.joints import Node
from pwscont.curve.metric import Metric
from pwscont.enumeration import Filled, filled, solve_slice
from pwscont.graph.infinite import joined
from pwscont.graph.records import Stretch
from pwscont.system.blocks import number_of_cells
from pwscont.system.box import Box
from pwscont.system.system import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    has_too_many_tests,
)

#: Of more cells nothing is asked.
MANY_CELLS = 4**10


def infinite_stretches(
    system: PiecewiseSystem, metric: Metric, alphas: list[float]
) -> tuple[Stretch, ...]:
    """Return the stretches of alpha with infinitely many solutions.

    Exact for piecewise-linear systems. For systems that are only affine in z at fixed alpha, all
    solutions are sought at the special points and in the middle between them.

    Parameters
    ----------
    system : PiecewiseSystem
        Nothing is asked of systems that are not affine in z at fixed alpha, or have many cells.
    metric : Metric
    alphas : list of float
        Where special points are, and both ends of the interval.
    """
    if not isinstance(system, SlicewiseLinearSystem) or has_too_many_tests(system):
        return ()
    if number_of_cells(system.blocks()) > MANY_CELLS:
        return ()
    if isinstance(system, PiecewiseLinearSystem):
        box = Box.of(system)
        parts = filled(system, metric.scale[:-1], metric.interval, (box.lower, box.upper))
        return joined(parts, alphas)
    return joined(_between(system, metric, sorted(set(alphas))), alphas)


def _between(
    system: SlicewiseLinearSystem, metric: Metric, alphas: list[float]
) -> Iterator[Filled]:
    at = [_is_filled(system, metric, alpha) for alpha in alphas]
    for alpha, is_filled in zip(alphas, at, strict=True):
        if is_filled:
            yield Filled(alpha, alpha, True, True, 0.0)
    for lo, hi in pairwise(alphas):
        if _is_filled(system, metric, 0.5 * (lo + hi)):
            yield Filled(lo, hi, False, False, 0.0)


def _is_filled(system: SlicewiseLinearSystem, metric: Metric, alpha: float) -> bool:
    return bool(solve_slice(system, metric, alpha).faces)


def is_sign(node: Node) -> bool:
    """Tell whether a special point is a sign that solutions fill more than curves."""
    return node.lost > 0 or node.kind == Kind.STOPPED or FILL in node.message
