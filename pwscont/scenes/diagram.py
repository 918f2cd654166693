"""One diagram: a quantity of all branches over the parameter, or over another quantity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.graph import BranchGraph
from pwscont.scenes.drawn import Drawn, What
from pwscont.scenes.marks import RADIUS, Mark, draw_marks, marks_of
from pwscont.scenes.panels import Panel
from pwscont.scenes.room import Room
from pwscont.scenes.strokes import Rail, Stroke, alike, joined, rails_of, strokes_of, visible
from pwscont.scenes.styles import THIN, WIDTH, color_of
from pwscont.scenes.symbols import symbol

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
        if over is not None:  # lines may bend back: no line is a function of what is across
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
        """Draw the rails beneath a branch, those of the lowest one outside, and the white core."""
        rails = [rail for rail in self.rails if rail.above == above]
        below = sorted({rail.below for rail in rails})
        for depth, branch in enumerate(below):
            width = CORE + 2.0 * RAIL * (len(below) - depth)
            lines = [rail.points for rail in rails if rail.below == branch]
            ax.add_collection(LineCollection(lines, colors=color_of(branch), linewidths=width))
        lines = [rail.points for rail in rails]
        ax.add_collection(LineCollection(lines, colors="white", linewidths=CORE))

    def set_axes(self, ax: Axes, graph: BranchGraph, title: str) -> None:
        """Set names and limits; an axis that would show nothing but rounding is widened."""
        across = graph.parameter if self.across is None else self.across.label
        ax.set(xlabel=symbol(across), ylabel=symbol(self.quantity.label))
        ax.set_title(title, fontsize="medium")
        ax.margins(0.06)
        ax.autoscale_view()
        ax.grid(alpha=0.25)
        if self.quantity.is_constant([stroke.points[:, 1] for stroke in self.strokes]):
            low, high = ax.get_ylim()
            half = 0.05 * (self.quantity.size or abs(low) or 1.0)
            ax.set_ylim(low - half, high + half)

    def room(self, ax: Axes) -> Room:
        """Return the room that lines and marks leave free."""
        room = Room(ax)
        room.draw(stroke.points for stroke in self.strokes)
        for mark in self.marks:
            middle = room.part(mark.at) * room.extent
            room.take(room.box(middle, np.full(2, 2.0 * RADIUS)))
        return room
