"""One file for one branch graph: arrays and a JSON header in a zip, as numpy writes it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pwscont.foundation.character import Character
from pwscont.foundation.errors import GraphFileError
from pwscont.foundation.guarantee import Promise, Searched
from pwscont.foundation.kind import Kind
from pwscont.foundation.place import Stored
from pwscont.foundation.records import Piece, SpecialPoint, Track

FORMAT = "pwscont branch graph"
VERSION = 1

Contents = tuple[
    list[SpecialPoint], list[Piece], list[SpecialPoint], tuple[float, float], str, Searched
]


def write(
    path: str | Path,
    points: Sequence[SpecialPoint],
    pieces: Sequence[Piece],
    starts: Sequence[SpecialPoint],
    interval: tuple[float, float],
    parameter: str,
    searched: Searched,
) -> None:
    """Write a graph; the file appears whole or not at all.

    Raises
    ------
    GraphFileError
        If it cannot be written.
    """
    header = {
        "format": FORMAT,
        "version": VERSION,
        "interval": interval,
        "parameter": parameter,
        "searched": [searched.what, int(searched.promise), searched.spent],
        "nodes": [_node_header(point) for point in points],
        "starts": [_node_header(point) for point in starts],
        "pieces": [_piece_header(piece) for piece in pieces],
    }
    arrays = {
        "nodes": _stack([point.z for point in points]),
        "starts": _stack([point.z for point in starts]),
        "points": _stack([piece.points for piece in pieces]),
    }
    target = Path(path)
    temporary = target.with_name(target.name + ".part")
    try:
        with temporary.open("wb") as file:
            np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)
        os.replace(temporary, target)
    except OSError as error:
        raise GraphFileError(f"cannot write {path}: {error.strerror or error}") from error


def _stack(rows: list[Any]) -> Any:
    return np.vstack(rows) if rows else np.empty((0, 0))


def _node_header(point: SpecialPoint) -> dict[str, Any]:
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
        _check(path, header)
        return _contents(header, arrays)
    except OSError as error:
        raise GraphFileError(f"cannot read {path}: {error.strerror or error}") from error
    except GraphFileError:
        raise
    except Exception as error:  # a damaged zip fails in a dozen ways
        raise GraphFileError(f"{path} is not a {FORMAT} file, or it is damaged") from error


def _check(path: str | Path, header: dict[str, Any]) -> None:
    if header["format"] != FORMAT:
        raise GraphFileError(f"{path} holds {header['format']!r}, not a {FORMAT}")
    if header["version"] != VERSION:
        raise GraphFileError(
            f"{path} has format version {header['version']}; this pwscont reads {VERSION}"
        )


def _contents(header: dict[str, Any], arrays: dict[str, Any]) -> Contents:
    nodes = [_node(h, z) for h, z in zip(header["nodes"], arrays["nodes"], strict=True)]
    starts = [_node(h, z) for h, z in zip(header["starts"], arrays["starts"], strict=True)]
    ends = np.cumsum([h["count"] for h in header["pieces"]], dtype=int)
    if ends.size and ends[-1] != len(arrays["points"]):
        raise ValueError("points are missing")
    pieces = [
        _piece(h, arrays["points"][end - h["count"] : end])
        for h, end in zip(header["pieces"], ends, strict=True)
    ]
    lo, hi = header["interval"]
    what, promise, *spent = header["searched"]
    searched = Searched(what, Promise(promise), *map(str, spent))
    return nodes, pieces, starts, (float(lo), float(hi)), str(header["parameter"]), searched


def _node(header: dict[str, Any], z: Any) -> SpecialPoint:
    return SpecialPoint(
        id=header["id"],
        kind=Kind(header["kind"]),
        place=Stored(np.append(z, header["alpha"]), np.array(header["error"], dtype=float)),
        message=header["message"],
        backward=header["backward"],
        piece=header["piece"],
        digits=header["digits"],
        lost=header["lost"],
    )


def _piece(header: dict[str, Any], points: Any) -> Piece:
    return Piece(
        id=header["id"],
        start=header["start"],
        end=header["end"],
        character=Character(tuple(sign == "+" for sign in header["signs"])),
        naming=lambda _: str(header["label"]),
        track=Track.of(points),
        det_sign=header["det_sign"],
    )
