"""c of J' - J = c g^T, by which the Jacobians on both sides of an interface differ (F1).

Failure modes and answers
-------------------------
- A difference of small parts of large numbers: c is read off the unknown along which the test
  changes most.
- Jacobians that cost more than all else, since they are put together for every cell: c is the
  difference of two residuals far away, where that unknown is so much larger than all others that
  the rounding of their terms is less than the rounding of its column.
- Residuals far away that mean nothing: not asked of systems whose unknowns have bounds.
- A system that says what c is may be wrong: the point of the next transition is no solution then,
  as its residual tells.
"""

from __future__ import annotations

import math

import numpy as np

from pwscont.basics.arrays import Array, Matrix
from pwscont.curve.curve import Curve
from pwscont.linear.factorise import column

#: How many times larger than all other unknowns one is made, in their typical magnitudes.
FAR = 2.0**20


def by_columns(before: Matrix, after: Matrix, gradient: Array, scale: Array) -> Array:
    """Return c, shape (n,), from the Jacobians on both sides, shape (n, n + 1).

    Parameters
    ----------
    before, after : ndarray, sparse matrix or StructuredJacobian
    gradient : ndarray, shape (n + 1,)
        g, of the test that vanishes on the interface.
    scale : ndarray, shape (n + 1,)
        Typical magnitudes of the unknowns.
    """
    steepest = int(np.abs(gradient * scale).argmax())
    jump: Array = (column(after, steepest) - column(before, steepest)) / gradient[steepest]
    return jump


def by_residuals(before: Curve, after: Curve, x: Array, gradient: Array) -> Array | None:
    """Return c, shape (n,), without Jacobians; None where the test changes with alpha alone.

    Parameters
    ----------
    before, after : Curve
        Of the selections on both sides, affine in z.
    x : ndarray, shape (n + 1,)
        A point of the interface, but for rounding.
    gradient : ndarray, shape (n + 1,)
        g, of the test that vanishes on the interface.
    """
    scale = after.metric.scale
    weights = np.abs(gradient * scale)[:-1]
    steepest = int(weights.argmax())
    far = x.copy()
    far[steepest] += FAR * max(1.0, after.metric.norm(x)) * scale[steepest]
    test = gradient[steepest] * (far[steepest] - x[steepest])
    if weights[steepest] <= abs(gradient[-1] * scale[-1]) / FAR or not math.isfinite(test):
        return None
    jump: Array = (after.selection.residual(far) - before.selection.residual(far)) / test
    return jump
