"""A walk (a followed piece and its arrival) as text and bytes, and back, bit by bit.

All arrays of a walk are rows of n + 1 numbers. Many are the same: the end of the piece is also
where its rays start, and the rays share the samples of its error. Each row is written once.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.kind import kind_of
from pwscont.continuation.follow import FollowedPiece
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray


class Transcript(NamedTuple):
    """A walk as a text, which is a JSON object, and rows of doubles."""

    header: str
    rows: bytes


def written(walk: FollowedPiece) -> Transcript:
    """Return the transcript of a walk."""
    rows, arrival = _JournalRows(), walk.arrival
    header = {
        "kind": str(arrival.kind),
        "message": arrival.message,
        "points": rows.add(walk.points),
        "x": rows.add(arrival.x[np.newaxis]),
        "rays": [_ray(ray, rows) for ray in arrival.rays],
    }
    return Transcript(json.dumps(header), b"".join(rows.numbers))


def walk_of(transcript: Transcript, ray: Ray) -> FollowedPiece:
    """Return the walk of a transcript; ``ray``, with which it began, has system and metric."""
    header = json.loads(transcript.header)
    rows = np.frombuffer(transcript.rows).reshape(-1, len(ray.state.x)).copy()
    system, metric = ray.curve.selection.system, ray.curve.metric
    rays = tuple(_ray_of(data, rows, system, metric) for data in header["rays"])
    x = rows[header["x"][0]]
    arrival = SpecialPointFound(kind_of(header["kind"]), x, header["message"], rays)
    return FollowedPiece(list(rows[header["points"]]), arrival)


@final
class _JournalRows:
    """The different rows of a transcript, each with its number."""

    def __init__(self) -> None:
        self.numbers: dict[bytes, int] = {}

    def add(self, rows: Iterable[Array]) -> list[int]:
        """Return the numbers of these rows."""
        return [self.numbers.setdefault(row.tobytes(), len(self.numbers)) for row in rows]


def _ray(ray: Ray, rows: _JournalRows) -> dict[str, Any]:
    state, selection = ray.state, ray.curve.selection
    return {
        "signs": str(selection.character),
        "beside": [str(cell) for cell in selection.adjacent_cells],
        "shared": [str(cell) for cell in ray.interface_cells],
        "index": int(ray.index),
        "state": rows.add(np.stack([state.x, state.tangent])),
        "error": rows.add(state.error),
        "orientation": int(state.orientation),
    }


def _ray_of(data: dict[str, Any], rows: Array, system: PiecewiseSystem, metric: Metric) -> Ray:
    beside = tuple(map(Character.read, data["beside"]))
    curve = Curve(Selection(system, Character.read(data["signs"]), beside), metric)
    x, tangent = rows[data["state"]]
    state = State(x, tangent, rows[data["error"]], data["orientation"])
    return Ray(curve, state, tuple(map(Character.read, data["shared"])), data["index"])
