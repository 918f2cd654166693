"""Where an evolution goes on after the loss of a solution, by a rule that the user names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.evolution.ways import Evolver, Moment

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
