"""One file for one branch graph: arrays and a JSON header in a zip, as numpy writes it.

Failure modes and answers
-------------------------
- The file is cut off or bytes of it have changed: a zip holds a checksum of every entry.
- It was edited by hand: every entry is checked for its type, every array for its shape, and every
  reference for what it refers to, before a graph is made.
- The disk is full, or the program is interrupted: the file appears whole or not at all.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import GraphFileError
from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.basics.kind import kind_of
from pwscont.basics.quantities import Kept, Quantities
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.graph.fields import DamagedError, Fields
from pwscont.graph.place import Stored
from pwscont.graph.records import Piece, SpecialPoint, Track, attempted

FORMAT = "pwscont branch graph"
VERSION = 1


@final
@dataclass(frozen=True, slots=True)
class Contents:
    """What a file holds; ``names`` are those of the unknowns, None where there are none."""

    points: Sequence[SpecialPoint]
    pieces: Sequence[Piece]
    starts: Sequence[SpecialPoint]
    interval: tuple[float, float]
    parameter: str
    searched: SearchScope
    names: tuple[str, ...] | None


def write(path: str | Path, contents: Contents) -> None:
    """Write a graph; the file appears whole or not at all.

    Raises
    ------
    GraphFileError
        If it cannot be written.
    """
    header, states = _header(contents), (contents.points, contents.starts)
    arrays = {
        name: _stack([point.z for point in points])
        for name, points in zip(("nodes", "starts"), states, strict=True)
    }
    arrays["points"] = _stack([piece.points for piece in contents.pieces])
    content = BytesIO()
    np.savez_compressed(content, header=np.array(json.dumps(header)), **arrays)
    try:
        _replace(Path(path), content.getvalue())
    except OSError as error:
        raise GraphFileError(f"cannot write {path}: {error.strerror or error}") from error


def _header(contents: Contents) -> dict[str, Any]:
    searched = contents.searched
    header = {
        "format": FORMAT,
        "version": VERSION,
        "interval": contents.interval,
        "parameter": contents.parameter,
        "searched": [searched.what, int(searched.promise), searched.spent],
        "nodes": [_node_header(point) for point in contents.points],
        "starts": [_node_header(point) for point in contents.starts],
        "pieces": [_piece_header(piece) for piece in contents.pieces],
    }
    return header if contents.names is None else header | {"names": contents.names}


def _replace(target: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all, and leaves nothing else behind."""
    temporary = target.with_name(target.name + ".part")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _stack(rows: list[Any]) -> Any:
    return np.vstack(rows) if rows else np.empty((0, 0))


def _node_header(point: SpecialPoint) -> dict[str, Any]:
    """Return what there is to a special point; in place of a value that fails, why."""
    return {
        "id": point.id,
        "kind": str(point.kind),
        "alpha": float(point.alpha),
        "message": point.message,
        "backward": point.backward,
        "piece": point.piece,
        "error": point.error.tolist(),
        "digits": point.digits,
        "lost": point.lost,
        "recorded": attempted(point),
        "events": point.events,
    }


def _piece_header(piece: Piece) -> dict[str, Any]:
    return {
        "id": piece.id,
        "start": piece.start,
        "end": piece.end,
        "signs": str(piece.character),
        "label": piece.label,
        "det_sign": piece.det_sign,
        "count": len(piece.points),
    }


def read(path: str | Path) -> Contents:
    """Read what :func:`write` wrote.

    Raises
    ------
    GraphFileError
        If the file cannot be read, is damaged, or is something else.
    """
    try:
        # opened here, since numpy leaves a file open that it cannot read
        with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in ("header", "nodes", "starts", "points")}
        header = json.loads(str(arrays["header"]))
    except OSError as error:
        raise GraphFileError(f"cannot read {path}: {error.strerror or error}") from error
    except Exception as error:  # a damaged zip fails in a dozen ways
        raise GraphFileError(f"{path} is not a {FORMAT} file, or it is damaged") from error
    try:
        fields = Fields("the header", header)
        _check_format(path, fields)
        return _contents(fields, arrays)
    except DamagedError as error:
        raise GraphFileError(f"{path} is not a {FORMAT} file, or it is damaged: {error}") from error


