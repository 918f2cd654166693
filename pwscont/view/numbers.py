"""The numbers of a view: the points of all pieces, each once, with everything that has a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.graph.refinement import fine_points
from pwscont.scenes.smooth import FINER, Smooth

#: Most numbers of a file: eight bytes each, a third more as text.
MOST_NUMBERS = 400_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Rows of numbers, and which of them make a piece or a special point.

    Attributes
    ----------
    names : tuple of str
        The names of the columns: the parameter, the unknowns, the recorded quantities.
    unknowns : int
        How many of them are unknowns.
    rows : ndarray, shape (r, 1 + n + m)
        nan where a recorded quantity failed.
    pieces : list of ndarray of int
        For each piece its rows, from start to end.
    points : ndarray of int
        For each special point its row.
    """

    names: tuple[str, ...]
    unknowns: int
    rows: Array
    pieces: list[Indices]
    points: Indices

    @classmethod
    def of(cls, graph: BranchGraph) -> Numbers:
        """Return the numbers of a graph; curved pieces are smooth curves through their points."""
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

    def fitting(self, wanted: Sequence[str]) -> Indices:
        """Return as many columns as a file has room for, those that are wanted first."""
        most = max(MOST_NUMBERS // max(len(self.rows), 1), 2 + len(wanted))
        first = [0, *(self.names.index(name) for name in wanted)]
        recorded = range(1 + self.unknowns, len(self.names))
        order = dict.fromkeys([*first, *recorded, *range(len(self.names))])
        return np.sort(np.array(list(order)[:most], dtype=int))


def is_curved(piece: Piece) -> bool:
    """Tell whether a piece has points between its ends."""
    return len(piece.track.inner) > 0


def _finer(graph: BranchGraph) -> int:
    """Return in how many parts the steps of curved pieces are drawn: as many as there is room."""
    curved = sum(len(piece.track.inner) + 2 for piece in graph.pieces if is_curved(piece))
    columns = 1 + len(graph.names) + len(graph.quantities.record)
    return int(np.clip(MOST_NUMBERS // max(curved * columns, 1), 1, FINER))


def _line(graph: BranchGraph, piece: Piece, finer: int) -> Array:
    """Return the rows of a piece."""
    points = piece.points
    if is_curved(piece) and not piece.is_vertical and finer > 1:
        points = _fine(graph, piece, finer)
    return np.array([_row(graph, x) for x in points])


def _fine(graph: BranchGraph, piece: Piece, finer: int) -> Array:
    """Return points of a curve through those of a piece along which alpha is monotone, too."""
    points = piece.points
    if graph.system is not None:
        fine = fine_points(graph.system, piece, graph.interval, finer)
        if (np.diff(fine[:, -1]) * (points[-1, -1] - points[0, -1]) > 0.0).all():
            return fine
    smooth = Smooth.through(points, finer)
    return points if smooth is None else smooth(points)


def _row(graph: BranchGraph, x: Array) -> list[float]:
    z, alpha = x[:-1], float(x[-1])
    found = graph.quantities.attempted(z, alpha).values()
    recorded = [np.nan if isinstance(value, str) else value for value in found]
    return [alpha, *z.tolist(), *recorded]


def _point(graph: BranchGraph, point: SpecialPoint) -> list[float]:
    return _row(graph, np.append(point.z, point.alpha))
