"""Solutions at one alpha, by trying every cell."""

from __future__ import annotations

import numpy as np

from pwscont.enumeration import Face, Point, Slice, det_sign, solve_slice
from pwscont.foundation.arrays import Array, finite_array
from pwscont.foundation.errors import InvalidInputError
from pwscont.foundation.kind import Kind
from pwscont.foundation.records import Solution, significant
from pwscont.model.box import Box
from pwscont.model.selection import Selection
from pwscont.model.system import PiecewiseSystem, SlicewiseLinearSystem
from pwscont.numerics.corrector import BorderedNewton, Corrected
from pwscont.numerics.curve import Curve
from pwscont.numerics.linalg import last_unit
from pwscont.numerics.metric import Metric
from pwscont.numerics.uncertainty import has_digits, is_same, magnitude, slack_of_values
from pwscont.transitions.cone import fan
from pwscont.transitions.rays import vanishing

#: A solution, shape (n + 1,), and samples of its error, shape (k, n + 1).
Found = tuple[Array, Array]


def enumerate_solutions(system: SlicewiseLinearSystem, alpha: float) -> list[Solution]:
    """Return all isolated solutions of a system of linear pieces at one alpha.

    Parameters
    ----------
    system : SlicewiseLinearSystem
    alpha : float

    Returns
    -------
    list of Solution
        Each once, also where several cells share it; such a one carries the ``kind`` of point
        that it is, and the sum of signs of the solutions that meet there: 0 at a fold.

    Raises
    ------
    InvalidInputError
        If the system is not affine in z at fixed alpha, or alpha is no finite number.
    """
    if not isinstance(system, SlicewiseLinearSystem):
        raise InvalidInputError(
            f"enumerate_solutions needs a SlicewiseLinearSystem, and {type(system).__name__} is "
            "none; use explore with MultiStart"
        )
    alpha = float(finite_array("alpha", alpha, ()))
    metric = Metric(np.append(system.scale(alpha, alpha), max(1.0, abs(alpha))))
    return [_solution(system, metric, point) for point in solve_slice(system, metric, alpha).points]


def _solution(system: SlicewiseLinearSystem, metric: Metric, point: Point) -> Solution:
    z, alpha, character = point.x[:-1], float(point.x[-1]), point.characters[0]
    index, kind = _index(system, metric, point)
    label = system.label(character)
    error = magnitude(point.x, point.error)
    digits = significant(error, point.x, metric.scale)
    return Solution(z, alpha, character, label, index, -1, kind, error, digits)


def _index(system: PiecewiseSystem, metric: Metric, point: Point) -> tuple[int, Kind | None]:
    """Return the sum of signs to the right of a point, and the kind of point."""
    if len(point.characters) <= 2:
        others = point.characters[1:]
        signs = [point.det_sign, *(det_sign(system, metric, point.x, cell) for cell in others)]
        if len(signs) == 1:
            return signs[0], None
        return (0, Kind.NONSMOOTH_FOLD) if sum(signs) == 0 else (signs[0], Kind.TRANSITION)
    zero = vanishing(system, point.x, point.error, metric.scale)
    found = fan(system, metric, point.x, point.error, zero)
    right = [
        ray.index if ray.shared else ray.state.orientation
        for ray in found.rays
        if ray.curve.slope(ray.state) > 0.0
    ]
    return sum(right), found.kind


def starts_at(system: PiecewiseSystem, metric: Metric, alpha: float) -> list[Found]:
    """Return solutions at ``alpha`` to start from, each once; of a face, its corners.

    Complete for a :class:`~pwscont.SlicewiseLinearSystem`. For other systems Newton is tried
    once in every cell, from z = 0 or what of the bounds is near it, which may miss some.
    """
    if isinstance(system, SlicewiseLinearSystem):
        return as_starts(solve_slice(system, metric, alpha))
    found: list[Found] = []
    box = Box.of(system)
    for character in system.cells():
        solution = _in_cell(Curve(Selection(system, character), metric), box, alpha)
        if solution and not any(is_same(metric, solution, other) for other in found):
            found.append(solution)
    return found


def as_starts(found: Slice) -> list[Found]:
    """Return the points of a slice, and the corners of its faces, as starts."""
    points = [(point.x, point.error) for point in found.points]
    return points + [start for face in found.faces for start in _corners(face)]


def _corners(face: Face) -> list[Found]:
    return [(corner, np.zeros_like(corner)[np.newaxis]) for corner in face.corners]


def _in_cell(curve: Curve, box: Box, alpha: float) -> Found | None:
    """Return the solution of one selection at ``alpha``, if it lies in the closed cell."""
    x = np.append(box.centre(curve.metric.scale[:-1]), alpha)
    along_alpha = last_unit(len(x)) * curve.metric.scale[-1]
    corrected = BorderedNewton(most_iterations=30).correct(curve, x, along_alpha)
    if not isinstance(corrected, Corrected):
        return None
    state = corrected.state
    if not has_digits(state.x, state.error, curve.metric.scale):
        return None  # Newton ran off
    x = np.append(box.wrapped(state.x[:-1]), alpha)
    gradients = curve.selection.test_gradients(x)
    slack = slack_of_values(gradients, x, state.error, curve.metric.scale)
    inside = (curve.selection.tests(x) >= -slack).all()
    return (x, state.error) if inside else None
