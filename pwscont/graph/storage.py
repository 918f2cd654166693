"""The file of a branch graph: written and read, and given a system.

The file may have been edited by hand: the type of every entry, the shape of every array and the
target of every reference are checked before a graph is made.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import GraphFileError, InvalidInputError, InvalidSystemError
from pwscont.basics.outcome import Guarantee, SearchScope, kind_of
from pwscont.basics.quantities import Kept, Quantities
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.curve.metric import Metric, Range
from pwscont.graph.archive import (
    DamagedError,
    Fields,
    damaged,
    read_archive,
    stacked,
    write_archive,
)
from pwscont.graph.proved import BoxProof
from pwscont.graph.queries import stray_alpha
from pwscont.graph.records import (
    Piece,
    Place,
    SpecialPoint,
    Stretch,
    attempted,
    first_digits,
    from_first_digits,
)
from pwscont.graph.structure import ConnectedPieces
from pwscont.system.abilities import completed, shown_size
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem

FORMAT = "pwscont branch graph"
VERSION = 2
#: No number of special points, pieces or signs is larger.
MOST_STORED = 2**31
#: Squares of larger numbers overflow: no run returns numbers above this bound.
LARGEST_STORED = 1e150
#: Farthest from its node that a piece ends, as a part of the interval and of the largest number of
#: each unknown: much more than arrivals at a node are apart.
SAME_END = 1e-3
ARRAYS = ("nodes", "starts", "errors", "points")


#: The arguments of :class:`pwscont.BranchGraph`, as a file has them.
Contents: TypeAlias = dict[str, Any]


def write(path: str | Path, graph: ConnectedPieces, proof: BoxProof | None) -> None:
    """Write a graph; the file appears whole or not at all."""
    arrays = {
        "nodes": stacked([point.z for point in graph.nodes]),
        "starts": stacked([start.z for start in graph.starts]),
        "errors": first_digits(stacked([p.error for p in (*graph.nodes, *graph.starts)])),
        "points": stacked([piece.points for piece in graph.pieces]),
    }
    write_archive(path, _header(graph, proof), arrays)


def _header(graph: ConnectedPieces, proof: BoxProof | None) -> dict[str, Any]:
    """Return the header: all of a graph that is not an array of numbers."""
    searched = graph.searched
    header: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "interval": graph.interval,
        "parameter": graph.parameter,
        "searched": [searched.what, int(searched.promise), searched.spent],
        "gap": searched.gap,
        "nodes": [_node_header(point) for point in graph.nodes],
        "starts": [_node_header(start) for start in graph.starts],
        "pieces": [_piece_header(piece) for piece in graph.pieces],
        "infinite": [[*row[:2], row.lo_closed, row.hi_closed] for row in graph.infinite],
    }
    with suppress(InvalidSystemError):  # names that do not fit: the numbers are kept
        if graph.quantities.is_named and graph.nodes:
            header["names"] = graph.names
    if proof is not None:
        header["proof"] = proof.plain()
    return header


def _node_header(point: SpecialPoint) -> dict[str, Any]:
    """Return the header of a special point; for a recorded value that fails, a text says why."""
    names = "id", "message", "backward", "piece", "digits", "lost", "events"
    values = {"kind": str(point.kind), "alpha": float(point.alpha), "recorded": attempted(point)}
    return {name: getattr(point, name) for name in names} | values


def _piece_header(piece: Piece) -> dict[str, Any]:
    names = "id", "start", "end", "label", "det_sign"
    values = {"signs": str(piece.character), "count": len(piece.points)}
    return {name: getattr(piece, name) for name in names} | values


def read(path: str | Path) -> tuple[Contents, BoxProof | None]:
    """Read what :func:`write` wrote, or refuse a file that is damaged or something else."""
    header, arrays = read_archive(path, FORMAT, ARRAYS)
    try:
        fields = Fields("the header", header)
        if fields.entry("format") != FORMAT:
            raise GraphFileError(f"{path} holds {fields.entry('format')!r}, not a {FORMAT}")
        if (version := fields.entry("version")) != VERSION:
            words = f"{path} has format version {version}; this pwscont reads {VERSION}"
            raise GraphFileError(words)
        return _contents(fields, arrays), _proof(header)
    except DamagedError as error:
        raise damaged(path, FORMAT, error) from error


def _contents(header: Fields, arrays: dict[str, Any]) -> Contents:
    nodes, starts, errors, points = (_table(name, arrays[name]) for name in ARRAYS)
    sizes = {t.shape[1] for t in (nodes, starts, errors[:, :-1], points[:, :-1]) if len(t)}
    if len(sizes) > 1:
        raise DamagedError("nodes, starts and points have different numbers of unknowns")
    if len(errors) != len(nodes) + len(starts) or (errors < 0.0).any():
        raise DamagedError("errors must be one row for each node and start, none negative")
    names, interval = _names(header, next(iter(sizes), None)), _interval(header)
    contents: Contents = {
        "points": _special_points(header, "nodes", nodes, errors[: len(nodes)], names),
        "starts": _special_points(header, "starts", starts, errors[len(nodes) :], names),
        "pieces": _pieces(header.objects("pieces"), points),
        "interval": interval,
        "searched": _searched(header),
        "parameter": header.text("parameter"),
        "infinite": tuple(_stretches(header, interval)),
        "names": names,
    }
    _check(contents["points"], contents["pieces"], contents["starts"], interval)
    return contents


def _check(
    points: Sequence[SpecialPoint],
    pieces: Sequence[Piece],
    starts: Sequence[SpecialPoint],
    interval: Range,
) -> None:
    """Refuse numbers that stand twice or refer to nothing, and points outside the interval."""
    nodes, known = {point.id: point for point in points}, {piece.id for piece in pieces}
    if len(nodes) < len(points) or len(known) < len(pieces) or -1 in nodes:
        raise DamagedError("each node and each piece needs an id of its own, from 0 on")
    for start in starts:
        if start.piece not in known:
            raise DamagedError(f"a start lies on piece {start.piece}, which is not there")
    slack = SAME_ALPHA * max(*map(abs, interval), interval[1] - interval[0])
    lo, hi = interval[0] - slack, interval[1] + slack
    for point in points:
        if not lo <= point.alpha <= hi:
            raise DamagedError(f"node {point.id} lies outside the interval: {point.alpha}")
    for piece in pieces:
        if not {piece.start, piece.end} <= nodes.keys():
            raise DamagedError(f"piece {piece.id} begins or ends at a node that is not there")
        for number, alpha in zip((piece.start, piece.end), piece.points[[0, -1], -1], strict=True):
            if not abs(alpha - nodes[number].alpha) <= SAME_END * (hi - lo):
                raise DamagedError(f"piece {piece.id} does not reach node {number}: {alpha}")
        if not lo <= min(piece.interval) <= max(piece.interval) <= hi:
            raise DamagedError(f"piece {piece.id} leaves the interval: {piece.interval}")
    if len({len(bytes(piece.character)) for piece in pieces}) > 1:
        raise DamagedError("pieces have different numbers of signs")


def _proof(header: dict[str, Any]) -> BoxProof | None:
    """Return what was proved, which files of graphs without proof lack."""
    try:
        return BoxProof.read(header["proof"]) if "proof" in header else None
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedError(f"the proof makes no sense: {error}") from error


def _names(header: Fields, unknowns: int | None) -> tuple[str, ...] | None:
    """Return the names of the unknowns, which old files lack."""
    if not header.has("names"):
        return None
    names = header.items("names", unknowns)
    if not all(isinstance(name, str) for name in names):
        raise DamagedError("names must be texts")
    return tuple(names)


def _table(name: str, values: Any) -> Array:
    if not isinstance(values, np.ndarray):  # numpy returns bytes for a member that is no array
        raise DamagedError(f"{name} must be rows of numbers")
    if values.dtype not in (float, np.uint16) or values.ndim != 2:
        raise DamagedError(f"{name} must be rows of numbers, got {values.dtype}{values.shape}")
    numbers = from_first_digits(values) if values.dtype == np.uint16 else np.asarray(values)
    if not (np.abs(numbers) <= LARGEST_STORED).all():
        raise DamagedError(f"{name} must be finite, and at most {LARGEST_STORED:g}")
    return numbers


def _special_points(
    header: Fields, kind: str, states: Array, errors: Array, names: tuple[str, ...] | None
) -> list[SpecialPoint]:
    headers = header.objects(kind)
    if len(states) != len(headers):
        raise DamagedError(f"there are {len(headers)} {kind} with {len(states)} states")
    return [_node(*row, names) for row in zip(headers, states, errors, strict=True)]


def _node(header: Fields, z: Array, error: Array, names: tuple[str, ...] | None) -> SpecialPoint:
    piece = header.entry("piece")
    return SpecialPoint(
        id=header.integer("id", -1),
        kind=kind_of(header.word("kind")),
        place=Place(np.append(z, header.finite("alpha")), error),
        message=header.text("message"),
        backward=header.text("backward"),
        piece=None if piece is None else header.integer("piece", 0),
        digits=header.number("digits"),
        lost=header.integer("lost", 0),
        quantities=Quantities(names, _recorded(header)),
        events=header.text("events") if header.has("events") else "",  # not in files at first
    )


def _recorded(header: Fields) -> dict[str, Kept]:
    """Return the recorded values of a special point, which old files lack."""
    values = Fields(f"recorded of {header.name}", header.data.get("recorded", {}))
    return {name: Kept(values.finite_or_text(name)) for name in values.data}


def _pieces(headers: list[Fields], points: Array) -> list[Piece]:
    """Return the pieces, each with the next rows of the points."""
    counts = [header.integer("count", 2) for header in headers]
    if sum(counts) != len(points):
        raise DamagedError(f"pieces have {sum(counts)} points, there are {len(points)}")
    parts = np.split(points, np.cumsum(counts, dtype=int)[:-1]) if counts else []
    return [_piece(*row) for row in zip(headers, parts, strict=True)]


def _piece(header: Fields, points: Array) -> Piece:
    signs = header.text("signs")
    if set(signs) - {"+", "-"}:
        raise DamagedError(f"signs of {header.name} must be + or -")
    return Piece(
        id=header.integer("id", 0),
        start=header.integer("start", 0),
        end=header.integer("end", 0),
        character=Character.read(signs),
        naming=partial(_name, header.text("label")),
        points=points,
        det_sign=header.integer("det_sign", -MOST_STORED),  # any number along an interface
    )


def _name(name: str, character: Character) -> str:
    """Return the name that the system gave to a piece's character."""
    return name


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
    gap = header.number("gap") if header.has("gap") else 0.0  # not in files at first
    return SearchScope(searched.text("what"), Guarantee(promise), searched.text("spent"), gap)


