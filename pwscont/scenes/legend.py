"""Legends of branch diagrams: outside the axes, and short."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from textwrap import fill
from typing import Any

from matplotlib.lines import Line2D

from pwscont.basics.kind import Kind
from pwscont.graph import BranchGraph
from pwscont.scenes.marks import UNLABELLED, marked, markers_of
from pwscont.scenes.styles import COLORS, THIN, WIDTH, are_told_apart, color_of
from pwscont.scenes.symbols import in_notation, symbol

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


def told_apart(words: Sequence[str]) -> list[str]:
    """Return names that a legend has room for; what long names share at their ends is left out."""
    if max(map(len, words), default=0) > MOST_LETTERS:
        before, after = _shared(words), _shared([word[::-1] for word in words])[::-1]
        words = [_without(word, before, after) for word in words]
    return [fill(in_notation(word), MOST_LETTERS) for word in words]


def _shared(words: Sequence[str]) -> str:
    """Return what several names begin with, up to the end of a word."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*words, strict=False))
    shared = "".join(letters[0] for letters in alike) if len(words) > 1 else ""
    return shared[: shared.rfind(" ") + 1]


def _without(word: str, before: str, after: str) -> str:
    middle = word[len(before) : max(len(word) - len(after), len(before))]
    return f"{'… ' * bool(before)}{middle.strip(', ') or '–'}{' …' * bool(after)}"


def _word(graph: BranchGraph, kind: str) -> str:
    """Return the word for a kind, with a note on the number beside its mark."""
    beside = "" if kind in {*UNLABELLED, Kind.EVENT} else f", at {symbol(graph.parameter)}"
    return f"{kind}{beside}".replace("nonsmooth", "non-smooth")
