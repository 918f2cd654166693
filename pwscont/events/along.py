"""Events: zeros of functions that a user names, along a branch.

An event is a zero of a user's function g(z, alpha). An event divides a piece in two, and changes
neither the solutions nor their signs: counts and balances are the same without events. No step
depends on events: events are searched on steps that are taken, and divide pieces that are followed.

Failure modes and answers
-------------------------
- g has several zeros on one step: g is evaluated in places along the step, and where g comes
  closest to zero between the places. Zeros closer than the places may go unseen if g has several
  extrema between two places. If g is zero on a stretch, as max(0, z) is, the edges are events.
- g has no sign where a piece begins, because g is level there or nothing but rounding: g is watched
  from the first place where g has a sign.
- Between two points of a step the curve is known by a cubic: where g seems to vanish on the cubic,
  points of the curve itself decide. If no point of the curve is found, the event stands where the
  cubic has it, with an error as large as the distance between the two places.
- Events at the same point: the point has the names of all events. A transition, a fold or an end of
  the interval keeps its kind, and has the name of the event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONVERGED, EPS
from pwscont.curve.curve import State
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import BESIDE, CurvedSegment, Segment
from pwscont.events.user_event import UserEvent
from pwscont.transitions.zeros import locate_sign_change

#: Parts of a step, or of a straight piece, at which g is looked at close to the ends.
GRADED = 10.0 ** np.arange(-7.0, -1.0)
#: How closely the place is found where g comes closest to zero, as a part of the step.
CLOSEST = EPS**0.5
NO_PLACES = np.empty(0)
#: If g comes no closer to zero than this part of its values, points of the cubic prove the sign.
SHALLOW_DIP = 1e-3
#: Distance beside an end of a step, as a part of the way to the next place, at which g shows how it
#: changes.
DISTANCE_TO_PLACE = 1e-3
#: Where between two places, as a part of the way, g is compared with that of a single zero.
COMPARED_AT = 0.3
#: Growth of |g| over a thousandth of the way to a sign change that makes the place a pole.
POLE_GROWS = 4.0


def _places(count: int) -> Array:
    """Return parts of a stretch: evenly spaced, and graded towards both ends."""
    even = np.linspace(0.0, 1.0, count + 1)[1:]
    return np.sort(np.concatenate([even, GRADED, 1.0 - GRADED]))


#: Places on a step, and on a straight piece, at which g is evaluated.
ON_STEP, ON_RAY = _places(16), _places(64)
#: If g comes closer to zero than this part of its values, g is evaluated around the closest place,
#: too.
CLOSE_TO_ZERO = 0.1
#: At what distances from there, as parts of the stretch.
AROUND = np.outer(GRADED, [1.0, 2.0, 5.0]).ravel()
#: An event closer than this to a special point, in the metric, may be at that point.
AT_SPECIAL_POINT = 1e-6


@final
@dataclass(frozen=True, slots=True, eq=False)
class EventMark:
    """A place on a piece where events are zero."""

    state: State
    events: tuple[UserEvent, ...]
    after: int  # how many of the points of the piece come before
    position: float  # distance along the stretch from the last of these points

    @property
    def names(self) -> str:
        """The names of the events."""
        return named(self.events)


@final
class EventsAlong:
    """Watches events along one piece, stretch after stretch."""

    def __init__(
        self, events: Sequence[UserEvent], metric: Metric, begin: tuple[Array, Array]
    ) -> None:
        self._events, self._metric, self._begin = events, metric, begin
        self._signs = [_sign(event, metric, *begin) for event in events]
        self._marks: list[EventMark] = []

    def look(self, segment: Segment, length: float, after: int) -> Sequence[EventMark]:
        """Return the events on a stretch of the piece, and keep these events."""
        found: list[EventMark] = []
        for i, event in enumerate(self._events):
            stretch = _Stretch(event, segment, length, self._signs[i])
            found += [EventMark(state, (event,), after, s) for s, state in stretch.zeros()]
            self._signs[i] = stretch.sign
        known, metric = len(self._marks), self._metric
        for mark in sorted(found, key=lambda mark: mark.position):
            if self._is_at(mark, *self._begin):
                continue
            if len(self._marks) > known:
                last = self._marks[-1]
                x = last.state.x
                if metric.norm(x - mark.state.x) <= metric.slack(x, CONVERGED):  # the same place
                    self._marks[-1] = replace(last, events=(*last.events, *mark.events))
                    continue
            self._marks.append(mark)
        return self._marks[known:]

    def before(self, x: Array, error: Array) -> Sequence[EventMark]:
        """Return the events on the piece except those at the special point that ends the piece."""
        end = len(self._marks)
        while end and self._is_at(self._marks[end - 1], x, error):
            end -= 1
        return self._marks[:end]

    def _is_at(self, mark: EventMark, x: Array, error: Array) -> bool:
        """Tell whether events are at a special point, to the accuracy of that point."""
        way = mark.state.x - x
        if self._metric.norm(way) > AT_SPECIAL_POINT:
            return False
        return all(event.is_near(self._metric, x, error, way) for event in mark.events)


def _sign(event: UserEvent, metric: Metric, x: Array, size: Array) -> float | None:
    """Return the sign of g, 0 where g is zero all around, None where g is rounding."""
    if value := event.cleared(metric, x, size):
        return float(np.sign(value))
    is_flat = not event.value(x) and event.noise(metric, x, 0.0 * x) == 0.0
    return 0.0 if is_flat else None


class _Stretch:
    """A function g on a stretch of a piece: the sign of g so far, and where the sign changes."""

    def __init__(
        self, event: UserEvent, segment: Segment, length: float, sign: float | None
    ) -> None:
        self._event, self._segment, self._length, self.sign = event, segment, length, sign
        self._metric, self._is_curved = segment.curve.metric, isinstance(segment, CurvedSegment)

    def zeros(self) -> Iterator[tuple[float, State]]:
        """Yield places where the sign changes; keep the sign at the end."""
        places = self._length * (ON_STEP if self._is_curved else ON_RAY)
        values = self._values(places)
        if len(more := self._beside_least(places, values)):
            places = np.unique([*places, *more])
            values = self._values(places)
        lows = list(self._lows(places, values)) if values.any() else []
        if self.sign is not None and not lows and (np.sign(values) == self.sign).all():
            return
        yield from self._changes(0.0, np.unique([*places, *lows]))

    def _changes(
        self, before: float, places: Array, is_fine: bool = False
    ) -> Iterator[tuple[float, State]]:
        """Yield where the sign changes between places; keep the sign at the last place."""
        for s in map(float, places):
            sign = _sign(self._event, self._metric, *self._exact(s))
            if sign is None:
                continue
            if self.sign is not None and sign != self.sign:
                found = self._change(self.sign, before, s)
                more = NO_PLACES if is_fine else self._around(self.sign, before, found[0], s)
                if len(more):
                    yield from self._changes(before, np.append(more, s), is_fine=True)
                elif not self._is_pole(before, found[0], s):
                    yield found
            self.sign, before = sign, s

    def _change(self, sign: float, lo: float, hi: float) -> tuple[float, State]:
        """Return the place where the sign changes; a rough place if the location fails.

        The rough place lies between two places, and is as uncertain as the places are apart.
        """
        segment, ahead = self._segment, self._event.ahead
        if ahead(sign, self._exact(lo)[0]) <= 0.0:
            hi = lo  # g is rounding there already
        found = locate_sign_change(segment, lambda state: ahead(sign, state.x), (lo, hi), EPS)
        found = segment.at(hi) if isinstance(found, Failure) else found
        if isinstance(found, State):
            return segment.position(found.x), found
        start, ends, s = segment.start, (segment.near(lo), segment.near(hi)), 0.5 * (lo + hi)
        aside = BESIDE * self._metric.norm(ends[1] - start.x) * self._metric.scale
        error = np.abs(ends[1] - ends[0]) + aside
        return s, State(segment.near(s), start.tangent, error[np.newaxis], start.orientation)

    def _is_pole(self, lo: float, place: float, hi: float) -> bool:
        """Tell whether |g| grows from both sides towards the place of a sign change."""
        beside = [(end, place + DISTANCE_TO_PLACE * (end - place)) for end in (lo, hi)]
        sizes = np.abs([[self._on_curve(s) for s in pair] for pair in beside])
        return bool((sizes[:, 1] > POLE_GROWS * sizes[:, 0]).all())

    def _around(self, sign: float, lo: float, zero: float, hi: float) -> Array:
        """Return places that tell three zeros from one, beside which g / distance is even."""
        cell, places = hi - lo, [lo]
        if not sign:
            return NO_PLACES

        def divided(s: float) -> float:
            """Return g over the distance to the zero, positive if the zero is the only zero."""
            places.append(s)
            return sign * self._on_curve(s) / (zero - s) if s != zero else np.inf

        plain, close = COMPARED_AT * cell, DISTANCE_TO_PLACE * cell
        beside = lo, lo + plain, hi - plain, zero - close, zero + close, hi
        sizes = [divided(s) for s in beside if lo <= s <= hi]
        if min(sizes) >= 0.5 * max(sizes):
            return NO_PLACES
        place, least = _least(divided, lo, hi)
        if least < 0.0:  # two more zeros: on either side of this place
            apart = DISTANCE_TO_PLACE * abs(place - zero)
            places += [zero - apart, zero + apart]
        return np.unique([s for s in places if lo < s < hi])

    def _rough(self, s: float) -> float:
        """Return g at a place of the cubic, or of the ray."""
        x = self._segment.near(s)
        self._metric.admits(x)  # moves rounding of alpha into the interval
        return self._event.value(x)

    def _on_curve(self, s: float) -> float:
        """Return g at a point of the curve."""
        x, _ = self._exact(s)
        self._metric.admits(x)
        return self._event.value(x)

    def _exact(self, s: float) -> tuple[Array, Array]:
        """Return a point of the curve, and the size of the point's error."""
        found = self._segment.at(s) if self._is_curved else None
        if isinstance(found, State):
            return found.x, found.size
        return self._segment.near(s), np.zeros_like(self._segment.start.x)

    def _values(self, places: Array) -> Array:
        """Return g at places in the interval, the last place on the curve itself."""
        *inside, last = places.tolist()
        return np.array([*map(self._rough, inside), self._on_curve(last)])

    def _beside_least(self, places: Array, values: Array) -> Array:
        """Return graded places around where g seems to vanish, if g comes close to zero."""
        sizes, length = np.abs(values), float(places[-1])
        i = int(sizes.argmin())
        if not sizes[i] <= CLOSE_TO_ZERO * sizes.max() or not sizes.any():
            return NO_PLACES
        s = np.concatenate([[0.0], places])
        low, _ = _least(lambda s: abs(self._rough(s)), s[i], s[min(i + 2, len(s) - 1)])
        beside = np.concatenate([low - length * AROUND, low + length * AROUND])
        return beside[(beside > 0.0) & (beside < length)]

    def _lows(self, places: Array, values: Array) -> Iterator[float]:
        """Yield the lowest places where g has another sign than at the places around."""
        s = np.concatenate([[0.0], places])
        values = np.concatenate([[self._rough(0.0)], values])
        sizes, signs = np.abs(values), np.sign(values)
        least = (sizes[1:-1] <= sizes[:-2]) & (sizes[1:-1] <= sizes[2:])
        least &= (signs[1:-1] == signs[:-2]) & (signs[1:-1] == signs[2:])
        valleys = [(s[i], s[i + 2], signs[i]) for i in np.flatnonzero(least)]
        for at, beyond in ((0, 1), (-1, -2)):
            beside = float(s[at] + DISTANCE_TO_PLACE * (s[beyond] - s[at]))
            is_least = signs[at] == signs[beyond] and sizes[at] <= sizes[beyond]
            if is_least and signs[at] * self._rough(beside) < sizes[at]:
                valleys.append((*sorted((s[at], s[beyond])), signs[at]))
        for lo, hi, sign in valleys:
            low, lowest = _least(self._rough, lo, hi, sign)
            if abs(lowest) <= SHALLOW_DIP * float(sizes.max()) and self._is_curved:
                low, lowest = _least(self._on_curve, lo, hi, sign)
            if lowest < 0.0:
                yield low


def _least(
    function: Callable[[float], float], lo: float, hi: float, sign: float = 1.0
) -> tuple[float, float]:
    """Return the place where sign * function is least between two places, and the least value."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  few events need it

    found = minimize_scalar(
        lambda s: sign * function(float(s)),
        bounds=(lo, hi),
        method="bounded",
        options={"xatol": CLOSEST * (hi - lo)},
    )
    return float(found.x), float(found.fun)


def named(events: Sequence[UserEvent]) -> str:
    """Return the names of events."""
    return ", ".join(event.name for event in events)
