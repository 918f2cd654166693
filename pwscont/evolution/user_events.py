"""Zeros of users' functions along the straight pieces of an evolution.

Failure modes and answers
-------------------------
- The function is zero where the piece begins, because the piece begins at that event: the search
  begins a little later.
- The function is curved and has two zeros close together: both zeros are found if one of
  :data:`SAMPLES` samples lies between the zeros.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function, evaluated
from pwscont.basics.rounding import EPS
from pwscont.evolution.ways import Evolver, Moment, Way
from pwscont.transitions.user_event import Stop

#: Places on a piece at which a function is read.
SAMPLES = 17
#: The first place, as a part of the piece.
BEGIN = EPS**0.5


@final
@dataclass(frozen=True, slots=True)
class UserEventFound:
    """The first zero on a piece: when, of which functions, and whether the evolution ends there."""

    t: float
    name: str
    stops: bool


@final
class UserEvents:
    """The functions of a user by name.

    Parameters
    ----------
    events : mapping of str to callable or Stop, or None
    """

    def __init__(self, events: Mapping[str, Function | Stop] | None) -> None:
        if events is not None and not isinstance(events, Mapping):
            raise InvalidInputError(f"events must map names to functions of (z, t), got {events!r}")
        self._functions: dict[str, Any] = dict(events or {})
        for name, given in self._functions.items():
            if not isinstance(name, str) or not name:
                raise InvalidInputError(f"names of events are texts that are not empty: {name!r}")
            if not callable(given.function if isinstance(given, Stop) else given):
                raise InvalidInputError(f"event {name!r} must be a function of (z, t)")

    def first(
        self, evolver: Evolver, moment: Moment, way: Way, until: float
    ) -> UserEventFound | None:
        """Return the first event on a way, None where there is none."""
        found = [
            UserEventFound(t, name, isinstance(given, Stop))
            for name, given in self._functions.items()
            if (t := self._zero(name, evolver, moment, way, until)) is not None
        ]
        return min(found, key=lambda event: event.t, default=None)

    def _zero(
        self, name: str, evolver: Evolver, moment: Moment, way: Way, until: float
    ) -> float | None:
        given = self._functions[name]
        function = given.function if isinstance(given, Stop) else given

        def value(part: float) -> float:
            t = moment.t + part * (until - moment.t)
            z = evolver.shown(way.z + (t - moment.t) * way.rate, t)
            return evaluated(f"the event {name!r}", function, z, t)

        parts = np.append(BEGIN, np.linspace(0.0, 1.0, SAMPLES)[1:])
        values = [value(part) for part in parts]
        for i in range(1, len(parts)):
            if values[i - 1] * values[i] < 0.0 or (values[i] == 0.0 != values[i - 1]):
                return moment.t + _root(value, parts[i - 1], parts[i]) * (until - moment.t)
        return None


def _root(value: Any, lo: float, hi: float) -> float:
    """Return the zero between two places at which a function has different signs."""
    from scipy.optimize import brentq  # noqa: PLC0415  only where a user has events

    if value(hi) == 0.0:
        return hi
    return float(brentq(value, lo, hi, xtol=2.0 * EPS, rtol=4.0 * EPS))
