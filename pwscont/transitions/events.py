"""Events: points along a branch that a user asks for, at which the branch may end on purpose.

An event is a zero of a user's function g(z, alpha). It divides a piece in two, and changes neither
the solutions nor their signs: counts and balances are the same without it.

Failure modes and answers
-------------------------
- g has either sign: both g and -g are watched, of which one falls to zero.
- g is not affine on a straight piece: the ratio test of affine functions does not hold. It is
  looked at in a number of places on the way to the piece's end; two zeros between two of them are
  not seen.
- g is zero on a stretch, as max(0, z) is: its edges are events. Of these -g and g see only where a
  stretch begins; a third function falls where one ends.
- g has no sign where a piece begins, for it is level there or nothing but rounding: it is watched
  from where it has one.
- Events at one point: the point has the names of all of them.
- An event at a transition, a fold or an end of the interval: both are one point, which is what it
  is without the event, and has the name of the event.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONVERGED, EPS, SAME_ALPHA
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import MOST_BRENT, locate_point, locate_sign_change
from pwscont.transitions.rays import Ray
from pwscont.transitions.user_event import Stop, UserEvent

#: Places on a straight piece at which g is evaluated.
SAMPLES = 64
#: A zero closer to the end of a straight piece than this part of its length is at the end.
AT_THE_END = CONVERGED
#: Of each event g and -g are watched, by these factors, and whether g is zero on a stretch.
WATCHED = (1.0, -1.0, 0.0)
FLAT = 2
#: The one of the three that is positive, and so watched, where g begins with a given sign.
BY_SIGN = {1.0: 0, -1.0: 1, 0.0: FLAT}
ALWAYS = (
    "the event {!r} is zero at the start, alpha = {:.8g}, and wherever it was tried around it, to "
    "rounding; give a function that is zero only where the event is"
)


def checked_events(events: Mapping[str, Any] | None, shown: int | None = None) -> Events | None:
    """Return the detector of events given by name, None where there are none.

    Their functions are given the first ``shown`` unknowns, default all.

    Raises
    ------
    InvalidInputError
        If ``events`` is no mapping of names to functions or :class:`Stop`.
    """
    if not events:
        return None
    if not isinstance(events, Mapping):
        raise InvalidInputError(f"events must be a mapping of names to functions, got {events!r}")
    return Events(tuple(_checked(name, what, shown) for name, what in events.items()))


def _checked(name: Any, what: Any, shown: int | None) -> UserEvent:
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
    return UserEvent(name, function, isinstance(what, Stop), shown)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Events(TransitionDetector):
    """Watches functions of (z, alpha) that users give by name; each as g, as -g, and as flat.

    The third is 1 where g is zero on a stretch, and -1 elsewhere.
    """

    events: tuple[UserEvent, ...]

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the three of each; zero to the accuracy of the state counts as zero."""
        read = [event.read(curve, state) for event in self.events]
        numbers = np.array([(value, slope) for value, slope, _ in read])
        values, slopes = np.outer(numbers[:, 0], WATCHED), np.outer(numbers[:, 1], WATCHED)
        values[:, FLAT] = [1.0 if flat else -1.0 for *_, flat in read]
        return Reading(values.ravel(), slopes.ravel())

    def falls(self, segment: Segment, start: Reading, farthest: float) -> Array:
        """Return where on a straight segment each function falls to zero before ``farthest``."""
        distances = np.full(len(start.values), np.inf)
        if not np.isfinite(farthest):
            return distances
        places = np.linspace(0.0, farthest * (1.0 - AT_THE_END), SAMPLES + 1)
        for i, event in enumerate(self.events):
            g, _, flat = len(WATCHED) * i + np.arange(len(WATCHED))
            sign, seen = float(np.sign(start.values[g] or start.slopes[g])), places[1:]
            if not sign and start.values[flat] < 0.0:
                sign, seen = _first_sign(event, segment, places[1:])
            if (zero := _first_change(event, segment, seen, sign)) is not None:
                distances[g + BY_SIGN[sign]] = zero
        return distances

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find the zero of the function along the curve."""
        if not isinstance(segment, CurvedSegment):
            return locate_point(segment, bracket[0])
        event, sign = self.events[index // len(WATCHED)], WATCHED[index % len(WATCHED)]
        if index % len(WATCHED) == FLAT and not event.read(segment.curve, segment.end)[0]:
            return segment.end  # to the accuracy of that point, which may be special by itself
        return locate_sign_change(segment, lambda state: event.ahead(sign, state.x), bracket, EPS)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve, or end it."""
        event, forth = self.events[index // len(WATCHED)], Ray(curve, state)
        here = [each for each in self.events if each is event or each.crosses(curve, state)]
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
        (lo, hi), alpha = ray.curve.metric.interval, ray.state.alpha
        if min(alpha - lo, hi - alpha) <= SAME_ALPHA * (hi - lo):
            return arrival
        here = [event for event in self.events if event.crosses(ray.curve, ray.state)]
        if not here:
            return arrival
        return SpecialPointFound(Kind.EVENT, arrival.x, _named(here), arrival.rays)

    def names_at(self, metric: Metric, x: Array, error: Array, beyond: Sequence[Array]) -> str:
        """Return the names of the events that are zero at a special point of another kind.

        Parameters
        ----------
        metric : Metric
        x, error : ndarray, shape (n + 1,)
            The point and the estimate of its error.
        beyond : sequence of ndarray, shape (n + 1,)
            A point of each piece that it joins.
        """
        return _named([e for e in self.events if e.meets(metric, x, error, beyond)])


def _named(events: Sequence[UserEvent]) -> str:
    return ", ".join(event.name for event in events)


def _first_sign(event: UserEvent, segment: Segment, places: Array) -> tuple[float, Array]:
    """Return the first sign that a function has at some places, and those from there on."""
    metric, exact = segment.curve.metric, np.zeros_like(segment.start.x)
    for i, s in enumerate(places):
        if value := event.cleared(metric, segment.near(s), exact):
            return float(np.sign(value)), places[i:]
    return 0.0, places[:0]


def _first_change(event: UserEvent, segment: Segment, places: Array, sign: float) -> float | None:
    """Return where g, which begins with this sign, first has another; None if nowhere."""

    def value(s: float) -> float:
        return event.ahead(sign, segment.near(s))

    before = None
    for s in places:
        if value(s) > 0.0:
            before = float(s)
        else:
            break
    else:
        return None
    if before is None:
        before = _still_positive(value, float(s))
    if before is None:
        return None
    from scipy.optimize import brentq  # noqa: PLC0415  it takes as long to import as all the rest

    at = brentq(value, before, s, xtol=EPS * s, rtol=4.0 * EPS, maxiter=MOST_BRENT)
    return float(at)


def _still_positive(value: Callable[[float], float], s: float) -> float | None:
    """Return a distance before ``s`` at which a value is positive, None if none is found."""
    for _ in range(50):
        s *= 0.5
        if value(s) > 0.0:
            return s
    return None
