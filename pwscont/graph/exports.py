"""What a graph hands to other programs.

Failure modes and answers
-------------------------
- GraphML and the like know numbers and texts only: states and characters are written as texts.
- A recorded quantity fails at some point: a data frame is refused with what happened, the networkx
  graph has no such attribute there, and neither changes the branch graph.
- An unknown has the name of another column: its column is called ``z[i]``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from math import isfinite, isnan
from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, MissingPackageError
from pwscont.graph.records import Piece, SpecialPoint, attempted
from pwscont.graph.structure import Structure


class DamagedError(Exception):
    """An entry of a file is missing or of the wrong type; the message names it."""


@final
@dataclass(frozen=True, slots=True)
class Fields:
    """A JSON object, and its name in messages.

    All methods raise :class:`DamagedError` where an entry is missing or of another type.

    Parameters
    ----------
    name : str
        Such as ``"node 3"``.
    data : object
        The value read from the file; refused if it is no JSON object.
    """

    name: str
    data: Any

    def __post_init__(self) -> None:
        if not isinstance(self.data, dict):
            raise DamagedError(f"{self.name} is no JSON object")

    def has(self, key: str) -> bool:
        """Tell whether there is an entry, for entries that older files lack."""
        return key in self.data

    def entry(self, key: str) -> Any:
        """Return an entry of any type."""
        if key not in self.data:
            raise DamagedError(f"{self.name} has no {key}")
        return self.data[key]

    def integer(self, key: str, least: int) -> int:
        """Return a whole number that is not below ``least``."""
        value = self.entry(key)
        if type(value) is not int or value < least:
            raise self._unfit(key, f"a whole number from {least} on")
        return value

    def number(self, key: str) -> float:
        """Return a number, which may be infinite."""
        value = _number(self.entry(key))
        if value is None or isnan(value):
            raise self._unfit(key, "a number")
        return value

    def finite(self, key: str) -> float:
        """Return a finite number."""
        value = self.number(key)
        if not isfinite(value):
            raise self._unfit(key, "finite")
        return value

    def finite_or_text(self, key: str) -> float | str:
        """Return a finite number, or a text."""
        return self.text(key) if isinstance(self.entry(key), str) else self.finite(key)

    def text(self, key: str) -> str:
        """Return a text."""
        value = self.entry(key)
        if not isinstance(value, str):
            raise self._unfit(key, "a text")
        return value

    def word(self, key: str) -> str:
        """Return a text that is not empty."""
        text = self.text(key)
        if not text:
            raise DamagedError(f"{key} of {self.name} must not be empty")
        return text

    def items(self, key: str, length: int | None = None) -> list[Any]:
        """Return a list."""
        value = self.entry(key)
        if not isinstance(value, list) or (length is not None and len(value) != length):
            raise self._unfit(key, "a list" if length is None else f"a list of {length}")
        return value

    def numbers(self, key: str) -> Array:
        """Return a list of numbers."""
        values = self.items(key)
        if set(map(type, values)) - {float}:
            values = [_number(value) for value in values]
        if None in values:
            raise self._unfit(key, "a list of numbers")
        return np.array(values, dtype=float)

    def objects(self, key: str) -> list[Fields]:
        """Return a list of JSON objects, named by their place in the list."""
        return [Fields(f"entry {i} of {key}", item) for i, item in enumerate(self.items(key))]

    def _unfit(self, key: str, what: str) -> DamagedError:
        return DamagedError(f"{key} of {self.name} must be {what}, got {str(self.data[key])[:40]}")


def _number(value: Any) -> float | None:
    """Return a JSON number as a float, None if it is none or too large for one."""
    if type(value) not in (int, float):
        return None
    try:
        return float(value)
    except OverflowError:
        return None


if TYPE_CHECKING:
    import networkx as nx

#: The columns beside those of states, in data frames that have states.
FIXED = frozenset(
    ("piece", "component", "label", "alpha", "id", "kind", "name", "message", "error", "digits")
)

# -- networkx ------------------------------------------------------------------------------------


def networkx_graph(graph: Structure) -> nx.MultiGraph:
    """Return a networkx graph with plain attributes, for :attr:`pwscont.BranchGraph.nx`."""
    import networkx as nx  # noqa: PLC0415  it takes longer to import than most paths to follow

    plain, scale = nx.MultiGraph(), magnitudes(graph)
    for point in graph.special_points():
        if point.id >= 0:  # a start within a piece is no node
            plain.add_node(point.id, **_of_node(point))
    for piece in graph.pieces:
        plain.add_edge(piece.start, piece.end, key=piece.id, **_of_edge(piece, scale))
    return plain


def _of_node(point: SpecialPoint) -> dict[str, Any]:
    """Return the attributes of a node."""
    numbers = {k: value for k, value in attempted(point).items() if not isinstance(value, str)}
    words = {"kind": str(point.kind), "message": point.message, "name": point.name}
    return words | {"alpha": point.alpha, "z": json.dumps(point.z.tolist())} | numbers


def _of_edge(piece: Piece, scale: Array) -> dict[str, Any]:
    """Return the attributes of an edge."""
    lo, hi = piece.interval
    return {
        "piece": piece.id,
        "label": piece.label,
        "det_sign": int(piece.det_sign),
        "character": str(piece.character),
        "length": length(piece, scale),
        "alpha_lo": lo,
        "alpha_hi": hi,
    }


def magnitudes(graph: Structure) -> Array:
    """Return the largest magnitude of each unknown, 1 where it is zero, and the interval's length.

    They are taken from the graph, not from its system, so that lengths are the same for a graph
    that was read from a file.
    """
    each = [np.abs(piece.z).max(axis=0) for piece in graph.pieces]
    largest = np.max(each, axis=0) if each else np.zeros(0)
    lo, hi = graph.interval
    return np.append(np.where(largest > 0.0, largest, 1.0), hi - lo)


def length(piece: Piece, scale: Array) -> float:
    """Return the sum of the chords between the stored points of a piece."""
    return float(np.linalg.norm(np.diff(piece.points / scale, axis=0), axis=1).sum())


# -- pandas --------------------------------------------------------------------------------------


def data_frame(graph: Structure, rows: str) -> Any:
    """Return a pandas data frame, for :meth:`pwscont.BranchGraph.to_dataframe`."""
    tables = {"pieces": _pieces, "points": _points, "special": _special}
    if rows not in tables:
        raise InvalidInputError(f"rows must be one of {', '.join(tables)}, got {rows!r}")
    return tables[rows](graph, _pandas())


def _pandas() -> Any:
    try:
        return import_module("pandas")
    except ImportError as error:
        raise MissingPackageError("to_dataframe needs pandas: pip install pandas") from error


def _component(graph: Structure) -> dict[int, int]:
    """Return the number of the component of each piece."""
    return {piece.id: i for i, some in enumerate(graph.components()) for piece in some}


def _pieces(graph: Structure, pandas: Any) -> Any:
    component, scale = _component(graph), magnitudes(graph)
    ends = [(p.id, component[p.id], p.start, p.end, p.label) for p in graph.pieces]
    kinds = [(str(p.character), p.det_sign, *p.interval) for p in graph.pieces]
    sizes = [(len(p.track.inner) + 2, length(p, scale)) for p in graph.pieces]
    rows = [sum(parts, ()) for parts in zip(ends, kinds, sizes, strict=True)]
    names = "id component start end label character det_sign alpha_lo alpha_hi points length"
    return pandas.DataFrame(rows, columns=names.split())


def _points(graph: Structure, pandas: Any) -> Any:
    component = _component(graph)
    parts = [piece.points for piece in graph.pieces]
    points = np.vstack(parts) if parts else np.zeros((0, len(graph.names) + 1))
    heads = [
        row
        for piece, part in zip(graph.pieces, parts, strict=True)
        for row in [(piece.id, component[piece.id], piece.label)] * len(part)
    ]
    head = pandas.DataFrame(heads, columns=["piece", "component", "label"])
    head["alpha"] = points[:, -1]
    recorded = [graph.quantities.recorded(x[:-1], float(x[-1])) for x in points]
    names = list(graph.quantities.record)
    return _joined(pandas, [head, _states(graph, pandas, points[:, :-1]), (recorded, names)])


def _special(graph: Structure, pandas: Any) -> Any:
    points = graph.special_points()
    rows = [(p.id, str(p.kind), p.name, p.alpha, p.message) for p in points]
    head = pandas.DataFrame(rows, columns=["id", "kind", "name", "alpha", "message"])
    states = np.array([p.z for p in points]).reshape(len(points), len(graph.names))
    recorded = [p.quantities.recorded(p.z, p.alpha) for p in points]
    names = list(dict.fromkeys(name for row in recorded for name in row))
    errors = [(p.error[-1] if len(p.error) else np.nan, p.digits) for p in points]
    tail = pandas.DataFrame(errors, columns=["error", "digits"])
    return _joined(pandas, [head, _states(graph, pandas, states), (recorded, names), tail])


def _states(graph: Structure, pandas: Any, states: Array) -> Any:
    return pandas.DataFrame(states, columns=columns(graph.names))


def _joined(pandas: Any, parts: Sequence[Any]) -> Any:
    """Return tables side by side; a pair (rows, columns) becomes a table of floats first."""
    tables = [
        pandas.DataFrame(part[0], columns=part[1], dtype=float) if isinstance(part, tuple) else part
        for part in parts
    ]
    return pandas.concat(tables, axis=1)


def columns(names: Sequence[str]) -> list[str]:
    """Return a name for each unknown that no other column has: its own, or its place."""
    places = [f"z[{i}]" for i in range(len(names))]
    other = FIXED.union(places)
    return [
        place if name in other or name in names[:i] else name
        for i, (name, place) in enumerate(zip(names, places, strict=True))
    ]
