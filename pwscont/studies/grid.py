"""The cases of a study: all combinations of the values of some settings, by number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from math import isfinite, prod
from typing import Any, TypeAlias, final

from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import short

#: The value of a setting.
Setting: TypeAlias = bool | int | float | str
#: Columns of the table of a study beside those of settings and measures.
FIXED = ("case", "proven", "guarantee", "seconds", "failure")


@final
class Grid:
    """All combinations of values, numbered from 0; the last setting changes fastest.

    Parameters
    ----------
    over : mapping of str to iterable
        For each setting its values: numbers, texts or truth values.

    Attributes
    ----------
    values : dict of str to tuple
        The values of each setting.

    Raises
    ------
    InvalidInputError
        If there is no setting, a setting has no values, one that is not finite, or one twice.
    """

    def __init__(self, over: Mapping[str, Iterable[Any]]) -> None:
        if not isinstance(over, Mapping) or not over:
            raise InvalidInputError(f"over must map settings to their values, got {over!r}")
        self.values = {checked_column("over", name): _values(name, over[name]) for name in over}

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values of each setting."""
        return tuple(map(len, self.values.values()))

    def __len__(self) -> int:
        """Return the number of cases."""
        return prod(self.shape)

    def settings(self, number: int) -> dict[str, Setting]:
        """Return the settings of a case."""
        found: dict[str, Setting] = {}
        for name, values in reversed(self.values.items()):
            number, place = divmod(number, len(values))
            found[name] = values[place]
        return {name: found[name] for name in self.values}


def checked_column(what: str, name: Any) -> str:
    """Return the name of a setting or a measure, or say why the table cannot have such a column."""
    if not isinstance(name, str) or not name:
        raise InvalidInputError(f"{what}: names are texts that are not empty, got {name!r}")
    if name in FIXED:
        raise InvalidInputError(f"{what}: the name {name!r} is that of another column")
    return name


def _values(name: str, given: Any) -> tuple[Setting, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        words = f"over {name!r} must be several values, as in [0.1, 0.2], got"
        raise InvalidInputError(f"{words} {short(repr(given))}")
    values = tuple(_plain(name, value) for value in given)
    if not values:
        raise InvalidInputError(f"over {name!r} is empty: give at least one value")
    twice = [value for value, times in Counter(values).items() if times > 1]
    if twice:
        raise InvalidInputError(f"over {name!r} has the value {twice[0]!r} twice")
    return values


def _plain(name: str, value: Any) -> Setting:
    """Return a value as a plain Python object, which files and processes keep unchanged."""
    plain = value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value
    finite = isinstance(plain, float) and isfinite(plain)
    if not (finite or isinstance(plain, bool | int | str)):
        words = f"over {name!r}: values are finite numbers, texts, True or False, got"
        raise InvalidInputError(f"{words} {short(repr(value))}")
    return plain  # type: ignore[no-any-return]
