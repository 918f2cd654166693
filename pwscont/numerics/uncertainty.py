"""How far a computed solution may be from the true one, because of rounding.

The residual of the bordered system at the solution is a sum of terms J_ij x_j that cancel; its
own rounding error is of the order of EPS times the sum of their magnitudes, and the inverse of
the bordered matrix turns it into an error of x. The inverse is not formed: a few right-hand
sides with these magnitudes and random signs are solved for, which sees the same cancellation as
the true error does (statistical condition estimation, Kenney and Laub 1994).

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

from pwscont.foundation.arrays import Array, Matrix
from pwscont.foundation.rounding import EPS
from pwscont.numerics.newton import Root, joined

#: Solves per estimate: with three the chance to miss a factor of ten is below one in a thousand.
SAMPLES = 3


def uncertainty(root: Root) -> Array:
    """Return samples of the error of ``root.x``, shape (SAMPLES, n + 1), with signs."""
    size = np.abs(root.x) + root.error
    terms = joined(abs(root.jacobian) @ size, float((abs(root.row) @ size).sum()))
    return np.stack([root.factor.solve(EPS * signs * terms) for signs in _signs(len(size))])


def magnitude(x: Array, error: Array) -> Array:
    """Return the estimated error of every component of ``x``, shape (n + 1,).

    Parameters
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (k, n + 1)
        Samples.
    """
    estimate: Array = np.maximum(EPS * np.abs(x), np.abs(error).max(axis=0))
    return estimate


def magnitude_of_values(rows: Matrix, x: Array, error: Array) -> Array:
    """Return the estimated error of ``rows @ x``, shape (l,); ``error`` as for magnitude."""
    estimate: Array = EPS * (abs(rows) @ np.abs(x)) + np.abs(rows @ error.T).max(axis=1)
    return estimate


@lru_cache(maxsize=8)
def _signs(size: int) -> Array:
    """Return fixed random signs, shape (SAMPLES, size): two runs are identical."""
    return np.random.default_rng(size).choice([-1.0, 1.0], size=(SAMPLES, size))
