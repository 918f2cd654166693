"""Ends of branches within the interval: there the sum of signs may change.

The ends that a vertical piece joins count as one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

from pwscont.basics.kind import Kind
from pwscont.basics.outcome import ON_BOUND
from pwscont.graph.connected import connected
from pwscont.graph.records import SpecialPoint
from pwscont.graph.structure import Structure

#: Kinds of points at which a branch may end because the system or the user ends it.
ON_PURPOSE = ("end", "event")


def loose_ends(graph: Structure) -> dict[SpecialPoint, int]:
    """Return the points within the interval at which the sum of signs jumps, and the jumps."""
    jumps, found = _jumps(graph), {}
    for nodes in _joined_by_verticals(graph, [node for node, jump in jumps.items() if jump]):
        points = [graph.point(node) for node in nodes]
        jump = sum(jumps.get(node, 0) for node in nodes)
        if jump and not any(graph.same(points[0].alpha, end) for end in graph.interval):
            found[min(points, key=_suspicion)] = jump
    return found


def _jumps(graph: Structure) -> dict[int, int]:
    """Return by how much the sum of signs grows from left to right at each node."""
    jumps: dict[int, int] = defaultdict(int)
    for piece in graph.pieces:
        first, last = piece.track.start.alpha, piece.track.end.alpha
        sign = piece.det_sign if first < last else -piece.det_sign
        jumps[piece.start] += sign
        jumps[piece.end] -= sign
    return jumps


def _joined_by_verticals(graph: Structure, nodes: Iterable[int]) -> Iterator[set[int]]:
    """Yield sets of nodes: those joined by vertical pieces together, the others alone."""
    yield from connected(nodes, ((piece.start, piece.end) for piece in graph.verticals))


def _suspicion(point: SpecialPoint) -> int:
    """Return a key that sorts points: ends on purpose, then stops, then the others."""
    order = (*ON_PURPOSE, Kind.STOPPED)
    return order.index(point.kind) if point.kind in order else len(order)


def is_on_purpose(graph: Structure, point: SpecialPoint) -> bool:
    """Tell whether branches end at a point because the system or the user ends them."""
    ends = point.kind == Kind.EVENT and len(graph.pieces_at(point.id)) == 1
    return point.kind == Kind.END or ends or ON_BOUND in point.message
