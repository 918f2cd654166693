"""Length and angle in (z, alpha), independent of the units of either."""

from __future__ import annotations

import math
from typing import final

import numpy as np

from pwscont.foundation.arrays import Array, finite_array
from pwscont.foundation.errors import InvalidSystemError
from pwscont.foundation.rounding import SAME_ALPHA
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.linalg import power_of_two

#: Squares and products of magnitudes up to this one stay far from overflow.
LARGEST = 1e120
EVERYWHERE = (-math.inf, math.inf)


@final
class Metric:
    """Euclidean geometry after dividing each unknown by its typical magnitude.

    Parameters
    ----------
    scale : ndarray, shape (n + 1,)
        Positive typical magnitudes of (z, alpha).
    interval : tuple of float
        The values of alpha at which a system may be asked for anything.

    Attributes
    ----------
    scale, binary : ndarray, shape (n + 1,)
        The magnitudes, and the powers of two next above them.
    """

    def __init__(self, scale: Array, interval: tuple[float, float] = EVERYWHERE) -> None:
        self.scale, self.interval = scale, interval
        self.binary = power_of_two(scale)
        self._weight = 1.0 / scale**2

    @classmethod
    def of(cls, system: PiecewiseSystem, interval: tuple[float, float]) -> Metric:
        """Return the metric of a system on an interval, in which the interval has length 1."""
        lo, hi = interval
        scale = finite_array(f"{type(system).__name__}.scale()", system.scale(lo, hi))
        if scale.shape != (system.size,) or not (scale > 0.0).all():
            raise InvalidSystemError(
                f"{type(system).__name__}.scale() must return {system.size} positive numbers"
            )
        everything = np.append(scale, hi - lo)
        if everything.max() > LARGEST or everything.min() < 1.0 / LARGEST:
            raise InvalidSystemError(
                f"typical magnitudes from {everything.min():.3g} to {everything.max():.3g} leave "
                f"the range [{1.0 / LARGEST:g}, {LARGEST:g}] in which their squares can be "
                "computed; choose other units"
            )
        return cls(everything, (lo, hi))

    def admits(self, x: Array) -> bool:
        """Tell whether alpha lies in the interval; beside an end by rounding, it is put there."""
        lo, hi = self.interval
        alpha = float(x[-1])
        if lo <= alpha <= hi:
            return True
        end = lo if alpha < lo else hi
        if not abs(alpha - end) <= SAME_ALPHA * max(abs(end), hi - lo):
            return False
        x[-1] = end
        return True

    def norm(self, x: Array) -> float:
        """Return the length of a difference of two points."""
        y = x / self.scale
        return math.sqrt(y.dot(y))

    def relative(self, dx: Array, x: Array) -> float:
        """Return the largest component of ``dx`` relative to that of ``x`` or its scale."""
        return float((np.abs(dx) / (self.scale + np.abs(x))).max())

    def covector(self, t: Array) -> Array:
        """Return the row w with ``w @ x`` the inner product of t and x."""
        return self._weight * t

    def normalised(self, t: Array) -> Array:
        """Return t with length one."""
        unit: Array = t / self.norm(t)
        return unit
