"""The lines of a branch diagram.

Corners of a polygon would look like kinks: pieces are drawn as smooth curves. The parameter of a
curve is the length along the points; the cubics never leave the range of the values at the ends
(Fritsch and Carlson 1980). The length leaves out unknowns that change by rounding only; points that
nearly coincide are drawn as one point.

If branches coincide, as for a constant quantity, the upper line runs between rails in the colours
of the lines beneath.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from pwscont import BranchGraph, Character
from pwscont.extending import Array, Piece

#: Least points of a piece that is drawn as a smooth curve, and parts into which each step of the
#: piece is divided.
LEAST_POINTS, FINER = 4, 8
#: Points of a piece that are closer than this part of the piece's length are drawn as one point.
APART = 1e-6
#: Unknowns that change by less than this part of the largest value change by rounding only.
ON_ONE_LINE = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Smooth:
    """The places at which a curve through points is drawn.

    Attributes
    ----------
    kept : ndarray of bool, shape (k,)
        The points that the curve passes through.
    length : ndarray
        The length along the points at the kept points.
    fine : ndarray
        The lengths at which the curve is drawn.
    """

    kept: npt.NDArray[np.bool_]
    length: Array
    fine: Array

    @classmethod
    def through(cls, points: Array, finer: int = FINER) -> Smooth | None:
        """Return the curve through points (z, alpha), shape (k, n + 1); None for too few points."""
        if len(points) < LEAST_POINTS:
            return None
        length = length_along(points)
        apart = np.diff(length) > APART * length[-1]
        kept = np.concatenate([[True], apart[:-1] & apart[1:], [True]])
        length = length[kept]
        if len(length) < LEAST_POINTS:
            return None
        ends = np.arange(len(length))
        fine = np.interp(np.linspace(0.0, ends[-1], finer * ends[-1] + 1), ends, length)
        return cls(kept, length, fine)

    def __call__(self, values: Array) -> Array:
        """Return values along the curve from values at all points, shape (k,) or (k, m)."""
        along: Array = PchipInterpolator(self.length, values[self.kept])(self.fine)
        return along


def is_straight(values: Array, parts: Array) -> bool:
    """Tell whether values, (k,) or (k, m), at parts 0 to 1 lie on the line of the end values."""
    line = values[0] + np.multiply.outer(parts, values[-1] - values[0])
    return bool((np.abs(values - line) <= ON_ONE_LINE * np.abs(values).max(axis=0)).all())


def length_along(points: Array) -> Array:
    """Return the length along points, shape (k, m), at each point; columns are scaled by extent."""
    extent, size = np.ptp(points, axis=0), np.abs(points).max()
    steps = np.diff(points / np.where(extent > ON_ONE_LINE * size, extent, np.inf), axis=0)
    return np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))


#: Lines of two branches that are closer than this part of the picture's height look like one line.
NEAR = 3e-3
#: A common stretch shorter than this part of the picture's width is a crossing.
LEAST_STRETCH = 0.01
#: Number of parts of a straight piece along which a quantity is drawn as a curve.
FINE = 64
#: Parts of a straight piece at which a quantity is compared with a straight line.
TRIED = np.array([0.0, 0.37, 0.71, 1.0])
#: Number of points at which common stretches are compared and drawn.
SAMPLES = 17


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A line of a diagram.

    Attributes
    ----------
    points : ndarray, shape (k, 2)
        The places in the diagram, such as parameter and quantity.
    branch : int
    style
        Line style of matplotlib.
    is_thin : bool
        Whether the determinant is negative.
    ends : tuple of int
        The nodes where the line begins and ends.
    """

    points: Array
    branch: int
    style: Any
    is_thin: bool
    ends: tuple[int, int]

    @property
    def kind(self) -> tuple[int, str, bool]:
        """Branch, style and width: strokes with equal kinds can be drawn as one stroke."""
        return self.branch, repr(self.style), self.is_thin

    def at(self, alpha: Array) -> Array:
        """Return the quantity at values of the parameter, for the line of a single piece."""
        order = np.argsort(self.points[:, 0])
        values: Array = np.interp(alpha, *self.points[order].T)
        return values


@final
@dataclass(frozen=True, slots=True, eq=False)
class Rail:
    """A stretch of a branch that lies beneath another branch.

    Attributes
    ----------
    points : ndarray, shape (k, 2)
    below, above : int
        The numbers of the branches.
    """

    points: Array
    below: int
    above: int


def strokes_of(
    graph: BranchGraph,
    mode: Callable[[Character], str],
    place: Callable[[Array], Array],
    styles: Mapping[str, Any],
) -> list[Stroke]:
    """Return a line for each piece of a graph.

    Parameters
    ----------
    graph, mode, styles
    place : callable
        Points (z, alpha), shape (k, n + 1) -> places in the diagram, shape (k, 2).
    """
    return [
        Stroke(
            line_of(piece, place)[1],
            branch,
            styles[mode(piece.character)],
            piece.det_sign < 0,
            (piece.start, piece.end),
        )
        for branch, pieces in enumerate(graph.components())
        for piece in pieces
    ]


