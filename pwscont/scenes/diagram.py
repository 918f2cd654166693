"""A diagram of a quantity, and the inset that enlarges crowded folds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from pwscont import BranchGraph, Character
from pwscont.extending import Array, Kind
from pwscont.scenes.labels import LETTERS, Room, label_marks
from pwscont.scenes.marks import RADIUS, Mark, Window, draw_marks, marks_of
from pwscont.scenes.panels import Drawn, Panel, What
from pwscont.scenes.strokes import Rail, Stroke, alike, joined, rails_of, strokes_of, visible
from pwscont.scenes.styles import THIN, WIDTH, color_of, symbol

#: Width of the white between rails, and of each rail, in points.
CORE, RAIL = 3.4, 1.6


def mode_of(graph: BranchGraph, panel: Panel) -> Callable[[Character], str]:
    """Return the function from a character to the mode that chooses the line style."""
    if panel.mode is not None:
        return panel.mode
    labels = {piece.character: piece.label for piece in graph.pieces}
    return labels.__getitem__


@final
@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """The lines and marks that draw a quantity.

    Attributes
    ----------
    quantity : Drawn
    across : Drawn or None
        The quantity of the horizontal axis; None for the parameter.
    strokes : list of Stroke
    rails : list of Rail
    marks : list of Mark
    """

    quantity: Drawn
    across: Drawn | None
    strokes: list[Stroke]
    rails: list[Rail]
    marks: list[Mark]

    @classmethod
    def of(
        cls, graph: BranchGraph, panel: Panel, styles: Mapping[str, Any], across: What | None = None
    ) -> Diagram:
        """Return the lines and marks of a panel."""
        quantity, mode = Drawn.of(graph, panel.component), mode_of(graph, panel)
        over = None if across is None else Drawn.of(graph, across)

        def place(points: Array) -> Array:
            return np.column_stack(
                [over.along(points) if over else points[:, -1], quantity.along(points)]
            )

        strokes, marks = strokes_of(graph, mode, place, styles), marks_of(graph, mode, place)
        if over is not None:  # lines may bend back: no line is a function of x
            return cls(quantity, over, joined(strokes), [], [replace(m, side=0) for m in marks])
        strokes = visible(strokes)
        return cls(quantity, None, joined(strokes), rails_of(strokes), marks)

    def draw(self, ax: Axes) -> None:
        """Draw lines and marks, branch by branch."""
        for branch, group in groupby(self.strokes, key=lambda stroke: stroke.branch):
            self._draw_rails(ax, branch)
            for look, lines in alike(list(group)):
                width = THIN if look.is_thin else WIDTH
                some = LineCollection(
                    lines, colors=color_of(branch), linestyles=[look.style], linewidths=width
                )
                ax.add_collection(some)
        draw_marks(ax, self.marks)

    def _draw_rails(self, ax: Axes, above: int) -> None:
        """Draw the rails beneath a branch, the lowest branch outermost, and the white core."""
        rails = [rail for rail in self.rails if rail.above == above]
        below = sorted({rail.below for rail in rails})
        for depth, branch in enumerate(below):
            width = CORE + 2.0 * RAIL * (len(below) - depth)
            lines = [rail.points for rail in rails if rail.below == branch]
            ax.add_collection(LineCollection(lines, colors=color_of(branch), linewidths=width))
        lines = [rail.points for rail in rails]
        ax.add_collection(LineCollection(lines, colors="white", linewidths=CORE))

    def set_axes(self, ax: Axes, graph: BranchGraph, title: str) -> None:
        """Set names and limits of the axes; an axis that would show only rounding is widened."""
        across = graph.parameter if self.across is None else self.across.label
        ax.set(xlabel=symbol(across), ylabel=symbol(self.quantity.label))
        ax.set_title(title if self.strokes else "no solution found", fontsize="medium")
        ax.margins(0.06)
        ax.autoscale_view()
        ax.grid(alpha=0.25)
        if not self.strokes and self.across is None:
            ax.set_xlim(graph.interval)
        if self.quantity.is_constant([stroke.points[:, 1] for stroke in self.strokes]):
            low, high = ax.get_ylim()
            half = 0.05 * (self.quantity.size or abs(low) or 1.0)
            ax.set_ylim(low - half, high + half)

    def room(self, ax: Axes) -> Room:
        """Return the cells of the axes that lines and marks leave free."""
        room = Room(ax)
        room.draw(stroke.points for stroke in self.strokes)
        for mark in self.marks:
            middle = room.part(mark.at) * room.extent
            room.take(room.box(middle, np.full(2, 2.0 * RADIUS)))
        return room


FOLDS = (Kind.FOLD, Kind.NONSMOOTH_FOLD)
#: Folds of a branch that extend over less than the first part of the axis are enlarged, if two
#: folds are closer than the second part of the picture.
SMALL, CROWDED = 0.12, 0.05
#: A branch that fills less than this part of the axis is a stub, and enlarged.
STUB = 0.06
#: Margins of an inset, room for labels: beside the folds as part of the extent of the folds, above
#: and below the lines as part of the height of the lines.
MARGIN, ABOVE = 0.25, 0.5
#: Sizes of an inset, the first that fits is taken, and the room for numbers to the left and below,
#: as parts of the axes.
SIZES = ((0.62, 0.56), (0.56, 0.5), (0.5, 0.45), (0.45, 0.4), (0.45, 0.33), (0.6, 0.28))
NUMBERS = 0.13, 0.11
POINTS = 101  # places of each step of a line at which heights in an inset are measured
#: The colour of the frames around the inset and around the enlarged part.
FRAME = "0.55"


def draw_inset(ax: Axes, diagram: Diagram, room: Room) -> Window | None:
    """Enlarge crowded folds and short branches of a diagram, if the diagram has room.

    Returns
    -------
    tuple or None
        Limits of the parameter and of the quantity in the inset.
    """
    window = None if diagram.across else _window(ax, diagram, room)
    box = room.largest(SIZES) if window else None
    if window is None or box is None:
        return None
    room.take(box)
    left, bottom, width, height = box
    aside, below = NUMBERS
    inset = ax.inset_axes((left + aside, bottom + below, width - aside - 0.02, height - below))
    diagram.draw(inset)
    inset.set(xlim=window[0], ylim=window[1])
    inset.tick_params(labelsize=LETTERS - 1.0, length=2.0, pad=1.5)
    inset.locator_params(nbins=4)
    inset.grid(alpha=0.25)
    inset.spines[:].set_color(FRAME)
    (lo, hi), (bottom, top) = window
    ax.indicate_inset((lo, bottom, hi - lo, top - bottom), edgecolor=FRAME, alpha=1.0)
    enlarged = [mark for mark in diagram.marks if mark.is_within(window)]
    label_marks(inset, enlarged, diagram.room(inset))
    return window


def _window(ax: Axes, diagram: Diagram, room: Room) -> Window | None:
    """Return the limits around a branch's crowded folds, else around stubs, else None."""
    for branch in dict.fromkeys(mark.branch for mark in diagram.marks):
        marks = [mark for mark in diagram.marks if mark.branch == branch and mark.kind in FOLDS]
        folds = np.array([mark.at for mark in marks]).reshape(-1, 2)
        if _are_crowded(room.part(folds)):
            return _around(ax, diagram, folds[:, 0])
    return _around_stubs(ax, diagram, room)


