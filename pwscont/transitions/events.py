"""Events: points along a branch that a user asks for, at which the branch may end on purpose.

An event is a zero of a user's function g(z, alpha). It divides a piece in two, and changes neither
the solutions nor their signs: counts and balances are the same without it.

Failure modes and answers
-------------------------
- g may fall or rise to zero: both g and -g are watched, one of which falls.
- The piece after an event begins with g = 0, with a sign that is rounding: a value of g that the
  error of the point explains counts as zero, and a zero does not fall.
- g is not affine on a straight piece, and the ratio test does not hold: g is evaluated at a number
  of places on the way to the piece's end. Two zeros between two such places are not seen.
- g is zero on a stretch, as max(0, z) is: both ends of the stretch are events. g and -g see only
  its beginning; a third function falls at its end.
- g is zero wherever it is tried: g is no event, and is refused at the start.
- Several events at one point: the point has all their names.
- An event at a transition: the point is a transition, and no event of its own.
- g cannot be computed, or returns no number (a truth value has no zero to be found): the error
  names the event.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.optimize import brentq

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.generic import generic
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.quantities import Function, evaluated
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.curve import Curve, State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import locate_point, locate_sign_change
from pwscont.transitions.rays import Ray

#: Places on a straight piece at which g is evaluated.
SAMPLES = 64
#: A zero closer to the end of a straight piece than this part of its length is at the end.
AT_THE_END = CONVERGED
#: Of each event g and -g are watched, by these factors, and whether g is zero on a stretch.
WATCHED = (1.0, -1.0, 0.0)
FLAT = 2
#: The one of the three that is positive, and so watched, where g begins with a given sign.
BY_SIGN = {1.0: 0, -1.0: 1, 0.0: FLAT}
#: A function that is zero at a start is tried at so many places along and off the branch.
PLACES = 9
TINY = float(np.finfo(float).tiny)
ALWAYS = (
    "the event {!r} is zero at the start, alpha = {:.8g}, and wherever it was tried around it; "
    "give a function that is zero only where the event is"
)


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
            If g fails, or is not a finite number.
        """
        return evaluated(f"the event {self.name!r}", self._number, x[:-1], float(x[-1]))

    def _number(self, z: Array, alpha: float) -> Any:
        """Return the value of the function; of an array with one entry, that entry."""
        given = self.function(z, alpha)
        return given.item() if isinstance(given, np.ndarray) and given.size == 1 else given

    def read(self, curve: Curve, state: State) -> tuple[float, float]:
        """Return g, or zero where the error of the state explains g, and its slope."""
        value, slope, steep = self._differences(curve, state)
        small = abs(value) <= steep * curve.metric.slack(state.x, CONVERGED)
        return (0.0 if small else value), slope

    def is_zero(self, ray: Ray) -> bool:
        """Tell whether g is zero where a ray begins, to the accuracy of that point."""
        curve, state = ray.curve, ray.state
        off = max(curve.metric.norm(sample) for sample in state.error)
        slack = max(curve.metric.slack(state.x, CONVERGED), CONFIDENCE * off)
        value, _, steep = self._differences(curve, state)
        return abs(value) <= steep * slack

    def _differences(self, curve: Curve, state: State) -> tuple[float, float, float]:
        """Return g, its derivative by a difference within the interval, and its steepness."""
        (lo, hi), step = curve.metric.interval, EPS**0.5 * curve.metric.slack(state.x, 1.0)
        if not lo <= state.alpha + step * state.tangent[-1] <= hi:
            step = -step
        value, ahead = self.value(state.x), self.value(state.x + step * state.tangent)
        slope = (ahead - value) / step
        behind = state.x - step * state.tangent
        if ahead == 0.0 != value and lo <= behind[-1] <= hi:  # perhaps it is zero from here on
            return value, slope, max(abs(slope), abs((value - self.value(behind)) / step))
        return value, slope, abs(slope)

    def is_zero_around(self, ray: Ray) -> bool:
        """Tell whether g is zero where a ray begins, and wherever else it is tried."""
        curve, x = ray.curve, ray.state.x
        if any(self.read(curve, ray.state)):
            return False
        (lo, hi), scale = curve.metric.interval, curve.metric.scale
        aside = [scale * generic(len(x), shift) for shift in range(PLACES)]
        along = [s * ray.state.tangent for s in np.linspace(-1.0, 1.0, PLACES)]
        tried = [x + step for step in (*along, *aside)]
        return all(self._vanishes(y) for y in tried if lo <= y[-1] <= hi)

    def _vanishes(self, x: Array) -> bool:
        """Tell whether g is zero at a place that may be far from all solutions."""
        try:
            return self.value(x) == 0.0
        except InvalidInputError:
            return False


