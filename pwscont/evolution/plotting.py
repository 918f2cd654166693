"""Pictures of evolutions, still or moving: a quantity over time or over another quantity.

Each evolution has a colour and a line style of its own. A piece that several evolutions share is
drawn in stripes of all their colours. An evolution that another one hides is still seen: the
evolutions behind are wider.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import counted
from pwscont.evolution.paths import EvolutionPaths
from pwscont.evolution.states import EvolutionPiece, EvolutionState
from pwscont.scenes.panels import quantity_named
from pwscont.scenes.styles import COLORS, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pwscont.evolution.states import EvolutionStructure

#: Look of nodes by kind; other kinds have no mark.
MARKS = {"start": "o", "branching": "s", "loss": "X", "jump": "^", "undecided": "$?$"}
#: Sizes of marks: where evolutions branch from the start, the small start stands in the branching.
MARK_SIZE, SMALL_MARK = 64, 20
#: The length between two arrows in a loop, as a part of the panel.
ARROWS_APART = 0.4
#: Arrows closer than this, as a part of the panel, that point the same way are one arrow.
APART = 0.08
#: Evolutions that have a colour of their own, and line styles by turns.
MOST_COLORED = 8
LINE_STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1, 1, 1)), (0, (1, 1)))
#: Widths of the last and of the first evolution, and the length of a stripe in points.
NARROW, WIDE, STRIPE = 1.6, 3.6, 7.0
OTHERS, JUMP = "0.7", (0, (1, 2))
#: Places on a piece at which a recorded quantity is read.
SAMPLES = 17

Quantity = str | int


@final
class Curves:
    """The values of two quantities along the pieces of a graph, each read once.

    Parameters
    ----------
    graph : EvolutionStructure
    x, y : str or int
        A name, or the place of an unknown; "t" is the time.

    Raises
    ------
    UnknownNameError
        If there is no such quantity.
    """

    def __init__(self, graph: EvolutionStructure, x: Quantity, y: Quantity) -> None:
        self._graph, known = graph, (graph.names, graph.quantities.record)
        self.shown = [q if q == "t" else quantity_named(str(q), *known) for q in (x, y)]
        self._count = 2 if {*self.shown} <= {"t", *graph.names} else SAMPLES
        self._known: dict[int, Array] = {}

    def point(self, state: EvolutionState) -> list[float]:
        """Return both quantities of a state."""
        return [self._graph.value(state, quantity) for quantity in self.shown]

    def piece(self, piece: EvolutionPiece) -> Array:
        """Return the points of a piece, shape (k, 2)."""
        if id(piece) not in self._known:
            states = self._graph.along(piece, self._count)
            self._known[id(piece)] = np.array([self.point(state) for state in states])
        return self._known[id(piece)]

    def pieces(self, pieces: Sequence[EvolutionPiece]) -> Array:
        """Return the points of pieces that follow each other, shape (2, k)."""
        return np.vstack([self.piece(piece) for piece in pieces]).T


def draw(graph: EvolutionStructure, panels: Sequence[tuple[Quantity, Quantity]]) -> Figure:
    """Return a picture of all evolutions, with a panel for each pair of quantities (y, x)."""
    from matplotlib.figure import Figure  # noqa: PLC0415  only where asked for

    figure = Figure(figsize=(5.4 * len(panels) + 1.6, 4.2), layout="constrained")
    curves = [Curves(graph, x, y) for y, x in panels]
    all_axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, some in zip(all_axes, curves, strict=True):
        draw_curves(axes, graph, some)
    handles: dict[str, Any] = {}
    for axes in all_axes:
        handles |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.legend(
        handles.values(), handles, loc="outside right upper", fontsize="small", handlelength=3.6
    )
    return figure


def draw_curves(axes: Axes, graph: EvolutionStructure, curves: Curves) -> None:
    """Draw all evolutions, and the nodes at which evolutions begin, branch, jump or are lost."""
    chosen, more = colored(graph)
    if more:
        _draw_others(axes, graph, curves, f"{counted(more, 'evolution')} more")
    owners = owners_of(chosen)
    for number, pieces in enumerate(chosen):
        _draw_evolution(axes, curves, pieces, (number, len(chosen)), owners)
    if "t" not in curves.shown:
        _draw_arrows(axes, chosen, curves)
    _draw_nodes(axes, graph, curves)
    for axis, name in zip((axes.xaxis, axes.yaxis), curves.shown, strict=True):
        axis.set_label_text(symbol(name))
    axes.grid(alpha=0.25)


def colored(graph: EvolutionStructure) -> tuple[list[tuple[EvolutionPiece, ...]], int]:
    """Return the pieces of each evolution that has a colour, and how many more there are."""
    paths = EvolutionPaths(graph)
    chosen = [path.pieces for path in islice(paths, MOST_COLORED)]
    return chosen, paths.number - len(chosen)


def owners_of(chosen: Sequence[Sequence[EvolutionPiece]]) -> dict[int, list[int]]:
    """Return the numbers of the evolutions that share a piece, by the id of the piece."""
    owners: dict[int, list[int]] = {}
    for number, pieces in enumerate(chosen):
        for piece in pieces:
            owners.setdefault(id(piece), []).append(number)
    return owners


def _draw_others(axes: Axes, graph: EvolutionStructure, curves: Curves, words: str) -> None:
    for piece in graph.pieces:
        style = JUMP if piece.is_jump else "-"
        axes.plot(*curves.piece(piece).T, linestyle=style, color=OTHERS, linewidth=1.0)
    axes.plot([], [], color=OTHERS, linewidth=1.0, label=words)


def _draw_evolution(
    axes: Axes,
    curves: Curves,
    pieces: Sequence[EvolutionPiece],
    number: tuple[int, int],
    owners: dict[int, list[int]],
) -> None:
    """Draw an evolution, in stripes where other evolutions share the pieces."""
    mine, count = number
    width = NARROW + (WIDE - NARROW) * (1.0 - (mine + 1) / count)
    look: dict[str, Any] = {"color": COLORS[mine], "linewidth": width, "dash_capstyle": "butt"}
    own = LINE_STYLES[mine % len(LINE_STYLES)]
    axes.plot([], [], linestyle=own, label=f"evolution {mine + 1}", **look)
    for (jumps, sharing), run in groupby(pieces, lambda p: (p.is_jump, tuple(owners[id(p)]))):
        if jumps and sharing[0] != mine:
            continue
        style = JUMP if jumps else _stripes(sharing, mine, width) if len(sharing) > 1 else own
        axes.plot(*curves.pieces(list(run)), linestyle=style, **look)


def _stripes(sharing: Sequence[int], mine: int, width: float) -> Any:
    """Return the dashes of one evolution of those that share a piece, in widths of the line."""
    stripe, others = STRIPE / width, len(sharing) - 1
    return (-sharing.index(mine) * stripe, (stripe, others * stripe))


def _draw_nodes(axes: Axes, graph: EvolutionStructure, curves: Curves) -> None:
    for kind, mark in MARKS.items():
        states = graph.branchings() if kind == "branching" else graph.events(kind)
        points: Array = np.array([curves.point(state) for state in states]).reshape(-1, 2)
        look: dict[str, Any] = {
            "facecolor": "white" if kind in ("start", "branching") else "black",
            "edgecolor": "black",
            "zorder": 6 if kind == "start" else 5,
            "s": SMALL_MARK if kind == "start" else MARK_SIZE,
        }
        if len(points):
            axes.scatter(*points.T, marker=mark, label=kind, **look)


def _draw_arrows(axes: Axes, chosen: Sequence[Sequence[EvolutionPiece]], curves: Curves) -> None:
    """Draw the direction of time along evolutions, an arrow once where evolutions agree."""
    sizes = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())])
    drawn: list[Array] = []
    for pieces in chosen:
        points = curves.pieces([p for p in pieces if not p.is_jump]).T / sizes
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        ends = np.append(0.0, np.cumsum(lengths))
        for length in np.arange(0.5 * ARROWS_APART, ends[-1], ARROWS_APART):
            k = int(np.searchsorted(ends, length)) - 1
            way = (points[k + 1] - points[k]) / lengths[k]
            tip = points[k] + (length - ends[k]) * way
            here = np.append(tip, 0.3 * way)
            if all(np.abs(here - other).max() > APART for other in drawn):
                drawn.append(here)
                _draw_arrow(axes, (tip - 0.01 * way) * sizes, tip * sizes)


def _draw_arrow(axes: Axes, tail: Array, tip: Array) -> None:
    look: dict[str, Any] = {"arrowstyle": "-|>", "color": "black", "mutation_scale": 11}
    look |= {"shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", (tip[0], tip[1]), (tail[0], tail[1]), arrowprops=look, zorder=4)


DPI, STATE_SIZE = 90, 60


def animate(
    graph: EvolutionStructure, path: Path, panel: tuple[Quantity, Quantity], frames: int, fps: int
) -> Path:
    """Write an animated GIF, for :meth:`EvolutionGraph.animate`."""
    from matplotlib.animation import PillowWriter  # noqa: PLC0415  only where asked for

    check_animation(path, frames, fps)
    figure = draw(graph, [panel])
    curves, axes = Curves(graph, panel[1], panel[0]), figure.axes[0]
    dots = axes.scatter([], [], STATE_SIZE, facecolor="black", edgecolor="white")
    dots.set_zorder(7)
    writer = PillowWriter(fps=fps)
    try:
        with writer.saving(figure, str(path), dpi=DPI):
            for t in np.linspace(*graph.interval, frames).tolist():
                states = graph.states(t)
                points = np.array([curves.point(state) for state in states]).reshape(-1, 2)
                dots.set_offsets(points)
                axes.set_title(f"t = {t:.4g}: {counted(len(states), 'state')}")
                writer.grab_frame()
                figure.set_layout_engine("none")  # the layout of the first frame: nothing jumps
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def check_animation(path: Path, frames: int, fps: int) -> None:
    """Refuse a moving picture that cannot be written.

    Raises
    ------
    InvalidInputError
    """
    if path.suffix.lower() != ".gif":
        raise InvalidInputError(f"an animation is a file that ends in .gif, got {str(path)!r}")
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"cannot write {path}: there is no directory {path.parent}")
    are_numbers = all(isinstance(each, int | np.integer) for each in (frames, fps))
    if not are_numbers or frames < 2 or fps < 1:
        raise InvalidInputError(
            "an animation needs whole numbers, at least 2 frames and 1 frame per second, got "
            f"{frames!r} and {fps!r}"
        )
