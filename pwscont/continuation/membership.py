"""Whether a solution is a point of a piece that is already known."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.curve import Curve, State
from pwscont.graph.refinement import solve_between

#: Solutions at one alpha in one cell are one when closer than this times their size.
SAME = EPS**0.5


def lies_on(curve: Curve, points: Array, state: State, interval: tuple[float, float]) -> bool:
    """Tell whether a state lies on the piece with these points, to within its error.

    Parameters
    ----------
    curve : Curve
        The curve of the piece, on whose selection the state lies as well.
    points : ndarray, shape (k, n + 1)
    state : State
    interval : tuple of float
    """
    metric, x, alpha = curve.metric, state.x, state.alpha
    if not points[:, -1].min() <= alpha <= points[:, -1].max():
        return False
    if len(points) == 2:
        nearest = _nearest_on_chord(curve, points, x)
    else:
        around = (curve.selection.system, curve.selection.character, points, alpha, interval)
        nearest = solve_between(*around)[0]
    apart = metric.difference(nearest, x)
    if metric.norm(apart) <= metric.slack(x, SAME):
        return True
    both = 2.0 * state.size  # the piece is as uncertain as the state
    return bool((np.abs(apart) <= CONFIDENCE * both).all())


def _nearest_on_chord(curve: Curve, points: Array, x: Array) -> Array:
    chord = points[1] - points[0]
    row = curve.metric.covector(chord)
    s = float(row.dot(x - points[0]) / row.dot(chord))
    nearest: Array = points[0] + min(max(s, 0.0), 1.0) * chord
    return nearest
