"""The window of the plane of alpha and mu, as a square: units of both parameters do not matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError


@final
@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A rectangle of the plane, whose points are centre + half * s with s in the square [-1, 1]^2.

    Attributes
    ----------
    centre, half : ndarray, shape (2,)
        The middle (alpha, mu) and half of both widths.
    """

    centre: Array
    half: Array

    @classmethod
    def of(cls, alphas: tuple[float, float], mus: tuple[float, float]) -> Window:
        """Return the window between two values of alpha and of mu.

        Raises
        ------
        InvalidInputError
            If one of the ranges is no pair of finite numbers lo < hi.
        """
        ends = np.array([finite_array(n, r, (2,)) for n, r in (("alphas", alphas), ("mus", mus))])
        for name, (lo, hi) in zip(("alphas", "mus"), ends.tolist(), strict=True):
            if not lo < hi:
                raise InvalidInputError(f"{name} need lo < hi, got ({lo}, {hi})")
        return cls(0.5 * ends.sum(axis=1), 0.5 * np.diff(ends)[:, 0])

    @property
    def alphas(self) -> tuple[float, float]:
        """The range of alpha."""
        return float(self.centre[0] - self.half[0]), float(self.centre[0] + self.half[0])

    @property
    def mus(self) -> tuple[float, float]:
        """The range of mu."""
        return float(self.centre[1] - self.half[1]), float(self.centre[1] + self.half[1])

    def inside(self, squared: Array) -> Array:
        """Return points (alpha, mu) from points of the square, shape (..., 2)."""
        points: Array = self.centre + self.half * squared
        return points

    def squared(self, points: Array) -> Array:
        """Return points of the square from points (alpha, mu), shape (..., 2)."""
        square: Array = (points - self.centre) / self.half
        return square
