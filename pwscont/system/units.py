"""Units of tests and equations: units that cannot be computed with are refused."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, largest, smallest
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.rounding import EPS
from pwscont.system.system import PiecewiseSystem

#: Largest magnitude whose square, and whose inverse's square, are normal numbers.
LARGEST_TO_SQUARE = 1e150
#: Smallest terms of H whose sum loses no digits to underflow.
LEAST_TERMS = float(np.finfo(float).tiny) / EPS


def refuse_extreme_tests(system: PiecewiseSystem, changes: Array) -> None:
    """Refuse tests whose typical changes have squares that overflow or underflow.

    Parameters
    ----------
    system : PiecewiseSystem
    changes : ndarray, shape (m,)
        By how much each test changes over typical magnitudes of (z, alpha).

    Raises
    ------
    InvalidSystemError
    """
    if (
        len(changes)
        and largest(changes) <= LARGEST_TO_SQUARE
        and smallest(changes) >= 1.0 / LARGEST_TO_SQUARE
    ):
        return  # nearly always
    bad = np.flatnonzero(
        (changes > LARGEST_TO_SQUARE) | ((changes < 1.0 / LARGEST_TO_SQUARE) & (changes > 0.0))
    )
    if len(bad):
        raise InvalidSystemError(
            f"{system.test_name(int(bad[0]))} of {type(system).__name__} typically changes by "
            f"{changes[bad[0]]:.3g}, outside the range [{1.0 / LARGEST_TO_SQUARE:g}, "
            f"{LARGEST_TO_SQUARE:g}] in which squares can be computed: multiply the test function "
            "by a constant"
        )


def refuse_extreme_rows(system: PiecewiseSystem, terms: Array) -> None:
    """Refuse equations whose terms are so small that the values lose digits to underflow.

    Parameters
    ----------
    system : PiecewiseSystem
    terms : ndarray, shape (n,)
        How large the terms of each row are.

    Raises
    ------
    InvalidSystemError
    """
    bad = np.flatnonzero((terms > 0.0) & (terms < LEAST_TERMS))
    if len(bad):
        raise InvalidSystemError(
            f"row {bad[0]} of {type(system).__name__}.residual is typically {terms[bad[0]]:.3g}, "
            f"less than {LEAST_TERMS:.3g}, where numbers lose digits: multiply it by a constant"
        )
