"""Guarantees: the promises of searches, in the words that users read."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import final


@final
class Guarantee(IntEnum):
    """How much of the zero set a search finds; larger is more.

    UNIQUE is the system's own promise: at every alpha one solution at most.
    """

    NOTHING = 0
    BUT_LOOPS = 1
    EVERYTHING = 2
    UNIQUE = 3


@final
@dataclass(frozen=True, slots=True)
class SearchScope:
    """The searches of a run, and the promise that they make.

    Attributes
    ----------
    what : str
        The searches, in words.
    promise : Guarantee
    spent : str
        Why the run ended before it was finished, in words; empty where it was finished.
    gap : float
        Distance along a curve within which two smooth folds may be passed over, where alpha is
        measured by the interval and each unknown by its typical magnitude; zero where none may.
    """

    what: str
    promise: Guarantee
    spent: str = ""
    gap: float = 0.0

    @property
    def unseen(self) -> str:
        """What may have been passed over on the pieces that were followed; empty where nothing."""
        if not self.gap:
            return ""
        return f"two smooth folds closer together along a curve than {self.gap:.2g} of the interval"
