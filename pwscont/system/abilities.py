"""What a system may do beside what every system does, and is asked for only if it says so."""

from __future__ import annotations

from pwscont.basics.errors import InvalidSystemError
from pwscont.system.compact import Compact
from pwscont.system.ending import Ending
from pwscont.system.hidden import HidesUnknowns
from pwscont.system.own_searches import BringsSearches
from pwscont.system.reduction import Reducible
from pwscont.system.system import PiecewiseSystem

ABILITIES = (Ending, Reducible, Compact, BringsSearches, HidesUnknowns)


def check_abilities(system: PiecewiseSystem) -> None:
    """Refuse a method that would never be called, for the system does not say that it has it.

    Raises
    ------
    InvalidSystemError
    """
    for ability in ABILITIES:
        for method in sorted(ability.__abstractmethods__):
            given = getattr(type(system), method, None)
            if callable(given) and not isinstance(system, ability):
                kind = type(system).__name__
                raise InvalidSystemError(
                    f"{kind}.{method} would never be called, for {kind} does not derive from "
                    f"pwscont.extending.{ability.__name__}: let it, or give the method another name"
                )
