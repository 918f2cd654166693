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
#: The methods of all of them.
METHODS = [(name, ability) for ability in ABILITIES for name in sorted(ability.__abstractmethods__)]


def check_abilities(system: PiecewiseSystem) -> None:
    """Refuse a method that would never be called, for the system does not say that it has it.

    Raises
    ------
    InvalidSystemError
    """
    kind = type(system)
    for method, ability in METHODS:
        if callable(getattr(kind, method, None)) and not isinstance(system, ability):
            raise InvalidSystemError(
                f"{kind.__name__}.{method} would never be called, for {kind.__name__} does not "
                f"derive from pwscont.extending.{ability.__name__}: let it, or give the method "
                "another name"
            )
