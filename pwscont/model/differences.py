"""Jacobians by central differences, for systems that bring none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.rounding import EPS

#: Balances truncation (h^2) against cancellation (EPS / h) for central differences.
STEP = EPS ** (1.0 / 3.0)


def central_differences(function: Callable[[Array], Array], x: Array) -> Array:
    """Return the Jacobian of ``function`` at ``x``, shape (k, len(x)), about 10 digits right."""
    columns = []
    for j, h in enumerate(STEP * np.maximum(1.0, np.abs(x))):
        forward, backward = x.copy(), x.copy()
        forward[j] += h
        backward[j] -= h
        # the step actually taken differs from 2 h by rounding
        columns.append((function(forward) - function(backward)) / (forward[j] - backward[j]))
    return np.stack(columns, axis=1)


def exact_differences(function: Callable[[Array], Array], size: int) -> Array:
    """Return the Jacobian of an affine ``function`` of ``size`` unknowns, right to rounding."""
    origin = function(np.zeros(size))
    return np.stack([function(unit) - origin for unit in np.eye(size)], axis=1)
