"""The branch graph as text, as HTML for notebooks, and as plain data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from math import isinf
from typing import Any

from pwscont.basics.looks import apart, counted
from pwscont.graph.balance import balance_values
from pwscont.graph.queries import count_at, multiplicity
from pwscont.graph.records import SpecialPoint, Stretch, attempted
from pwscont.graph.structure import Structure

#: A value below this part of the largest value of the same kind is rounding, and reads as zero.
DUST = 1e-12
#: The recorded quantities of a state by name; a text says why a quantity failed.
Attempt = Mapping[str, float | str]


def number(value: float) -> str:
    """Return a number as users read it: at most eight digits, no rounding dust."""
    return f"{value:.8g}"


def as_text(graph: Structure, guarantee: str) -> str:
    """Return a short summary."""
    name = graph.parameter
    lines = [
        f"BranchGraph: {name} in [{', '.join(apart(*graph.interval))}], "
        f"components: {len(graph.components())}, pieces: {len(graph.pieces)}, "
        f"special points: {len(graph.special_points())}"
    ]
    lines += [
        f"  {counted(stretch[2], 'solution')} for {name} in {stretch.ends}"
        for stretch in multiplicity(graph)
    ]
    lines.append(f"  {guarantee}")
    return "\n".join(lines)


def as_html(graph: Structure, guarantee: str) -> str:
    """Return the summary and the pieces as an HTML table."""
    rows = "".join(
        f"<tr><td>{piece.id}</td><td>{escape(piece.label)}</td>"
        f"<td>{number(piece.alpha[0])} → {number(piece.alpha[-1])}</td>"
        f"<td>{piece.det_sign:+d}</td></tr>"
        for piece in graph.pieces
    )
    head = f"<tr><th>piece</th><th>mode</th><th>{escape(graph.parameter)}</th><th>det</th></tr>"
    return f"<pre>{escape(as_text(graph, guarantee))}</pre><table>{head}{rows}</table>"


def as_dict(graph: Structure, guarantee: str) -> dict[str, Any]:
    """Return nodes, pieces, multiplicity and balance as lists and numbers.

    ``parameter`` has the name of alpha, and the interval. The ``name`` of a node is that of an
    event, empty for other kinds.
    ``stretches`` are the rows of ``multiplicity`` with open and closed ends; ``between`` has the
    single values of alpha with another number of solutions. Infinitely many are None. ``names``
    are the names of the components of every state. A ``recorded`` quantity that failed is None,
    and ``not_recorded`` then says why.
    """
    sums = balance_values(graph)
    rows = [row for row in multiplicity(graph) if row[0] < row[1]]
    component = {p.id: c for c, pieces in enumerate(graph.components()) for p in pieces}
    nodes = [point for point in graph.special_points() if point.id >= 0]
    attempts = [attempted(point) for point in nodes]
    lo, hi = graph.interval
    return {
        "parameter": {"name": graph.parameter, "lo": lo, "hi": hi},
        "components": len(graph.components()),
        "names": list(graph.names),
        "nodes": [_node(*pair) for pair in zip(nodes, attempts, strict=True)],
        "pieces": [
            {
                "id": piece.id,
                "component": component[piece.id],
                "start": piece.start,
                "end": piece.end,
                "label": piece.label,
                "det_sign": piece.det_sign,
                "alpha": piece.alpha.tolist(),
                "points": piece.z.tolist(),
            }
            for piece in graph.pieces
        ],
        "multiplicity": [[*row[:2], finite(row[2])] for row in rows],
        "stretches": [_stretch(row) for row in rows],
        "between": list(_between(graph, rows)),
        "balance": {
            "value": sums[0] if len(sums) == 1 else None,
            "constant": len(sums) <= 1,
        },
        "searched": graph.searched.what,
        "unseen": graph.searched.unseen,
        "guarantee": guarantee,
        **not_recorded(attempts),
    }


def _node(point: SpecialPoint, attempt: Attempt) -> dict[str, Any]:
    return {
        "id": point.id,
        "kind": str(point.kind),
        "name": point.name,
        "alpha": point.alpha,
        "z": point.z.tolist(),
        "recorded": recorded(attempt),
        "message": point.message,
        "error": point.error.tolist(),
        "digits": point.digits,
    }


def recorded(attempt: Attempt) -> dict[str, float | None]:
    """Return the recorded quantities of a state, None for a quantity that failed."""
    return {name: None if isinstance(v, str) else v for name, v in attempt.items()}


def not_recorded(attempts: Iterable[Attempt]) -> dict[str, list[str]]:
    """Return why recorded quantities failed, nothing where none did."""
    failures = [v for attempt in attempts for v in attempt.values() if isinstance(v, str)]
    return {"not_recorded": failures} if failures else {}


def _stretch(row: Stretch) -> dict[str, Any]:
    lo, hi, count = row
    ends = {"lo_closed": row.lo_closed, "hi_closed": row.hi_closed}
    return {"lo": lo, "hi": hi, "count": finite(count)} | ends


def _between(graph: Structure, rows: Sequence[Stretch]) -> Iterator[list[float | int | None]]:
    for alpha in graph.breaks():
        count = count_at(graph, alpha)
        if count not in [row[2] for row in rows if row[0] <= alpha <= row[1]]:
            yield [alpha, finite(count)]


def finite(count: int | float) -> int | None:
    """Return a count, None for infinitely many, which JSON cannot say."""
    return None if isinf(count) else int(count)
