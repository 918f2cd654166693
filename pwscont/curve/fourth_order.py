"""Tangents by differences of fourth order, where those of second order do not tell enough.

Failure modes and answers
-------------------------
- A function changes within the longer steps of fourth order: with errors d of second order, those
  of fourth order are RATIO d^2, and are taken only where that is less.
- Along a vertical piece the slope of alpha is nothing but the errors of differences, and its signs
  would be folds. What these errors are depends on the units of alpha and on how long the interval
  is: they are estimated from the terms of which the derivatives consist.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pwscont.basics.arrays import Array, joined
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.error_samples import samples
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.differences import FINE_STEP, STEP
from pwscont.system.selection import Selection

#: What differences of second and of fourth order are off by at least, relative to derivatives.
CENTRAL, FINE = EPS / STEP, EPS / FINE_STEP
#: Errors of both are (STEP / w)^2 and (FINE_STEP / w)^4 for a function that changes over a width w.
RATIO = (FINE_STEP / STEP) ** 4


class Finer(NamedTuple):
    """A tangent by differences of fourth order.

    Attributes
    ----------
    tangent : ndarray, shape (n + 1,)
        Of length one in the metric.
    rounding : ndarray, shape (k, n + 1)
        Samples of what rounding of the differences makes of it.
    """

    tangent: Array
    rounding: Array


def finer(selection: Selection, metric: Metric, x: Array, tangent: Array) -> Finer | None:
    """Return the tangent next to one by differences of second order, None where there is none."""
    differences = selection.system.differences(float(x[-1]))
    jacobian = differences.to_fourth_order(selection.residual, x)
    factor = bordered(jacobian, metric.covector(tangent), metric.binary)
    if factor.is_singular():
        return None
    terms = np.abs(jacobian).dot(np.abs(x) + metric.scale)
    rounding = FINE * samples(len(x)) * joined(terms, 0.0)
    along, *errors = factor.solve_all(np.vstack([last_unit(len(x)), rounding]))
    return Finer(metric.normalised(along), np.array(errors))


def fine_slope(selection: Selection, metric: Metric, x: Array, tangent: Array) -> float:
    """Return d alpha / d arc length of a tangent by differences, zero where it may be zero."""
    slope, found = float(tangent[-1]) / metric.width, finer(selection, metric, x, tangent)
    if found is None:
        return slope
    fine = float(found.tangent[-1]) / metric.width
    rounding = float(np.linalg.norm(found.rounding[:, -1])) / metric.width
    relative = abs(fine - slope) * FINE / rounding if rounding else 0.0
    off = CONFIDENCE * rounding + min(1.0, RATIO * relative) * abs(fine - slope)
    return fine if abs(fine) > off else 0.0
