"""Loads over time: polygons, and the straight lines that make up a polygon."""

from __future__ import annotations

from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import named
from pwscont.basics.rounding import SAME_STATE


@final
class LoadHistory:
    """A load that goes in straight lines from one given load to the next.

    Parameters
    ----------
    loads : array_like, shape (k, n)
        The loads at the corners, at least two.
    times : array_like, shape (k,), optional
        When the loads are reached, growing; default 0, 1, ..., k - 1.

    Attributes
    ----------
    loads : ndarray, shape (k, n)
    times : ndarray, shape (k,)

    Raises
    ------
    InvalidInputError
        If there are fewer than two loads, or the times do not grow by more than rounding.

    Examples
    --------
    >>> from pwscont import LoadHistory
    >>> LoadHistory([[0.0, 0.0], [1.0, 2.0], [1.0, -2.0]])(1.5)
    array([1., 0.])
    """

    def __init__(self, loads: Any, times: Any = None) -> None:
        self.loads = finite_array("loads", loads)
        if self.loads.ndim != 2 or len(self.loads) < 2:
            raise InvalidInputError(
                f"loads must be at least two loads of one length, got shape {self.loads.shape}"
            )
        count = len(self.loads)
        given = np.arange(float(count)) if times is None else times
        self.times = finite_array("times", given, (count,))
        if (np.diff(self.times) <= 2.0 * abs(self._slack)).any():
            raise InvalidInputError(f"times must grow beyond rounding, got {self.times}")
        self.loads.flags.writeable = self.times.flags.writeable = False

    @property
    def interval(self) -> tuple[float, float]:
        """The first and the last time."""
        return float(self.times[0]), float(self.times[-1])

    @property
    def _slack(self) -> float:
        """Times closer than this are one time."""
        return SAME_STATE * float(self.times[-1] - self.times[0])

    def leg(self, t: float) -> int:
        """Return the number of the straight line on which the load goes on from a time."""
        place = int(np.searchsorted(self.times, t + self._slack, side="right")) - 1
        return min(max(place, 0), len(self.times) - 2)

    def weights(self, t: float) -> Array:
        """Return how much of each given load acts at a time, shape (k,)."""
        weights, leg = np.zeros(len(self.times)), self.leg(t)
        begin, end = self.times[leg : leg + 2]
        part = (t - begin) / (end - begin)
        weights[leg : leg + 2] = 1.0 - part, part
        return weights

    def line(self, leg: int) -> tuple[Array, Array]:
        """Return the load at t = 0 and the slope of a straight line, each of shape (n,)."""
        slope = (self.loads[leg + 1] - self.loads[leg]) / (self.times[leg + 1] - self.times[leg])
        return self.loads[leg] - self.times[leg] * slope, slope

    @property
    def corners(self) -> Array:
        """The times within the history at which the line changes, shape (k - 2,)."""
        corners: Array = self.times[1:-1]
        return corners

    def refuse_beyond(self, interval: tuple[float, float]) -> None:
        """Refuse an interval that leaves the history.

        Raises
        ------
        InvalidInputError
            If the interval leaves the history.
        """
        lo, hi = self.interval
        if interval[0] < lo or interval[1] > hi:
            raise InvalidInputError(
                f"the interval {interval} leaves the times [{lo:g}, {hi:g}] of the load history"
            )

    def __call__(self, t: float) -> Array:
        """Return the load at a time, shape (n,).

        Raises
        ------
        InvalidInputError
            If the time lies outside the history.
        """
        if not self.times[0] - self._slack <= t <= self.times[-1] + self._slack:
            lo, hi = self.interval
            raise InvalidInputError(f"t = {t} lies outside the history [{lo:g}, {hi:g}]")
        load: Array = self.weights(t) @ self.loads
        return load

    def __repr__(self) -> str:
        lo, hi = self.interval
        count, n = self.loads.shape
        return named(self, f"{count} loads, n = {n}, t from {lo:g} to {hi:g}")
