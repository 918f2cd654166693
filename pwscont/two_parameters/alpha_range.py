"""A range that alpha must not leave, as test functions of a locus."""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError

#: No limits.
ALL = (-np.inf, np.inf)


@final
class AlphaRange:
    """The tests alpha - lo and hi - alpha, each only where its limit is finite.

    Parameters
    ----------
    alphas : tuple of float
        (lo, hi), either of which may be infinite.

    Raises
    ------
    InvalidInputError
        If the range is empty or no pair of numbers.
    """

    def __init__(self, alphas: tuple[float, float]) -> None:
        try:
            self.lo, self.hi = (float(end) for end in alphas)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"alphas must be two numbers, got {alphas!r}") from error
        if not self.lo < self.hi:
            raise InvalidInputError(f"alphas need lo < hi, got ({self.lo}, {self.hi})")
        self._finite = np.isfinite([self.lo, self.hi])

    def __len__(self) -> int:
        return int(np.count_nonzero(self._finite))

    @property
    def are_finite(self) -> bool:
        """Whether alpha is limited on both sides."""
        return bool(self._finite.all())

    @property
    def width(self) -> float:
        """The length of the range, one where it is infinite."""
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
