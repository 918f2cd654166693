"""Groups of nodes that are joined, directly or through further nodes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import final


@final
class Joined:
    """Groups of nodes, merged pair by pair."""

    def __init__(self, pairs: Iterable[tuple[str, str]] = ()) -> None:
        self._next: dict[str, str] = {}
        for pair in pairs:
            self.join(*pair)

    def join(self, one: str, other: str) -> bool:
        """Merge the groups of two nodes; return whether the groups were apart."""
        one, other = self._last(one), self._last(other)
        if one != other:
            self._next[one] = other
        return one != other

    def are(self, *nodes: str) -> bool:
        """Tell whether all given nodes are in the same group."""
        return len({self._last(node) for node in nodes}) == 1

    def _last(self, node: str) -> str:
        while node in self._next:
            after = self._next[node]
            self._next[node] = self._next.get(after, after)  # halves the way for the next time
            node = after
        return node
