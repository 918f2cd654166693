"""Branch diagrams in the manner of the paper.

Line style tells the mode, an asterisk the start, an open circle a transition, a filled one a
non-smooth fold; every branch has its colour. Imported only where a picture is asked for.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle, islice
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.interpolate import PchipInterpolator

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.kind import Kind
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.scenes.counting import draw_counts
from pwscont.scenes.drawn import Drawn, What
from pwscont.scenes.scene import Panel, ParameterPath, Scene

#: How each kind of special point is drawn; ends need no mark.
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
#: How kinds of a user's own detectors are drawn.
OWN_MARKER: dict[str, Any] = {"marker": "h", "markersize": 8}
#: Colours that colour-blind readers tell apart (Okabe and Ito 2008), without the yellow.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Widths of lines; pieces on which the determinant is negative are thin.
WIDTH, THIN = 1.8, 0.9
#: Modes that the legend names.
MOST_MODES = 12
LINE_STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)))
#: Pieces of at least so many points are drawn as smooth curves, with so many parts of each step.
LEAST_POINTS, FINER = 4, 8
#: Points closer than this part of a piece are one in its curve.
APART = 1e-6
#: Lines closer than this part of their size are one in a picture.
SAME = 1e-9
ROW_HEIGHT, COUNTS_HEIGHT, COLUMN_WIDTH = 2.9, 1.9, 3.9  # inches


def plot(graph: BranchGraph, what: What = 0, *, ax: Axes | None = None) -> Axes:
    """Draw a quantity over the parameter: colours are branches, line styles modes.

    Thin lines are pieces on which det(dH/dz) is negative.

    Parameters
    ----------
    graph : BranchGraph
    what : int, str or callable
        Index into z, name of an unknown or of a recorded quantity, or function of (z, alpha).
    ax : matplotlib.axes.Axes, optional
        Where to draw; default a new figure of pyplot, which notebooks and ``plt.show()`` show.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax.figure.savefig(...)`` writes the picture.

    Raises
    ------
    InvalidInputError
        If there is no such quantity; a name that is close is told.
    """
    panel = Panel(what)
    Drawn.of(graph, what)  # refuses what cannot be drawn before there is a figure
    if ax is None:
        _, ax = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
    styles = _styles(graph, [panel], {})
    _draw_panel(ax, graph, panel, styles)
    ax.legend(
        handles=_legend(graph, styles),
        fontsize="small",
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
    )
    return ax


def draw_scene(scene: Scene, graph: BranchGraph) -> Figure:
    """Draw all panels of a scene, a row per title, with its parameter paths beside them.

    Below them stands how many solutions there are, and their balance.
    """
    titles = list(dict.fromkeys(panel.title for panel in scene.panels))
    rows: list[list[Panel | ParameterPath]] = [
        [panel for panel in scene.panels if panel.title == title] for title in titles
    ]
    for row, path in zip(cycle(rows), scene.paths, strict=False):
        row.append(path)
    styles = _styles(graph, scene.panels, scene.styles)
    figure, grid = _cells(max(map(len, rows)), len(rows))
    for i, row in enumerate(rows):
        for j in range(grid.shape[1]):
            _draw_cell(grid[i, j], graph, row[j] if j < len(row) else None, styles)
    _draw_counts(grid[-1, 0], graph, grid[0, 0].get_xlim())
    _draw_legend(grid[-1, 1:], _legend(graph, styles))
    figure.suptitle(scene.title.replace("alpha", "α"), fontsize="medium")
    return figure


def _cells(width: int, height: int) -> tuple[Figure, Any]:
    """Return a figure and its axes: rows for panels, and a low one for counts and legend."""
    width = max(width, 2)
    size = COLUMN_WIDTH * width, ROW_HEIGHT * height + COUNTS_HEIGHT
    figure = Figure(figsize=size, layout="constrained")
    ratios = [ROW_HEIGHT] * height + [COUNTS_HEIGHT]
    return figure, figure.subplots(height + 1, width, squeeze=False, height_ratios=ratios)


def _draw_counts(ax: Axes, graph: BranchGraph, extent: tuple[float, float]) -> None:
    draw_counts(graph, ax)
    ax.set_xlim(extent)
    ax.set_xlabel(symbol(graph.parameter))
    ax.margins(y=0.15)


def _draw_legend(free: Sequence[Axes], handles: Sequence[Line2D]) -> None:
    for ax in free:
        ax.set_axis_off()
    free[0].legend(handles=handles, loc="center left", ncols=1 + len(handles) // 6, frameon=False)


def _draw_cell(
    ax: Axes, graph: BranchGraph, content: Panel | ParameterPath | None, styles: Mapping[str, Any]
) -> None:
    if isinstance(content, Panel):
        _draw_panel(ax, graph, content, styles)
    elif content is not None:
        _draw_path(ax, graph, content)
    else:
        ax.set_axis_off()


def _draw_panel(ax: Axes, graph: BranchGraph, panel: Panel, styles: Mapping[str, Any]) -> None:
    mode, quantity = _mode(graph, panel), Drawn.of(graph, panel.component)
    drawn: dict[str, list[tuple[Array, Array]]] = defaultdict(list)
    for pieces, color in zip(graph.components(), cycle(COLORS), strict=False):
        for piece in pieces:
            word, line = mode(piece.character), line_of(piece, quantity.along)
            if not any(_covers(other, line) for other in drawn[word]):
                width = WIDTH if piece.det_sign >= 0 else THIN
                ax.plot(*line, color=color, linestyle=styles[word], linewidth=width)
                drawn[word].append(line)
        for point in _marked(graph, pieces):
            ax.plot(
                point.alpha,
                quantity.along(np.append(point.z, point.alpha)[np.newaxis])[0],
                color=color,
                linestyle="none",
                zorder=3.0 if point.kind in (Kind.TRANSITION, Kind.START) else 4.0,
                **_marker(point.kind),
            )
    ax.set_xlabel(symbol(graph.parameter))
    ax.set_ylabel(symbol(quantity.label))
    ax.set_title(panel.title, fontsize="medium")
    ax.margins(0.06)
    ax.grid(alpha=0.25)
    _show_dust_as_constant(ax, graph)


def _covers(line: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Tell whether a line hides another one of its style.

    Dashes on dashes of another phase would look like a solid line, which is another mode.
    """
    (alpha, values), (alphas, wanted) = line, other
    order = np.argsort(alpha)
    within = alpha.min() <= alphas.min() and alphas.max() <= alpha.max()
    near = np.interp(alphas, alpha[order], values[order]) - wanted
    return bool(within and np.abs(near).max() <= SAME * max(np.ptp(values), np.abs(values).max()))


