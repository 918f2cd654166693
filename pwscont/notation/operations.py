"""What switches do: the branches between which each chooses, in words and inequalities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """A kind of switch: with k tests it takes branch j where j of the tests are not negative.

    Attributes
    ----------
    name : str
    modes : tuple of str, length k + 1
        What a switch does in each mode.
    changes : dict of (int, int) to str
        What happens to it from one mode to another.
    sides : tuple of int, length k + 1
        +1 or -1 where its value is never below, or never above, that branch, whatever the mode.
    """

    name: str
    modes: tuple[str, ...]
    changes: dict[tuple[int, int], str]
    sides: tuple[int, ...]

    def __reduce__(self) -> str:
        """Return the name by which a pickle finds it: there is one of each, told by identity."""
        return next(name for name, value in globals().items() if value is self)


def _there_and_back(forth: str, back: str) -> dict[tuple[int, int], str]:
    return {(0, 1): forth, (1, 0): back}


_FIRST, _SECOND = "takes its first argument", "takes its second argument"
MAX = Operation("max", ("second", "first"), _there_and_back(_FIRST, _SECOND), (1, 1))
MIN = Operation("min", ("first", "second"), _there_and_back(_SECOND, _FIRST), (-1, -1))
ABS = Operation(
    "abs",
    ("negative", "positive"),
    _there_and_back("becomes positive", "becomes negative"),
    (1, 1),
)
RELU = Operation("relu", ("off", "on"), _there_and_back("turns on", "turns off"), (1, 1))
WHERE = Operation("where", ABS.modes, ABS.changes, (0, 0))
LOWER = Operation(
    "clip",
    ("at its lower bound", "above its lower bound"),
    _there_and_back("leaves its lower bound", "reaches its lower bound"),
    (1, 1),
)
UPPER = Operation(
    "clip",
    ("below its upper bound", "at its upper bound"),
    _there_and_back("reaches its upper bound", "leaves its upper bound"),
    (-1, -1),
)
CLIP = Operation(
    "clip",
    ("at its lower bound", "between its bounds", "at its upper bound"),
    {
        (0, 1): "leaves its lower bound",
        (1, 0): "reaches its lower bound",
        (1, 2): "reaches its upper bound",
        (2, 1): "leaves its upper bound",
        (0, 2): "goes from its lower to its upper bound",
        (2, 0): "goes from its upper to its lower bound",
    },
    (1, 0, -1),
)
