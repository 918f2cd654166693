"""What a user adds to a run: rules of jumps, and events.

Zeros of users' functions are looked for along the straight pieces of an evolution.

Failure modes and answers
-------------------------
- The function is zero where the piece begins, because the piece begins at that event: the search
  begins a little later.
- The function is curved and has two zeros close together: both zeros are found if one of
  :data:`SAMPLES` samples lies between the zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function, evaluated
from pwscont.basics.rounding import EPS
from pwscont.events.user_event import Stop
from pwscont.evolution.memory import Evolver, Moment, Way

#: (state at the loss, states that are left) -> number of the chosen state.
Rule: TypeAlias = Callable[[Array, Sequence[Array]], int]
WORDS = ("nearest", "all")


@final
@dataclass(frozen=True, slots=True)
class Jumps:
    """The rule of jumps.

    Attributes
    ----------
    rule : "nearest", "all", callable or None
        None stops at a loss. "nearest" goes on at the nearest state, each unknown measured by the
        typical magnitude; "all" goes on at every state; a callable is given the state at the loss
        and the other states, and returns the number of the state to go on with.
    """

    rule: Any

    def __post_init__(self) -> None:
        if not (self.rule is None or self.rule in WORDS or callable(self.rule)):
            words = ", ".join(map(repr, WORDS))
            raise InvalidInputError(f"jumps must be {words}, a function or None, got {self.rule!r}")

    def targets(self, evolver: Evolver, moment: Moment) -> list[Moment]:
        """Return the states with which evolutions go on."""
        if self.rule is None:
            return []
        left = list(evolver.elsewhere(moment).moments)
        if self.rule == "all" or not left:
            return left
        return [left[self._chosen(evolver, moment, left)]]

    def _chosen(self, evolver: Evolver, moment: Moment, left: Sequence[Moment]) -> int:
        if not callable(self.rule):
            far = [np.linalg.norm((m.z - moment.z) / evolver.sizes()) for m in left]
            return int(np.argmin(far))
        here = evolver.shown(moment.z, moment.t)
        chosen = self.rule(here, [evolver.shown(m.z, m.t) for m in left])
        if not isinstance(chosen, int | np.integer) or not 0 <= chosen < len(left):
            raise InvalidInputError(
                f"jumps must return a number from 0 to {len(left) - 1}, got {chosen!r}"
            )
        return int(chosen)

    @property
    def in_words(self) -> str:
        """The rule in words."""
        return self.rule if isinstance(self.rule, str) else "the user's"


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
