"""Branch diagrams in the manner of the paper.

Colours are branches, line styles modes, thin lines a negative determinant; marks are special
points. Imported only where a picture is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from pwscont.graph import BranchGraph
from pwscont.scenes.counting import draw_counts, is_one_number
from pwscont.scenes.diagram import Diagram, mode_of
from pwscont.scenes.drawn import Drawn, What, is_parameter
from pwscont.scenes.inset import draw_inset
from pwscont.scenes.labels import label_marks
from pwscont.scenes.layout import Content, arrange, columns_for, place_legend, place_title, rows_of
from pwscont.scenes.legend import legend_of
from pwscont.scenes.panels import Panel, ParameterPath, Shown
from pwscont.scenes.paths import draw_path
from pwscont.scenes.styles import styles_of
from pwscont.scenes.symbols import symbol


def plot(
    graph: BranchGraph,
    what: What = 0,
    *,
    x: What | None = None,
    y: What | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a quantity over the parameter, or over another one: colours are branches.

    Line styles are modes, and thin lines are pieces on which det(dH/dz) is negative. Where branches
    coincide over the parameter, the upper branch runs between rails in the colours of the branches
    beneath. Folds that are close together are enlarged.

    Parameters
    ----------
    graph : BranchGraph
    what : int, str or callable
        The quantity: index into z, name of an unknown or of a recorded quantity, or function of
        (z, alpha). Greek letters may be given in words, ``lambda_t`` for ``λ_t``.
    x : int, str or callable, optional
        The quantity of the horizontal axis; default the parameter, which goes by its name, too.
    y : int, str or callable, optional
        Another word for ``what``.
    ax : matplotlib.axes.Axes, optional
        Where to draw; default a new figure of pyplot, which notebooks and ``plt.show()`` show.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax.figure.savefig(...)`` writes the picture.

    Raises
    ------
    InvalidInputError
        If there is no such quantity; the message names close ones.

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
    panel = Panel(what if y is None else y)
    across = None if isinstance(x, str) and is_parameter(graph, x) else x
    for quantity in (panel.component, *(() if across is None else (across,))):
        Drawn.of(graph, quantity)  # refuses what cannot be drawn before there is a figure
    if ax is None:
        _, ax = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
    styles = _styles(graph, [panel], {})
    diagram = _draw_panel(ax, graph, panel, styles, across)
    handles = legend_of(graph, styles)
    ax.legend(
        handles=handles,
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
    ax.set(xlim=extent, xlabel=symbol(graph.parameter))
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
    """Enlarge what is crowded and write labels, once it is known how large the diagrams are."""
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
    """Return a line style for every mode that occurs: the scene's, else the system's."""
    own = graph.system.line_styles if graph.system else {}
    modes = [mode_of(graph, panel) for panel in panels]
    words = (mode(piece.character) for mode in modes for piece in graph.pieces)
    return styles_of(words, {**own, **wanted})
