"""Marks of special points, and the labels of marks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle, groupby
from typing import Any, TypeAlias, final

import numpy as np
from matplotlib.axes import Axes

from pwscont import BranchGraph, Character
from pwscont.extending import Array, Kind, Piece, SpecialPoint
from pwscont.scenes.panels import DUST
from pwscont.scenes.styles import color_of, number_of

#: Limits of the parameter and of the quantity.
Window: TypeAlias = tuple[tuple[float, float], tuple[float, float]]

#: How each kind of special point is drawn; the ends of the interval need no mark.
MARKERS: dict[str, dict[str, Any]] = {
    Kind.START: {"marker": (6, 2, 0), "markersize": 11},
    Kind.TRANSITION: {"marker": "o", "markerfacecolor": "white", "markersize": 6},
    Kind.NONSMOOTH_FOLD: {"marker": "o", "markersize": 7},
    Kind.FOLD: {"marker": "D", "markersize": 6},
    Kind.BRANCH_POINT: {"marker": "P", "markersize": 8},
    Kind.CORNER: {"marker": "s", "markersize": 7},
    Kind.PARTIAL_CORNER: {"marker": "s", "markersize": 7, "markerfacecolor": "white"},
    Kind.NONSMOOTH_BRANCH_POINT: {"marker": "^", "markersize": 8},
    Kind.DEGENERATE: {"marker": "v", "markersize": 8},
    Kind.ISOLATED: {"marker": ".", "markersize": 8},
    Kind.EVENT: {"marker": "*", "markersize": 9},
    Kind.STOPPED: {"marker": "x", "markersize": 9, "markeredgewidth": 2},
}
#: The shapes of kinds of a user's own detectors, in the order of their names.
OWN_MARKERS = "hp<>8dX1"
#: Kinds without alpha beside the mark: such points are frequent, or the mark says all. The name of
#: an event stands beside any kind.
UNLABELLED = (Kind.START, Kind.END, Kind.TRANSITION, Kind.STOPPED)
#: Most transitions of a diagram that are drawn with marks of full size.
FEW = 12
#: Sizes in points: of the smallest marks, and the radius of a mark for labels.
SMALLEST, RADIUS = 1.5, 4.5


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A special point in a diagram.

    Attributes
    ----------
    kind, label : str
        The label is empty if the mark says enough.
    look : dict
        How matplotlib draws the mark.
    at : ndarray, shape (2,)
    branch : int
    side : int
        The side without pieces of the point: right (1), left (-1), or neither (0).
    """

    kind: str
    label: str
    look: dict[str, Any]
    at: Array
    branch: int
    side: int

    def is_within(self, window: Window | None) -> bool:
        """Tell whether the mark lies in a window of the diagram; not without window."""
        if window is None:
            return False
        return all(lo <= value <= hi for value, (lo, hi) in zip(self.at, window, strict=True))


def markers_of(graph: BranchGraph) -> dict[str, dict[str, Any]]:
    """Return {kind: look} for all special points, also from a user's own detectors."""
    kinds = {str(point.kind) for point in graph.special_points()}
    own = zip(sorted(kinds - {str(kind) for kind in MARKERS}), cycle(OWN_MARKERS), strict=False)
    return MARKERS | {kind: {"marker": shape, "markersize": 8} for kind, shape in own}


def marked(graph: BranchGraph) -> dict[int, list[SpecialPoint]]:
    """Return the special points that are marked, by branch.

    The end of a branch on the boundary of the interval has no mark, even if the run started from
    that end.
    """
    found = {}
    for branch, pieces in enumerate(graph.components()):
        nodes = {node for piece in pieces for node in (piece.start, piece.end)}
        ids = {piece.id for piece in pieces}
        inner = [start for start in graph.starts if start.piece in ids]
        points = [*(graph.point(node) for node in sorted(nodes)), *inner]
        found[branch] = [point for point in points if not _leaves(graph, point)]
    return found


def _leaves(graph: BranchGraph, point: SpecialPoint) -> bool:
    lo, hi = graph.interval
    near = min(abs(point.alpha - lo), abs(point.alpha - hi)) <= DUST * (hi - lo)
    return point.kind == Kind.END or (point.kind == Kind.START and near)


def marks_of(
    graph: BranchGraph, mode: Callable[[Character], str], place: Callable[[Array], Array]
) -> list[Mark]:
    """Return the marks of a diagram, without transitions that do not change the mode.

    Parameters
    ----------
    graph, mode
    place : callable
        Points (z, alpha), shape (k, n + 1) -> places in the diagram, shape (k, 2).
    """
    sides, unseen, looks = _sides(graph), _unseen(graph, mode), markers_of(graph)
    return [
        Mark(
            point.kind,
            _label(graph, point),
            looks[point.kind],
            place(np.append(point.z, point.alpha)[np.newaxis])[0],
            branch,
            sides.get(point.id, 0),
        )
        for branch, points in marked(graph).items()
        for point in points
        if point.id not in unseen
    ]


def _unseen(graph: BranchGraph, mode: Callable[[Character], str]) -> set[int]:
    """Return the transitions at which the mode of the panel does not change."""
    words: dict[int, set[str]] = {}
    for piece in graph.pieces:
        for node in (piece.start, piece.end):
            words.setdefault(node, set()).add(mode(piece.character))
    transitions = {point.id for point in graph.special_points(Kind.TRANSITION)}
    return {node for node in transitions if len(words.get(node, ())) == 1}


def _label(graph: BranchGraph, point: SpecialPoint) -> str:
    """Return the label of a point; alpha within rounding of zero reads as zero."""
    if point.kind in UNLABELLED or point.kind == Kind.EVENT:
        return point.name
    dust = DUST * float(np.ptp(graph.interval))
    number = number_of(point.alpha if abs(point.alpha) > dust else 0.0, graph.interval)
    return f"{number}, {point.name}" if point.name else number


def _sides(graph: BranchGraph) -> dict[int, int]:
    """Return the side without pieces, 1 or -1, of each node whose pieces lie on a single side."""
    seen: dict[int, set[int]] = {}
    for piece in graph.pieces:
        for node in {piece.start, piece.end}:
            seen.setdefault(node, set()).add(_side(graph.point(node), piece))
    return {node: -ways.pop() for node, ways in seen.items() if len(ways) == 1}


def _side(point: SpecialPoint, piece: Piece) -> int:
    """Return the side, 1 or -1, of a node on which a piece lies."""
    return int(np.sign(0.5 * sum(piece.interval) - point.alpha))


def draw_marks(ax: Axes, marks: Sequence[Mark]) -> None:
    """Draw marks, with one call for each kind and branch."""
    small = _small(sum(mark.kind == Kind.TRANSITION for mark in marks))
    for (kind, branch), group in groupby(sorted(marks, key=_group), key=_group):
        some = list(group)
        look = some[0].look | (small if kind == Kind.TRANSITION else {})
        x, y = np.array([mark.at for mark in some]).T
        order = 3.0 if kind in (Kind.TRANSITION, Kind.START) else 4.0
        ax.plot(x, y, color=color_of(branch), linestyle="none", zorder=order, **look)


def _small(count: int) -> dict[str, float]:
    """Return the size of the marks of ``count`` transitions."""
    size = MARKERS[Kind.TRANSITION]["markersize"] * min(1.0, (FEW / max(count, 1)) ** 0.5)
    return {"markersize": max(SMALLEST, size), "markeredgewidth": 1.0 if count <= FEW else 0.7}


def _group(mark: Mark) -> tuple[str, int]:
    return mark.kind, mark.branch
