"""Arguments of the wrong kind, answered in words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pwscont import InvalidInputError


def check_kind(name: str, given: Any, *kinds: type[Any]) -> None:
    """Refuse an argument that is no object of these kinds, such as the class itself.

    Raises
    ------
    InvalidInputError
        Naming the argument, the kinds, and what was given.
    """
    if not isinstance(given, kinds):
        raise InvalidInputError(f"{name} must be an object of {_either(kinds)}, got {given!r}")


def listed(name: str, given: Any, *kinds: type[Any]) -> list[Any]:
    """Return objects of some kinds as a list; refuse other objects as :func:`check_kind` does."""
    items = list(given) if isinstance(given, Iterable) else [None]
    if not all(isinstance(item, kinds) for item in items):
        raise InvalidInputError(
            f"{name} must be a list of objects of {_either(kinds)}, such as "
            f"[{kinds[0].__name__}(...)], got {given!r}"
        )
    return items


def check_number(name: str, given: Any) -> None:
    """Refuse an argument that is no real number, as :func:`check_kind` does."""
    try:
        float(given + 0.0)  # float() alone would take a text
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be a number, got {given!r}") from error


def _either(kinds: tuple[type[Any], ...]) -> str:
    return " or ".join(kind.__name__ for kind in kinds)