def _show_dust_as_constant(ax: Axes, graph: BranchGraph) -> None:
    """Widen an axis that would show nothing but rounding errors."""
    size = max((float(np.abs(piece.z).max()) for piece in graph.pieces), default=0.0) or 1.0
    low, high = ax.get_ylim()
    if high - low < 1e-9 * size:
        ax.set_ylim(low - 0.05 * size, high + 0.05 * size)


def _marked(graph: BranchGraph, pieces: Sequence[Piece]) -> list[SpecialPoint]:
    """Return the special points of a component that are drawn, each once."""
    nodes = {node for piece in pieces for node in (piece.start, piece.end)}
    points = [graph.point(node) for node in sorted(nodes)]
    inner = [start for start in graph.starts if _lies_on(start, pieces)]
    return [point for point in [*points, *inner] if point.kind != Kind.END]


def _lies_on(start: SpecialPoint, pieces: Sequence[Piece]) -> bool:
    """Tell whether a start in the middle of a piece belongs to one of these pieces."""
    return any(start.piece == piece.id for piece in pieces)


def _mode(graph: BranchGraph, panel: Panel) -> Callable[[Character], str]:
    if panel.mode is not None:
        return panel.mode
    labels = {piece.character: piece.label for piece in graph.pieces}
    return labels.__getitem__


