"""Whether the parts of a graph that was read fit each other."""

from __future__ import annotations

from collections.abc import Sequence

from pwscont.basics.rounding import SAME_ALPHA
from pwscont.graph.fields import DamagedError
from pwscont.graph.records import Piece, SpecialPoint


def check_references(
    points: Sequence[SpecialPoint], pieces: Sequence[Piece], starts: Sequence[SpecialPoint]
) -> None:
    """Refuse numbers that stand twice, and pieces and starts that refer to nothing."""
    nodes, known = {point.id for point in points}, {piece.id for piece in pieces}
    if len(nodes) < len(points) or len(known) < len(pieces) or -1 in nodes:
        raise DamagedError("each node and each piece needs an id of its own, from 0 on")
    for piece in pieces:
        if not {piece.start, piece.end} <= nodes:
            raise DamagedError(f"piece {piece.id} begins or ends at a node that is not there")
    for start in starts:
        if start.piece not in known:
            raise DamagedError(f"a start lies on piece {start.piece}, which is not there")


def check_places(
    points: Sequence[SpecialPoint], pieces: Sequence[Piece], interval: tuple[float, float]
) -> None:
    """Refuse points outside the interval, and characters of different lengths."""
    slack = SAME_ALPHA * max(*map(abs, interval), interval[1] - interval[0])
    lo, hi = interval[0] - slack, interval[1] + slack
    for point in points:
        if not lo <= point.alpha <= hi:
            raise DamagedError(f"node {point.id} lies outside the interval: {point.alpha}")
    for piece in pieces:
        if not (lo <= piece.interval[0] and piece.interval[1] <= hi):
            raise DamagedError(f"piece {piece.id} leaves the interval: {piece.interval}")
    if len({len(bytes(piece.character)) for piece in pieces}) > 1:
        raise DamagedError("pieces have different numbers of signs")
