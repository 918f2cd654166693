"""What a graph hands to readers and to other programs: text, HTML, plain data, tables, networkx.

GraphML and the like know numbers and texts only: states and characters are written as texts.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import import_module
from math import isinf
from typing import TYPE_CHECKING, Any

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, MissingPackageError
from pwscont.basics.outcome import NOTHING_FOUND
from pwscont.basics.printing import apart, counted, number
from pwscont.graph.balance import balance_values
from pwscont.graph.queries import multiplicity, runs
from pwscont.graph.records import Piece, SpecialPoint, attempted
from pwscont.graph.structure import ConnectedPieces

if TYPE_CHECKING:
    import networkx as nx

#: The columns beside those of states, in data frames that have states.
FIXED = frozenset(
    ("piece", "component", "label", "alpha", "id", "kind", "name", "message", "error", "digits")
)

# -- networkx ------------------------------------------------------------------------------------


def networkx_graph(graph: ConnectedPieces) -> nx.MultiGraph:
    """Return the branch graph as a new networkx graph with plain attributes.

    All attributes are numbers and texts, which :func:`networkx.write_graphml` and the like can
    write. Changing the networkx graph does not change the branch graph.

    Nodes are the ids of special points. Nodes have ``kind``, ``alpha``, ``message``, ``name``, the
    recorded quantities, and ``z``, the state as a JSON list. (The array is ``graph.point(node).z``;
    a single unknown is ``graph.point(node)["u_t"]``.)

    The key of an edge is the id of the piece. Edges have this ``piece``, ``label``, ``det_sign``,
    ``character`` (a text of + and -), ``alpha_lo``, ``alpha_hi``, and ``length``: the sum of the
    chords between stored points in (z, alpha), where alpha is measured by the interval and each
    unknown by the largest magnitude in the graph.
    """
    import networkx as nx  # noqa: PLC0415  it takes longer to import than most paths to follow

    plain, scale = nx.MultiGraph(), magnitudes(graph)
    for point in graph.nodes:
        recorded = {k: v for k, v in attempted(point).items() if not isinstance(v, str)}
        words = {"kind": str(point.kind), "message": point.message, "name": point.name}
        state = {"alpha": point.alpha, "z": json.dumps(point.z.tolist())}
        plain.add_node(point.id, **(words | state | recorded))
    for piece in graph.pieces:
        plain.add_edge(piece.start, piece.end, key=piece.id, **_of_edge(piece, scale))
    return plain


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


def magnitudes(graph: ConnectedPieces) -> Array:
    """Return the largest magnitude of each unknown, 1 for zero, and the interval's length."""
    each = [np.abs(piece.z).max(axis=0) for piece in graph.pieces]
    largest = np.max(each, axis=0) if each else np.zeros(0)
    lo, hi = graph.interval
    return np.append(np.where(largest > 0.0, largest, 1.0), hi - lo)


def length(piece: Piece, scale: Array) -> float:
    """Return the sum of the chords between the stored points of a piece."""
    return float(np.linalg.norm(np.diff(piece.points / scale, axis=0), axis=1).sum())


# -- pandas --------------------------------------------------------------------------------------


def data_frame(graph: ConnectedPieces, rows: str) -> Any:
    """Return a pandas data frame.

    Parameters
    ----------
    rows : {"pieces", "points", "special"}
        "pieces": one row for each piece, with id, component, start, end, label, character,
        det_sign, alpha_lo, alpha_hi, number of points and length (see :attr:`nx`).
        "points": one row for each stored point of every piece, with piece, component, label,
        alpha, all unknowns by name and the recorded quantities.
        "special": one row for each special point, with id (-1 for a start within a piece),
        kind, name, alpha, message, all unknowns by name, the recorded quantities, the
        estimated error of alpha and the number of digits known.

        An unknown whose name is that of another column, such as ``alpha`` or ``name``, is
        called by the place among the unknowns, ``z[i]``.

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    InvalidInputError
        If ``rows`` is another word, or a recorded quantity fails.
    MissingPackageError
        If pandas is not installed.
    """
    tables = {"pieces": _pieces, "points": _points, "special": _special}
    if rows not in tables:
        raise InvalidInputError(f"rows must be one of {', '.join(tables)}, got {rows!r}")
    try:
        pandas = import_module("pandas")
    except ImportError as error:
        raise MissingPackageError("to_dataframe needs pandas: pip install pandas") from error
    return tables[rows](graph, pandas)


def _component(graph: ConnectedPieces) -> dict[int, int]:
    """Return the number of the component of each piece."""
    return {piece.id: i for i, some in enumerate(graph.components()) for piece in some}


def _pieces(graph: ConnectedPieces, pandas: Any) -> Any:
    component, scale = _component(graph), magnitudes(graph)
    rows = [
        {"id": p.id, "component": component[p.id], "start": p.start, "end": p.end}
        | {"points": len(p.points), **_of_edge(p, scale)}
        for p in graph.pieces
    ]
    names = "id component start end label character det_sign alpha_lo alpha_hi points length"
    return pandas.DataFrame(rows, columns=names.split())


def _points(graph: ConnectedPieces, pandas: Any) -> Any:
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
    states = pandas.DataFrame(points[:, :-1], columns=columns(graph.names))
    values = [graph.quantities.recorded(x[:-1], float(x[-1])) for x in points]
    names = list(graph.quantities.record)
    recorded = pandas.DataFrame(values, columns=names, dtype=float)
    return pandas.concat([head, states, recorded], axis=1)


