"""What samples of an error say: magnitudes of errors of points, and of functions of points.

The root of the sum of squares of independent contributions, component by component or through a
linear function, is the estimated error. A test function may depend on a point through a difference
that is known better than the point itself: its error is taken from the samples, not from a bound on
each component.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pwscont.basics.arrays import (
    Array,
    Matrix,
    is_anywhere,
    is_everywhere,
    largest,
    product,
    smallest,
)
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.metric import Metric
from pwscont.system.box import Box

#: A solution (z, alpha), and samples of its error or the size of the last correction.
Found = tuple[Array, Array]
#: Up to this many unknowns the inverse is formed column by column, which samples nothing.
SMALL = 16
#: So many numbers, and fewer, are squared and added one by one in less time.
FEW = 256
#: A point is known to one digit where its error is at most this part of it.
ONE_DIGIT = 0.1
#: Squares of smaller numbers lose digits.
UNDERFLOW = 1e-140
#: Samples for larger systems.
SAMPLES = 4


def magnitude(x: Array, error: Array) -> Array:
    """Return the estimated error of every component of ``x``, shape (n + 1,).

    Parameters
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (k, n + 1)
        Independent contributions, as from :func:`uncertainty`.
    """
    return magnitude_beside(np.abs(x), error)


def magnitude_beside(sizes: Array, error: Array) -> Array:
    """Return the same from the magnitudes of ``x``, shape (n + 1,)."""
    estimate: Array = np.maximum(EPS * sizes, _root_of_squares(error))
    return estimate


def _root_of_squares(error: Array) -> Array:
    """Return the root of the sum of squares of each column; of many ``hypot`` takes far longer.

    Magnitudes are far from where squares overflow, see :class:`~pwscont.curve.metric.Metric`.
    """
    spread: Array
    if error.size <= FEW:
        spread = np.abs(np.hypot.reduce(error, axis=0))
        return spread
    spread = np.sqrt(_ones(len(error)).dot(np.square(error)))
    if len(spread) and smallest(spread) < UNDERFLOW:  # most of these are zero
        lost = spread < UNDERFLOW
        if len(error) and is_anywhere(np.logical_and(error, lost)):
            spread[lost] = np.hypot.reduce(error[:, lost], axis=0)
    return spread


def magnitude_of_values(rows: Matrix, x: Array, error: Array) -> Array:
    """Return the estimated error of ``rows @ x``, shape (l,); ``error`` as for magnitude."""
    return rounding_of_values(rows, np.abs(x), error)


def rounding_of_values(rows: Matrix, sizes: Array, error: Array) -> Array:
    """Return the same where the terms of ``x`` are of these sizes."""
    spread = np.abs(np.hypot.reduce(product(rows, error.T), axis=1))  # rows are in any units
    estimate: Array = EPS * product(abs(rows), sizes) + spread
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
    sizes = np.abs(x)
    known = ONE_DIGIT * np.maximum(sizes, scale)
    return largest(sizes) < np.inf and is_everywhere(magnitude_beside(sizes, error) <= known)


def is_inside(box: Box, x: Array, error: Array, scale: Array) -> bool:
    """Tell whether a solution with samples of its error may lie within the bounds of unknowns.

    Rounding of typical magnitudes counts as well: an unknown that is zero has none of its own.
    """
    if not box.is_bounded:
        return True  # nearly always, and magnitudes cost something
    slack = CONFIDENCE * (magnitude(x, error) + EPS * scale)
    return box.contains(x[:-1], slack[:-1])


def is_same(metric: Metric, a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    """Tell whether two solutions, each with samples of its error, are one within their errors."""
    errors = (metric.norm(magnitude(*found)) for found in (a, b))
    return metric.norm(metric.difference(a[0], b[0])) <= CONFIDENCE * sum(errors)


@lru_cache(maxsize=8)
def _ones(number: int) -> Array:
    """Return what adds up rows as a product, in half of the time of a sum."""
    return np.ones(number)


@lru_cache(maxsize=8)
def samples(size: int) -> Array:
    """Return unit vectors, or fixed random ones of which a few are enough; runs are identical.

    The squares of each column add up to one, so that the errors of single rows are not sampled.
    """
    if size <= SMALL:
        return np.asarray(np.eye(size))
    samples = np.random.default_rng(size).normal(size=(SAMPLES, size))
    return np.asarray(samples / np.sqrt((samples**2).sum(axis=0)))
