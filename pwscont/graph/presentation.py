"""The branch graph as text, as HTML for notebooks, and as plain data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from math import isinf
from typing import TYPE_CHECKING, Any

from pwscont.foundation.records import Stretch

if TYPE_CHECKING:
    from pwscont.graph.branch_graph import BranchGraph


def number(value: float) -> str:
    """Return a number as users read it: at most eight digits, no rounding dust."""
    return f"{value:.8g}"


def as_text(graph: BranchGraph) -> str:
    """Return a short summary."""
    lo, hi = graph.interval
    name = graph.parameter
    lines = [
        f"BranchGraph: {name} in [{number(lo)}, {number(hi)}], "
        f"components: {len(graph.components())}, pieces: {len(graph.pieces)}, "
        f"special points: {len(graph.special_points())}"
    ]
    lines += [
        f"  {stretch[2]} solution{'' if stretch[2] == 1 else 's'} for {name} in {stretch.ends}"
        for stretch in graph.multiplicity()
    ]
    lines.append(f"  {graph.guarantee}")
    return "\n".join(lines)


def as_html(graph: BranchGraph) -> str:
    """Return the summary and the pieces as an HTML table."""
    rows = "".join(
        f"<tr><td>{piece.id}</td><td>{escape(piece.label)}</td>"
        f"<td>{number(piece.alpha[0])} → {number(piece.alpha[-1])}</td>"
        f"<td>{piece.det_sign:+d}</td></tr>"
        for piece in graph.pieces
    )
    head = f"<tr><th>piece</th><th>mode</th><th>{escape(graph.parameter)}</th><th>det</th></tr>"
    return f"<pre>{escape(as_text(graph))}</pre><table>{head}{rows}</table>"


def as_dict(graph: BranchGraph) -> dict[str, Any]:
    """Return nodes, pieces, multiplicity and balance as lists and numbers.

    ``stretches`` are the rows of ``multiplicity`` with open and closed ends; ``between`` has the
    numbers at single values of alpha where they differ, None for infinitely many.
    """
    sums, rows = graph.sums(), graph.multiplicity()
    component = {p.id: c for c, pieces in enumerate(graph.components()) for p in pieces}
    return {
        "components": len(graph.components()),
        "nodes": [
            {"id": p.id, "kind": str(p.kind), "alpha": p.alpha, "z": p.z.tolist()}
            | {"message": p.message, "error": p.error.tolist(), "digits": p.digits}
            for p in graph.special_points()
            if p.id >= 0
        ],
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
        "multiplicity": [list(row) for row in rows],
        "stretches": [_stretch(row) for row in rows],
        "between": list(_between(graph, rows)),
        "balance": {
            "value": sums[0] if len(sums) == 1 else None,
            "constant": len(sums) <= 1,
        },
        "searched": graph.searched.what,
        "guarantee": graph.guarantee,
    }


def _stretch(row: Stretch) -> dict[str, Any]:
    lo, hi, count = row
    ends = {"lo_closed": row.lo_closed, "hi_closed": row.hi_closed}
    return {"lo": lo, "hi": hi, "count": count} | ends


def _between(graph: BranchGraph, rows: Sequence[Stretch]) -> Iterator[list[float | int | None]]:
    for alpha in graph.breaks():
        count = graph.count(alpha)
        if count not in [row[2] for row in rows if row[0] <= alpha <= row[1]]:
            yield [alpha, finite(count)]


def finite(count: int | float) -> int | None:
    """Return a count, None for infinitely many, which JSON cannot say."""
    return None if isinf(count) else int(count)
