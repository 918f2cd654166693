"""Branch diagrams in the manner of the paper.

Colours are branches, line styles modes, thin lines a negative determinant; marks are special
points. This module is imported only if a picture is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle, takewhile, zip_longest
from textwrap import fill, wrap
from typing import Any, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from pwscont import BranchGraph, InvalidInputError
from pwscont.extending import Kind, checked_kind
from pwscont.scenes.diagram import Diagram, draw_inset, mode_of
from pwscont.scenes.labels import label_marks
from pwscont.scenes.marks import UNLABELLED, marked, markers_of
from pwscont.scenes.panels import Drawn, Panel, ParameterPath, Shown, What, is_parameter
from pwscont.scenes.paths import draw_counts, draw_path, is_at_rest, is_one_number
from pwscont.scenes.strokes import line_of
from pwscont.scenes.styles import (
    COLORS,
    THIN,
    WIDTH,
    are_told_apart,
    color_of,
    in_letters,
    in_notation,
    number_of,
    styles_of,
    symbol,
)

#: Most letters in a line of a name, and most branches, in a legend.
MOST_LETTERS, MOST_BRANCHES = 40, len(COLORS)


def legend_of(graph: BranchGraph, styles: Mapping[str, Any]) -> list[Line2D]:
    """Return a handle for every branch, mode and kind of point that is drawn."""
    return [*_branches(graph), *_modes(styles), *_signs(graph), *_marks(graph)]


def _branches(graph: BranchGraph) -> list[Line2D]:
    count = len(graph.components())
    if count < 2:
        return []
    shown = [
        Line2D([], [], color=color_of(i), linewidth=4.0, label=f"branch {i + 1}")
        for i in range(min(count, MOST_BRANCHES))
    ]
    more = count - len(shown)
    return [*shown, *([_text(f"and {more} more, in the same colours")] if more else [])]


def _modes(styles: Mapping[str, Any]) -> list[Line2D]:
    if not are_told_apart(styles):
        return [_text(f"{len(styles)} modes, not told apart")]
    return [
        Line2D([], [], color="black", linewidth=WIDTH, linestyle=style, label=label)
        for label, style in zip(told_apart(list(styles)), styles.values(), strict=True)
    ]


def _signs(graph: BranchGraph) -> list[Line2D]:
    """Return the handle that explains thin lines, if a piece has a negative determinant."""
    if not any(piece.det_sign < 0 for piece in graph.pieces):
        return []
    return [Line2D([], [], color="black", linewidth=THIN, label="thin: det(dH/dz) < 0")]


def _marks(graph: BranchGraph) -> list[Line2D]:
    kinds = dict.fromkeys(point.kind for points in marked(graph).values() for point in points)
    return [
        Line2D([], [], color="black", linestyle="none", label=_word(graph, kind), **look)
        for kind, look in markers_of(graph).items()
        if kind in kinds
    ]


def _text(words: str) -> Line2D:
    return Line2D([], [], linestyle="none", label=words)


def told_apart(words: Sequence[str]) -> list[str]:
    """Return names short enough for a legend, without the clauses that long names share."""
    if max(map(len, words), default=0) > MOST_LETTERS:
        end = next((mark for mark in ("; ", ", ") if any(mark in word for word in words)), " ")
        before = _shared(words, end)
        after = _shared([word[::-1] for word in words], end[::-1])[::-1]
        words = [_without(word, before, after) for word in words]
    return [fill(in_notation(word), MOST_LETTERS) for word in words]


def _shared(words: Sequence[str], end: str) -> str:
    """Return the whole clauses, each with its end, with which all of several names begin."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*words, strict=False))
    shared = "".join(letters[0] for letters in alike) if len(words) > 1 else ""
    return "".join(shared.rpartition(end)[:2])


def _without(word: str, before: str, after: str) -> str:
    middle = word[len(before) : max(len(word) - len(after), len(before))]
    return f"{'… ' * bool(before)}{middle.strip(',; ') or '–'}{' …' * bool(after)}"


def _word(graph: BranchGraph, kind: str) -> str:
    """Return the word for a kind, with a note on the number beside the mark."""
    beside = "" if kind in {*UNLABELLED, Kind.EVENT} else f", at {symbol(graph.parameter)}"
    return f"{kind}{beside}".replace("nonsmooth", "non-smooth")


Content: TypeAlias = Panel | ParameterPath

ROW, COUNTS, COLUMN, ALONE, LINE = 2.9, 1.8, 3.9, 6.4, 0.22  # inches
#: Most diagrams side by side, and most rows of a legend beside the counts.
MOST_COLUMNS, LEGEND_ROWS = 3, 6
#: Width of a handle in a legend and of the labels of an axis in inches, and letters per inch of a
#: legend.
HANDLE, TICKS, SMALL_LETTERS = 0.6, 0.5, 16
#: Most constant quantities that a title names, and letters per inch of a title.
MOST_CONSTANTS, LETTERS = 4, 12


