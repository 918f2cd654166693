"""The content of a scene's picture, and its arrangement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle
from textwrap import wrap
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pwscont.graph import BranchGraph
from pwscont.scenes.counting import is_one_number
from pwscont.scenes.drawn import Drawn
from pwscont.scenes.panels import Panel, ParameterPath, Shown
from pwscont.scenes.paths import is_at_rest
from pwscont.scenes.strokes import line_of
from pwscont.scenes.symbols import in_letters, number_of, symbol

Content: TypeAlias = Panel | ParameterPath

ROW, COUNTS, COLUMN, ALONE, LINE = 2.9, 1.8, 3.9, 6.4, 0.22  # inches
#: Most diagrams side by side, and most rows of a legend beside the counts.
MOST_COLUMNS, LEGEND_ROWS = 3, 6
#: Inches of a line in a legend and its letters per inch.
HANDLE, SMALL_LETTERS = 0.6, 16
#: Most constant quantities that a title names, and its letters per inch.
MOST_CONSTANTS, LETTERS = 4, 12


def rows_of(scene: Shown, graph: BranchGraph) -> list[list[Content]]:
    """Return the diagrams in rows, a row per title with its parameter path.

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
    lines = wrap(in_letters(scene.title), int(figure.get_figwidth() * LETTERS))
    lines += [said] if said else []
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
    """Return how many diagrams stand side by side."""
    lengths, count = {len(row) for row in rows}, sum(map(len, rows))
    if len(lengths) == 1 and max(lengths) <= MOST_COLUMNS:
        return max(lengths)
    return 2 if count in (2, 4) else MOST_COLUMNS


def arrange(columns: int, rows: int, *, counted: bool) -> tuple[Figure, Any]:
    """Return a figure and its axes: rows for diagrams, and a low row for the counts."""
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
    if _legend_width(handles, columns) <= COLUMN * len(free):
        free[0].legend(loc="center left", ncols=columns, fontsize="small", **style)
        return
    columns = max(1, min(int(figure.get_figwidth() // 2.1), len(handles)))
    while columns > 1 and _legend_width(handles, columns) > figure.get_figwidth():
        columns -= 1
    lines = max((str(handle.get_label()).count("\n") + 1 for handle in handles), default=1)
    figure.set_figheight(figure.get_figheight() + LINE * lines * -(-len(handles) // columns))
    figure.legend(loc="outside lower center", ncols=columns, fontsize="small", **style)


def _legend_width(handles: Sequence[Line2D], columns: int) -> float:
    """Return how many inches wide a legend is, about."""
    lines = [str(handle.get_label()).split("\n") for handle in handles]
    letters = [max(map(len, some)) for some in lines]
    longest = [max(part, default=0) for part in np.array_split(letters, columns or 1)]
    return sum(HANDLE + length / SMALL_LETTERS for length in longest)
