"""The records of evolutions for the page of :class:`pwscont.View`.

A page shows branches over a parameter, and evolutions over t. A piece of evolutions
belongs to all evolutions that share the piece, and has stripes of all their colours.

Failure modes and answers
-------------------------
- There are very many evolutions: the first evolutions have a colour each, the rest share a colour.
- Too many unknowns for a page: the unknowns that fit are kept, and the page says how many are not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.printing import number
from pwscont.evolution.plotting import MOST_COLORED, SAMPLES, colored, owners_of
from pwscont.evolution.states import SAME_TIME
from pwscont.graph.branch_graph import DUST
from pwscont.scenes.styles import COLORS
from pwscont.view.numbers import MOST_NUMBERS, row_of
from pwscont.view.records import packed, style_record

if TYPE_CHECKING:
    from pwscont.evolution.states import EvolutionStructure

#: Marker of Bokeh, size in pixels, whether hollow, by kind of node.
MARKERS = {
    "start": ("circle", 9, True),
    "event": ("dot", 7, False),
    "branching": ("square", 9, True),
    "loss": ("x", 11, False),
    "jump": ("triangle", 9, False),
    "undecided": ("star", 11, False),
    "end": ("dot", 8, False),
}


def page_records(graph: EvolutionStructure, wanted: str) -> dict[str, Any]:
    """Return the records of a graph of evolutions for the page.

    Parameters
    ----------
    graph : EvolutionStructure
    wanted : str
        The name of a quantity that is never left out.
    """
    count = SAMPLES if graph.quantities.record else 2
    along = [graph.along(piece, count) for piece in graph.pieces]
    *lines, points = [
        np.array([row_of(state.quantities, state.z, state.t) for state in states])
        for states in [*along, graph.events()]
    ]
    names = ["t", *graph.names, *graph.quantities.record]
    rows = np.vstack([*lines, points])
    kept = _fitting(rows, len(graph.names), names.index(wanted))
    largest = np.nan_to_num(np.abs(rows)).max(axis=0, initial=0.0)[kept]
    chosen, more = colored(graph)
    return {
        "parameter": "t",
        "interval": list(graph.interval),
        "same": SAME_TIME,
        "names": [names[i] for i in kept],
        "digits": 4,
        "rough": (1e-5 * largest).tolist(),
        "unknowns": int((kept <= len(graph.names)).sum()) - 1,
        "dust": (DUST * largest).tolist(),
        "left_out": len(names) - len(kept),
        "rows": packed(rows[:, kept], "Float64Array"),
        "pieces": _pieces(graph, [len(line) for line in lines]),
        "points": _points(graph, len(rows) - len(points)),
        "branches": len(chosen) + (more > 0),
        "noun": "evolution",
        "others": more > 0,
        "colors": [*COLORS[: len(chosen)], "#b0b0b0"],
        **_counts(graph),
        "guarantee": graph.guarantee,
        "searched": "all ways on at every event",
        "complete": graph.guarantee.startswith("all "),
        "marks": _marks(graph),
        "styles": [style_record("modes", [piece.label for piece in graph.pieces], {})],
    }


def _fitting(rows: Array, unknowns: int, wanted: int) -> Any:
    """Return the columns that fit into a page: time, what is wanted or recorded, unknowns."""
    columns = range(rows.shape[1])
    order = dict.fromkeys([0, wanted, *columns[1 + unknowns :], *columns])
    return np.sort(np.array(list(order)[: max(2, MOST_NUMBERS // max(len(rows), 1))], dtype=int))


def _owners(graph: EvolutionStructure) -> list[list[int]]:
    """Return for each piece the evolutions with a colour that share it, or the rest together."""
    owners = owners_of(colored(graph)[0])
    return [owners.get(id(piece), [MOST_COLORED]) for piece in graph.pieces]


def _pieces(graph: EvolutionStructure, lengths: list[int]) -> dict[str, Any]:
    owners, labels = _owners(graph), [piece.label for piece in graph.pieces]
    words = list(dict.fromkeys(labels))
    place = {label: i for i, label in enumerate(words)}
    first = np.cumsum([0, *lengths])
    along = [np.linspace(0.0, 1.0, length) for length in lengths]
    return {
        "id": list(range(len(graph.pieces))),
        "first": first.tolist(),
        "rows": packed(np.arange(first[-1]), "Int32Array"),
        "along": packed(np.concatenate([np.zeros(0), *along]), "Float64Array"),
        "branch": [some[0] for some in owners],
        "owners": owners,
        "start": [piece.start for piece in graph.pieces],
        "end": [piece.end for piece in graph.pieces],
        "det": [0] * len(graph.pieces),
        "label": [place[label] for label in labels],
        "labels": words,
        "curved": [False] * len(graph.pieces),
        "vertical": [False] * len(graph.pieces),
        "jump": [piece.is_jump for piece in graph.pieces],
    }


def _points(graph: EvolutionStructure, first: int) -> list[dict[str, Any]]:
    """Return the records of the nodes, whose rows follow one another from a row on."""
    owners, place = _owners(graph), {id(piece): i for i, piece in enumerate(graph.pieces)}
    points = []
    for i, state in enumerate(graph.events()):
        beside = [*graph.into[i], *graph.out_of[i]]
        piece = place[id(beside[0])] if beside else -1
        words = [line for line in (f"t = {number(state.t)}", state.name, state.remark) if line]
        told = {"node": i, "row": first + i, "piece": piece, "label": state.label, "words": words}
        told |= {"kind": str(state.kind), "shown": state.kind != "end", "det": 0}
        points.append(told | {"branch": owners[piece][0] if beside else 0})
    return points


def _counts(graph: EvolutionStructure) -> dict[str, Any]:
    """Return the number of states by time."""
    rows = graph.multiplicity()
    names = ("lo", "hi", "count", "lo_closed", "hi_closed")
    between = [[t, graph.count(t)] for t in sorted({node.t for node in graph.nodes})]
    stretches = [dict(zip(names, (*row, True, True), strict=True)) for row in rows]
    return {"stretches": stretches, "between": between, "breaks": [], "balances": []}


def _marks(graph: EvolutionStructure) -> dict[str, dict[str, Any]]:
    names, kinds = ("marker", "size", "hollow", "lined"), {node.kind for node in graph.nodes}
    looks = {kind: MARKERS[kind] for kind in MARKERS if kind in kinds}
    return {kind: dict(zip(names, (*look, True), strict=True)) for kind, look in looks.items()}