def rows_of(scene: Shown, graph: BranchGraph) -> list[list[Content]]:
    """Return the diagrams in rows, a row for each title, with a parameter path at the end.

    Constant quantities are left out, unless all quantities are constant.
    """
    lively = [panel for panel in scene.panels if constant_value(graph, panel) is None]
    panels = lively or scene.panels
    titles = list(dict.fromkeys(panel.title for panel in scene.panels))
    rows: list[list[Content]] = [
        [panel for panel in panels if panel.title == title] for title in titles
    ]
    for row, path in zip(cycle(rows), scene.paths, strict=False):
        row.extend([] if is_at_rest(graph, path) else [path])
    return [row for row in rows if row]


def constant_value(graph: BranchGraph, panel: Panel) -> float | None:
    """Return the value of a constant quantity; None for a quantity with several values."""
    quantity = Drawn.of(graph, panel.component)
    values = [line_of(piece, quantity.along)[1] for piece in graph.pieces]
    return float(values[0][0]) if quantity.is_constant(values) else None


def place_title(figure: Figure, scene: Shown, graph: BranchGraph) -> None:
    """Write the title of a scene, and the values of the quantities that are not drawn."""
    said = "; ".join([*_constants(scene, graph), *_number(graph)])
    wrapped = wrap(in_letters(scene.title), int(figure.get_figwidth() * LETTERS))
    lines = [*map(in_notation, wrapped), *([said] if said else [])]
    figure.set_figheight(figure.get_figheight() + LINE * len(lines))
    figure.suptitle("\n".join(lines), fontsize="medium")


def _constants(scene: Shown, graph: BranchGraph) -> Iterator[str]:
    found = [(panel, constant_value(graph, panel)) for panel in scene.panels]
    constant = [(panel, value) for panel, value in found if value is not None]
    if not constant or len(constant) == len(found):
        return
    some = [
        f"{symbol(Drawn.of(graph, panel.component).label)} = {number_of(value)}"
        for panel, value in constant[:MOST_CONSTANTS]
    ]
    more = len(constant) - len(some)
    yield f"constant: {', '.join(some)}{f' and {more} more' if more else ''}"


def _number(graph: BranchGraph) -> Iterator[str]:
    if is_one_number(graph):
        count = int(graph.multiplicity()[0][2])
        least = "" if graph.is_complete else "at least "
        yield f"{least}{count} solution{'' if count == 1 else 's'} throughout"


def columns_for(rows: Sequence[Sequence[Any]]) -> int:
    """Return the number of diagrams that stand side by side."""
    lengths, count = {len(row) for row in rows}, sum(map(len, rows))
    if len(lengths) == 1 and max(lengths) <= MOST_COLUMNS:
        return max(lengths)
    return 2 if count in (2, 4) else MOST_COLUMNS


def arrange(columns: int, rows: int, *, counted: bool) -> tuple[Figure, Any]:
    """Return a figure and axes: rows for diagrams, and a low row for the counts."""
    heights = [ROW] * rows + [COUNTS] * counted
    width = COLUMN * columns if columns > 1 else ALONE
    figure = Figure(figsize=(width, sum(heights)), layout="constrained")
    axes = figure.subplots(len(heights), columns, squeeze=False, height_ratios=heights)
    return figure, axes


