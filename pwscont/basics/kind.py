"""Kinds of special points."""

from enum import StrEnum
from typing import final


@final
class Kind(StrEnum):
    """The kind of a special point; its value is the word that users read and query by."""

    START = "start"
    END = "end"
    TRANSITION = "transition"
    NONSMOOTH_FOLD = "nonsmooth fold"
    FOLD = "fold"
    BRANCH_POINT = "branch point"
    CORNER = "corner"
    PARTIAL_CORNER = "corner searched in part"
    NONSMOOTH_BRANCH_POINT = "nonsmooth branch point"
    DEGENERATE = "degenerate"
    ISOLATED = "isolated solution"
    EVENT = "event"
    STOPPED = "stopped"


def kind_of(word: str) -> Kind | str:
    """Return the kind with this word, or the word itself where a detector of a user made it."""
    return Kind(word) if word in set(Kind) else word