def _special(graph: ConnectedPieces, pandas: Any) -> Any:
    points = graph.special_points()
    rows = [(p.id, str(p.kind), p.name, p.alpha, p.message) for p in points]
    head = pandas.DataFrame(rows, columns=["id", "kind", "name", "alpha", "message"])
    z = np.array([p.z for p in points]).reshape(len(points), len(graph.names))
    states = pandas.DataFrame(z, columns=columns(graph.names))
    values = [p.quantities.recorded(p.z, p.alpha) for p in points]
    names = list(dict.fromkeys(name for row in values for name in row))
    recorded = pandas.DataFrame(values, columns=names, dtype=float)
    errors = [(p.error[-1] if len(p.error) else np.nan, p.digits) for p in points]
    tail = pandas.DataFrame(errors, columns=["error", "digits"])
    return pandas.concat([head, states, recorded, tail], axis=1)


def columns(names: Sequence[str]) -> list[str]:
    """Return for each unknown a name that no other column has: the own name, or the place."""
    places = [f"z[{i}]" for i in range(len(names))]
    other = FIXED.union(places)
    return [
        place if name in other or name in names[:i] else name
        for i, (name, place) in enumerate(zip(names, places, strict=True))
    ]


#: A value below this part of the largest value of the same kind is rounding, and reads as zero.
DUST = 1e-12
#: The recorded quantities of a state by name; a text says why a quantity failed.
Attempt = Mapping[str, float | str]


def as_text(graph: ConnectedPieces, guarantee: str) -> str:
    """Return a short summary."""
    name = graph.parameter
    lines = [
        f"BranchGraph: {name} in [{', '.join(apart(*graph.interval))}], "
        f"components: {len(graph.components())}, pieces: {len(graph.pieces)}, "
        f"special points: {len(graph.special_points())}"
    ]
    is_found = not guarantee.startswith(NOTHING_FOUND)  # no number is known otherwise
    lines += [
        f"  {counted(stretch[2], 'solution')} for {name} in {stretch.ends}"
        for stretch in (multiplicity(graph) if is_found else ())
    ]
    lines.append(f"  {guarantee}")
    return "\n".join(lines)


def as_html(graph: ConnectedPieces, guarantee: str) -> str:
    """Return the summary and the pieces as an HTML table."""
    rows = "".join(
        f"<tr><td>{piece.id}</td><td>{escape(piece.label)}</td>"
        f"<td>{' → '.join(number(piece.alpha[i], graph.interval) for i in (0, -1))}</td>"
        f"<td>{piece.det_sign:+d}</td></tr>"
        for piece in graph.pieces
    )
    head = f"<tr><th>piece</th><th>mode</th><th>{escape(graph.parameter)}</th><th>det</th></tr>"
    return f"<pre>{escape(as_text(graph, guarantee))}</pre><table>{head}{rows}</table>"


def as_dict(graph: ConnectedPieces, guarantee: str) -> dict[str, Any]:
    """Return nodes, pieces, multiplicity and balance as lists and numbers.

    ``between`` has the single values of alpha with another number of solutions than the
    ``stretches`` around. Infinitely many, and a ``recorded`` quantity that failed, are None.
    """
    sums, found = balance_values(graph), runs(graph)
    rows = [run for run in found if run[0] < run[1]]
    component = _component(graph)
    attempts = [attempted(point) for point in graph.nodes]
    lo, hi = graph.interval
    return {
        "parameter": {"name": graph.parameter, "lo": lo, "hi": hi},
        "components": len(graph.components()),
        "names": list(graph.names),
        "nodes": [
            _plain(point, "id kind name alpha z")
            | {"recorded": recorded(attempt)}
            | _plain(point, "message error digits")
            for point, attempt in zip(graph.nodes, attempts, strict=True)
        ],
        "pieces": [
            {"id": piece.id, "component": component[piece.id]}
            | _plain(piece, "start end label det_sign alpha")
            | {"points": piece.z.tolist()}
            for piece in graph.pieces
        ],
        "multiplicity": [[*row[:2], finite(row[2])] for row in rows],
        "stretches": [
            {"lo": row[0], "hi": row[1], "count": finite(row[2])}
            | {"lo_closed": row.lo_closed, "hi_closed": row.hi_closed}
            for row in rows
        ],
        "between": [[lo, finite(count)] for lo, hi, count in found if lo == hi],
        "balance": {"value": sums[0] if len(sums) == 1 else None, "constant": len(sums) <= 1},
        "searched": graph.searched.what,
        "unseen": graph.searched.unseen,
        "guarantee": guarantee,
        **not_recorded(attempts),
    }


def _plain(record: SpecialPoint | Piece, names: str) -> dict[str, Any]:
    """Return attributes of a record by name: arrays as lists, kinds as texts."""
    values = {name: getattr(record, name) for name in names.split()}
    arrays = {name: v.tolist() for name, v in values.items() if isinstance(v, np.ndarray)}
    return values | arrays | ({"kind": str(values["kind"])} if "kind" in values else {})


def recorded(attempt: Attempt) -> dict[str, float | None]:
    """Return the recorded quantities of a state, None for a quantity that failed."""
    return {name: None if isinstance(v, str) else v for name, v in attempt.items()}


def not_recorded(attempts: Iterable[Attempt]) -> dict[str, list[str]]:
    """Return why recorded quantities failed; an empty dict if no quantity failed."""
    failures = [v for attempt in attempts for v in attempt.values() if isinstance(v, str)]
    return {"not_recorded": failures} if failures else {}


def finite(count: int | float) -> int | None:
    """Return a count, None for infinitely many, which JSON cannot say."""
    return None if isinf(count) else int(count)