def checked_events(events: Mapping[str, Any] | None) -> Events | None:
    """Return the detector of events given by name, None where there are none.

    Raises
    ------
    InvalidInputError
        If ``events`` is no mapping of names to functions or :class:`Stop`.
    """
    if not events:
        return None
    if not isinstance(events, Mapping):
        raise InvalidInputError(f"events must be a mapping of names to functions, got {events!r}")
    return Events(tuple(_checked(name, what) for name, what in events.items()))


def _checked(name: Any, what: Any) -> UserEvent:
    if what is Stop:
        raise InvalidInputError(
            f"the event {name!r} is the class Stop: give Stop(g) with a function g(z, alpha)"
        )
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
    """Watches functions of (z, alpha) that users give by name; each as g, as -g, and as flat.

    The third is 1 where g is zero on a stretch, and -1 elsewhere.
    """

    events: tuple[UserEvent, ...]

    def read(self, curve: Curve, state: State) -> Reading:
        """Return three functions of each event; g is zero if the error of the state explains it."""
        read = np.array([event.read(curve, state) for event in self.events])
        values, slopes = np.outer(read[:, 0], WATCHED), np.outer(read[:, 1], WATCHED)
        values[:, FLAT] = np.where(read.any(axis=1), -1.0, 1.0)
        return Reading(values.ravel(), slopes.ravel())

    def falls(self, segment: Segment, start: Reading, farthest: float) -> Array:
        """Return where on a straight segment each function falls to zero before ``farthest``."""
        distances = np.full(len(start.values), np.inf)
        if not np.isfinite(farthest):
            return distances
        places = np.linspace(0.0, farthest * (1.0 - AT_THE_END), SAMPLES + 1)
        for i, event in enumerate(self.events):
            first = len(WATCHED) * i
            sign = float(np.sign(start.values[first] or start.slopes[first]))
            if (zero := _first_change(event, segment, places, sign)) is not None:
                distances[first + BY_SIGN[sign]] = zero
        return distances

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find the zero of the function along the curve."""
        if not isinstance(segment, CurvedSegment):
            return locate_point(segment, bracket[0])
        event, sign = self.events[index // len(WATCHED)], WATCHED[index % len(WATCHED)]

        def function(state: State) -> float:
            return _ahead(sign, event.value(state.x))

        return locate_sign_change(segment, function, bracket, EPS)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve, or end it."""
        event, forth = self.events[index // len(WATCHED)], Ray(curve, state)
        here = [each for each in self.events if each is event or _crosses(each, curve, state)]
        stops = any(each.stops for each in here)
        ways = (forth.reversed(),) if stops else (forth.reversed(), forth)
        return SpecialPointFound(Kind.EVENT, state.x, _named(here), ways)

    def ended(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return a special point as the end of a branch, where an event that stops is zero."""
        for event in self.events:
            if event.stops and arrival.kind != Kind.EVENT and event.is_zero(arrival.rays[0]):
                return SpecialPointFound(Kind.EVENT, arrival.x, event.name, arrival.rays[:1])
        return arrival

    def begun(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return the start of a component, as an event if one is zero there."""
        for event in self.events:
            if arrival.rays and event.is_zero_around(arrival.rays[0]):
                raise InvalidInputError(ALWAYS.format(event.name, arrival.x[-1]))
        if arrival.kind != Kind.START or len(arrival.rays) != 2:
            return arrival
        ray = arrival.rays[0]
        here = [event for event in self.events if _crosses(event, ray.curve, ray.state)]
        if not here:
            return arrival
        return SpecialPointFound(Kind.EVENT, arrival.x, _named(here), arrival.rays)


def _crosses(event: UserEvent, curve: Curve, state: State) -> bool:
    """Tell whether an event is zero at a state with a slope: zero there, and not around."""
    value, slope = event.read(curve, state)
    return value == 0.0 != slope


def _named(events: Sequence[UserEvent]) -> str:
    return ", ".join(event.name for event in events)


def _ahead(sign: float, value: float) -> float:
    """Return a number that is positive where g has this sign, and negative elsewhere.

    The sign of a g that is zero on a stretch is 0.
    """
    if sign == 0.0:
        return 1.0 if value == 0.0 else -1.0
    return sign * value or -TINY


def _first_change(event: UserEvent, segment: Segment, places: Array, sign: float) -> float | None:
    """Return where g, which begins with this sign, first has another; None if nowhere."""

    def value(s: float) -> float:
        return _ahead(sign, event.value(segment.near(s)))

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
    """Return a distance before ``s`` at which a value is positive, None if none is found."""
    for _ in range(50):
        s *= 0.5
        if value(s) > 0.0:
            return s
    return None
