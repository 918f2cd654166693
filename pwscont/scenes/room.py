"""The empty parts of a picture: room for labels and insets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import final

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pwscont.basics.arrays import Array

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
        Its limits are set.

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
        """Return points in parts of the axes, shape (k, 2)."""
        lo, hi = self._limits.T
        parts: Array = (points - lo) / (hi - lo)
        return parts

    @property
    def cell(self) -> Array:
        """Width and height of a cell in points."""
        size: Array = self.extent / CELLS
        return size

    def box(self, middle: Array, size: Array) -> Box:
        """Return the box with this middle and size, both given in points."""
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
        """Return a free box close to a corner, of the first size that has room."""
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
    """Return how far a box is from the nearest corner."""
    left, bottom, width, height = box
    return min(left, 1.0 - left - width) + min(bottom, 1.0 - bottom - height)
