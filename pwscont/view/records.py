"""The records of a view for the page: lists, texts, and arrays packed in base64."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from pwscont import BranchGraph, Character
from pwscont.extending import FEW_DIGITS, SAME_ALPHA, Kind, SpecialPoint, attempted, counted, number
from pwscont.scenes.panels import Panel
from pwscont.scenes.styles import COLORS, in_letters, styles_of
from pwscont.view.numbers import Numbers, is_curved

#: The look of each kind of special point: marker of Bokeh, size in pixels, whether hollow.
MARKERS: dict[str, tuple[str, int, bool]] = {
    Kind.START: ("asterisk", 11, False),
    Kind.END: ("dot", 8, False),
    Kind.TRANSITION: ("circle", 7, True),
    Kind.NONSMOOTH_FOLD: ("circle", 8, False),
    Kind.FOLD: ("diamond", 10, False),
    Kind.BRANCH_POINT: ("plus", 11, False),
    Kind.CORNER: ("square", 8, False),
    Kind.PARTIAL_CORNER: ("square", 8, True),
    Kind.NONSMOOTH_BRANCH_POINT: ("triangle", 9, False),
    Kind.DEGENERATE: ("inverted_triangle", 9, False),
    Kind.ISOLATED: ("dot", 14, False),
    Kind.EVENT: ("star", 12, False),
    Kind.STOPPED: ("x", 10, False),
}
#: The markers for kinds of a user's own detectors, in the order of the kinds' names.
OWN_MARKERS = ("hex", "square_pin", "triangle_pin", "diamond_cross", "circle_x", "square_x")
MINUS = "\N{MINUS SIGN}"
#: Most digits shown of interpolated values, and the possible error of interpolation as a part of
#: the largest value: with the system, which checked every step by cubics, and without the system.
#: A cubic is off by 1e-5 of typical magnitudes at most where a step was looked at; the width of the
#: interval, the typical magnitude of the parameter, may be twice the largest value.
CORRECTED, UNCORRECTED = (4, 2.5e-5), (3, 3e-3)
#: Most transitions of a graph that are drawn with marks of full size, and the least size in pixels.
FEW, SMALLEST = 12, 4.0
#: More transitions than this are drawn as plain dots: outlines would take most of the drawing time.
CROWD = 300


def packed(values: Any, kind: str) -> dict[str, Any]:
    """Return an array as the page unpacks arrays: type in JavaScript, and bytes in base64."""
    types = {"Float64Array": "<f8", "Float32Array": "<f4", "Int32Array": "<i4"}
    array = np.ascontiguousarray(values, dtype=types[kind])
    return {"type": kind, "bytes": b64encode(array.tobytes()).decode("ascii")}


def graph_records(graph: BranchGraph, numbers: Numbers, wanted: Sequence[str]) -> dict[str, Any]:
    """Return the records of a graph for the page.

    Parameters
    ----------
    graph : BranchGraph
    numbers : Numbers
    wanted : sequence of str
        Names of quantities that are never left out.
    """
    kept, plain = numbers.fitting(wanted), graph.to_dict()
    digits, rough = CORRECTED if graph.system is not None else UNCORRECTED
    return {
        "parameter": graph.parameter,
        "interval": list(graph.interval),
        "same": SAME_ALPHA,
        "names": [numbers.names[i] for i in kept],
        "digits": digits,
        "rough": (rough * numbers.largest[kept]).tolist(),
        "unknowns": int((kept <= numbers.unknowns).sum()) - 1,
        "dust": numbers.dust(graph)[kept].tolist(),
        "left_out": len(numbers.names) - len(kept),
        "rows": packed(numbers.rows[:, kept], "Float64Array"),
        "pieces": _pieces(graph, numbers),
        "points": _points(graph, numbers),
        "branches": len(graph.components()),
        "colors": list(COLORS),
        "stretches": plain["stretches"],
        "between": plain["between"],
        "breaks": graph.breaks(),
        "balances": graph.balances(),
        "guarantee": plain["guarantee"],
        "searched": plain["searched"],
        "complete": graph.is_complete,
    }


def _pieces(graph: BranchGraph, numbers: Numbers) -> dict[str, Any]:
    branch = {piece.id: i for i, some in enumerate(graph.components()) for piece in some}
    labels = list(dict.fromkeys(piece.label for piece in graph.pieces))
    place = {label: i for i, label in enumerate(labels)}
    ends = np.cumsum([0, *map(len, numbers.pieces)])
    rows = np.concatenate([np.zeros(0), *numbers.pieces])
    return {
        "id": [piece.id for piece in graph.pieces],
        "first": ends.tolist(),
        "rows": packed(rows, "Int32Array"),
        "along": packed(np.concatenate([np.zeros(0), *numbers.along]), "Float64Array"),
        "branch": [branch[piece.id] for piece in graph.pieces],
        "start": [piece.start for piece in graph.pieces],
        "end": [piece.end for piece in graph.pieces],
        "det": [piece.det_sign for piece in graph.pieces],
        "label": [place[piece.label] for piece in graph.pieces],
        "labels": labels,
        "curved": [is_curved(piece) for piece in graph.pieces],
        "vertical": [piece.is_vertical for piece in graph.pieces],
    }


def _points(graph: BranchGraph, numbers: Numbers) -> list[dict[str, Any]]:
    """Return the records of the special points; nodes have the records of a solution, too."""
    branch, points = _branches(graph), graph.special_points()
    return [
        _point(graph, point, branch) | {"row": int(row)}
        for point, row in zip(points, numbers.points, strict=True)
    ]


def _point(graph: BranchGraph, point: SpecialPoint, branch: Mapping[int, int]) -> dict[str, Any]:
    told = {"node": point.id, "kind": str(point.kind), "words": _words(graph, point)}
    ends = any(graph.same(point.alpha, end) for end in graph.interval)
    told |= {"shown": not (ends and point.kind in (Kind.START, Kind.END))}
    if point.id < 0:  # a start within a piece
        return told | {"branch": branch[_start_of(graph, point)]}
    found = graph.solution_at(point.id)
    known = {"det": found.det_sign, "piece": found.piece, "label": found.label}
    return told | {"branch": branch[point.id]} | known


def _start_of(graph: BranchGraph, point: SpecialPoint) -> int:
    return next(piece.start for piece in graph.pieces if piece.id == point.piece)


def _branches(graph: BranchGraph) -> dict[int, int]:
    """Return the branch of each node; branches are numbered as by ``graph.components()``."""
    alone = (p.id for p in graph.nodes if not graph.pieces_at(p.id))
    ends = [[node for p in pieces for node in (p.start, p.end)] for pieces in graph.components()]
    return {node: i for i, nodes in enumerate(ends) for node in nodes or (next(alone),)}


def _words(graph: BranchGraph, point: SpecialPoint) -> list[str]:
    """Return the lines shown when the pointer is over a special point."""
    name = in_letters(graph.parameter)
    lines = [f"{name} = {_alpha(graph, point.alpha)}", point.message]
    lines += [point.events] if point.events else []
    lines += [f"{name} = {_value(value)}" for name, value in attempted(point).items()]
    few = point.digits < FEW_DIGITS
    known = f"only {counted(int(point.digits), 'digit')} known"
    return [line for line in lines if line] + [known] * few


def _alpha(graph: BranchGraph, alpha: float) -> str:
    """Return a parameter value as text, with more digits in an interval far from zero."""
    return number(graph.clean(alpha), graph.interval).replace("-", MINUS)


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else number(value).replace("-", MINUS)


def marks(graph: BranchGraph) -> dict[str, dict[str, Any]]:
    """Return {kind: look} for the special points of a graph; many transitions get small marks."""
    kinds = [str(point.kind) for point in graph.special_points()]
    own = zip(sorted({*kinds} - {*MARKERS}), cycle(OWN_MARKERS), strict=False)
    every = MARKERS | {kind: (marker, 9, False) for kind, marker in own}
    count = kinds.count(Kind.TRANSITION)
    small = max(SMALLEST, MARKERS[Kind.TRANSITION][1] * min(1.0, (FEW / max(count, 1)) ** 0.5))
    looks = {
        kind: {"marker": marker, "size": size, "hollow": hollow, "lined": True}
        for kind, (marker, size, hollow) in every.items()
        if kind in kinds
    }
    if count:
        crowd = count > CROWD
        looks[Kind.TRANSITION] |= {"size": small, "hollow": not crowd, "lined": not crowd}
    return looks


# -- styles by mode ------------------------------------------------------------------------------


def style_records(
    graph: BranchGraph, panels: Sequence[Panel], wanted: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return the line styles of all pieces, by the mode of each panel and by the whole state."""
    own = graph.system.line_styles if graph.system else {}
    whole = _style(graph, "all of the state", None, {**own, **wanted})
    some = {panel.title or "part of the state": panel.mode for panel in panels if panel.mode}
    parts = [_style(graph, title, mode, {**own, **wanted}) for title, mode in some.items()]
    return [*(part for part in parts if part["of"] != whole["of"]), whole]