def place_legend(figure: Figure, free: Sequence[Axes], handles: Sequence[Line2D]) -> None:
    """Draw the legend into free cells beside the counts, or below the figure."""
    for ax in free:
        ax.set_axis_off()
    style: dict[str, Any] = {"handles": handles, "frameon": False, "handlelength": 3.2}
    columns = -(-len(handles) // LEGEND_ROWS)
    if _legend_width(handles, columns) <= COLUMN * len(free) - TICKS:
        free[0].legend(loc="center left", ncols=columns, fontsize="small", **style)
        return
    columns = max(1, min(int(figure.get_figwidth() // 2.1), len(handles)))
    while columns > 1 and _legend_width(handles, columns) > figure.get_figwidth():
        columns -= 1
    lines = max((str(handle.get_label()).count("\n") + 1 for handle in handles), default=1)
    figure.set_figheight(figure.get_figheight() + LINE * lines * -(-len(handles) // columns))
    figure.legend(loc="outside lower center", ncols=columns, fontsize="small", **style)


def _legend_width(handles: Sequence[Line2D], columns: int) -> float:
    """Return the approximate width of a legend, in inches."""
    lines = [str(handle.get_label()).split("\n") for handle in handles]
    letters = [max(map(len, some)) for some in lines]
    longest = [max(part, default=0) for part in np.array_split(letters, columns or 1)]
    return sum(HANDLE + length / SMALL_LETTERS for length in longest)


def plot(
    graph: BranchGraph,
    what: What = 0,
    *,
    x: What | None = None,
    y: What | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a quantity over the parameter or over another quantity: colours are branches.

    Line styles are modes, and thin lines are pieces on which det(dH/dz) is negative. If branches
    coincide over the parameter, the upper branch runs between rails in the colours of the branches
    beneath. Folds that are close together are enlarged.

    Parameters
    ----------
    graph : BranchGraph
    what : int, str or callable, optional
        The quantity: index into z, default 0; name of an unknown or of a recorded quantity; or
        function of (z, alpha). Greek letters may be given in words, ``lambda_t`` for ``λ_t``.
    x : int, str or callable, optional
        The quantity of the horizontal axis; default the parameter, whose name is accepted, too.
    y : int, str or callable, optional
        The quantity of the vertical axis, instead of ``what``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into, of a figure with ``layout="constrained"``, which leaves room for the
        legend; default a new figure of pyplot, which notebooks and ``plt.show()`` show.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax.figure.savefig(...)`` writes the picture.

    Raises
    ------
    InvalidInputError
        If ``graph`` or ``ax`` is none, ``what`` and ``y`` are both given, or there is no such
        quantity: the message lists similar names.

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("Agg")  # no window for an example
    >>> from pwscont import LCP, explore, plot
    >>> graph = explore(LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))
    >>> plot(graph, 0).get_xlabel()
    '$α$'
    >>> plot(graph, x=0, y=1).get_ylabel()
    '$z$[1]'
    """
    checked_kind("graph", graph, BranchGraph, is_needed=True)
    checked_kind("ax", ax, Axes)
    if y is not None and what != 0:
        raise InvalidInputError("what and y are both the vertical axis: give one of them")
    panel = Panel(what if y is None else y)
    across = None if isinstance(x, str) and is_parameter(graph, x) else x
    for quantity in (panel.component, *(() if across is None else (across,))):
        Drawn.of(graph, quantity)  # refuses what cannot be drawn before there is a figure
    if ax is None:
        _, ax = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
    styles = _styles(graph, [panel], {})
    diagram = _draw_panel(ax, graph, panel, styles, across)
    ax.legend(
        handles=legend_of(graph, styles),
        frameon=bool(graph.pieces),
        fontsize="small",
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        handlelength=3.2,
    )
    _write_labels(ax.figure, {ax: diagram})
    return ax


def draw_scene(scene: Shown, graph: BranchGraph) -> Figure:
    """Draw the panels and parameter paths of a scene, and the number of solutions.

    Quantities that stay constant are named in the title instead.
    """
    rows, counted = rows_of(scene, graph), not is_one_number(graph)
    cells = [cell for row in rows for cell in row]
    panels = [cell for cell in cells if isinstance(cell, Panel)]
    styles, columns = _styles(graph, panels, scene.styles), columns_for(rows)
    figure, axes = arrange(columns, -(-len(cells) // columns), counted=counted)
    places = axes[: len(axes) - counted].ravel()
    drawn = {ax: _draw_cell(ax, graph, cell, styles) for ax, cell in zip_longest(places, cells)}
    if counted:
        _draw_counts(axes[-1, 0], graph, places[0].get_xlim())
    place_legend(figure, axes[-1, 1:] if counted else [], legend_of(graph, styles))
    place_title(figure, scene, graph)
    _write_labels(figure, drawn)
    return figure


def _draw_counts(ax: Axes, graph: BranchGraph, extent: tuple[float, float]) -> None:
    draw_counts(graph, ax)
    ax.set_xlim(extent)
    ax.margins(y=0.15)


def _draw_cell(
    ax: Axes, graph: BranchGraph, content: Content | None, styles: Mapping[str, Any]
) -> Diagram | None:
    if isinstance(content, Panel):
        return _draw_panel(ax, graph, content, styles)
    if isinstance(content, ParameterPath):
        draw_path(ax, graph, content)
    else:
        ax.set_axis_off()
    return None


def _draw_panel(
    ax: Axes,
    graph: BranchGraph,
    panel: Panel,
    styles: Mapping[str, Any],
    across: What | None = None,
) -> Diagram:
    diagram = Diagram.of(graph, panel, styles, across)
    diagram.draw(ax)
    diagram.set_axes(ax, graph, panel.title)
    return diagram


def _write_labels(figure: Figure | SubFigure, diagrams: Mapping[Axes, Diagram | None]) -> None:
    """Draw insets and labels, after the layout has set the sizes of the diagrams."""
    layout = figure.get_layout_engine()
    if layout is not None and isinstance(figure, Figure):
        layout.execute(figure)
    for ax, diagram in diagrams.items():
        if diagram is not None:
            room = diagram.room(ax)
            enlarged = draw_inset(ax, diagram, room)
            label_marks(ax, [mark for mark in diagram.marks if not mark.is_within(enlarged)], room)


def _styles(
    graph: BranchGraph, panels: Sequence[Panel], wanted: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a line style for every mode that occurs: from the scene, else from the system."""
    own = graph.system.line_styles if graph.system else {}
    modes = [mode_of(graph, panel) for panel in panels]
    words = (mode(piece.character) for mode in modes for piece in graph.pieces)
    return styles_of(words, {**own, **wanted})