def _check_format(path: str | Path, header: Fields) -> None:
    if header.entry("format") != FORMAT:
        raise GraphFileError(f"{path} holds {header.entry('format')!r}, not a {FORMAT}")
    if header.entry("version") != VERSION:
        raise GraphFileError(
            f"{path} has format version {header.entry('version')}; this pwscont reads {VERSION}"
        )


def _contents(header: Fields, arrays: dict[str, Any]) -> Contents:
    rows = _StoredRows.of(arrays)
    names = _names(header, rows)
    points = [_node(*row, names) for row in rows.each("nodes", header.objects("nodes"))]
    starts = [_node(*row, names) for row in rows.each("starts", header.objects("starts"))]
    pieces = _pieces(header.objects("pieces"), rows)
    interval = _interval(header)
    _check_references(points, pieces, starts)
    _check_places(points, pieces, interval)
    searched = _searched(header)
    return Contents(points, pieces, starts, interval, header.text("parameter"), searched, names)


def _names(header: Fields, rows: _StoredRows) -> tuple[str, ...] | None:
    """Return the names of the unknowns, which files had none of at first."""
    if not header.has("names"):
        return None
    names = header.items("names", rows.unknowns)
    if not all(isinstance(name, str) for name in names):
        raise DamagedError("names must be texts")
    return tuple(names)


@final
@dataclass(frozen=True, slots=True)
class _StoredRows:
    """The arrays of a file, finite, with n columns for states and n + 1 for points of pieces."""

    nodes: Array
    starts: Array
    points: Array

    @classmethod
    def of(cls, arrays: dict[str, Any]) -> _StoredRows:
        rows = cls(*(_table(name, arrays[name]) for name in ("nodes", "starts", "points")))
        states = {len(a.T) for a in (rows.nodes, rows.starts, rows.points[:, :-1]) if len(a)}
        if len(states) > 1:
            raise DamagedError("nodes, starts and points have different numbers of unknowns")
        return rows

    @property
    def unknowns(self) -> int | None:
        """The number of unknowns, None where there is no state."""
        sizes = (a.shape[1] for a in (self.nodes, self.starts, self.points[:, :-1]) if len(a))
        return next(sizes, None)

    def each(self, name: str, headers: list[Fields]) -> list[tuple[Fields, Array]]:
        """Return each header with its row."""
        rows = getattr(self, name)
        if len(rows) != len(headers):
            raise DamagedError(f"there are {len(headers)} {name} with {len(rows)} states")
        return list(zip(headers, rows, strict=True))


def _table(name: str, values: Any) -> Array:
    if not isinstance(values, np.ndarray):  # numpy returns a member that is no array as it is
        raise DamagedError(f"{name} must be rows of numbers")
    if values.dtype.kind != "f" or values.ndim != 2:
        raise DamagedError(f"{name} must be rows of numbers, got {values.dtype}{values.shape}")
    if not np.isfinite(values).all():
        raise DamagedError(f"{name} must be finite")
    return np.asarray(values, dtype=float)


def _node(header: Fields, z: Array, names: tuple[str, ...] | None) -> SpecialPoint:
    piece = header.entry("piece")
    return SpecialPoint(
        id=header.integer("id", -1),
        kind=kind_of(header.word("kind")),
        place=Stored(np.append(z, header.finite("alpha")), _error(header, len(z) + 1)),
        message=header.text("message"),
        backward=header.text("backward"),
        piece=None if piece is None else header.integer("piece", 0),
        digits=header.number("digits"),
        lost=header.integer("lost", 0),
        quantities=Quantities(names, _recorded(header)),
        events=header.text("events") if header.has("events") else "",  # not in files at first
    )


def _recorded(header: Fields) -> dict[str, Kept]:
    """Return the recorded values of a special point, which files had none of at first."""
    if not header.has("recorded"):
        return {}
    values = Fields(f"recorded of {header.name}", header.entry("recorded"))
    return {name: Kept(values.finite_or_text(name)) for name in values.data}