def _style(
    graph: BranchGraph,
    title: str,
    mode: Callable[[Character], str] | None,
    wanted: Mapping[str, Any],
) -> dict[str, Any]:
    words = [mode(p.character) if mode else p.label for p in graph.pieces]
    return style_record(title, words, wanted)


def style_record(title: str, words: Sequence[str], wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Return the line style of each piece by the words of the pieces."""
    styles = styles_of(words, wanted)
    place = {word: i for i, word in enumerate(styles)}
    return {
        "title": title,
        "words": list(styles),
        "dashes": [dash_of(style) for style in styles.values()],
        "of": [place[word] for word in words],
    }


#: Names of matplotlib's line styles -> lengths of dashes and gaps, in widths of the line.
DASHES = {
    "-": [],
    "solid": [],
    "--": [4, 2],
    "dashed": [4, 2],
    "-.": [6, 2, 1, 2],
    "dashdot": [6, 2, 1, 2],
    ":": [1, 2],
    "dotted": [1, 2],
}
#: Pixels for each width of the line.
UNIT = 2


def dash_of(style: Any) -> list[int]:
    """Return a line style of matplotlib as lengths of dashes and gaps in pixels."""
    lengths = DASHES.get(style, []) if isinstance(style, str) else style[1] or []
    return [max(1, round(UNIT * float(length))) for length in lengths]
