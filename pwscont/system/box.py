"""The box of the unknowns of a system: bounds of all unknowns, and periods of periodic unknowns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arrays import Array, is_anywhere, is_everywhere
from pwscont.system.values import broken

if TYPE_CHECKING:
    from pwscont.system.system import PiecewiseSystem

#: Widest range, in deviations, that counts as narrow: a normal distribution would leave the range
#: too often.
MOST_DEVIATIONS = 8.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """The bounds and periods of the n unknowns, shape (n,), infinite where there are none.

    Examples
    --------
    >>> from pwscont import LCP
    >>> from pwscont.extending import Box
    >>> Box.of(LCP([[1.0]], q=[0.0], d=[1.0])).is_bounded
    False
    """

    lower: Array
    upper: Array
    period: Array
    is_bounded: bool = field(init=False)
    is_periodic: bool = field(init=False)

    def __post_init__(self) -> None:
        """See whether there are bounds and periods, which a run asks again and again."""
        bounded = any(is_anywhere(np.isfinite(ends)) for ends in (self.lower, self.upper))
        object.__setattr__(self, "is_bounded", bounded)
        object.__setattr__(self, "is_periodic", is_anywhere(np.isfinite(self.period)))

    @classmethod
    def of(cls, system: PiecewiseSystem) -> Box:
        """Return the box of a system, or refuse bounds and periods that do not fit."""
        bounds = system.bounds()
        if not isinstance(bounds, tuple | list) or len(bounds) != 2:
            raise broken(system, "bounds()", f"must return (lower, upper), got {bounds!r}")
        lower, upper = (_broadcast(system, "bounds()", end) for end in bounds)
        period = _broadcast(system, "periods()", system.periods())
        period[period == 0.0] = np.inf
        if not is_everywhere(lower < upper):
            i = int(np.flatnonzero(~(lower < upper))[0])
            words = f"needs lower < upper, but for {system.names()[i]} they are"
            raise broken(system, "bounds()", f"{words} {lower[i]} and {upper[i]}")
        if not is_everywhere(period > 0.0):
            words = "must return positive numbers, infinite where an unknown is not periodic"
            raise broken(system, "periods()", f"{words}, got {period[~(period > 0.0)][0]}")
        return cls(lower, upper, period)

    def contains(self, z: Array, error: Array) -> bool:
        """Tell whether z, shape (n,), is inside, or outside by at most ``error``, shape (n,)."""
        return bool(((z >= self.lower - error) & (z <= self.upper + error)).all())

    def centre(self, scale: Array) -> Array:
        """Return the point nearest to zero that is a typical magnitude inside the bounds."""
        # the middle, for an interval shorter than two magnitudes
        depth = np.minimum(scale, 0.5 * (self.upper - self.lower))
        return np.clip(np.zeros(len(depth)), self.lower + depth, self.upper - depth)

    def guess(
        self, normal: Array, even: Array, deviation: Array, near: Array | None = None
    ) -> Array:
        """Return a random point inside, of normal numbers and of even numbers in (-1/2, 1/2).

        Around the centre, an unknown with a narrow range is distributed evenly over the range.
        """
        if near is not None:
            return self.inside(near + deviation * normal)
        width = np.minimum(self.upper - self.lower, self.period)
        narrow = width <= MOST_DEVIATIONS * deviation
        away = np.where(narrow, np.where(narrow, width, 0.0) * even, deviation * normal)
        return self.inside(self.centre(deviation) + away)

    def inside(self, z: Array) -> Array:
        """Return z mirrored at the bounds that z exceeds, then clipped to the bounds."""
        z = np.where(z < self.lower, 2.0 * self.lower - z, z)
        z = np.where(z > self.upper, 2.0 * self.upper - z, z)
        return np.clip(z, self.lower, self.upper)

    def wrapped(self, z: Array) -> Array:
        """Return z moved by whole periods to within half a period from the centre."""
        turning = np.isfinite(self.period)
        period, moved = self.period[turning], z.copy()
        apart = z[turning] - self.centre(np.zeros_like(z))[turning]
        moved[turning] -= period * np.round(apart / period)
        return moved


def _broadcast(system: PiecewiseSystem, method: str, values: Any) -> Array:
    """Return values, which may be infinite, as numbers of shape (n,)."""
    shape = (system.size,)
    try:
        array = np.full(shape, np.asarray(values, dtype=float))
    except (TypeError, ValueError) as error:
        words = f"must return numbers that can be broadcast to shape {shape}, got {values!r}"
        raise broken(system, method, words) from error
    if is_anywhere(np.isnan(array)):
        raise broken(system, method, f"must return numbers, got {values!r}")
    return array
