"""Special points that are events as well: a transition, a fold or an end may be one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from pwscont.basics.arrays import Array
from pwscont.basics.kind import Kind
from pwscont.curve.metric import Metric
from pwscont.graph import Piece, SpecialPoint
from pwscont.transitions.events import Events


def named_by_events(
    points: Sequence[SpecialPoint], pieces: Sequence[Piece], metric: Metric, events: Events
) -> list[SpecialPoint]:
    """Return special points with the names of the events that are zero there."""
    beyond: dict[int, list[Array]] = defaultdict(list)
    for piece in pieces:
        first, last = _inside(piece)
        beyond[piece.start].append(first)
        beyond[piece.end].append(last)
    return [
        point if point.kind == Kind.EVENT else _named(point, beyond[point.id], metric, events)
        for point in points
    ]


def _inside(piece: Piece) -> tuple[Array, Array]:
    """Return the points of a piece next to its ends; of a straight one both are its middle."""
    points = piece.points
    if len(points) == 2:
        middle: Array = 0.5 * (points[0] + points[1])
        return middle, middle
    return points[1], points[-2]


def _named(
    point: SpecialPoint, beyond: Sequence[Array], metric: Metric, events: Events
) -> SpecialPoint:
    names = events.names_at(metric, point.place.x, point.error, beyond)
    return replace(point, events=", ".join(filter(None, [point.events, names])))