def _error(header: Fields, size: int) -> Array:
    error = header.numbers("error")
    if len(error) not in (0, size) or (error < 0.0).any():
        raise DamagedError(f"error of {header.name} must be {size} numbers, none negative")
    return error


def _pieces(headers: list[Fields], rows: _StoredRows) -> list[Piece]:
    """Return the pieces, each with the rows that follow those of the one before."""
    counts = [header.integer("count", 2) for header in headers]
    if sum(counts) != len(rows.points):
        raise DamagedError(f"pieces have {sum(counts)} points, there are {len(rows.points)}")
    parts = np.split(rows.points, np.cumsum(counts, dtype=int)[:-1]) if counts else []
    return [_piece(header, points) for header, points in zip(headers, parts, strict=True)]


def _piece(header: Fields, points: Array) -> Piece:
    signs, det_sign = header.text("signs"), header.integer("det_sign", -1)
    if set(signs) - {"+", "-"}:
        raise DamagedError(f"signs of {header.name} must be + or -")
    if det_sign > 1:
        raise DamagedError(f"det_sign of {header.name} must be -1, 0 or 1, got {det_sign}")
    return Piece(
        id=header.integer("id", 0),
        start=header.integer("start", 0),
        end=header.integer("end", 0),
        character=Character(sign == "+" for sign in signs),
        naming=_Name(header.text("label")),
        track=Track.of(points),
        det_sign=det_sign,
    )


@final
@dataclass(frozen=True, slots=True)
class _Name:
    """The name that the system gave to a piece's character."""

    name: str

    def __call__(self, character: Character) -> str:
        return self.name


def _check_references(
    points: Sequence[SpecialPoint], pieces: Sequence[Piece], starts: Sequence[SpecialPoint]
) -> None:
    """Refuse numbers that stand twice, and pieces and starts that refer to nothing."""
    nodes, known = {point.id for point in points}, {piece.id for piece in pieces}
    if len(nodes) < len(points) or len(known) < len(pieces) or -1 in nodes:
        raise DamagedError("each node and each piece needs an id of its own, from 0 on")
    for piece in pieces:
        if not {piece.start, piece.end} <= nodes:
            raise DamagedError(f"piece {piece.id} begins or ends at a node that is not there")
    for start in starts:
        if start.piece not in known:
            raise DamagedError(f"a start lies on piece {start.piece}, which is not there")


def _check_places(
    points: Sequence[SpecialPoint], pieces: Sequence[Piece], interval: tuple[float, float]
) -> None:
    """Refuse what lies outside the interval, and characters of different systems."""
    slack = SAME_ALPHA * max(*map(abs, interval), interval[1] - interval[0])
    lo, hi = interval[0] - slack, interval[1] + slack
    for point in points:
        if not lo <= point.alpha <= hi:
            raise DamagedError(f"node {point.id} lies outside the interval: {point.alpha}")
    for piece in pieces:
        if not (lo <= piece.interval[0] and piece.interval[1] <= hi):
            raise DamagedError(f"piece {piece.id} leaves the interval: {piece.interval}")
    if len({len(bytes(piece.character)) for piece in pieces}) > 1:
        raise DamagedError("pieces have different numbers of signs")


def _interval(header: Fields) -> tuple[float, float]:
    ends = Fields("the interval", dict(zip(("lo", "hi"), header.items("interval", 2), strict=True)))
    lo, hi = ends.finite("lo"), ends.finite("hi")
    if not lo < hi:
        raise DamagedError(f"the interval needs lo < hi, got ({lo}, {hi})")
    return lo, hi


def _searched(header: Fields) -> SearchScope:
    words = dict(zip(("what", "promise", "spent"), header.items("searched", 3), strict=True))
    searched = Fields("searched", words)
    promise = searched.integer("promise", 0)
    if promise not in set(Guarantee):
        raise DamagedError(f"promise of searched must be at most {max(Guarantee)}, got {promise}")
    return SearchScope(searched.text("what"), Guarantee(promise), searched.text("spent"))
