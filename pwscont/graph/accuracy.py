"""How many digits of a result are significant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, largest
from pwscont.graph.place import Place

#: Significant digits where the error is rounding.
ALL_DIGITS = 16.0


def significant(error: Array, values: Array, scale: Array) -> float:
    """Return how many decimal digits of ``values`` are significant, by their estimated error.

    Each is measured by its own size or, where that is smaller, by its typical magnitude, so that
    the number does not depend on units; 16 where the error is rounding.
    """
    off = largest(error / np.maximum(np.abs(values), scale))
    return min(ALL_DIGITS, max(0.0, -math.log10(off))) if off > 0.0 else ALL_DIGITS


@final
@dataclass(frozen=True, slots=True, eq=False)
class Accuracy:
    """Tells how many digits of a place are significant, by its error when it is asked for.

    Attributes
    ----------
    scale : ndarray, shape (n + 1,), or None
        Typical magnitudes of (z, alpha).
    known : float
        The number where there are no magnitudes.
    """

    scale: Array | None = None
    known: float = ALL_DIGITS

    def digits(self, place: Place) -> float:
        """Return the number of significant decimal digits."""
        return self.known if self.scale is None else significant(place.error, place.x, self.scale)


ROUNDING = Accuracy()