#: Which entries of a row in a file tell whether an end is closed.
IS_CLOSED = [False, False, True, True]


def _stretches(header: Fields, interval: Range) -> Iterator[Stretch]:
    """Yield the stretches with infinitely many solutions, which old files lack."""
    for row in header.items("infinite") if header.has("infinite") else ():
        if not isinstance(row, list) or [type(one) is bool for one in row] != IS_CLOSED:
            raise DamagedError("infinite must be rows of two ends, and whether they are closed")
        ends = Fields("infinite", {"lo": row[0], "hi": row[1]})
        lo, hi = ends.finite("lo"), ends.finite("hi")
        if not interval[0] <= lo <= hi <= interval[1]:
            raise DamagedError(f"infinitely many solutions outside the interval: {lo} to {hi}")
        yield Stretch(lo, hi, inf, *row[2:])


#: Components larger than this, or smaller than 1 / this, are not of the order of 1.
ORDER_OF_ONE = 8.0
#: At about this many pieces of a graph, of different cells, the equations are checked.
MOST_CHECKED = 32


def adopted(path: str | Path, contents: Contents, system: PiecewiseSystem) -> PiecewiseSystem:
    """Return the system of a graph, fitted to the graph, or refuse another graph's system."""
    pieces, points, interval = (contents[name] for name in ("pieces", "points", "interval"))
    name, words = type(system).__name__, f"{path} is of another system: it has"
    if pieces:
        point, piece = points[0], pieces[0]
        if len(point.z) != (size := shown_size(system)):
            raise InvalidInputError(f"{words} {len(point.z)} unknowns, {name} has {size}")
        z, stored = completed(system, point.z, point.alpha), len(bytes(piece.character))
        if stored != (tests := len(bytes(system.character(z, point.alpha)))):
            raise InvalidInputError(f"{words} {stored} tests, {name} has {tests}")
    if pieces:
        _refuse_apart(path, contents, Box.of(system).period[:size])
    fitted = _fitted(system, interval, points)
    of_cells = list({piece.character: piece for piece in pieces}.values())
    scale = np.append(fitted.scale(*interval), np.ptp(interval))
    for piece in of_cells[:: max(1, len(of_cells) // MOST_CHECKED)]:
        if (alpha := stray_alpha(fitted, piece, 0.5 * sum(piece.interval), scale)) is not None:
            raise InvalidInputError(
                f"{path} is of another system: {name} does not have its solution at alpha = "
                f"{alpha:.10g}; give the system with the constants that the graph was made with"
            )
    return fitted


def _refuse_apart(path: str | Path, contents: Contents, period: Array) -> None:
    """Refuse pieces that do not reach their nodes, up to periods."""
    nodes = {point.id: np.append(point.z, point.alpha) for point in contents["points"]}
    pieces, metric = contents["pieces"], Metric(np.ones(len(period) + 1), period=period)
    sizes = SAME_END * np.abs(np.vstack([piece.points for piece in pieces])).max(axis=0)
    for piece in pieces:
        for number, x in zip((piece.start, piece.end), piece.points[[0, -1]], strict=True):
            if (np.abs(metric.difference(x, nodes[number])) > sizes).any():
                raise InvalidInputError(f"{path}: piece {piece.id} does not reach node {number}")


def _fitted(
    system: PiecewiseSystem, interval: Range, points: Sequence[SpecialPoint]
) -> PiecewiseSystem:
    """Return a system fitted to an interval; a system without a scale, also to the solutions."""
    states = [completed(system, point.z, point.alpha) for point in points]
    sizes = np.max(np.abs(states), axis=0, initial=0.0)
    usual = (sizes == 0.0) | ((sizes > 1.0 / ORDER_OF_ONE) & (sizes < ORDER_OF_ONE))
    found = None if system.gives_scale or usual.all() else np.where(usual, 1.0, sizes)
    return system.within(*interval, found)
