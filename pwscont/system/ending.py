"""Systems whose equations mean nothing beyond some of their interfaces."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.system.system import PiecewiseSystem


class Ending(ABC):
    """A system whose curves end at some interfaces, as the locus of a transition does."""

    __slots__ = ()

    @abstractmethod
    def end(self, character: Character, tests: frozenset[int]) -> str | None:
        """Return why a curve in this cell ends where all of ``tests`` vanish.

        None where it goes on in another cell. A corner where the curve of one cell ends is the end
        of all curves that meet there; from a start at a corner, the curve of every cell is
        followed, and none goes on as another.
        """


def end_of(system: PiecewiseSystem, character: Character, tests: frozenset[int]) -> str | None:
    """Return why a curve of a system ends where ``tests`` vanish, None where it does not."""
    why = system.end(character, tests) if isinstance(system, Ending) else None
    if not (why is None or isinstance(why, str)):
        raise InvalidSystemError(
            f"{type(system).__name__}.end must return why a curve ends, a text, or None where it "
            f"goes on, got {why!r}"
        )
    return why
