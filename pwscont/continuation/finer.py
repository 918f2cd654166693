"""Finer differences, where a function changes within less than one of their steps.

Failure modes and answers
-------------------------
- Shorter steps amplify rounding, and noise of the user's function, and every later piece of the run
  would have them: the error of steps that are too long falls with their length, that of rounding
  and noise grows. So finer steps are taken only where the next finer ones change derivatives more
  than those after them.
- Beside an end of the model derivatives are nan, or change by rounding: that is no reason.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.generic import generic
from pwscont.curve.curve import Curve
from pwscont.system.differences import FINER, FINEST


def refined(curve: Curve, x: Array) -> bool:
    """Let differences have shorter steps where that makes derivatives better; tell whether it does.

    Parameters
    ----------
    curve : Curve
    x : ndarray, shape (n + 1,)
        Where derivatives are compared.
    """
    part = part_of(curve)
    if part * FINER < FINEST:
        return False
    usual, finer, finest = (_derivatives(curve, x, part * FINER**k) for k in range(3))
    is_better = _apart(usual, finer) > _apart(finer, finest)
    curve.selection.system.refine_differences(part * FINER if is_better else part)
    return is_better


def part_of(curve: Curve) -> float:
    """Return what part of the usual steps differences take."""
    return curve.selection.system.differences(curve.metric.interval[0]).part


def _derivatives(curve: Curve, x: Array, part: float) -> tuple[Array, Array]:
    """Return derivatives along a generic direction by steps of this part, and their terms."""
    curve.selection.system.refine_differences(part)
    jacobian, scale = curve.selection.jacobian(x), curve.metric.scale
    return jacobian @ (scale * generic(len(scale))), abs(jacobian) @ scale


def _apart(one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """Return the largest difference of derivatives, relative to the terms of the second ones."""
    (first, _), (second, terms) = one, other
    with np.errstate(invalid="ignore"):
        apart = np.abs(first - second)
    known = terms != 0.0
    return float(np.divide(apart, terms, out=np.zeros_like(terms), where=known).max())
