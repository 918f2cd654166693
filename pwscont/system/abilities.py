"""What a system may do beside what every system does, and is asked for only if it says so."""

from __future__ import annotations

from functools import lru_cache

from pwscont.basics.errors import InvalidSystemError
from pwscont.system.compact import Compact
from pwscont.system.ending import Ending
from pwscont.system.hidden import HidesUnknowns
from pwscont.system.own_searches import BringsSearches
from pwscont.system.reduction import Reducible
from pwscont.system.system import PiecewiseSystem

ABILITIES = (Ending, Reducible, Compact, BringsSearches, HidesUnknowns)


@lru_cache(maxsize=64)  # no more than that of classes that nobody uses any more are kept
def check_abilities(kind: type[PiecewiseSystem]) -> None:
    """Refuse a method that would never be called, for its class does not say that it has it.

    Raises
    ------
    InvalidSystemError
    """
    for ability in ABILITIES:
        for method in sorted(ability.__abstractmethods__):
            if callable(getattr(kind, method, None)) and not issubclass(kind, ability):
                name = kind.__name__
                raise InvalidSystemError(
                    f"{name}.{method} would never be called, for {name} does not derive from "
                    f"pwscont.extending.{ability.__name__}: let it, or give the method another name"
                )
