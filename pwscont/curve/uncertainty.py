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
- A test function depends on x through a difference that is known better than x itself: its
  error is taken from the samples, not from a bound on each component.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.curve import Curve
from pwscont.curve.metric import Metric
from pwscont.curve.root import Root, joined
from pwscont.linear.factorise import bordered

#: Up to this many unknowns the inverse is formed column by column, which samples nothing.
SMALL = 16
#: A point is known to one digit where its error is at most this part of it.
ONE_DIGIT = 0.1
#: Squares of smaller numbers lose digits.
UNDERFLOW = 1e-140
#: Samples for larger systems.
SAMPLES = 4


def uncertainty(root: Root) -> Array:
    """Return independent contributions to the error of ``root.x``, shape (k, n + 1).

    Their root of the sum of squares, component by component or through a linear function, is
    the estimated error.
    """
    # the last correction was solved with errors of its largest parts everywhere
    size = np.abs(root.x) + (root.error / root.scale).max() * root.scale
    return root.factor.solve_all(_rounding(root.jacobian, root.row, size))


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
    jacobian, rest = curve.selection.jacobian(x), joined(curve.selection.residual(x), value)
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
    terms = joined(abs(jacobian) @ size, float((abs(row) @ size).sum()))
    rounding: Array = EPS * terms * samples(len(size))
    return rounding


def is_rounding(root: Root) -> bool:
    """Tell whether the last correction was nothing but rounding, as ill conditioning makes it."""
    return is_within(root, uncertainty(root))


def is_within(root: Root, error: Array) -> bool:
    """Tell whether the last correction is no more than an error, as from :func:`uncertainty`."""
    return bool((root.error <= CONFIDENCE * magnitude(root.x, error)).all())


def magnitude(x: Array, error: Array) -> Array:
    """Return the estimated error of every component of ``x``, shape (n + 1,).

    Parameters
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (k, n + 1)
        Independent contributions, as from :func:`uncertainty`.
    """
    estimate: Array = np.maximum(EPS * np.abs(x), _root_of_squares(error))
    return estimate


def _root_of_squares(error: Array) -> Array:
    """Return the root of the sum of squares of each column; ``hypot`` takes ten times as long.

    Magnitudes are far from where squares overflow, see :class:`~pwscont.curve.metric.Metric`.
    """
    spread: Array = np.sqrt(np.einsum("ki,ki->i", error, error))
    lost = spread < UNDERFLOW
    if np.count_nonzero(lost):
        spread[lost] = np.hypot.reduce(error[:, lost], axis=0)
    return spread


def magnitude_of_values(rows: Matrix, x: Array, error: Array) -> Array:
    """Return the estimated error of ``rows @ x``, shape (l,); ``error`` as for magnitude."""
    spread = np.abs(np.hypot.reduce(rows @ error.T, axis=1))
    estimate: Array = EPS * (abs(rows) @ np.abs(x)) + spread
    return estimate


def slack_of_values(rows: Matrix, x: Array, error: Array, scale: Array) -> Array:
    """Return how far below zero tests may be computed at a solution of a closed cell, shape (l,).

    The rounding of their own terms, and of typical ones: an unknown may be zero because constants
    in H cancel, of which its error knows nothing.
    """
    slack: Array = CONFIDENCE * magnitude_of_values(rows, x, error) + EPS * (abs(rows) @ scale)
    return slack


def has_digits(x: Array, error: Array, scale: Array) -> bool:
    """Tell whether at least one digit of every component of ``x`` is certain, all finite.

    Each is measured by its own size or, where that is smaller, by its typical magnitude.
    """
    known = ONE_DIGIT * np.maximum(np.abs(x), scale)
    return bool(np.isfinite(x).all() and (magnitude(x, error) <= known).all())


def is_same(metric: Metric, a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    """Tell whether two solutions, each with samples of its error, are one within their errors."""
    errors = (metric.norm(magnitude(*found)) for found in (a, b))
    return metric.norm(metric.difference(a[0], b[0])) <= CONFIDENCE * sum(errors)


@lru_cache(maxsize=8)
def samples(size: int) -> Array:
    """Return unit vectors, or fixed random ones of which a few are enough; runs are identical.

    The squares of each column add up to one, so that the errors of single rows are not sampled.
    """
    if size <= SMALL:
        return np.asarray(np.eye(size))
    samples = np.random.default_rng(size).normal(size=(SAMPLES, size))
    return np.asarray(samples / np.sqrt((samples**2).sum(axis=0)))
