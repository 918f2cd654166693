"""All isolated solutions of one slice in exact arithmetic, each once, with all its cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pwscont.curve.error_samples import is_same
from pwscont.curve.metric import Metric
from pwscont.enumeration.exact import ExactSlice, ExactSolution
from pwscont.enumeration.point import Point, Slice
from pwscont.enumeration.slices import tests_of
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem


def solve_exactly(
    system: SlicewiseLinearSystem, metric: Metric, alpha: float, known: Sequence[Point] = ()
) -> Slice | None:
    """Return all isolated solutions by trying every cell in exact arithmetic.

    None where that takes too long, or the system's numbers are not finite. Faces are left out;
    ``known`` are points of them, which rounding in the system may put outside of regular cells.
    """
    solutions = ExactSlice(system, metric.scale[:-1], alpha).solutions()
    if solutions is None:
        return None
    candidates = [_candidate(one, alpha) for one in solutions]
    points: list[Point] = []
    for one, point in candidates:
        if one.is_inside and not any(_joins(metric, point, other) for other in points):
            shared = [o for o, other in candidates if o.is_inside and _joins(metric, other, point)]
            cells, signs = tuple(o.character for o in shared), tuple(o.det_sign for o in shared)
            points.append(replace(point, characters=cells, det_sign=signs[0], known_signs=signs))
    undecided = sum(
        _is_undecided(system, metric, *candidate, [*points, *known]) for candidate in candidates
    )
    return Slice(tuple(points), (), undecided, exact=True)


def _candidate(one: ExactSolution, alpha: float) -> tuple[ExactSolution, Point]:
    error = np.column_stack([one.error, np.zeros(len(one.error))])
    return one, Point(np.append(one.z, alpha), error, (one.character,), one.det_sign)


def _joins(metric: Metric, a: Point, b: Point) -> bool:
    """Tell whether two points of exact cells are one.

    Equal points are one. Points that differ by no more than their errors are one if their signs
    agree: by F1 the curve crosses the interface between their cells. If the signs differ, the curve
    turns back at the interface, and there are two points.
    """
    if np.array_equal(a.x, b.x):
        return True
    return a.det_sign == b.det_sign and is_same(metric, (a.x, a.error), (b.x, b.error))


def _is_undecided(
    system: PiecewiseSystem,
    metric: Metric,
    one: ExactSolution,
    point: Point,
    points: Sequence[Point],
) -> bool:
    """Tell whether a solution is outside its cell by no more than its error, in no other cell."""
    if one.is_inside:
        return False
    selection = Selection(system, one.character)
    tests, slack = tests_of(selection, metric, point.x, point.error)
    found = any(is_same(metric, (point.x, point.error), (p.x, p.error)) for p in points)
    return bool((tests >= -slack).all()) and not found
