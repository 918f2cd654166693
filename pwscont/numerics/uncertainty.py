"""How far a computed solution may be from the true one, because of rounding.

The residual of the bordered system at the solution is a sum of terms J_ij x_j that cancel; its
own rounding error is of the order of EPS times the sum of their magnitudes, and the inverse of
the bordered matrix turns it into an error of x. The inverse is not formed: a few right-hand
sides with these magnitudes and random signs are solved for, which sees the same cancellation as
the true error does (statistical condition estimation, Kenney and Laub 1994).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.rounding import EPS
from pwscont.numerics.newton import Root, joined

#: Solves per estimate: with three the chance to miss a factor of ten is below one in a thousand.
SAMPLES = 3


def uncertainty(root: Root) -> Array:
    """Return an estimate of the error of every component of ``root.x``, shape (n + 1,)."""
    size = np.abs(root.x)
    terms = joined(abs(root.jacobian) @ size, float((abs(root.row) @ size).sum()))
    samples = [np.abs(root.factor.solve(EPS * signs * terms)) for signs in _signs(len(size))]
    estimate: Array = np.maximum(EPS * size, np.max(samples, axis=0))
    return estimate


@lru_cache(maxsize=8)
def _signs(size: int) -> Array:
    """Return fixed random signs, shape (SAMPLES, size): two runs are identical."""
    return np.random.default_rng(size).choice([-1.0, 1.0], size=(SAMPLES, size))
