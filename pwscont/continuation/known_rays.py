"""The rays that leave known nodes, by the cells in which they may be met.

Failure modes and answers
-------------------------
- At a branch point several rays of one cell leave one place: the best aligned one is it.
- Special points are closer than places are told apart by digits: of several, only errors tell that
  they are this place. A walk that has never left that distance may have passed some of them: only
  errors tell whether it has come back to any.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import NamedTuple, final

from pwscont.continuation.ray_keys import RayKey
from pwscont.transitions.rays import Ray


class KnownRay(NamedTuple):
    """A ray of a node: the numbers of both, and its key."""

    node: int
    number: int
    key: RayKey


@final
class KnownRays:
    """All rays on which walks may arrive."""

    def __init__(self) -> None:
        self._by_cell: dict[bytes, list[KnownRay]] = defaultdict(list)

    def add(self, node: int, keys: Iterable[RayKey], first: int = 0) -> None:
        """Let walks arrive at a node, by these keys of its rays, numbered from ``first`` on."""
        for number, key in enumerate(keys, start=first):
            for cell in key.names:
                self._by_cell[cell].append(KnownRay(node, number, key))

    def nodes_in(self, cell: bytes) -> set[int]:
        """Return the nodes that rays in a cell leave."""
        return {known.node for known in self._by_cell.get(cell, ())}

    def match(self, ray: Ray, key: RayKey, left: KnownRay | None = None) -> KnownRay | None:
        """Return the known ray that a ray is, None if it is a new one.

        Parameters
        ----------
        ray : Ray
        key : RayKey
            Its key.
        left : KnownRay or None
            The ray that a walk has followed without ever being clearly away from its node; it is
            not the one that goes on where the walk arrives, and digits tell nothing then.
        """
        found = [
            (cosine, known)
            for cell in key.names
            for known in self._by_cell.get(cell, ())
            if (cosine := known.key.alignment(ray, key)) > 0.0
        ]
        return _best(found, ray, left) if found else None  # nearly always


def _best(found: list[tuple[float, KnownRay]], ray: Ray, left: KnownRay | None) -> KnownRay | None:
    """Return the best aligned ray of those with the same cell and, by digits, the same place."""
    if left or len({known.node for _, known in found}) > 1:
        surely = [one for one in found if _is_surely(one[1].key, ray)]
        found = [one for one in surely if one[1].key is not left.key] if left else surely or found
    if len({known.node for _, known in found}) > 1:
        nearest = min((known for _, known in found), key=lambda known: _distance(known.key, ray))
        found = [one for one in found if one[1].node == nearest.node]
    return max(found, key=lambda one: one[0])[1] if found else None


def _distance(key: RayKey, ray: Ray) -> float:
    """Return how far a ray starts from the place of a key."""
    metric = ray.curve.metric
    return metric.norm(metric.difference(key.place.x, ray.state.x))


def _is_surely(key: RayKey, ray: Ray) -> bool:
    """Tell whether a ray starts at the place of a key by the errors of both, not by digits."""
    return key.is_within(ray.curve.metric, ray.state.x, ray.state.size)
