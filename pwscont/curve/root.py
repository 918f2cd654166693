"""What Newton leaves: a solution and the matrices that tell how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.rounding import CONVERGED
from pwscont.linear.factorise import Factor

#: A first correction below this relative size is followed by one that is rounding.
SMALL = CONVERGED**0.5


@final
@dataclass(slots=True, eq=False)
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
    contraction : float
        Ratio of the first two corrections, see :func:`first_quotient`.
    """

    x: Array
    error: Array
    jacobian: Matrix
    row: Matrix
    factor: Factor
    scale: Array
    iterations: int
    stale: bool = False
    contraction: float = 0.0


def first_quotient(sizes: Sequence[float]) -> float:
    """Return the ratio of the first two corrections, 0 where the first was small itself."""
    return sizes[1] / sizes[0] if len(sizes) > 1 and sizes[0] > SMALL else 0.0