def _around_stubs(ax: Axes, diagram: Diagram, room: Room) -> Window | None:
    """Return the limits around branches that are too short to be seen; None without stubs."""
    found: dict[int, list[Array]] = {}
    for stroke in diagram.strokes:
        found.setdefault(stroke.branch, []).append(stroke.points)
    extents = [_extent(np.concatenate(points)) for points in found.values()]
    lo, hi = np.array(ax.get_xlim())
    stubs = [alphas for alphas in extents if np.ptp(alphas) < STUB * (hi - lo)]
    if not stubs or np.ptp(np.concatenate(stubs)) > SMALL * (hi - lo):
        return None
    return _around(ax, diagram, np.concatenate(stubs))


def _extent(points: Array) -> Array:
    return np.array([points[:, 0].min(), points[:, 0].max()])


def _are_crowded(parts: Array) -> bool:
    """Tell whether folds, given as parts of the picture, (k, 2), are hard to tell apart."""
    if len(parts) < 2 or np.ptp(parts[:, 0]) > SMALL:
        return False
    distances = np.linalg.norm(parts[:, np.newaxis] - parts, axis=2)
    return bool(distances[np.triu_indices(len(parts), 1)].min() < CROWDED)


def _around(ax: Axes, diagram: Diagram, alphas: Array) -> Window | None:
    """Return the limits around folds at these values of the parameter, within the picture."""
    margin = MARGIN * float(np.ptp(alphas))
    left, right = ax.get_xlim()
    lo, hi = max(float(alphas.min()) - margin, left), min(float(alphas.max()) + margin, right)
    found = np.concatenate([_values_within(s.points, lo, hi) for s in diagram.strokes])
    extent, (bottom, top) = float(np.ptp(found)), ax.get_ylim()
    low, high = float(found.min()) - ABOVE * extent, float(found.max()) + ABOVE * extent
    return ((lo, hi), (max(low, bottom), min(high, top))) if margin and extent else None


def _values_within(points: Array, lo: float, hi: float) -> Array:
    """Return the values of a line at parameters in an interval."""
    t = np.linspace(0.0, len(points) - 1.0, POINTS * (len(points) - 1) + 1)
    alpha, values = (np.interp(t, np.arange(len(points)), column) for column in points.T)
    within: Array = values[(alpha >= lo) & (alpha <= hi)]
    return within
