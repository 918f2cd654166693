"""Entries of a JSON object, each taken out with its type: the file may have been edited by hand."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, isnan
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array


class DamagedError(Exception):
    """An entry of a file is missing or of the wrong type; the message names it."""


@final
@dataclass(frozen=True, slots=True)
class Fields:
    """A JSON object, and its name in messages.

    All methods raise :class:`DamagedError` where an entry is missing or of another type.

    Parameters
    ----------
    name : str
        Such as ``"node 3"``.
    data : object
        The value read from the file; refused if it is no JSON object.
    """

    name: str
    data: Any

    def __post_init__(self) -> None:
        if not isinstance(self.data, dict):
            raise DamagedError(f"{self.name} is no JSON object")

    def has(self, key: str) -> bool:
        """Tell whether there is an entry, for entries that older files lack."""
        return key in self.data

    def entry(self, key: str) -> Any:
        """Return an entry of any type."""
        if key not in self.data:
            raise DamagedError(f"{self.name} has no {key}")
        return self.data[key]

    def integer(self, key: str, least: int) -> int:
        """Return a whole number that is not below ``least``."""
        value = self.entry(key)
        if type(value) is not int or value < least:
            raise self._unfit(key, f"a whole number from {least} on")
        return value

    def number(self, key: str) -> float:
        """Return a number, which may be infinite."""
        value = _number(self.entry(key))
        if value is None or isnan(value):
            raise self._unfit(key, "a number")
        return value

    def finite(self, key: str) -> float:
        """Return a finite number."""
        value = self.number(key)
        if not isfinite(value):
            raise self._unfit(key, "finite")
        return value

    def finite_or_text(self, key: str) -> float | str:
        """Return a finite number, or a text."""
        return self.text(key) if isinstance(self.entry(key), str) else self.finite(key)

    def text(self, key: str) -> str:
        """Return a text."""
        value = self.entry(key)
        if not isinstance(value, str):
            raise self._unfit(key, "a text")
        return value

    def word(self, key: str) -> str:
        """Return a text that is not empty."""
        text = self.text(key)
        if not text:
            raise DamagedError(f"{key} of {self.name} must not be empty")
        return text

    def items(self, key: str, length: int | None = None) -> list[Any]:
        """Return a list."""
        value = self.entry(key)
        if not isinstance(value, list) or (length is not None and len(value) != length):
            raise self._unfit(key, "a list" if length is None else f"a list of {length}")
        return value

    def numbers(self, key: str) -> Array:
        """Return a list of numbers."""
        values = self.items(key)
        if set(map(type, values)) - {float}:
            values = [_number(value) for value in values]
        if None in values:
            raise self._unfit(key, "a list of numbers")
        return np.array(values, dtype=float)

    def objects(self, key: str) -> list[Fields]:
        """Return a list of JSON objects, named by their place in the list."""
        return [Fields(f"entry {i} of {key}", item) for i, item in enumerate(self.items(key))]

    def _unfit(self, key: str, what: str) -> DamagedError:
        return DamagedError(f"{key} of {self.name} must be {what}, got {str(self.data[key])[:40]}")


def _number(value: Any) -> float | None:
    """Return a JSON number as a float, None if it is none or too large for one."""
    if type(value) not in (int, float):
        return None
    try:
        return float(value)
    except OverflowError:
        return None
