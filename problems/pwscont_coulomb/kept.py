"""A few values that are asked for again and again."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

Key = TypeVar("Key")
Value = TypeVar("Value")


@final
class Kept(dict[Key, Value]):
    """Values by all that they depend on, of which no more than ``most`` are kept."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self._last: tuple[Key, Value] | None = None

    def __reduce__(self) -> tuple[type[Kept[Key, Value]], tuple[int]]:
        """Leave the values behind in copies, also those for other processes."""
        return Kept, (self._most,)

    def of(self, key: Key, make: Callable[[Key], Value]) -> Value:
        """Return the value of a key; the last one that was asked for is known without comparing."""
        last = self._last
        if last is None or last[0] is not key:
            value = self[key] if key in self else self._put(key, make(key))
            self._last = last = key, value
        return last[1]

    def _put(self, key: Key, value: Value) -> Value:
        """Keep a value, instead of all others if there are too many, and return it."""
        if len(self) >= self._most:
            self.clear()
        self[key] = value
        return value
