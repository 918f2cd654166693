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
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, Matrix, joined, largest, product
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude, samples
from pwscont.curve.root import Root
from pwscont.linear.factorise import bordered


def uncertainty(root: Root) -> Array:
    """Return independent contributions to the error of ``root.x``, shape (k, n + 1).

    Their root of the sum of squares, component by component or through a linear function, is
    the estimated error.
    """
    # the last correction was solved with errors of its largest parts everywhere
    size = np.abs(root.x) + largest(root.error / root.scale) * root.scale
    return root.factor.solve_all(_rounding(root.jacobian, root.row, size))


def uncertainty_beside(curve: Curve, state: State) -> Array:
    """Return how far a point may be from its curve, which :func:`uncertainty` returns of a root."""
    jacobian, row = curve.selection.jacobian(state.x), curve.metric.covector(state.tangent)
    factor, known = bordered(jacobian, row, curve.metric.binary), np.abs(state.error).max(axis=0)
    if factor.failed:
        return state.error
    return uncertainty(Root(state.x, known, jacobian, row, factor, curve.metric.scale, 0))


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


def _rounding(jacobian: Matrix, row: Matrix, size: Array) -> Array:
    """Return samples of the rounding of all rows, for unknowns of a size."""
    terms = joined(product(abs(jacobian), size), product(abs(row), size).item())
    rounding: Array = EPS * terms * samples(len(size))
    return rounding


def is_rounding(root: Root) -> bool:
    """Tell whether the last correction was nothing but rounding, as ill conditioning makes it."""
    return is_within(root, uncertainty(root))


def is_within(root: Root, error: Array) -> bool:
    """Tell whether the last correction is no more than an error, as from :func:`uncertainty`."""
    return bool((root.error <= CONFIDENCE * magnitude(root.x, error)).all())
