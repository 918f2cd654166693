"""Events: what users want to know of along a branch, and where it may end on purpose.

An event is a zero of a user's function g(z, alpha). It divides a piece in two, and changes neither
the solutions nor their signs: counts and balances are what they are without it.

Failure modes and answers
-------------------------
- g has either sign: both g and -g are watched, of which one falls to zero.
- Where an event was found, the next piece begins with g = 0, with a sign that is rounding: what the
  accuracy of the point explains is zero, and a zero does not fall.
- g is not affine on a straight piece: the ratio test of affine functions does not hold. It is
  looked at in a number of places on the way to the piece's end; two zeros between two of them are
  not seen.
- An event at a transition: both are one point, and the transition is it.
- g cannot be computed, or is not a number: the user hears of it by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.optimize import brentq

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.quantities import Function
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.curve import Curve, State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import locate_point, locate_sign_change
from pwscont.transitions.rays import Ray

#: Places on a straight piece in which events are looked at.
SAMPLES = 64
#: Before the end of a straight piece by less than this part of it is at its end.
AT_THE_END = CONVERGED


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """An event at which the branch ends: ``events={"collapse": Stop(g)}``.

    Attributes
    ----------
    function : callable
        (z, alpha) -> float; the branch ends where it is zero.
    """

    function: Function


@final
@dataclass(frozen=True, slots=True, eq=False)
class UserEvent:
    """A named function whose zeros are special points of kind "event"."""

    name: str
    function: Function
    stops: bool

    def value(self, x: Array) -> float:
        """Return g(z, alpha).

        Raises
        ------
        InvalidInputError
            If it is not a finite number.
        """
        z, alpha = x[:-1], float(x[-1])
        given = self.function(z.copy(), alpha)
        value = np.asarray(given, dtype=float).item() if np.size(given) == 1 else np.nan
        if not np.isfinite(value):
            raise InvalidInputError(
                f"the event {self.name!r} must be a finite number, got {given!r} at alpha = "
                f"{alpha:.10g}, z = {np.array2string(z, precision=6, threshold=8)}"
            )
        return value

    def is_zero(self, ray: Ray) -> bool:
        """Tell whether g is zero where a ray begins, to the accuracy of that point."""
        curve, state = ray.curve, ray.state
        off = max(curve.metric.norm(sample) for sample in state.error)
        slack = max(curve.metric.slack(state.x, CONVERGED), CONFIDENCE * off)
        return abs(self.value(state.x)) <= abs(self.slope(curve, state)) * slack

    def slope(self, curve: Curve, state: State) -> float:
        """Return the derivative along the tangent, by a difference within the interval."""
        (lo, hi), step = curve.metric.interval, EPS**0.5 * curve.metric.slack(state.x, 1.0)
        ahead = state.x + step * state.tangent
        if not lo <= ahead[-1] <= hi:
            step, ahead = -step, state.x - step * state.tangent
        return float((self.value(ahead) - self.value(state.x)) / step)


def checked_events(events: Mapping[str, Any] | None) -> Events | None:
    """Return the detector of events given by name, None where there are none.

    Raises
    ------
    InvalidInputError
        If they are no mapping of names to functions or :class:`Stop`.
    """
    if not events:
        return None
    if not isinstance(events, Mapping):
        raise InvalidInputError(f"events must be a mapping of names to functions, got {events!r}")
    return Events(tuple(_checked(name, what) for name, what in events.items()))


def _checked(name: Any, what: Any) -> UserEvent:
    function = what.function if isinstance(what, Stop) else what
    if not (isinstance(name, str) and name and callable(function)):
        raise InvalidInputError(
            f"events must be given as name: function (z, alpha) -> float, or name: Stop(function), "
            f"got {name!r}: {what!r}"
        )
    return UserEvent(name, function, isinstance(what, Stop))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Events(TransitionDetector):
    """Watches functions of (z, alpha) that users give by name; each as g and as -g."""

    events: tuple[UserEvent, ...]

    def read(self, curve: Curve, state: State) -> Reading:
        """Return g and -g of each; zero to the accuracy of the state counts as zero."""
        values = np.array([event.value(state.x) for event in self.events])
        slopes = np.array([event.slope(curve, state) for event in self.events])
        values[np.abs(values) <= np.abs(slopes) * curve.metric.slack(state.x, CONVERGED)] = 0.0
        both = np.array([1.0, -1.0])
        return Reading(np.outer(values, both).ravel(), np.outer(slopes, both).ravel())

    def falls(self, segment: Segment, start: Reading, farthest: float) -> Array:
        """Return where on a straight segment each falls to zero before ``farthest``."""
        distances = np.full(len(start.values), np.inf)
        if not np.isfinite(farthest):
            return distances
        places = np.linspace(0.0, farthest * (1.0 - AT_THE_END), SAMPLES + 1)
        for i, event in enumerate(self.events):
            sign = np.sign(start.values[2 * i] or start.slopes[2 * i])
            if (zero := _first_zero(event, segment, places, float(sign))) is not None:
                distances[2 * i + (sign < 0.0)] = zero
        return distances

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find the zero along the curve."""
        if not isinstance(segment, CurvedSegment):
            return locate_point(segment, bracket[0])
        event, sign = self.events[index // 2], 1.0 - 2.0 * (index % 2)

        def function(state: State) -> float:
            return sign * event.value(state.x)

        return locate_sign_change(segment, function, bracket, EPS)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve, or end it."""
        event, forth = self.events[index // 2], Ray(curve, state)
        ways = (forth.reversed(),) if event.stops else (forth.reversed(), forth)
        return SpecialPointFound(Kind.EVENT, state.x, event.name, ways)

    def ended(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return a special point as the end of a branch, where an event that stops is zero."""
        for event in self.events:
            if event.stops and arrival.kind != Kind.EVENT and event.is_zero(arrival.rays[0]):
                return SpecialPointFound(Kind.EVENT, arrival.x, event.name, arrival.rays[:1])
        return arrival

    def begun(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return the start of a component as the event that it is, if it lies on one."""
        if arrival.kind != Kind.START or len(arrival.rays) != 2:
            return arrival
        ray = arrival.rays[0]
        reading = self.read(ray.curve, ray.state)
        zero = np.flatnonzero((reading.values[::2] == 0.0) & (reading.slopes[::2] != 0.0))
        if not len(zero):
            return arrival
        return SpecialPointFound(Kind.EVENT, arrival.x, self.events[zero[0]].name, arrival.rays)


def _first_zero(event: UserEvent, segment: Segment, places: Array, sign: float) -> float | None:
    """Return where a function that begins with a sign first has the other, None if nowhere."""

    def value(s: float) -> float:
        return sign * event.value(segment.near(s))

    before = None
    for s in places[1:]:
        if value(s) > 0.0:
            before = float(s)
        else:
            break
    else:
        return None
    if before is None:
        before = _still_positive(value, float(s))
    return None if before is None else float(brentq(value, before, s, xtol=EPS * s, rtol=4.0 * EPS))


def _still_positive(value: Callable[[float], float], s: float) -> float | None:
    """Return a distance before ``s`` at which a function has not changed sign yet."""
    for _ in range(50):
        s *= 0.5
        if value(s) > 0.0:
            return s
    return None
