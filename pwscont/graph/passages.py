"""What is said where a special point is passed, for both orientations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from pwscont.basics.character import Character
from pwscont.system.system import PiecewiseSystem

#: Orientation, +1 or -1 -> message.
Passage = Callable[[int], str]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """Two messages, or one for both orientations."""

    forward: str
    backward: str | None = None

    def __call__(self, orientation: int) -> str:
        """Return the message for an orientation."""
        return self.forward if orientation > 0 or self.backward is None else self.backward


@final
@dataclass(slots=True, eq=False)
class Begun:
    """That tracing began inside a cell, put into words when it is asked for.

    Attributes
    ----------
    system : PiecewiseSystem
        Has the words.
    character : Character
    """

    system: PiecewiseSystem
    character: Character

    def __call__(self, orientation: int) -> str:
        """Return the message."""
        return f"start in {self.system.label(self.character)}"

    def __reduce__(self) -> tuple[type[Said], tuple[str]]:
        return Said, (self(1),)  # copies, also in other processes, have no system


@final
@dataclass(slots=True, eq=False)
class Change:
    """What changes from one cell to another, put into words when it is asked for.

    Attributes
    ----------
    system : PiecewiseSystem
        Has the words.
    before, after : Character
        The cells in the order of the positive orientation.
    note : str
        What else is known.
    """

    system: PiecewiseSystem
    before: Character
    after: Character
    note: str = ""

    def __call__(self, orientation: int) -> str:
        """Return the message for an orientation."""
        cells = (self.before, self.after) if orientation > 0 else (self.after, self.before)
        change = self.system.describe_transition(*cells)
        return f"{change}; {self.note}" if self.note else change

    def __reduce__(self) -> tuple[type[Said], tuple[str, str]]:
        return Said, (self(1), self(-1))  # copies, also in other processes, have no system
