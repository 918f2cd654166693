"""A few values that are asked for again and again."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

Key = TypeVar("Key")
Value = TypeVar("Value")


@final
class Kept(dict[Key, Value]):
    """Values by key, the key being everything a value depends on; at most ``most`` are kept."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self._last: tuple[Key, Value] | None = None

    def __reduce__(self) -> tuple[type[Kept[Key, Value]], tuple[int]]:
        """Leave the values behind in copies, including copies for other processes."""
        return Kept, (self._most,)

    def of(self, key: Key, make: Callable[[Key], Value]) -> Value:
        """Return the value of a key; the last key is recognised without comparing contents."""
        last = self._last
        if last is None or last[0] is not key:
            value = self[key] if key in self else self._put(key, make(key))
            self._last = last = key, value
        return last[1]

    def _put(self, key: Key, value: Value) -> Value:
        """Keep and return a value; drop all other values if there are too many."""
        if len(self) >= self._most:
            self.clear()
        self[key] = value
        return value
