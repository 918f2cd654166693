"""What a graph of evolutions hands to other programs, and the file of a graph.

A file is written whole or not at all, and checked when read.

Failure modes and answers
-------------------------
- The file is cut off, changed or something else: a zip holds a checksum of every entry, and types,
  shapes and references are checked.
- A piece is straight in the unknowns of the evolver; the states that users see are straight, too,
  where the evolver's are: so a graph that was read needs no system.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arguments import pandas_for
from pwscont.basics.arrays import Array
from pwscont.evolution.paths import EvolutionPaths
from pwscont.evolution.states import (
    KINDS,
    EvolutionNode,
    EvolutionPiece,
    EvolutionState,
    EvolutionStructure,
    StateReader,
)
from pwscont.graph.storage import (
    DamagedError,
    Fields,
    damaged,
    read_archive,
    stacked,
    write_archive,
)

if TYPE_CHECKING:
    import networkx as nx


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
    pandas = pandas_for(rows, tables)
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


FORMAT = "pwscont evolution"
VERSION = 1
ARRAYS = ("z", "memory", "ends", "memories")


@final
class StoredStates(StateReader):
    """The unknowns of a graph that was read from a file: those that users see, then the memory.

    Parameters
    ----------
    names : tuple of str
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names

    def memory(self, z: Array, t: float) -> Array:
        """Return what stands behind the unknowns."""
        return z[len(self._names) :]

    def shown(self, z: Array, t: float) -> Array:
        """Return the unknowns."""
        return z[: len(self._names)]

    def names(self) -> tuple[str, ...]:
        """Return the names."""
        return self._names


@final
@dataclass(frozen=True, slots=True)
class StoredGraph:
    """The content of a file."""

    nodes: list[EvolutionNode]
    pieces: list[EvolutionPiece]
    interval: tuple[float, float]
    reader: StoredStates
    guarantee: str


def write(path: str | Path, graph: EvolutionStructure) -> None:
    """Write a graph.

    Raises
    ------
    GraphFileError
        If the file cannot be written.
    """
    states = graph.events()
    ends = [z for i in range(len(graph.pieces)) for z in ends_of(graph, i)]
    memories = [m for i in range(len(graph.pieces)) for m in _memories(graph, i)]
    arrays = {
        "z": stacked([state.z for state in states]),
        "memory": stacked([state.memory for state in states]),
        "ends": stacked(ends),
        "memories": stacked(memories),
    }
    write_archive(path, _header(graph), arrays)


def _memories(graph: EvolutionStructure, number: int) -> list[Array]:
    piece = graph.pieces[number]
    return [graph.memory_at(piece.first, piece.start), graph.memory_at(piece.last, piece.end)]


def _header(graph: EvolutionStructure) -> dict[str, Any]:
    nodes = [
        {"t": node.t, "kind": node.kind, "name": node.name, "remark": node.remark}
        for node in graph.nodes
    ]
    pieces = [
        {"start": p.start, "end": p.end, "label": p.label, "jump": p.is_jump} for p in graph.pieces
    ]
    return {
        "format": FORMAT,
        "version": VERSION,
        "interval": list(graph.interval),
        "names": list(graph.names),
        "guarantee": graph.guarantee,
        "nodes": nodes,
        "pieces": pieces,
    }


def read(path: str | Path) -> StoredGraph:
    """Read what :func:`write` wrote.

    Raises
    ------
    GraphFileError
        If the file cannot be read, is damaged, or is something else.
    """
    header, arrays = read_archive(path, FORMAT, ARRAYS)
    try:
        return _stored(Fields("the header", header), arrays)
    except DamagedError as error:
        raise damaged(path, FORMAT, error) from error


def _stored(header: Fields, arrays: dict[str, Any]) -> StoredGraph:
    if header.entry("format") != FORMAT or header.entry("version") != VERSION:
        raise DamagedError(f"it holds {header.entry('format')!r}, {header.entry('version')!r}")
    nodes, pieces = header.objects("nodes"), header.objects("pieces")
    names = tuple(str(name) for name in header.items("names"))
    tables = {name: _table(name, arrays[name]) for name in ARRAYS}
    z, memory = tables["z"], tables["memory"]
    both = np.hstack([tables["ends"], tables["memories"]]) if pieces else np.empty((0, 0))
    if len(z) != len(nodes) or len(memory) != len(nodes) or len(both) != 2 * len(pieces):
        raise DamagedError("the numbers of states, nodes and pieces do not fit")
    if nodes and z.shape[1] != len(names):
        raise DamagedError(f"{len(names)} names for {z.shape[1]} unknowns")
    found = [_stored_node(*row) for row in zip(nodes, np.hstack([z, memory]), memory, strict=True)]
    linked = [_stored_piece(f, both[2 * i : 2 * i + 2], len(nodes)) for i, f in enumerate(pieces)]
    lo, hi = header.numbers("interval").tolist()
    return StoredGraph(found, linked, (lo, hi), StoredStates(names), header.text("guarantee"))


def _table(name: str, values: Any) -> Array:
    if not isinstance(values, np.ndarray) or values.dtype != float or values.ndim != 2:
        raise DamagedError(f"{name} must be rows of numbers")
    if not np.isfinite(values).all():
        raise DamagedError(f"{name} must be finite")
    return values


def _stored_node(fields: Fields, z: Array, memory: Array) -> EvolutionNode:
    kind = fields.word("kind")
    if kind not in KINDS:
        raise DamagedError(f"kind of {fields.name} is {kind!r}")
    words = fields.text("name"), fields.text("remark")
    return EvolutionNode(fields.finite("t"), z, memory, kind, *words)


def _stored_piece(fields: Fields, ends: Array, nodes: int) -> EvolutionPiece:
    start, end = fields.integer("start", 0), fields.integer("end", 0)
    if max(start, end) >= nodes:
        raise DamagedError(f"{fields.name} refers to a node that is not there")
    label = fields.text("label")
    return EvolutionPiece(start, end, label, ends[0], ends[1], bool(fields.entry("jump")))
