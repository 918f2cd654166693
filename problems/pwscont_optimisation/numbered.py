"""Names that a user gives, or default names with numbers."""

from __future__ import annotations

from collections.abc import Sequence

from pwscont import InvalidInputError


def numbered(what: str, given: Sequence[str] | None, word: str, count: int) -> tuple[str, ...]:
    """Return the given names, or the word with numbers from 1 on.

    Raises
    ------
    InvalidInputError
        If there are more or fewer names than ``count``; the message calls the names ``what``.
    """
    names = tuple(given) if given is not None else tuple(f"{word}{i + 1}" for i in range(count))
    if len(names) != count:
        raise InvalidInputError(f"{what} must be {count} texts, got {len(names)}")
    return names
