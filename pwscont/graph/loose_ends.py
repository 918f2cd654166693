"""Where branches begin or end within the interval, by which the sum of signs may change.

A vertical piece joins ends at one alpha: they are one end.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import networkx as nx

from pwscont.basics.kind import Kind
from pwscont.graph.records import SpecialPoint
from pwscont.graph.structure import Structure

#: Kinds of points at which a branch may end because the system says so.
ON_PURPOSE = ("end", "event")


def loose_ends(graph: Structure) -> dict[SpecialPoint, int]:
    """Return the points within the interval by which the sum of signs jumps, and how much."""
    jumps, found = _jumps(graph), {}
    for nodes in _joined_by_verticals(graph, [node for node, jump in jumps.items() if jump]):
        points = [graph.point(node) for node in nodes]
        jump = sum(jumps.get(node, 0) for node in nodes)
        if jump and not any(graph.same(points[0].alpha, end) for end in graph.interval):
            found[min(points, key=_suspicion)] = jump
    return found


def _jumps(graph: Structure) -> dict[int, int]:
    """Return by how much the pieces at each node change the sum of signs from left to right."""
    jumps: dict[int, int] = defaultdict(int)
    for piece in graph.pieces:
        first, last = piece.track.start.alpha, piece.track.end.alpha
        sign = piece.det_sign if first < last else -piece.det_sign
        jumps[piece.start] += sign
        jumps[piece.end] -= sign
    return jumps


def _joined_by_verticals(graph: Structure, nodes: Iterable[int]) -> Iterator[set[int]]:
    """Yield nodes, those at the ends of one vertical piece together."""
    joined = nx.Graph((piece.start, piece.end) for piece in graph.verticals)
    joined.add_nodes_from(nodes)
    yield from nx.connected_components(joined)


def _suspicion(point: SpecialPoint) -> int:
    """Sort the points at which pieces end before those where they go on."""
    order = (*ON_PURPOSE, Kind.STOPPED)
    return order.index(point.kind) if point.kind in order else len(order)


def is_on_purpose(graph: Structure, point: SpecialPoint) -> bool:
    """Tell whether branches end at a point because the system says so."""
    return point.kind == Kind.END or (
        point.kind == Kind.EVENT and len(graph.pieces_at(point.id)) == 1
    )
