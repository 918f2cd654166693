"""Units of test functions: those in which products of tests cannot be computed are refused."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, largest, smallest
from pwscont.basics.errors import InvalidSystemError
from pwscont.system.system import PiecewiseSystem

#: Squares of magnitudes up to this one, and of its inverse, are numbers.
LARGEST = 1e150


def refuse_extreme_tests(system: PiecewiseSystem, changes: Array) -> None:
    """Refuse tests whose typical changes are so large or small that their squares are no numbers.

    Parameters
    ----------
    system : PiecewiseSystem
    changes : ndarray, shape (m,)
        By how much each test changes over typical magnitudes of (z, alpha).

    Raises
    ------
    InvalidSystemError
    """
    if len(changes) and largest(changes) <= LARGEST and smallest(changes) >= 1.0 / LARGEST:
        return  # nearly always
    bad = np.flatnonzero((changes > LARGEST) | ((changes < 1.0 / LARGEST) & (changes > 0.0)))
    if len(bad):
        raise InvalidSystemError(
            f"{system.test_name(int(bad[0]))} of {type(system).__name__} typically changes by "
            f"{changes[bad[0]]:.3g}, outside the range [{1.0 / LARGEST:g}, {LARGEST:g}] in which "
            "squares can be computed: multiply the test function by a constant"
        )
