"""A user's event: a named function, and the test whether the function is zero.

Where an event was found, the next piece begins with g = 0, with a sign that is rounding: what the
accuracy of the point explains is zero. The rounding of g is measured where nothing but rounding
changes the arguments of g. If g is zero, to rounding, at every place tried, as sin^2 + cos^2 - 1
is, g is no event, and is refused at the start.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, generic
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function, evaluated
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.metric import Metric
from pwscont.transitions.rays import Ray

#: Number of places at which a function is tried that may be zero all around.
PLACES_TRIED = 18
#: Distance of the farthest place, in the metric: longer than most intervals.
FARTHEST_TRIED = 4.0
#: Number of shaken points that tell how much of a function is rounding.
SHAKEN = 16
#: A change over this distance is rounding; a function this many times the change is not.
ROUNDING_DISTANCE, CLEARLY = 1e-9, 1e3
TINIEST = float(np.finfo(float).tiny)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """An event at which the branch ends: ``events={"collapse": Stop(g)}``.

    Attributes
    ----------
    function : callable
        (z, alpha) -> float; the branch ends where the function is zero.

    Examples
    --------
    >>> from pwscont import Stop, Switched, trace
    >>> line = Switched(1, lambda z, t, sw: z - t)
    >>> ended = trace(line, ([0.0], 0.0), (0.0, 2.0), events={"top": Stop(lambda z, t: z[0] - 1.5)})
    >>> [(p.name, round(p.alpha, 6)) for p in ended.special_points("event")]
    [('top', 1.5)]
    """

    function: Function


@final
@dataclass(frozen=True, slots=True, eq=False)
class UserEvent:
    """A named function whose zeros are special points of kind "event".

    The function is given the first ``shown`` unknowns, default all.
    """

    name: str
    function: Function
    stops: bool
    shown: int | None = None

    def value(self, x: Array) -> float:
        """Return g(z, alpha); refuse a function that fails, or returns no finite number."""

        def number(z: Array, alpha: float) -> Any:
            given = self.function(z, alpha)
            return given.item() if isinstance(given, np.ndarray) and given.size == 1 else given

        return evaluated(f"the event {self.name!r}", number, x[:-1][: self.shown], float(x[-1]))

    def meets(self, metric: Metric, x: Array, error: Array, beyond: Sequence[Array]) -> bool:
        """Tell whether g is zero at a special point, to its accuracy, and not on all its pieces.

        ``beyond`` are points of these pieces.
        """
        ways = (metric.difference(y, x) for y in beyond)
        if not beyond:
            return not self.cleared(metric, x, error)
        is_near = any(self.is_near(metric, x, error, way) for way in ways)
        return is_near and any(self.cleared(metric, y, error) for y in beyond)

    def is_near(self, metric: Metric, x: Array, error: Array, way: Array) -> bool:
        """Tell whether g is zero where a way begins, to the accuracy of that point.

        An event on the way that is next to the point counts as at the point.
        """
        value, length, nearly = self.value(x), metric.norm(way), 0.0
        if length:
            step = min(math.sqrt(EPS) * metric.slack(x, 1.0), length)
            steep = abs(self.value(x + step / length * way) - value) / step
            nearly = steep * (metric.slack(x, CONVERGED) + 2.0 * CONVERGED * length)
        return abs(value) <= nearly or abs(value) <= self.noise(metric, x, error)

    def cleared(self, metric: Metric, x: Array, error: Array) -> float:
        """Return g, or zero where rounding or the error of ``x`` explains g."""
        value = self.value(x)
        return value if value and abs(value) > self.noise(metric, x, error) else 0.0

    def ahead(self, sign: float, x: Array) -> float:
        """Return what is positive as long as g keeps a sign, and then negative.

        Without a sign g is zero, and keeps to that.
        """
        value = self.value(x)
        return sign * value or -TINIEST if sign else 1.0 if value == 0.0 else -1.0

    def noise(self, metric: Metric, x: Array, error: Array) -> float:
        """Return a bound on the computed g at a point where g is zero.

        The bound is the change of g where nothing but rounding changes the point.
        """
        size = error + GUARD * EPS * (metric.scale + np.abs(x))
        return CONFIDENCE * self._shaken(metric, x, size)

    def _shaken(self, metric: Metric, x: Array, size: Array) -> float:
        """Return how much g changes beside a point at most, where g is defined."""
        beside = x + size * np.array([generic(len(x), shift) for shift in range(SHAKEN)])
        beside[:, -1] = np.clip(beside[:, -1], *metric.interval)
        value, largest = self.value(x), 0.0
        for y in beside:
            with suppress(InvalidInputError):
                largest = max(largest, abs(self.value(y) - value))
        return largest

    def is_zero_around(self, ray: Ray) -> bool:
        """Tell whether g is nothing but rounding at a ray's beginning and wherever g is tried."""
        metric, x = ray.curve.metric, ray.state.x
        here, rounding = abs(self.value(x)), ROUNDING_DISTANCE * metric.scale
        if 0.0 < CLEARLY * self._shaken(metric, x, rounding) < here:
            return False  # nearly always
        (lo, hi), places = metric.interval, list[Array]()  # along and off the branch
        distances = np.linspace(-FARTHEST_TRIED, FARTHEST_TRIED, PLACES_TRIED).tolist()
        for i, alpha in enumerate(np.linspace(lo, hi, PLACES_TRIED)):
            aside = x + distances[i] * metric.scale * generic(len(x), i)
            along = x + distances[i] * ray.state.tangent
            places += [np.append(aside[:-1], alpha), *[along] * bool(lo <= along[-1] <= hi)]
        try:
            largest = max(here, *(abs(self.value(y)) for y in places))
            return largest <= CONFIDENCE * max(self._shaken(metric, y, rounding) for y in places)
        except InvalidInputError:  # at a place that may be far from all solutions
            return False
