"""What samples of an error say: magnitudes of errors of points, and of functions of points.

The root of the sum of squares of independent contributions, component by component or through a
linear function, is the estimated error. A test function may depend on a point through a difference
that is known better than the point itself: the error of the test is taken from the samples, not
from a bound on each component.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pwscont.basics.arrays import Array, Matrix, are_finite, is_everywhere, largest, product
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.metric import Metric
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import columns_scaled, largest_in_rows
from pwscont.system.box import Box

#: A solution (z, alpha), and samples of the error or the size of the last correction.
Found = tuple[Array, Array]
#: Most unknowns for which the inverse is formed column by column, instead of sampled.
MOST_WHOLE_INVERSE = 16
#: The number of entries up to which ``hypot`` is faster than sums of squares.
MOST_BY_HYPOT = 256
#: Largest error, as a part of a number, of a number with a certain digit.
ONE_DIGIT = 0.1
#: Number of random vectors, or of places near a point, that stand for all directions.
SAMPLES = 4


def magnitude(x: Array, error: Array) -> Array:
    """Return the estimated error of every component of ``x``, shape (n + 1,).

    ``error``, shape (k, n + 1): independent contributions, as from :func:`uncertainty`.
    """
    estimate: Array = np.maximum(EPS * np.abs(x), _root_of_squares(error))
    return estimate


def _root_of_squares(error: Array) -> Array:
    """Return the root of the sum of squares of each column; ``hypot`` of many takes far longer.

    Squares neither overflow nor vanish: typical magnitudes, and their rounding, are far from there
    (:class:`~pwscont.curve.metric.Metric`).
    """
    if error.size <= MOST_BY_HYPOT:
        return np.asarray(np.abs(np.hypot.reduce(error, axis=0)))
    squares = np.ones(len(error)).dot(np.square(error))  # a sum takes twice as long
    return np.asarray(np.sqrt(squares))


def zero_up_to(
    rows: Matrix, sizes: Array, error: Array | None = None, part: float = CONFIDENCE * EPS
) -> Array:
    """Return the sizes up to which linear functions ``rows @ v`` are zero, shape (l,).

    This is the rule by which a test function vanishes, and the slope of a test function: with v a
    point, ``rows @ v`` is the value of a test up to a constant, with v a unit tangent the slope.
    The value is a sum of terms row_j v_j. Terms and sum round by a part of the sum of the terms'
    magnitudes. To this comes CONFIDENCE times what the error of v contributes: the root of the sum
    of squares over the samples, because samples are independent.

    Nothing is known of rows with infinite entries: only zero itself is zero.

    Parameters
    ----------
    rows : Matrix, shape (l, k)
        The gradients of tests.
    sizes : ndarray, shape (k,)
        The magnitudes of the terms' second factors: abs(v), and the typical magnitudes as well
        where all unknowns of a test may vanish, because then abs(v) is no measure of rounding.
    error : ndarray, shape (j, k), optional
        Samples of the error of v.
    part : float
        The relative error of a term: by default that of a value. The slope of an exact tangent
        errs by GUARD EPS, a tangent that a solve gave by half of the digits, and gradients by
        differences by the error of differences.
    """
    zero: Array = part * product(abs(rows), sizes)
    if error is not None:
        zero += CONFIDENCE * np.abs(np.hypot.reduce(product(rows, error.T), axis=1))
    if len(zero) and not are_finite(zero):
        zero[~np.isfinite(zero)] = 0.0
    return zero


def slack_of_values(rows: Matrix, x: Array, error: Array, scale: Array) -> Array:
    """Return how far below zero tests may be computed at a solution of a closed cell, shape (l,).

    The typical magnitudes ``scale`` count once: an unknown may be zero because constants in H
    cancel, which the error of x does not show.
    """
    return zero_up_to(rows, np.abs(x) + scale / CONFIDENCE, error)


def slack_by_constants(
    rows: Matrix,
    values: Array,
    x: Array,
    error: Array,
    factor: Factor,
    jacobian: Matrix,
    constants: Array,
) -> Array:
    """Return how far from zero affine tests may be computed at a root of affine equations.

    The constants of equations, shape (n + 1,), and of tests round, which the error of x does not
    show. Typical magnitudes may be far more, as of F lam_nu with a large F. As equations may be
    written by tests, the constants of tests may cancel in the equations, where the coefficients of
    a test are as large as the entries of ``jacobian`` say.
    """
    sizes, known = abs(rows), np.abs(values - product(rows, x))
    sums = product(sizes, np.ones(len(x)))
    hidden = sizes.T @ (known / np.where(sums > 0.0, sums, 1.0) ** 2)
    constants = np.abs(constants)
    constants[:-1] += largest_in_rows(columns_scaled(jacobian, hidden))
    shifts = factor.solve_all(EPS * constants * samples(len(constants)))
    by_constants: Array = CONFIDENCE * EPS * known
    return by_constants + zero_up_to(rows, np.abs(x), np.vstack([error, shifts]))


def has_digits(x: Array, error: Array, scale: Array) -> bool:
    """Tell whether a digit or more of every component of ``x`` is certain, all finite.

    Each component is measured by the larger of size and typical magnitude.
    """
    sizes = np.abs(x)
    known = ONE_DIGIT * np.maximum(sizes, scale)
    return largest(sizes) < np.inf and is_everywhere(magnitude(x, error) <= known)


def is_inside(box: Box, x: Array, error: Array, scale: Array) -> bool:
    """Tell whether a solution with samples of the error may lie within the bounds of unknowns.

    Rounding of typical magnitudes counts as well: an unknown that is zero has no rounding.
    """
    if not box.is_bounded:
        return True  # nearly always, and magnitudes cost something
    slack = CONFIDENCE * (magnitude(x, error) + EPS * scale)
    return box.contains(x[:-1], slack[:-1])


def is_same(metric: Metric, a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    """Tell whether two solutions, each with samples of the error, agree within the errors."""
    errors = (metric.norm(magnitude(*found)) for found in (a, b))
    return metric.norm(metric.difference(a[0], b[0])) <= CONFIDENCE * sum(errors)


@lru_cache(maxsize=8)
def samples(size: int) -> Array:
    """Return unit vectors, or a few fixed random vectors for many unknowns; runs are identical.

    The squares of each column add up to 1.
    """
    if size <= MOST_WHOLE_INVERSE:
        return np.asarray(np.eye(size))
    samples = np.random.default_rng(size).normal(size=(SAMPLES, size))
    return np.asarray(samples / np.sqrt((samples**2).sum(axis=0)))
