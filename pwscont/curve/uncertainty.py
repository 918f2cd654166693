"""How far a computed solution may be from the true one, because of rounding.

The residual of the bordered system at the solution is a sum of terms J_ij x_j that cancel; its
own rounding error is of the order of EPS times the sum of their magnitudes, and the inverse of
the bordered matrix turns it into an error of x. For large systems the inverse is not formed: a
few right-hand sides with these magnitudes and random signs are solved for, which sees the same
cancellation as the true error does (statistical condition estimation, Kenney and Laub 1994).

Failure modes and answers
-------------------------
- The solution is zero where the terms were not (an unloaded body reached from a loaded one):
  the terms are taken before the last correction as well as after it.
- Constants in H cancel, of which no derivative tells: (z + B) - B moves in stairs as high as the
  rounding of B. H is asked next to the solution for how far it is off its own derivative. It is so
  by its curvature as well, which shows farther away and is taken off.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pwscont.basics.arrays import Array, Matrix, joined, largest, product
from pwscont.basics.generic import generic
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude, samples
from pwscont.curve.root import Root
from pwscont.linear.factorise import bordered
from pwscont.system.system import SlicewiseLinearSystem

#: How far from a solution H is asked, as a part of typical magnitudes; and at how many places.
NEAR, FAR = EPS**0.5, EPS ** (1.0 / 3.0)
PLACES = 4
#: Third derivatives make the curvature near by differ from that farther away.
BENT = 4.0


def uncertainty(root: Root, unseen: Array | float = 0.0) -> Array:
    """Return independent contributions to the error of ``root.x``, shape (k, n + 1).

    Their root of the sum of squares, component by component or through a linear function, is
    the estimated error. ``unseen`` is rounding of the rows beyond that of their terms.
    """
    # the last correction was solved with errors of its largest parts everywhere
    size = np.abs(root.x) + largest(root.error / root.scale) * root.scale
    return root.factor.solve_all(_rounding(root.jacobian, root.row, size, unseen))


def unseen_rounding(curve: Curve, root: Root, border: Callable[[Array], float]) -> Array:
    """Return rounding of the rows at a root of which their derivatives do not tell, (n + 1,).

    Systems that are linear at fixed alpha are made of matrices, where terms tell everything.
    """
    if isinstance(curve.selection.system, SlicewiseLinearSystem):
        return np.zeros(len(root.x))
    far = _off_derivative(curve, root, border, FAR, 0)
    near = np.max([_off_derivative(curve, root, border, NEAR, i) for i in range(PLACES)], axis=0)
    unseen: Array = np.maximum(near - BENT * (NEAR / FAR) ** 2 * far, 0.0)
    return np.where(np.isfinite(unseen), unseen, 0.0)


def _off_derivative(
    curve: Curve, root: Root, border: Callable[[Array], float], part: float, shift: int
) -> Array:
    """Return by how much the rows change in another way than their derivatives say."""
    x, metric = root.x, curve.metric
    step = part * generic(len(x), shift) * (np.abs(x) + metric.scale)
    grows = product(root.row, step).item() >= 0.0  # so it does where the path comes from
    there = x + (step if grows else -step)
    there[-1] = x[-1] + math.copysign(part * metric.width, sum(metric.interval) - 2.0 * x[-1])
    dx = there - x
    before, after = (curve.selection.residual_and(y, border(y)) for y in (x, there))
    linear = joined(product(root.jacobian, dx), product(root.row, dx).item())
    off: Array = np.abs(after - before - linear)
    return off


def uncertainty_beside(curve: Curve, state: State) -> Array:
    """Return how far a point may be from its curve, which :func:`uncertainty` returns of a root."""
    jacobian, row = curve.selection.jacobian(state.x), curve.metric.covector(state.tangent)
    factor, known = bordered(jacobian, row, curve.metric.binary), np.abs(state.error).max(axis=0)
    if factor.failed:
        return state.error
    root = Root(state.x, known, jacobian, row, factor, curve.metric.scale, 0)
    return uncertainty(root, unseen_rounding(curve, root, lambda x: float(row.dot(x))))


def corrected(curve: Curve, x: Array, value: float, row: Array) -> tuple[Root, Array] | None:
    """Correct a point that is nearly exact, and estimate its error, by one solve for both.

    Parameters
    ----------
    curve : Curve
        Of an affine selection.
    x : ndarray, shape (n + 1,)
    value, row
        The border there and its gradient, as for :func:`~pwscont.curve.newton.newton`.

    Returns
    -------
    Root and ndarray, or None
        The error is that of :func:`uncertainty`; None where the correction is more than rounding,
        or cannot be computed.
    """
    metric = curve.metric
    if not metric.admits(x):
        return None
    jacobian, rest = curve.selection.jacobian(x), curve.selection.residual_and(x, value)
    factor = bordered(jacobian, row, metric.binary)
    if factor.failed:
        return None
    rounding = _rounding(jacobian, row, np.abs(x) + CONVERGED * metric.scale)
    dx, *error = factor.solve_all(np.vstack([rest, rounding]))
    if not metric.relative(dx, x - dx) <= CONVERGED or not metric.admits(x := x - dx):
        return None
    return Root(x, np.abs(dx), jacobian, row, factor, metric.scale, 1), np.array(error)


def _rounding(jacobian: Matrix, row: Matrix, size: Array, unseen: Array | float = 0.0) -> Array:
    """Return samples of the rounding of all rows, for unknowns of a size."""
    terms = joined(product(abs(jacobian), size), product(abs(row), size).item())
    rounding: Array = (EPS * terms + unseen) * samples(len(size))
    return rounding


def is_rounding(root: Root) -> bool:
    """Tell whether the last correction was nothing but rounding, as ill conditioning makes it."""
    return is_within(root, uncertainty(root))


def is_within(root: Root, error: Array) -> bool:
    """Tell whether the last correction is no more than an error, as from :func:`uncertainty`."""
    return bool((root.error <= CONFIDENCE * magnitude(root.x, error)).all())
