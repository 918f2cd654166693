"""Labels of marks: beside the marks where there is room, else farther away.

Failure modes and answers
-------------------------
- One label takes the only place of another: marks with few free places come first.
- All places beside a mark are taken, or closer to other marks: the label stands farther away, and a
  line leads there where the label is closer to another mark.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pwscont.basics.arrays import Array
from pwscont.scenes.marks import RADIUS, Mark
from pwscont.scenes.room import Box, Room, is_inside

#: Labels in one diagram at most, and the size of their letters, in points.
MOST_LABELS, LETTERS = 8, 7.0
#: How far labels are from their marks, the nearest first, in units of the distance of a label that
#: stands beside its mark.
DISTANCES = (1.0, 1.4, 2.0, 2.8, 4.0)
#: Points between a label and the frame, on both sides together, where there is room for that.
PAD = 4.0
#: A line to a label comes no closer to another mark than this part of what the marks are apart.
ASIDE = 0.8
#: The line to a label that is closer to another mark.
LEADER: dict[str, Any] = {
    "arrowstyle": "-",
    "color": "0.6",
    "linewidth": 0.5,
    "shrinkA": 0.0,
    "shrinkB": RADIUS,
}


def label_marks(ax: Axes, marks: Sequence[Mark], room: Room) -> None:
    """Write labels at the marks, a few at most, where there is room for them."""
    places = np.array([room.part(mark.at) * room.extent for mark in marks]).reshape(-1, 2)
    labelled = [(mark, at) for mark, at in zip(marks, places, strict=True) if mark.label]
    free = [len(list(_beside(mark, at, places, room))) for mark, at in labelled]
    for i in np.argsort(free, kind="stable")[:MOST_LABELS]:
        mark, at = labelled[i]
        if spot := next(_beside(mark, at, places, room), None):
            room.take(spot[1])
            _write(ax, mark, spot[0] - at, None)
        elif spot := next(_led(mark, at, places, room), None):
            room.take(spot[1])
            _write(ax, mark, spot[0] - at, LEADER)


def _beside(mark: Mark, at: Array, places: Array, room: Room) -> Iterator[tuple[Array, Box]]:
    """Yield free places that are closer to a mark than to any other."""
    others = _others(at, places)
    for middle, box in _free(mark, at, room):
        if (np.linalg.norm(others - middle, axis=1) > np.linalg.norm(at - middle)).all():
            yield middle, box


def _led(mark: Mark, at: Array, places: Array, room: Room) -> Iterator[tuple[Array, Box]]:
    """Yield free places to which a line leads from a mark that does not come close to others."""
    others = _others(at, places)
    close = np.minimum(2.0 * RADIUS, ASIDE * np.linalg.norm(others - at, axis=1))
    for middle, box in _free(mark, at, room):
        if (_distances(at, middle, others) > close).all():
            yield middle, box


def _free(mark: Mark, at: Array, room: Room) -> Iterator[tuple[Array, Box]]:
    """Yield middles (in points) and boxes of free places for a label, the best first."""
    size = LETTERS * np.array([0.62 * len(mark.label), 1.2])
    beside = 0.5 * size + RADIUS + 1.5 * room.cell
    for pad, far, way in product((PAD, 0.0), DISTANCES, _ways(mark.side)):
        middle = at + far * np.array(way) * beside
        box = room.box(middle, size)
        if room.is_free(box) and is_inside(room.box(middle, size + pad)):
            yield middle, box


def _others(at: Array, places: Array) -> Array:
    """Return the places of the marks that are not at a place."""
    others: Array = places[np.abs(places - at).max(axis=1) > RADIUS]
    return others


def _distances(start: Array, end: Array, points: Array) -> Array:
    """Return how far points are from a line between two others."""
    way = end - start
    along = np.clip((points - start) @ way / float(way @ way), 0.0, 1.0)
    apart: Array = np.linalg.norm(points - start - along[:, np.newaxis] * way, axis=1)
    return apart


def _ways(side: int) -> list[tuple[int, int]]:
    """Return directions from a mark, the best first."""
    first = [(side, 0)] if side else []
    return [*first, (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1), (1, 0), (-1, 0)]


def _write(ax: Axes, mark: Mark, off: Array, leader: dict[str, Any] | None) -> None:
    """Write a label at a distance ``off`` from its mark, in points."""
    ax.annotate(
        mark.label,
        (mark.at[0], mark.at[1]),
        (off[0], off[1]),
        textcoords="offset points",
        color="0.2",
        fontsize=LETTERS,
        ha="center",
        va="center",
        zorder=6,
        arrowprops=leader,
    )
