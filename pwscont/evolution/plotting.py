"""Pictures of evolutions: a quantity over time, or a loop of one quantity over another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pwscont.basics.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pwscont.evolution.states import EvolutionPiece
    from pwscont.evolution.structure import EvolutionStructure

#: Marks of nodes by kind; other kinds have no mark.
MARKS = {"start": "o", "branching": "s", "loss": "X", "jump": "^", "undecided": "?"}
MARK_SIZE = 36


def draw(graph: EvolutionStructure, panels: Sequence[tuple[str | int, str | int]]) -> Figure:
    """Return a picture of all evolutions, with a panel for each pair of quantities (y, x)."""
    from matplotlib.figure import Figure  # noqa: PLC0415  only where asked for

    figure = Figure(figsize=(6.4 * len(panels), 4.4), layout="constrained")
    for axes, (y, x) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        for piece in graph.pieces:
            _draw_piece(axes, graph, piece, (x, y))
        _draw_nodes(axes, graph, (x, y))
        axes.set_xlabel(_named(graph, x))
        axes.set_ylabel(_named(graph, y))
    return figure


def _draw_piece(
    axes: Axes, graph: EvolutionStructure, piece: EvolutionPiece, shown: tuple[str | int, str | int]
) -> None:
    points = np.array([_point(graph, piece, place, shown) for place in (0, 1)])
    style = ":" if piece.is_jump else "-"
    axes.plot(*points.T, style, color="0.5" if piece.is_jump else "C0", linewidth=1.4)


def _point(
    graph: EvolutionStructure, piece: EvolutionPiece, place: int, shown: tuple[str | int, str | int]
) -> list[float]:
    node = piece.end if place else piece.start
    jump = piece.is_jump
    state = graph.node(node) if jump else graph.on(piece, graph.nodes[node].t)
    return [graph.value(state, quantity) for quantity in shown]


def _draw_nodes(axes: Axes, graph: EvolutionStructure, shown: tuple[str | int, str | int]) -> None:
    for kind, mark in MARKS.items():
        states = graph.events(kind)
        points: Array = np.array([[graph.value(s, q) for q in shown] for s in states])
        if len(points):
            marker = f"${mark}$" if mark == "?" else mark
            axes.scatter(
                points[:, 0],
                points[:, 1],
                MARK_SIZE,
                color="C3",
                marker=marker,
                label=kind,
                zorder=3,
            )
    if axes.get_legend_handles_labels()[0]:
        axes.legend()


def _named(graph: EvolutionStructure, quantity: str | int) -> str:
    return graph.names[quantity] if isinstance(quantity, int) else quantity
