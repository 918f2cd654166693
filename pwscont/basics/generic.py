"""Generic numbers, for directions that no problem is normal or parallel to by design."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pwscont.basics.arrays import Array


@lru_cache(maxsize=16)
def generic(size: int, shift: float = 0.0) -> Array:
    """Return numbers between -1 and 1, the same in every run; other numbers for each shift.

    They are not to be written to.
    """
    numbers: Array = np.cos(generic_angles(size, shift))
    numbers.flags.writeable = False
    return numbers


def generic_angles(size: int, shift: float = 0.0) -> Array:
    """Return the angles whose cosines and sines are generic: multiples of the root of two."""
    angles: Array = 1.0 + shift + np.sqrt(2.0) * np.arange(size)
    return angles
