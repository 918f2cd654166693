"""Events: points along a branch that a user asks for, at which the branch may end on purpose.

An event is a zero of a user's function g(z, alpha). It divides a piece in two, and changes neither
the solutions nor their signs: counts and balances are the same without it. No step depends on
events: they are looked for on steps that are taken, and divide pieces that are followed.

Failure modes and answers
-------------------------
- g has several zeros on one step: g is looked at in places on the way, and where it comes closest
  to zero between them. Two zeros around such a place are both found; of zeros closer than places
  some are not seen where g has several extrema between two places.
- g is zero on a stretch, as max(0, z) is: its edges are events.
- g has no sign where a piece begins, for it is level there or nothing but rounding: it is watched
  from where it has one.
- Between two points of a step the curve is known by a cubic: where g seems to vanish there, points
  of the curve itself tell whether it does.
- Events at one point: the point has the names of all of them.
- An event at a transition, a fold or an end of the interval: both are one point, which is what it
  is without the event, and has the name of the event.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.kind import Kind
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.events_along import EventMark, EventsAlong
from pwscont.transitions.rays import Ray
from pwscont.transitions.user_event import Stop, UserEvent

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
class Events:
    """Functions of (z, alpha) that users give by name."""

    events: tuple[UserEvent, ...]

    def along(self, curve: Curve, x: Array, error: Array) -> EventsAlong:
        """Return what watches all events along a piece that begins at a point with this error."""
        return EventsAlong(self.events, curve, (x, error))

    def stops_along(self, curve: Curve, state: State) -> EventsAlong | None:
        """Return what watches the events that end a branch, None where there are none."""
        stops = [event for event in self.events if event.stops]
        return EventsAlong(stops, curve, (state.x, state.size)) if stops else None

    def stopped(self, curve: Curve, mark: EventMark) -> SpecialPointFound:
        """Return the end of a branch at an event, with the names of all events there."""
        here = [e for e in self.events if e in mark.events or e.crosses(curve, mark.state)]
        back = Ray(curve, mark.state).reversed()
        return SpecialPointFound(Kind.EVENT, mark.state.x, _named(here), (back,))

    def ended(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return a special point as the end of a branch, where an event that stops is zero."""
        for event in self.events:
            if event.stops and arrival.kind != Kind.EVENT and event.is_zero(arrival.rays[0]):
                return SpecialPointFound(Kind.EVENT, arrival.x, event.name, arrival.rays[:1])
        return arrival

    @property
    def names(self) -> str:
        """The names of all of them."""
        return _named(self.events)

    def begun(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return the start of a component; refuse events that are zero all around it.

        Raises
        ------
        InvalidInputError
        """
        for event in self.events:
            if arrival.rays and event.is_zero_around(arrival.rays[0]):
                raise InvalidInputError(ALWAYS.format(event.name, arrival.x[-1]))
        return arrival

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
