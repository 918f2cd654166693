"""A system that depends on a second parameter mu."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeAlias, final

import numpy as np

from pwscont.foundation.arrays import Array, finite_array
from pwscont.foundation.errors import InvalidSystemError
from pwscont.model.alpha_range import AlphaRange
from pwscont.model.differences import STEP
from pwscont.model.system import PiecewiseSystem

#: mu -> a system; all of one size, with the same tests in the same order.
MakeSystem: TypeAlias = Callable[[float], PiecewiseSystem]

#: Systems that are remembered: a Newton step asks for one mu several times, and for both
#: neighbours of it.
REMEMBERED = 8


@final
class Family:
    """The systems of a family, built when they are asked for.

    Parameters
    ----------
    make : callable
        mu -> :class:`~pwscont.PiecewiseSystem`.
    sample : float
        A value of mu for which there is a system.

    Attributes
    ----------
    sample : PiecewiseSystem
        The one from which sizes and names are read off.

    Raises
    ------
    InvalidSystemError
        If ``make`` returns something else than a system.
    """

    def __init__(self, make: MakeSystem, sample: float) -> None:
        self._make, self._sampled_at = make, float(sample)
        self.at = lru_cache(REMEMBERED)(self._checked)
        self.sample = self.at(self._sampled_at)

    def __reduce__(self) -> tuple[type[Family], tuple[MakeSystem, float]]:
        """Let copies remember systems of their own."""
        return Family, (self._make, self._sampled_at)

    def _checked(self, mu: float) -> PiecewiseSystem:
        system = self._make(mu)
        if not isinstance(system, PiecewiseSystem):
            raise InvalidSystemError(
                f"the family returned {type(system).__name__} at mu = {mu}, where a "
                "PiecewiseSystem is expected"
            )
        return system

    def by_mu(self, function: Callable[[PiecewiseSystem], Any], mu: float) -> Any:
        """Return the derivative by mu of what ``function`` computes, by central differences."""
        h = STEP * max(1.0, abs(mu))
        above, below = mu + h, mu - h
        return (function(self.at(above)) - function(self.at(below))) / (above - below)

    def scale(self, mus: tuple[float, float], limits: AlphaRange) -> Array:
        """Return typical magnitudes of z over ranges of mu and alpha, shape (n,)."""
        lo, hi = (limits.lo, limits.hi) if limits.are_finite else (-1.0, 1.0)
        scales = [finite_array("scale()", self.at(mu).scale(lo, hi)) for mu in mus]
        largest: Array = np.maximum(*scales)
        return largest
