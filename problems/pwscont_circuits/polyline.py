"""Continuous functions of straight segments: the characteristics of elements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import finite_array


@final
class Polyline:
    """A continuous function of straight segments.

    Parameters
    ----------
    knots : sequence of float, shape (k,)
        Places at which the slope changes, ascending.
    slopes : sequence of float, shape (k + 1,)
        Slopes of the segments from left to right, any sign.
    value : float
        The function at the first knot.

    Raises
    ------
    InvalidInputError
        If the knots do not ascend, or k knots do not come with k + 1 slopes.

    Examples
    --------
    >>> from pwscont_circuits import Polyline
    >>> line = Polyline([1.0, 2.0], [1.0, -0.5, 1.0])  # slopes before, between and after the knots
    >>> line.knots.tolist()
    [1.0, 2.0]
    """

    def __init__(self, knots: Sequence[float], slopes: Sequence[float], value: float = 0.0) -> None:
        if len(knots) < 1 or len(slopes) != len(knots) + 1:
            raise InvalidInputError(
                f"k knots need k + 1 slopes, k at least one; got {len(knots)} and {len(slopes)}"
            )
        self.knots = finite_array("knots", knots)
        self.slopes = finite_array("slopes", slopes)
        self.value = float(finite_array("value", value, ()))
        if (np.diff(self.knots) <= 0.0).any():
            raise InvalidInputError(f"knots must ascend, got {list(knots)}")

    def __call__(self, x: Any) -> Any:
        """Return the values at places of any shape."""
        ramps = np.maximum(0.0, np.subtract.outer(x, self.knots)) @ np.diff(self.slopes)
        return self.value + self.slopes[0] * (np.asarray(x) - self.knots[0]) + ramps

    def supports(self) -> Iterator[tuple[int, float, float]]:
        """Yield lines a + b x that the whole function does not cross, as (side, a, b).

        A side of 1 says that the function is nowhere below the line, a side of -1 nowhere above.
        """
        first, last = self.slopes[0], self.slopes[-1]
        for slope in {first, last}:
            rests = self(self.knots) - slope * self.knots
            if first <= slope <= last:
                yield 1, float(rests.min()), float(slope)
            if last <= slope <= first:
                yield -1, float(rests.max()), float(slope)
