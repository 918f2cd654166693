"""Labels of marks, and the empty parts of a picture.

Failure modes and answers
-------------------------
- A label takes the only free place of another mark: marks with few free places come first.
- All places beside a mark are taken, or closer to other marks: the label stands farther away, and a
  line leads to any label that is closer to another mark.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import Any, final

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pwscont.extending import Array
from pwscont.scenes.marks import RADIUS, Mark

#: Number of cells of a picture, across and up.
CELLS = np.array([120, 80])
#: A line occupies all cells up to this number of cells away.
CLOSE = 1

#: Left, bottom, width and height, as parts of the axes.
Box = tuple[float, float, float, float]


@final
class Room:
    """The free cells of an axes, in which nothing is drawn.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes whose limits are set.

    Attributes
    ----------
    extent : ndarray, shape (2,)
        Width and height in points.
    """

    def __init__(self, ax: Axes) -> None:
        box = ax.get_window_extent()
        self.extent: Array = 72.0 / ax.figure.dpi * np.array([box.width, box.height])
        self._limits = np.array([ax.get_xlim(), ax.get_ylim()])
        self._is_taken = np.zeros(CELLS, dtype=bool)

    def part(self, points: Array) -> Array:
        """Return points, shape (k, 2), as parts of the axes."""
        lo, hi = self._limits.T
        parts: Array = (points - lo) / (hi - lo)
        return parts

    @property
    def cell(self) -> Array:
        """Width and height of a cell in points."""
        size: Array = self.extent / CELLS
        return size

    def box(self, middle: Array, size: Array) -> Box:
        """Return the box, in parts of the axes, from middle and size in points."""
        left, bottom = (middle - 0.5 * size) / self.extent
        width, height = size / self.extent
        return float(left), float(bottom), float(width), float(height)

    def draw(self, lines: Iterable[Array]) -> None:
        """Occupy the cells along lines, each of shape (k, 2)."""
        for line in lines:
            cells = np.clip(self.part(line), -0.5, 1.5) * CELLS
            steps = np.abs(np.diff(cells, axis=0)).max(axis=1)
            along = np.append(0.0, np.cumsum(steps))
            fine = np.linspace(0.0, along[-1], 2 + int(2.0 * along[-1]))
            self._take_cells(np.column_stack([np.interp(fine, along, x) for x in cells.T]))

    def _take_cells(self, points: Array) -> None:
        cells = np.floor(points).astype(int)
        for i, j in np.ndindex(2 * CLOSE + 1, 2 * CLOSE + 1):
            near = cells + np.array([i, j]) - CLOSE
            inside = ((near >= 0) & (near < CELLS)).all(axis=1)
            self._is_taken[tuple(near[inside].T)] = True

    def is_free(self, box: Box) -> bool:
        """Tell whether a box lies in the axes and is empty."""
        return is_inside(box) and not self._cells(box).any()

    def take(self, box: Box) -> None:
        """Occupy the cells of a box."""
        self._cells(box)[...] = True

    def _cells(self, box: Box) -> npt.NDArray[np.bool_]:
        left, bottom, width, height = box
        first = np.floor(np.array([left, bottom]) * CELLS).astype(int).clip(0)
        last = np.ceil(np.array([left + width, bottom + height]) * CELLS).astype(int).clip(0)
        return self._is_taken[first[0] : last[0], first[1] : last[1]]

    def largest(self, sizes: Iterable[tuple[float, float]]) -> Box | None:
        """Return a free box close to a corner, of the first size that fits, else None."""
        for width, height in sizes:
            across, up = (np.linspace(0.0, 1.0 - part, 12) for part in (width, height))
            spots = [(float(x), float(y), width, height) for x in across for y in up]
            free = [box for box in spots if self.is_free(box)]
            if free:
                return min(free, key=_off_corner)
        return None


def is_inside(box: Box) -> bool:
    """Tell whether a box lies in the axes."""
    left, bottom, width, height = box
    return min(left, bottom) >= 0.0 and left + width <= 1.0 and bottom + height <= 1.0


def _off_corner(box: Box) -> float:
    """Return the distance of a box from the nearest corner, in parts of the axes."""
    left, bottom, width, height = box
    return min(left, 1.0 - left - width) + min(bottom, 1.0 - bottom - height)


#: Largest number of labels in a diagram, and the size of the letters in points.
MOST_LABELS, LETTERS = 8, 7.0
#: Distances of labels from marks that are tried in turn, in units of the distance of a label right
#: beside the mark.
DISTANCES = (1.0, 1.4, 2.0, 2.8, 4.0)
#: Points between a label and the frame, left and right together, if there is room.
PAD = 4.0
#: A line to a label comes no closer to another mark than this part of the distance of the marks.
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
    """Write labels at marks, at most ``MOST_LABELS``, where there is room, equal labels once."""
    places = np.array([room.part(mark.at) * room.extent for mark in marks]).reshape(-1, 2)
    labelled: list[tuple[Mark, Array]] = []
    for mark, at in zip(marks, places, strict=True):
        alike = [there for other, there in labelled if other.label == mark.label]
        if mark.label and all(np.abs(at - there).max() > RADIUS for there in alike):
            labelled.append((mark, at))
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
    """Yield free places for a label that are closer to the mark than to any other mark."""
    others = _others(at, places)
    for middle, box in _free(mark, at, room):
        if (np.linalg.norm(others - middle, axis=1) > np.linalg.norm(at - middle)).all():
            yield middle, box


def _led(mark: Mark, at: Array, places: Array, room: Room) -> Iterator[tuple[Array, Box]]:
    """Yield free places for a label to which a line leads without coming close to other marks."""
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
    """Return the places of the marks except the mark at ``at``."""
    others: Array = places[np.abs(places - at).max(axis=1) > RADIUS]
    return others


def _distances(start: Array, end: Array, points: Array) -> Array:
    """Return the distances of points from the line between ``start`` and ``end``."""
    way = end - start
    along = np.clip((points - start) @ way / float(way @ way), 0.0, 1.0)
    apart: Array = np.linalg.norm(points - start - along[:, np.newaxis] * way, axis=1)
    return apart


def _ways(side: int) -> list[tuple[int, int]]:
    """Return directions (across, up) from a mark, the best first."""
    first = [(side, 0)] if side else []
    return [*first, (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1), (1, 0), (-1, 0)]


def _write(ax: Axes, mark: Mark, off: Array, leader: dict[str, Any] | None) -> None:
    """Write the label of a mark at a distance ``off`` from the mark, in points."""
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
