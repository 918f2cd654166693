"""What a graph of evolutions hands to other programs."""

from __future__ import annotations

import json
from importlib import import_module
from typing import TYPE_CHECKING, Any

from pwscont.basics.errors import InvalidInputError, MissingPackageError
from pwscont.evolution.paths import EvolutionPaths
from pwscont.evolution.states import EvolutionState

if TYPE_CHECKING:
    import networkx as nx

    from pwscont.evolution.structure import EvolutionStructure


def networkx_graph(graph: EvolutionStructure) -> nx.DiGraph:
    """Return a networkx graph with plain attributes, for :attr:`EvolutionGraph.nx`."""
    import networkx as nx  # noqa: PLC0415  only where asked for

    plain = nx.DiGraph()
    for i in range(len(graph.nodes)):
        plain.add_node(i, **_node(graph.node(i)))
    for piece in graph.pieces:
        t0, t1 = graph.nodes[piece.start].t, graph.nodes[piece.end].t
        plain.add_edge(piece.start, piece.end, label=piece.label, t0=t0, t1=t1, jump=piece.is_jump)
    return plain


def _node(state: EvolutionState) -> dict[str, Any]:
    words = {"kind": str(state.kind), "name": state.name, "remark": state.remark}
    recorded = state.quantities.attempted(state.z, state.t)
    numbers = {name: value for name, value in recorded.items() if not isinstance(value, str)}
    vectors = {"z": json.dumps(state.z.tolist()), "memory": json.dumps(state.memory.tolist())}
    return {"t": state.t} | words | vectors | numbers


def data_frame(graph: EvolutionStructure, rows: str) -> Any:
    """Return a pandas data frame, for :meth:`EvolutionGraph.to_dataframe`."""
    tables = {"events": _events, "pieces": _pieces}
    if rows not in tables:
        raise InvalidInputError(f"rows must be one of {', '.join(tables)}, got {rows!r}")
    try:
        pandas = import_module("pandas")
    except ImportError as error:
        raise MissingPackageError("to_dataframe needs pandas: pip install pandas") from error
    return pandas.DataFrame(tables[rows](graph))


def _events(graph: EvolutionStructure) -> dict[str, list[Any]]:
    states = graph.events()
    columns: dict[str, list[Any]] = {
        "id": [state.node for state in states],
        "kind": [state.kind for state in states],
        "name": [state.name for state in states],
        "t": [state.t for state in states],
    }
    for i, name in enumerate(graph.names):
        columns[name if name not in columns else f"z[{i}]"] = [state.z[i] for state in states]
    return columns


def _pieces(graph: EvolutionStructure) -> dict[str, list[Any]]:
    return {
        "start": [piece.start for piece in graph.pieces],
        "end": [piece.end for piece in graph.pieces],
        "label": [piece.label for piece in graph.pieces],
        "t0": [graph.nodes[piece.start].t for piece in graph.pieces],
        "t1": [graph.nodes[piece.end].t for piece in graph.pieces],
        "jump": [piece.is_jump for piece in graph.pieces],
    }


def as_dict(graph: EvolutionStructure) -> dict[str, Any]:
    """Return nodes and pieces as plain lists and numbers."""
    lo, hi = graph.interval
    return {
        "parameter": {"name": "t", "lo": lo, "hi": hi},
        "names": list(graph.names),
        "nodes": [
            {
                "id": state.node,
                "kind": state.kind,
                "name": state.name,
                "alpha": state.t,
                "z": state.z.tolist(),
                "memory": state.memory.tolist(),
                "remark": state.remark,
            }
            for state in graph.events()
        ],
        "pieces": [
            {
                "id": i,
                "start": piece.start,
                "end": piece.end,
                "label": piece.label,
                "alpha": [graph.nodes[piece.start].t, graph.nodes[piece.end].t],
                "points": [piece_end.tolist() for piece_end in ends_of(graph, i)],
                "jump": piece.is_jump,
            }
            for i, piece in enumerate(graph.pieces)
        ],
        "evolutions": EvolutionPaths(graph).number,
        "guarantee": graph.guarantee,
    }


def ends_of(graph: EvolutionStructure, number: int) -> list[Any]:
    """Return the states that users see at both ends of a piece."""
    piece = graph.pieces[number]
    times = graph.nodes[piece.start].t, graph.nodes[piece.end].t
    pairs = zip((piece.first, piece.last), times, strict=True)
    return [graph.shown(z, t) for z, t in pairs]