def visible(strokes: Sequence[Stroke]) -> list[Stroke]:
    """Return the lines without those that lie on another line of equal branch and style.

    Two dashed lines of different phase would look like a solid line, which is another mode.
    """
    boxes, kept = _boxes(strokes), np.zeros(len(strokes), dtype=bool)
    looks = {look: i for i, look in enumerate(dict.fromkeys(s.kind[:2] for s in strokes))}
    look = np.array([looks[stroke.kind[:2]] for stroke in strokes])
    extent, near = boxes[:, 1] - boxes[:, 0], ON_ONE_LINE * np.abs(boxes[:, 2:]).max(initial=0.0)
    for i in sorted(range(len(strokes)), key=lambda i: (strokes[i].is_thin, -extent[i])):
        within = (boxes[:, 0] <= boxes[i, 0]) & (boxes[i, 1] <= boxes[:, 1])
        rivals = np.flatnonzero(kept & (look == look[i]) & within)
        kept[i] = not any(_hides(strokes[int(j)], strokes[i], near) for j in rivals)
    return [stroke for stroke, is_kept in zip(strokes, kept, strict=True) if is_kept]


def _boxes(strokes: Sequence[Stroke]) -> Array:
    """Return the extents of lines, shape (k, 4): parameter from, to, quantity from, to."""
    rows = [np.stack([s.points.min(axis=0), s.points.max(axis=0)]).T.ravel() for s in strokes]
    return np.array(rows).reshape(-1, 4)


def _hides(upper: Stroke, lower: Stroke, near: float) -> bool:
    alpha, values = lower.points.T
    return bool(np.abs(upper.at(alpha) - values).max() <= near)


def joined(strokes: Sequence[Stroke]) -> list[Stroke]:
    """Return the lines, with successive lines of equal style joined.

    Otherwise the dashes of short pieces would begin anew at every transition.
    """
    found: list[list[Stroke]] = []
    for stroke in strokes:
        if found and _continues(found[-1][-1], stroke):
            found[-1].append(stroke)
        else:
            found.append([stroke])
    return [_as_one(run) for run in found]


def _continues(before: Stroke, after: Stroke) -> bool:
    return before.kind == after.kind and before.ends[1] == after.ends[0]


def _as_one(run: Sequence[Stroke]) -> Stroke:
    first, last = run[0], run[-1]
    points = np.vstack([first.points, *(stroke.points[1:] for stroke in run[1:])])
    ends = first.ends[0], last.ends[1]
    return Stroke(points, first.branch, first.style, first.is_thin, ends)


def alike(strokes: Sequence[Stroke]) -> Iterator[tuple[Stroke, list[Array]]]:
    """Yield for each style on a branch a stroke, and the points of all strokes of that style."""
    for _, group in groupby(sorted(strokes, key=lambda s: s.kind), key=lambda s: s.kind):
        some = list(group)
        yield some[0], [stroke.points for stroke in some]


def rails_of(strokes: Sequence[Stroke]) -> list[Rail]:
    """Return the stretches on which lines of different branches coincide."""
    if not strokes or strokes[0].branch == strokes[-1].branch:
        return []
    boxes, branch = _boxes(strokes), np.array([stroke.branch for stroke in strokes])
    width = np.ptp(boxes[:, :2]) * LEAST_STRETCH
    near = max(np.ptp(boxes[:, 2:]), np.abs(boxes[:, 2:]).max() * ON_ONE_LINE) * NEAR
    rails = []
    for i, upper in enumerate(strokes):
        beneath = np.flatnonzero((branch < branch[i]) & _meets(boxes, boxes[i], width, near))
        for j in map(int, beneath):
            stretch = max(boxes[i, 0], boxes[j, 0]), min(boxes[i, 1], boxes[j, 1])
            alpha = np.linspace(*stretch, SAMPLES)
            values = upper.at(alpha)
            if np.abs(values - strokes[j].at(alpha)).max() <= near:
                points = np.column_stack([alpha, values])
                rails.append(Rail(points, strokes[j].branch, upper.branch))
    return rails


def _meets(boxes: Array, box: Array, width: float, near: float) -> npt.NDArray[np.bool_]:
    """Tell which extents have a stretch in common with the extent ``box``."""
    common = np.minimum(boxes[:, 1], box[1]) - np.maximum(boxes[:, 0], box[0])
    apart = np.maximum(boxes[:, 2], box[2]) - np.minimum(boxes[:, 3], box[3])
    meets: npt.NDArray[np.bool_] = (common > width) & (apart <= near)
    return meets


def line_of(piece: Piece, along: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return alpha and a quantity along a piece, on a smooth curve through the points."""
    smooth = Smooth.through(piece.points)
    if smooth is not None:
        return smooth(piece.alpha), smooth(along(piece.points))
    points = piece.points
    if len(points) == 2 and not is_straight(along(_between(points, TRIED)), TRIED):
        points = _between(points, np.linspace(0.0, 1.0, FINE + 1))
    return points[:, -1], along(points)


def _between(ends: Array, parts: Array) -> Array:
    points: Array = ends[0] + parts[:, np.newaxis] * (ends[1] - ends[0])
    return points
