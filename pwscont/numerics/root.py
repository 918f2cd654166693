"""What Newton leaves: a solution and the matrices that tell how well it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.foundation.arrays import Array, Matrix
from pwscont.numerics.linalg import Factor


@final
@dataclass(frozen=True, slots=True)
class Root:
    """A solution of {H_chi = 0, border = 0}.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (n + 1,)
        Size of the last correction.
    jacobian, row
        Jacobian and gradient of the border, from before the last correction.
    factor : Factor
        Factorisation of both together.
    scale : ndarray, shape (n + 1,)
        Typical magnitudes of x.
    iterations : int
    stale : bool
        Whether the factorisation is too old for the tangent.
    """

    x: Array
    error: Array
    jacobian: Matrix
    row: Matrix
    factor: Factor
    scale: Array
    iterations: int
    stale: bool = False


def joined(residual: Array, value: float) -> Array:
    """Return the residual with one more entry (numpy.append costs several times as much)."""
    rhs = np.empty(len(residual) + 1)
    rhs[:-1] = residual
    rhs[-1] = value
    return rhs
