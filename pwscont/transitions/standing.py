"""Solutions at which dH/dz is singular: whether and where the curve is there.

Failure modes and answers
-------------------------
- Near a fold the residual is as small as the square of the distance: where dH/dz is singular,
  Newton at fixed alpha may stand still beside the fold, beyond it even, where there is no solution.
  With another unknown held fixed, Newton leads to the curve, at the alpha at which it is.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.curve.curve import Curve, Held
from pwscont.curve.metric import Metric
from pwscont.curve.newton import newton
from pwscont.linear.factorise import bordered
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

MOST_NEWTON = 8
#: A solution and samples of its error, or the size of the last correction.
Found = tuple[Array, Array]


def settled(system: PiecewiseSystem, metric: Metric, found: Found) -> Found | None:
    """Return a solution that Newton found at fixed alpha, put on the curve if dH/dz is singular.

    None where the curve is outside the interval.
    """
    if isinstance(system, SlicewiseLinearSystem):
        return found
    x, _ = found
    curve = Curve(Selection(system, system.character(x[:-1], float(x[-1]))), metric)
    held = regular_border(curve, x)
    if held is None or held.row[-1]:
        return found
    row = held.row
    root = newton(curve, lambda y: (float(row.dot(y - x)), row), x, MOST_NEWTON)
    if isinstance(root, Failure):
        return None
    same = 0.5 * SAME_ALPHA * max(abs(float(x[-1])), float(metric.scale[-1]))
    return found if abs(root.x[-1] - x[-1]) <= same else (root.x, root.error[np.newaxis])


def regular_border(curve: Curve, x: Array) -> Held | None:
    """Return J, the unit row e_j that borders it to a regular matrix, and the factorisation.

    It holds one unknown fixed: alpha, but at a fold, where that fails. At a branch point all fail.
    """
    jacobian, size = curve.selection.jacobian(x), len(x)
    for j in range(size - 1, -1, -1):
        row = np.zeros(size)
        row[j] = 1.0
        factor = bordered(jacobian, row, curve.metric.binary)
        if not factor.is_singular():
            return Held(jacobian, row, factor)
    return None
