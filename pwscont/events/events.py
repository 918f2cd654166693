"""The events of a run: what a user gave by name, asked where pieces begin, pass and end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Kind
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.events.along import AT_SPECIAL_POINT, EventMark, EventsAlong, named
from pwscont.events.user_event import Stop, UserEvent
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray

ALWAYS = (
    "the event {!r} is zero at the start, alpha = {:.8g}, and wherever it was tried around it, to "
    "rounding; give a function that is zero only where the event is"
)


def checked_events(events: Mapping[str, Any], shown: int | None = None) -> Events:
    """Return the events that a user gives by name.

    Event functions are given the first ``shown`` unknowns, default all.

    Raises
    ------
    InvalidInputError
        If ``events`` is no mapping of names to functions or :class:`Stop`.
    """
    if not isinstance(events, Mapping):
        raise InvalidInputError(f"events must be a mapping of names to functions, got {events!r}")
    checked = list[UserEvent]()
    for name, what in events.items():
        if what is Stop:
            words = (
                f"the event {name!r} is the class Stop: give Stop(g) with a function g(z, alpha)"
            )
            raise InvalidInputError(words)
        function = what.function if isinstance(what, Stop) else what
        if not (isinstance(name, str) and name and callable(function)):
            words = "as name: function (z, alpha) -> float, or name: Stop(function)"
            raise InvalidInputError(f"events must be given {words}, got {name!r}: {what!r}")
        checked.append(UserEvent(name, function, isinstance(what, Stop), shown))
    return Events(tuple(checked))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """Functions of (z, alpha) that users give by name."""

    events: tuple[UserEvent, ...]

    def along(self, curve: Curve, x: Array, error: Array) -> EventsAlong:
        """Return what watches all events along a piece that begins at a point with this error."""
        return EventsAlong(self.events, curve.metric, (x, error))

    def stops_along(self, curve: Curve, state: State) -> EventsAlong | None:
        """Return what watches the events that end a branch, None where there are none."""
        stops = [event for event in self.events if event.stops]
        return EventsAlong(stops, curve.metric, (state.x, state.size)) if stops else None

    def stopped(self, curve: Curve, mark: EventMark) -> SpecialPointFound:
        """Return the end of a branch at an event, with the names of all events there."""
        state, metric = mark.state, curve.metric
        beside = [state.x - AT_SPECIAL_POINT * state.tangent]
        here = [
            event
            for event in self.events
            if event in mark.events or event.meets(metric, state.x, state.size, beside)
        ]
        back = Ray(curve, state).reversed()
        return SpecialPointFound(Kind.EVENT, state.x, named(here), (back,))

    def ended(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return a special point as the end of a branch, where an event that stops is zero."""
        stops = [event for event in self.events if event.stops]
        for event in stops if arrival.kind != Kind.EVENT else ():
            back, state = arrival.rays[0], arrival.rays[0].state
            if event.is_near(back.curve.metric, state.x, state.size, state.tangent):
                return SpecialPointFound(Kind.EVENT, arrival.x, event.name, (back,))
        return arrival

    @property
    def names(self) -> str:
        """The names of all events."""
        return named(self.events)

    def begun(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return the start of a component; refuse events that are zero all around the start."""
        for event in self.events:
            if arrival.rays and event.is_zero_around(arrival.rays[0]):
                raise InvalidInputError(ALWAYS.format(event.name, arrival.x[-1]))
        return arrival

    def names_at(self, metric: Metric, x: Array, error: Array, beyond: Sequence[Array]) -> str:
        """Return the names of the events that are zero at a special point of another kind.

        ``x``, ``error``, shape (n + 1,): the point and the estimate of the point's error.
        ``beyond``, shape (n + 1,): a point of each piece that the special point joins.
        """
        return named([e for e in self.events if e.meets(metric, x, error, beyond)])
