"""Intervals of real numbers, thousands at a time, with outward rounding.

An end that is not a number says nothing: every comparison with such an end is false, so that no
rule excludes, contracts or proves anything by the end (NaN is everything).

The bounds on rounding are those of docs/theory, F21: IEEE arithmetic to nearest errs by at most
half a unit in the last place. Elementary functions are assumed to err by at most FUNCTION_ULPS
units.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Signs

#: Twice the unit roundoff: a bound of the relative error of + - * / sqrt with room for a rounding.
ULP = 2.0**-52
#: The smallest positive number: products and quotients may err by half of it near zero.
SMALLEST = 5e-324
#: How many units in the last place an elementary function of numpy may err: an assumption, see
#: docs/theory, F21.
FUNCTION_ULPS = 4.0


def below(x: Array, ulps: float = 1.0) -> Array:
    """Return numbers that are certainly below the true values of rounded numbers."""
    lower: Array = x - (np.abs(x) * (ulps * ULP) + ulps * SMALLEST)
    return lower


def above(x: Array, ulps: float = 1.0) -> Array:
    """Return numbers that are certainly above the true values of rounded numbers."""
    upper: Array = x + (np.abs(x) * (ulps * ULP) + ulps * SMALLEST)
    return upper


@final
class Interval:
    """Arrays of intervals [lo, hi]; operations broadcast.

    Parameters
    ----------
    lo, hi : ndarray of one shape
        The ends, which may be infinite. An end that is not a number says nothing.
    """

    __slots__ = ("hi", "lo")

    def __init__(self, lo: Array, hi: Array) -> None:
        self.lo, self.hi = lo, hi

    @classmethod
    def point(cls, x: Array) -> Interval:
        """Return intervals that hold one number each."""
        return cls(x, x)

    @classmethod
    def rounded(cls, lo: Array, hi: Array, ulps: float = 1.0) -> Interval:
        """Return the intervals between rounded ends, with the error of rounding added."""
        return cls(below(lo, ulps), above(hi, ulps))

    @classmethod
    def ball(cls, radius: Array) -> Interval:
        """Return the intervals [-radius, radius]."""
        return cls(-radius, radius)

    def __getitem__(self, key: Any) -> Interval:
        return Interval(self.lo[key], self.hi[key])

    # -- arithmetic ----------------------------------------------------------------------------

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __add__(self, other: Interval) -> Interval:
        return Interval.rounded(self.lo + other.lo, self.hi + other.hi)

    def __sub__(self, other: Interval) -> Interval:
        return Interval.rounded(self.lo - other.hi, self.hi - other.lo)

    def __mul__(self, other: Interval) -> Interval:
        a, b = self.lo * other.lo, self.lo * other.hi
        c, d = self.hi * other.lo, self.hi * other.hi
        lo = np.minimum(np.minimum(a, b), np.minimum(c, d))
        hi = np.maximum(np.maximum(a, b), np.maximum(c, d))
        return Interval.rounded(lo, hi)

    def __truediv__(self, other: Interval) -> Interval:
        """Divide; where the divisor may be zero, the quotient says nothing."""
        a, b = self.lo / other.lo, self.lo / other.hi
        c, d = self.hi / other.lo, self.hi / other.hi
        lo = np.minimum(np.minimum(a, b), np.minimum(c, d))
        hi = np.maximum(np.maximum(a, b), np.maximum(c, d))
        divides = (other.lo > 0.0) | (other.hi < 0.0)
        return Interval.rounded(np.where(divides, lo, np.nan), np.where(divides, hi, np.nan))

    def square(self) -> Interval:
        """Return the squares."""
        return self.magnitude().power_of_magnitude(2)

    def power(self, k: int) -> Interval:
        """Return the k-th powers, k a whole number."""
        if k < 0:
            one = np.ones_like(self.lo)
            return Interval.point(one) / self.power(-k)
        if k % 2 == 0:
            return self.magnitude().power_of_magnitude(k)
        lower = Interval.point(self.lo).repeated(k)
        return Interval(lower.lo, Interval.point(self.hi).repeated(k).hi)

    def repeated(self, k: int) -> Interval:
        """Return the product of k factors, each this interval; k at least zero."""
        if k <= 1:
            return self if k else Interval.point(np.ones_like(self.lo))
        half = self.repeated(k // 2)
        whole = half * half
        return whole * self if k % 2 else whole

    def power_of_magnitude(self, k: int) -> Interval:
        """Return the k-th powers of intervals without negative numbers."""
        found = self.repeated(k)
        return Interval(np.maximum(found.lo, 0.0), found.hi)

    def sqrt(self) -> Interval:
        """Return the roots; where the argument may be negative, the root says nothing."""
        root = Interval.rounded(np.sqrt(self.lo), np.sqrt(self.hi))
        return Interval(np.maximum(root.lo, 0.0), root.hi).where(self.lo >= 0.0)

    # -- order ---------------------------------------------------------------------------------

    def magnitude(self) -> Interval:
        """Return the absolute values."""
        lo = np.maximum(np.maximum(self.lo, -self.hi), 0.0)
        return Interval(lo, np.maximum(-self.lo, self.hi))

    def maximum(self, other: Interval) -> Interval:
        """Return the larger of two numbers."""
        return Interval(np.maximum(self.lo, other.lo), np.maximum(self.hi, other.hi))

    def minimum(self, other: Interval) -> Interval:
        """Return the smaller of two numbers."""
        return Interval(np.minimum(self.lo, other.lo), np.minimum(self.hi, other.hi))

    def hull(self, other: Interval) -> Interval:
        """Return the smallest intervals that hold both intervals."""
        return Interval(np.minimum(self.lo, other.lo), np.maximum(self.hi, other.hi))

    def meet(self, other: Interval) -> Interval:
        """Return what both intervals hold; empty where lo > hi. An end without a number is left."""
        return Interval(np.fmax(self.lo, other.lo), np.fmin(self.hi, other.hi))

    def where(self, keeps: Signs) -> Interval:
        """Return intervals that say nothing where a condition does not hold."""
        return Interval(np.where(keeps, self.lo, np.nan), np.where(keeps, self.hi, np.nan))

    def excludes_zero(self) -> Signs:
        """Tell which intervals certainly do not hold zero."""
        excluded: Signs = (self.lo > 0.0) | (self.hi < 0.0)
        return excluded

    def is_within(self, other: Interval) -> Signs:
        """Tell which intervals lie strictly inside other ones."""
        inside: Signs = (self.lo > other.lo) & (self.hi < other.hi)
        return inside

    def reach(self) -> Array:
        """Return the largest magnitude in each interval; not a number where nothing is known."""
        reach: Array = np.maximum(-self.lo, self.hi)
        return reach

    def middle(self) -> Array:
        """Return a number in each interval, near the middle."""
        middle: Array = 0.5 * self.lo + 0.5 * self.hi
        return middle

    def width(self) -> Array:
        """Return about how wide each interval is."""
        width: Array = self.hi - self.lo
        return width


def chosen(condition: Signs, one: Interval, other: Interval) -> Interval:
    """Return the intervals of ``one`` where a condition holds, those of ``other`` elsewhere."""
    return Interval(np.where(condition, one.lo, other.lo), np.where(condition, one.hi, other.hi))