def _styles(
    graph: BranchGraph, panels: Sequence[Panel], wanted: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a line style for every mode that occurs."""
    words = {
        _mode(graph, panel)(piece.character): None for panel in panels for piece in graph.pieces
    }
    free = cycle(LINE_STYLES)
    return {word: wanted[word] if word in wanted else next(free) for word in words}


def line_of(piece: Piece, along: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return alpha and a quantity along a piece: a smooth curve through its points.

    Corners of a polygon would look like kinks. The parameter is the length along the points; the
    cubics in between never leave the range of their ends (Fritsch and Carlson 1980). Unknowns
    that move by rounding only do not count, and of points almost upon each other one does.
    """
    extent, size = np.ptp(piece.points, axis=0), np.abs(piece.points).max()
    steps = np.diff(piece.points / np.where(extent > SAME * size, extent, np.inf), axis=0)
    length = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    apart = np.diff(length) > APART * length[-1]
    kept = np.concatenate([[True], apart[:-1] & apart[1:], [True]])
    points, length = piece.points[kept], length[kept]
    if len(points) < LEAST_POINTS:
        return piece.alpha, along(piece.points)
    points = np.column_stack([points[:, -1], along(points)])
    ends = np.arange(len(length))
    fine = np.interp(np.linspace(0.0, ends[-1], FINER * ends[-1] + 1), ends, length)
    alpha, values = PchipInterpolator(length, points)(fine).T
    return alpha, values


def _draw_path(ax: Axes, graph: BranchGraph, path: ParameterPath) -> None:
    lo, hi = graph.interval
    points = np.array([path.curve(float(alpha)) for alpha in np.linspace(lo, hi, 201)])
    ax.plot(*points.T, color="black")
    ax.plot(*points[0], color="black", linestyle="none", **MARKERS[Kind.START])
    middle = points[len(points) // 4 : len(points) // 4 + 2]
    ax.annotate("", middle[1], middle[0], arrowprops={"arrowstyle": "-|>", "color": "black"})
    ax.set_xlabel(path.labels[0])
    ax.set_ylabel(path.labels[1])
    ax.set_title(path.title, fontsize="medium")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    ax.grid(alpha=0.25)


def _legend(graph: BranchGraph, styles: Mapping[str, Any]) -> list[Line2D]:
    """Return a handle for every mode and every kind of point that occurs."""
    lines = [
        Line2D([], [], color="black", linestyle=style, label=word)
        for word, style in islice(styles.items(), MOST_MODES)
    ]
    if more := len(styles) - MOST_MODES:
        lines += [Line2D([], [], linestyle="none", label=f"and {more} more")] * (more > 0)
    if any(piece.det_sign < 0 for piece in graph.pieces):
        lines.append(Line2D([], [], color="black", linewidth=THIN, label="det < 0: thin"))
    kinds = dict.fromkeys(point.kind for point in graph.special_points())
    own = [kind for kind in kinds if kind not in {*MARKERS, Kind.END}]
    marks = [
        Line2D([], [], color="black", linestyle="none", label=_word(kind), **_marker(kind))
        for kind in (*MARKERS, *own)
        if kind in kinds
    ]
    return lines + marks


def _marker(kind: str) -> dict[str, Any]:
    return MARKERS.get(kind, OWN_MARKER)


def _word(kind: str) -> str:
    return str(kind).replace("nonsmooth", "non-smooth")


def symbol(name: str) -> str:
    """Return a name such as ``u_t,1`` or ``alpha`` as matplotlib sets it."""
    name = {"alpha": "α", "phi": "φ"}.get(name, name)
    if found := re.fullmatch(r"(\w+?)_(.+)", name):
        return f"${found[1]}_{{{found[2]}}}$"
    return f"${name}$" if len(name) == 1 else name
