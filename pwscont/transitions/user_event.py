"""An event: a function that a user gives by name, and when it is zero.

Failure modes and answers
-------------------------
- Where an event was found, the next piece begins with g = 0, with a sign that is rounding: what the
  accuracy of the point explains is zero.
- g is zero but for rounding on a stretch or everywhere, as sin^2 + cos^2 - 1 is, or a residual on
  all branches: how much of g is rounding is seen where nothing but rounding changes its arguments.
- g is zero, to rounding, wherever it is tried: it is no event, and is refused at the start.
- g cannot be computed, is not a number, or is a truth value, which has no zero to be found: the
  user hears of it by its name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, generic
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function, evaluated
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.transitions.rays import Ray

#: In so many places along and off a branch a function is tried that is zero where it begins.
PLACES = 18
#: How far from there, in the metric: farther than across most intervals.
FAR = 4.0
#: So many points are as good as one, and tell what of a function is rounding.
SHAKEN = 16
#: A function that is zero within this distance may be zero but for rounding, in the metric.
REACH = 1e-2
#: Over this distance a function hardly changes; where it does, the change is rounding.
APART = 1e-9
TINY = float(np.finfo(float).tiny)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """An event at which the branch ends: ``events={"collapse": Stop(g)}``.

    Attributes
    ----------
    function : callable
        (z, alpha) -> float; the branch ends where it is zero.

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

    It is given the first ``shown`` unknowns, default all.
    """

    name: str
    function: Function
    stops: bool
    shown: int | None = None

    def value(self, x: Array) -> float:
        """Return g(z, alpha).

        Raises
        ------
        InvalidInputError
            If it fails, or is not a finite number.
        """
        return evaluated(
            f"the event {self.name!r}", self._number, x[:-1][: self.shown], float(x[-1])
        )

    def _number(self, z: Array, alpha: float) -> Any:
        """Return what the function returns; the entry of an array that has one."""
        given = self.function(z, alpha)
        return given.item() if isinstance(given, np.ndarray) and given.size == 1 else given

    def read(self, curve: Curve, state: State) -> tuple[float, float, bool]:
        """Return g, its derivative along the tangent, and whether g is zero from here on.

        Each is zero where rounding, or the place of the state, explains it.
        """
        metric, x = curve.metric, state.x
        value, slope, steep = self._differences(metric, x, state.tangent)
        if not (value or slope):
            return 0.0, 0.0, self._is_zero_beyond(metric, x, state.tangent)
        if slope and abs(value) > REACH * steep:
            return value, slope, False
        noise = self.noise(metric, x, state.size)
        is_zero = abs(value) <= max(steep * metric.slack(x, CONVERGED), noise)
        is_level = abs(slope * _step(metric, x, state.tangent)) <= noise
        return (0.0 if is_zero else value), (0.0 if is_level else slope), False

    def crosses(self, curve: Curve, state: State) -> bool:
        """Tell whether g is zero at a state, and not around it."""
        value, slope, _ = self.read(curve, state)
        return value == 0.0 != slope

    def meets(self, metric: Metric, x: Array, error: Array, beyond: Sequence[Array]) -> bool:
        """Tell whether g is zero at a special point, to its accuracy, and not on all its pieces.

        ``beyond`` are points of these pieces.
        """
        ways = (metric.difference(y, x) for y in beyond)
        if not any(self.is_near(metric, x, error, way) for way in ways) and (
            beyond or self.cleared(metric, x, error)
        ):
            return False
        return not beyond or any(self.cleared(metric, y, error) for y in beyond)

    def is_near(self, metric: Metric, x: Array, error: Array, way: Array) -> bool:
        """Tell whether g is zero where a way begins, to the accuracy of that point."""
        value = abs(self.value(x))
        return value <= self._nearly(metric, x, way) or value <= self.noise(metric, x, error)

    def _nearly(self, metric: Metric, x: Array, way: Array) -> float:
        """Return how large g is where an event on the way is taken to be at its beginning."""
        length = metric.norm(way)
        if not length:
            return 0.0
        step = min(abs(_step(metric, x, way)), length)
        steep = abs(self.value(x + step / length * way) - self.value(x)) / step
        return steep * (metric.slack(x, CONVERGED) + 2.0 * CONVERGED * length)

    def cleared(self, metric: Metric, x: Array, error: Array) -> float:
        """Return g, zero where rounding, or the error of ``x``, explains it."""
        value = self.value(x)
        return value if value and abs(value) > self.noise(metric, x, error) else 0.0

    def ahead(self, sign: float, x: Array) -> float:
        """Return what is positive as long as g keeps a sign, and then negative.

        Without a sign g is zero, and keeps to that.
        """
        value = self.value(x)
        return sign * value or -TINY if sign else 1.0 if value == 0.0 else -1.0

    def noise(self, metric: Metric, x: Array, error: Array) -> float:
        """Return how far from zero g may be computed where it is zero.

        It is seen by how much g changes where nothing but rounding changes the point.
        """
        size = error + GUARD * EPS * (metric.scale + np.abs(x))
        return CONFIDENCE * self._shaken(metric, x, size)

    def _shaken(self, metric: Metric, x: Array, size: Array) -> float:
        """Return how much g changes beside a point at most."""
        beside = x + size * np.array([generic(len(x), shift) for shift in range(SHAKEN)])
        beside[:, -1] = np.clip(beside[:, -1], *metric.interval)
        value = self.value(x)
        return max([self._change(value, y) for y in beside])

    def _change(self, value: float, x: Array) -> float:
        """Return how far g is from a value; 0 where it is not defined, as beyond a square root."""
        try:
            return abs(self.value(x) - value)
        except InvalidInputError:
            return 0.0

    def is_zero(self, ray: Ray) -> bool:
        """Tell whether g is zero where a ray begins, to the accuracy of that point."""
        metric, state = ray.curve.metric, ray.state
        off = max(metric.norm(sample) for sample in state.error)
        slack = max(metric.slack(state.x, CONVERGED), CONFIDENCE * off)
        value, _, steep = self._differences(metric, state.x, state.tangent)
        if abs(value) <= steep * slack:
            return True
        return abs(value) <= self.noise(metric, state.x, state.size)

    def _is_zero_beyond(self, metric: Metric, x: Array, tangent: Array) -> bool:
        """Tell whether g, zero at ``x``, is zero all around a point a little further on."""
        ahead = x + _step(metric, x, tangent) * tangent
        return self.noise(metric, ahead, np.zeros_like(x)) == 0.0

    def _differences(self, metric: Metric, x: Array, tangent: Array) -> tuple[float, float, float]:
        """Return g, its derivative by a difference within the interval, and its steepness."""
        (lo, hi), step = metric.interval, _step(metric, x, tangent)
        value, ahead = self.value(x), self.value(x + step * tangent)
        slope = (ahead - value) / step
        behind = x - step * tangent
        if ahead == 0.0 != value and lo <= behind[-1] <= hi:  # perhaps it is zero from here on
            return value, slope, max(abs(slope), abs((value - self.value(behind)) / step))
        return value, slope, abs(slope)

    def is_zero_around(self, ray: Ray) -> bool:
        """Tell whether g is nothing but rounding where a ray begins, and wherever it is tried."""
        metric, x = ray.curve.metric, ray.state.x
        value, slope, steep = self._differences(metric, x, ray.state.tangent)
        if slope and abs(value) > REACH * steep:
            return False
        try:
            tried = np.array([self._tried(metric, y) for y in _around(ray)])
        except InvalidInputError:  # at a place that may be far from all solutions
            return False
        return bool(tried[:, 0].max() <= CONFIDENCE * tried[:, 1].max())

    def _tried(self, metric: Metric, x: Array) -> tuple[float, float]:
        """Return the size of g at a place, and how much is noise, for it changes at once."""
        return abs(self.value(x)), self._shaken(metric, x, APART * metric.scale)


def _around(ray: Ray) -> Iterator[Array]:
    """Yield places along and off a branch, all in the interval."""
    metric, x = ray.curve.metric, ray.state.x
    lo, hi = metric.interval
    distances, alphas = np.linspace(-FAR, FAR, PLACES), np.linspace(lo, hi, PLACES)
    for i, (s, alpha) in enumerate(zip(distances, alphas, strict=True)):
        along, aside = x + s * ray.state.tangent, x + s * metric.scale * generic(len(x), i)
        aside[-1] = alpha
        yield aside
        if lo <= along[-1] <= hi:
            yield along


def _step(metric: Metric, x: Array, way: Array) -> float:
    """Return the length over which derivatives are differences, negative at an end ahead."""
    (lo, hi), step = metric.interval, math.sqrt(EPS) * metric.slack(x, 1.0)
    return step if lo <= x[-1] + step * way[-1] <= hi else -step
