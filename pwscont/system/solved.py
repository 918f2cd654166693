"""Whether H vanishes at a point, to the rounding of the terms of H."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import PiecewiseSystem

#: Largest H that is rounding, as a part of the terms of the same equation, or as a part of the
#: largest terms of all equations, which a solve mixes.
OWN_TERMS, ALL_TERMS = 1e-6, 1e-12
#: Factor by which an error of a point, which is an estimate, may be too small.
ESTIMATED = 10.0


def unexplained(
    system: PiecewiseSystem,
    character: Character,
    x: Array,
    scale: Array,
    error: Array | None = None,
) -> float:
    """Return the largest entry of H at a point, zero where rounding and error explain all.

    Parameters
    ----------
    system : PiecewiseSystem
    character : Character
        The character of the selection that is to hold.
    x, scale : ndarray, shape (n + 1,)
        The point (z, alpha), and typical magnitudes.
    error : ndarray, shape (k, n + 1), optional
        Samples of the error of the point; default none.
    """
    z, alpha = x[:-1], float(x[-1])
    value = residual_at(system, z, alpha, character)
    jacobian = jacobian_at(system, z, alpha, character)
    terms = abs(jacobian) @ (np.abs(x) + scale) + np.abs(value - jacobian @ x)
    explained = OWN_TERMS * terms + ALL_TERMS * terms.max()
    if error is not None:
        explained += ESTIMATED * (abs(jacobian) @ np.abs(np.atleast_2d(error)).max(axis=0))
    return 0.0 if (np.abs(value) <= explained).all() else float(np.abs(value).max())
