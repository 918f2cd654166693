"""All solutions at one alpha, by trying every cell."""

from __future__ import annotations

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.rounding import EPS, GUARD
from pwscont.model.selection import Selection
from pwscont.model.system import PiecewiseSystem, SlicewiseLinearSystem
from pwscont.numerics.corrector import BorderedNewton, Corrected
from pwscont.numerics.curve import Curve
from pwscont.numerics.linalg import last_unit
from pwscont.numerics.metric import Metric

#: A solution and what is known about its error, each of shape (n + 1,).
Found = tuple[Array, Array]


def solutions_at(system: PiecewiseSystem, metric: Metric, alpha: float) -> list[Found]:
    """Return the isolated solutions at ``alpha``, each once.

    Complete for a :class:`~pwscont.model.system.SlicewiseLinearSystem`, whose cells hold at
    most one isolated solution each. For other systems Newton is tried once in every cell, from
    z = 0, which may miss some.
    """
    found: list[Found] = []
    for character in system.cells():
        solution = _in_cell(Curve(Selection(system, character), metric), alpha)
        if solution and not any(_same(metric, solution, other) for other in found):
            found.append(solution)
    return found


def _in_cell(curve: Curve, alpha: float) -> Found | None:
    """Return the solution of one selection at ``alpha``, if it lies in the closed cell."""
    x = np.append(np.zeros(curve.selection.system.size), alpha)
    along_alpha = last_unit(len(x)) * curve.metric.scale[-1]
    corrected = BorderedNewton(most_iterations=30).correct(curve, x, along_alpha)
    if not isinstance(corrected, Corrected):
        return None
    state = corrected.state
    state.x[-1] = alpha
    gradients = abs(curve.selection.test_gradients(state.x))
    slack = GUARD * (gradients @ (state.error + EPS * np.abs(state.x)))
    inside = (curve.selection.tests(state.x) >= -slack).all()
    return (state.x, state.error) if inside else None


def _same(metric: Metric, a: Found, b: Found) -> bool:
    """Tell whether two solutions are one, found in two cells that share it."""
    rounding = GUARD * EPS * (metric.norm(a[0]) + metric.norm(b[0]))
    errors = GUARD * (metric.norm(a[1]) + metric.norm(b[1]))
    return metric.norm(a[0] - b[0]) <= rounding + errors


def is_complete(system: PiecewiseSystem) -> bool:
    """Tell whether :func:`solutions_at` finds every isolated solution of this system."""
    return isinstance(system, SlicewiseLinearSystem)
