"""The numbers of a view: every point of a piece once, with all unknowns and recorded quantities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import BranchGraph
from pwscont.extending import (
    CONFIDENCE,
    DUST,
    SAME_ALPHA,
    Array,
    Indices,
    Piece,
    Quantities,
    SpecialPoint,
    fine_points,
)
from pwscont.scenes.strokes import APART, FINER, Smooth, is_straight, length_along

#: Most numbers of a file, so that a page stays small: eight bytes each, a third more as text.
MOST_NUMBERS = 400_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Rows of numbers, and the rows that belong to each piece and special point.

    Attributes
    ----------
    names : tuple of str
        The names of the columns: the parameter, the unknowns, the recorded quantities.
    unknowns : int
        The number of columns that are unknowns.
    rows : ndarray, shape (r, 1 + n + m)
        The numbers; nan where a recorded quantity failed.
    pieces : list of ndarray of int
        The rows of each piece, from start to end.
    points : ndarray of int
        The row of each special point.
    """

    names: tuple[str, ...]
    unknowns: int
    rows: Array
    pieces: list[Indices]
    points: Indices

    @classmethod
    def of(cls, graph: BranchGraph) -> Numbers:
        """Return the numbers of a graph; curved pieces get points of a smooth curve."""
        finer = _finer(graph)
        lines = [_line(graph, piece, finer) for piece in graph.pieces]
        points = [_point(graph, point) for point in graph.special_points()]
        names = (graph.parameter, *graph.names, *graph.quantities.record)
        every = np.vstack([np.zeros((0, len(names))), *lines, *points])
        rows, place = np.unique(every, axis=0, return_inverse=True)
        ends = np.cumsum([len(line) for line in lines], dtype=int)
        *pieces, rest = np.split(place.ravel(), ends)
        return cls(names, len(graph.names), rows, pieces, rest)

    @property
    def states(self) -> Array:
        """The solutions (z, alpha) of all rows, shape (r, n + 1)."""
        return np.roll(self.rows[:, : self.unknowns + 1], -1, axis=1)

    @property
    def along(self) -> list[Array]:
        """The strictly increasing lengths along each piece, at the rows of the piece."""
        return [_increasing(length_along(self.states[rows])) for rows in self.pieces]

    @property
    def largest(self) -> Array:
        """The largest magnitude of each column."""
        largest: Array = np.nan_to_num(np.abs(self.rows)).max(axis=0, initial=0.0)
        return largest

    def dust(self, graph: BranchGraph) -> Array:
        """Return for each column the largest magnitude that counts as rounding.

        An unknown that is zero throughout has no magnitude to compare with, but has an estimated
        error.
        """
        dust = DUST * self.largest
        errors = [point.error[:-1] for point in graph.special_points() if len(point.error)]
        if errors:
            unknowns = slice(1, 1 + self.unknowns)
            least = np.nan_to_num(np.min(errors, axis=0), posinf=0.0)
            dust[unknowns] = np.maximum(dust[unknowns], CONFIDENCE * least)
        dust[0] = SAME_ALPHA * np.ptp(graph.interval)
        return dust

    def fitting(self, wanted: Sequence[str]) -> Indices:
        """Return the numbers of the columns that fit into a file, wanted columns first."""
        most = max(MOST_NUMBERS // max(len(self.rows), 1), 2 + len(wanted))
        first = [0, *(self.names.index(name) for name in wanted)]
        recorded = range(1 + self.unknowns, len(self.names))
        order = dict.fromkeys([*first, *recorded, *range(len(self.names))])
        return np.sort(np.array(list(order)[:most], dtype=int))


def is_curved(piece: Piece) -> bool:
    """Tell whether a piece has points between the ends."""
    return len(piece.points) > 2


def _finer(graph: BranchGraph) -> int:
    """Return the number of parts into which steps of pieces are cut, ``FINER`` if room allows."""
    record = graph.quantities.record
    cut = [piece for piece in graph.pieces if is_curved(piece) or record]
    rows = sum(len(piece.points) for piece in cut)
    columns = 1 + len(graph.names) + len(record)
    return int(np.clip(MOST_NUMBERS // max(rows * columns, 1), 1, FINER))


def _line(graph: BranchGraph, piece: Piece, finer: int) -> Array:
    """Return the rows of a piece, shape (k, 1 + n + m)."""
    points = piece.points
    if not is_curved(piece):
        return _straight(graph, points, finer)
    if not piece.is_vertical and finer > 1:
        points = _fine(graph, piece, finer)
    return _rows(graph, points)


def _straight(graph: BranchGraph, ends: Array, finer: int) -> Array:
    """Return the rows of a straight piece: only the ends if recorded quantities are straight."""
    if not graph.quantities.record:
        return _rows(graph, ends)
    parts = np.linspace(0.0, 1.0, max(finer, 2) + 1)
    rows = _rows(graph, np.linspace(ends[0], ends[-1], len(parts)))
    return rows[[0, -1]] if is_straight(rows, parts) else rows


def _increasing(length: Array) -> Array:
    """Return lengths made strictly increasing, as interpolation needs."""
    least = APART * (length[-1] or 1.0)
    return np.append(0.0, np.cumsum(np.maximum(np.diff(length), least)))


def _rows(graph: BranchGraph, points: Array) -> Array:
    return np.array([row_of(graph.quantities, x[:-1], float(x[-1])) for x in points])


def _fine(graph: BranchGraph, piece: Piece, finer: int) -> Array:
    """Return finer points of a curve through a piece's points, with alpha still monotone."""
    points = piece.points
    if graph.system is not None:
        fine = fine_points(graph.system, piece, graph.interval, finer)
        if (np.diff(fine[:, -1]) * (points[-1, -1] - points[0, -1]) > 0.0).all():
            return fine
    smooth = Smooth.through(points, finer)
    return points if smooth is None else smooth(points)


def row_of(quantities: Quantities, z: Array, alpha: float) -> list[float]:
    """Return a row of numbers; nan where a recorded quantity fails."""
    found = quantities.attempted(z, alpha).values()
    recorded = [np.nan if isinstance(value, str) else value for value in found]
    return [alpha, *z.tolist(), *recorded]


def _point(graph: BranchGraph, point: SpecialPoint) -> list[float]:
    return row_of(graph.quantities, point.z, point.alpha)
