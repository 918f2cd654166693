"""A family of systems, which depend on a second parameter mu."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidSystemError
from pwscont.system.system import PiecewiseSystem
from pwscont.two_parameters.alpha_range import AlphaRange

#: mu -> a system; all of one size, with the same tests in the same order.
MakeSystem: TypeAlias = Callable[[float], PiecewiseSystem]

#: Number of systems that are remembered: a Newton step needs one mu several times, and both its
#: neighbours for differences.
REMEMBERED = 8


@final
class Family:
    """The systems of a family, each built when it is needed.

    Parameters
    ----------
    make : callable
        mu -> :class:`~pwscont.PiecewiseSystem`.
    sample : float
        A value of mu for which there is a system.
    limits : AlphaRange
        Limits of alpha: beyond finite ones nothing is evaluated.

    Attributes
    ----------
    sample : PiecewiseSystem
        The system from which sizes and names are read off.

    Raises
    ------
    InvalidSystemError
        If ``make`` returns something else than a system.
    """

    def __init__(self, make: MakeSystem, sample: float, limits: AlphaRange) -> None:
        self._make, self._sampled_at, self._limits = make, float(sample), limits
        self.at = lru_cache(REMEMBERED)(self._checked)
        self.sample = self.at(self._sampled_at)

    def __reduce__(self) -> tuple[type[Family], tuple[MakeSystem, float, AlphaRange]]:
        """Pickle the arguments: a copy remembers systems of its own."""
        return Family, (self._make, self._sampled_at, self._limits)

    def _checked(self, mu: float) -> PiecewiseSystem:
        system = self._make(mu)
        if not isinstance(system, PiecewiseSystem):
            raise InvalidSystemError(
                f"the family returned {type(system).__name__} at mu = {mu}, where a "
                "PiecewiseSystem is expected"
            )
        limits = self._limits
        return system.within(limits.lo, limits.hi) if limits.are_finite else system

    def scale(self, mus: tuple[float, float]) -> Array:
        """Return typical magnitudes of z over ranges of mu and alpha, shape (n,)."""
        limits = self._limits
        lo, hi = (limits.lo, limits.hi) if limits.are_finite else (-1.0, 1.0)
        scales = [finite_array("scale()", self.at(mu).scale(lo, hi)) for mu in mus]
        largest: Array = np.maximum(*scales)
        return largest
