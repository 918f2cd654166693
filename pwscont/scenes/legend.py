"""Legends of branch diagrams: outside the axes, and short."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.lines import Line2D

from pwscont.basics.kind import Kind
from pwscont.graph import BranchGraph
from pwscont.scenes.marks import UNLABELLED, marked, markers_of
from pwscont.scenes.styles import COLORS, THIN, WIDTH, are_told_apart, color_of
from pwscont.scenes.symbols import symbol

#: Most letters of a name, and most branches, in a legend.
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
        Line2D([], [], color="black", linewidth=WIDTH, linestyle=style, label=shortened(word))
        for word, style in styles.items()
    ]


def _signs(graph: BranchGraph) -> list[Line2D]:
    """Return the handle that explains thin lines, where there are any."""
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


def shortened(word: str) -> str:
    """Return a name that a legend has room for."""
    return word if len(word) <= MOST_LETTERS else f"{word[: MOST_LETTERS - 1].rstrip(', ')}…"


def _word(graph: BranchGraph, kind: str) -> str:
    """Return the word for a kind, with a note on the number beside its mark."""
    beside = "" if kind in {*UNLABELLED, Kind.EVENT} else f", at {symbol(graph.parameter)}"
    return f"{kind}{beside}".replace("nonsmooth", "non-smooth")
