"""What the path says of typical magnitudes, and the signal that they were wrong.

An unknown is typically as far from where the path begins as it is on the mean over alpha. The mean
over the points would follow a branch that leaves for infinity, where there are many points and
alpha hardly changes.

Failure modes and answers
-------------------------
- Magnitudes far too small: thousands of steps lead nowhere. The path is looked at after some steps;
  where alpha has hardly moved by then, and an unknown very far, its magnitude grows by a factor.
- Magnitudes far too large: a fold is as sharp as a kink, and may be passed over. That is known at
  the end only.
- An unknown that does not move, or by no more than rounding, has no magnitude: it is left out.
"""

from __future__ import annotations

import math
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import EPS
from pwscont.curve.metric import SHORTEST, Metric

#: A magnitude that is wrong by more than this factor, too small or too large.
TOO_SMALL, TOO_LARGE = 16.0, 64.0
#: The path is looked at after so many steps, then each time that their number has doubled.
FIRST_LOOK = 256
#: Before, an unknown that is so many magnitudes away is larger, but not by more than a factor.
FAR, FARTHER = 12.0, 4.0
#: How much of the interval a path must have seen before means over alpha say something.
MUCH = 0.25
#: Unknowns that change by less than this part of their size do not move.
STILL = EPS**0.5


class MisjudgedError(Exception):
    """Typical magnitudes, shape (n,), of a path whose own were wrong."""

    def __init__(self, magnitudes: Array) -> None:
        super().__init__()
        self.magnitudes = magnitudes


@final
class Gauge:
    """Adds up how far a path moves.

    Parameters
    ----------
    metric : Metric
        With the magnitudes that are judged.
    """

    def __init__(self, metric: Metric) -> None:
        self._scale, self._width = metric.scale[:-1], metric.width
        self._steps, self._look, self._alpha = 0, FIRST_LOOK, 0.0
        self._away, self._farthest, self._size = np.zeros((3, len(self._scale)))
        self._first: Array | None = None

    def see(self, x: Array, y: Array) -> None:
        """Add a step from x to y, each of shape (n + 1,).

        Raises
        ------
        MisjudgedError
        """
        first = self._first = x if self._first is None else self._first
        change = float(abs(y[-1] - x[-1]))
        away = np.abs(0.5 * (x + y) - first)[:-1]
        self._alpha += change
        self._away += change * away
        self._size = np.maximum(self._size, np.abs(y[:-1]))
        self._farthest = np.maximum(self._farthest, away)
        self._steps += 1
        if self._steps >= self._look:
            self._look *= 2
            self._judge(TOO_SMALL, math.inf)

    def close(self) -> None:
        """Judge the whole path.

        Raises
        ------
        MisjudgedError
        """
        if self._steps:
            self._judge(TOO_SMALL, TOO_LARGE)

    def _judge(self, small: float, large: float) -> None:
        if self._alpha >= MUCH * self._width:
            typical = 2.0 * self._away / self._alpha
            wrong = (typical > small * self._scale) | (large * typical < self._scale)
        else:
            ahead = self._width * self._farthest / max(self._alpha, SHORTEST)
            typical = np.minimum(ahead, FARTHER * self._farthest)
            wrong = self._farthest > FAR * self._scale
        wrong &= typical > STILL * self._size
        if wrong.any():
            raise MisjudgedError(np.where(wrong, typical, self._scale))
