"""Families of systems that depend on a second parameter mu."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TypeAlias, final

import numpy as np

from pwscont import InvalidInputError, InvalidSystemError, PiecewiseSystem
from pwscont.extending import Array, finite_array

#: The range of alpha without limits.
ALL = (-np.inf, np.inf)


@final
class AlphaRange:
    """The tests alpha - lo and hi - alpha; an infinite limit has no test.

    Parameters
    ----------
    alphas : tuple of float
        (lo, hi); a limit may be infinite.
    """

    def __init__(self, alphas: tuple[float, float]) -> None:
        try:
            self.lo, self.hi = (float(end) for end in alphas)
        except (TypeError, ValueError, OverflowError) as error:
            raise InvalidInputError(f"alphas must be two numbers, got {alphas!r}") from error
        if not self.lo < self.hi:
            raise InvalidInputError(f"alphas need lo < hi, got ({self.lo}, {self.hi})")
        self._finite = np.isfinite([self.lo, self.hi])

    def __len__(self) -> int:
        return int(np.count_nonzero(self._finite))

    @property
    def are_finite(self) -> bool:
        """Whether alpha is limited below and above."""
        return bool(self._finite.all())

    @property
    def width(self) -> float:
        """The length of the range, 1 if infinite."""
        return self.hi - self.lo if self.are_finite else 1.0

    def tests(self, alpha: float) -> Array:
        """Return the tests, positive within the range."""
        return np.array([alpha - self.lo, self.hi - alpha])[self._finite]

    def gradients(self, size: int) -> Array:
        """Return the gradients by ``size`` unknowns and mu; alpha is the last unknown."""
        rows = np.zeros((len(self), size + 1))
        rows[:, -2] = np.array([1.0, -1.0])[self._finite]
        return rows

    def __str__(self) -> str:
        return f"the first parameter leaves [{self.lo:g}, {self.hi:g}]"


#: mu -> a system; all systems have equal sizes and the same tests in the same order.
MakeSystem: TypeAlias = Callable[[float], PiecewiseSystem]

#: Least and most systems that are remembered: a Newton step needs the system at a value of mu
#: several times, and systems at two neighbouring values for differences; solutions on one step of a
#: locus need most of these systems again. Between both numbers, dH/dz has this many entries in all.
REMEMBERED, REMEMBERED_ENTRIES = (8, 128), 10**6


@final
class Family:
    """The systems of a family, each built when needed.

    Parameters
    ----------
    make : callable
        mu -> :class:`~pwscont.PiecewiseSystem`.
    sample : float
        A value of mu for which there is a system.
    limits : AlphaRange
        Limits of alpha; no system is evaluated beyond finite limits.
    magnitudes : ndarray, shape (n,), optional
        Typical magnitudes of z for systems that give none; not used without limits.

    Attributes
    ----------
    sample : PiecewiseSystem
        The system that gives sizes and names.
    """

    def __init__(
        self,
        make: MakeSystem,
        sample: float,
        limits: AlphaRange,
        magnitudes: Array | None = None,
    ) -> None:
        self._make, self._sampled_at, self._limits = make, float(sample), limits
        self._magnitudes = magnitudes
        self._sizes: tuple[int, int] | None = None
        self.sample = self._checked(self._sampled_at)
        (least, most), many = REMEMBERED, REMEMBERED_ENTRIES // max(self.sample.size, 1) ** 2
        self.at = lru_cache(min(max(least, many), most))(self._checked)

    def __reduce__(self) -> tuple[type[Family], tuple[MakeSystem, float, AlphaRange, Array | None]]:
        """Return the arguments for a pickle; a copy builds the systems anew."""
        return Family, (self._make, self._sampled_at, self._limits, self._magnitudes)

    def with_magnitudes(self, magnitudes: Array) -> Family:
        """Return the same family with other typical magnitudes of z, shape (n,)."""
        return Family(self._make, self._sampled_at, self._limits, magnitudes)

    def _checked(self, mu: float) -> PiecewiseSystem:
        system = self._make(mu)
        if not isinstance(system, PiecewiseSystem):
            raise InvalidSystemError(
                f"the family returned {type(system).__name__} at mu = {mu}, where a "
                "PiecewiseSystem is expected"
            )
        limits = self._limits
        self._check_sizes(mu, system)
        if not limits.are_finite:
            return system
        return system.within(limits.lo, limits.hi, self._magnitudes)

    def _check_sizes(self, mu: float, system: PiecewiseSystem) -> None:
        """Refuse a system with other numbers of unknowns or tests than the first system."""
        alpha = self._limits.lo if self._limits.are_finite else 0.0
        sizes = system.size, len(system.test_functions(np.zeros(system.size), alpha))
        self._sizes = self._sizes or sizes
        if sizes != self._sizes:
            raise InvalidInputError(
                f"the system at mu = {mu:.10g} has {sizes[0]} unknowns and {sizes[1]} tests, the "
                f"system at mu = {self._sampled_at:.10g} {self._sizes[0]} and {self._sizes[1]}; "
                "switches that agree at one mu are one switch there: leave that mu out, or move "
                "the end"
            )

    def scale(self, mus: tuple[float, float]) -> Array:
        """Return typical magnitudes of z, shape (n,), over ``mus`` and the limits of alpha."""
        limits = self._limits
        lo, hi = (limits.lo, limits.hi) if limits.are_finite else (-1.0, 1.0)
        scales = [finite_array("scale()", self.at(mu).scale(lo, hi)) for mu in mus]
        largest: Array = np.maximum(*scales)
        return largest
