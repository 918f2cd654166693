"""The file of a branch graph: written and read, and given a system.

Arrays and a header stand in one archive, which is written whole or not at all. The file may have
been edited by hand: the type of every entry, the shape of every array and the target of every
reference are checked before a graph is made.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from math import inf, isfinite, isnan
from pathlib import Path
from typing import Any, TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import GraphFileError, InvalidInputError, InvalidSystemError
from pwscont.basics.files import write_file
from pwscont.basics.outcome import Guarantee, SearchScope, kind_of
from pwscont.basics.quantities import Kept, Quantities
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.curve.metric import Metric, Range
from pwscont.graph import records
from pwscont.graph.proved import BoxProof
from pwscont.graph.queries import stray_alpha
from pwscont.graph.records import Piece, Place, SpecialPoint, Stretch
from pwscont.graph.structure import ConnectedPieces
from pwscont.system.abilities import completed, shown_size
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem


def write_archive(path: str | Path, header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a header, as JSON, and arrays by name, or raise a GraphFileError."""
    content = BytesIO()
    named: dict[str, Any] = {"header": np.array(json.dumps(header)), **arrays}
    # not compressed: digits are random, and compressing them takes ten times as long as all else
    np.savez(content, **named)
    try:
        with content.getbuffer() as data:
            write_file(path, data)
    except (OSError, TypeError, ValueError) as error:  # the last two: no path of a file
        why = getattr(error, "strerror", None) or error
        raise GraphFileError(f"cannot write {path}: {why}") from error


def read_archive(path: str | Path, kind: str, names: Sequence[str]) -> tuple[Any, dict[str, Any]]:
    """Return the header and the arrays with these names, or raise a GraphFileError."""
    try:
        # opened here: numpy would leave an unreadable file open
        with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in ("header", *names)}
        return json.loads(str(arrays.pop("header"))), arrays
    except OSError as error:
        raise GraphFileError(f"cannot read {path}: {error.strerror or error}") from error
    except Exception as error:  # a damaged zip fails in a dozen ways
        raise GraphFileError(f"{path} is not a {kind} file, or it is damaged") from error


def damaged(path: str | Path, kind: str, why: Exception) -> GraphFileError:
    """Return the error for a file whose content makes no sense."""
    return GraphFileError(f"{path} is not a {kind} file, or it is damaged: {why}")


def stacked(rows: Sequence[Any]) -> Any:
    """Return rows as one array; without rows an array of shape (0, 0)."""
    return np.vstack(rows) if len(rows) else np.empty((0, 0))


class DamagedError(Exception):
    """An entry of a file is missing or of the wrong type; the message names the entry."""


@final
@dataclass(frozen=True, slots=True)
class Fields:
    """A JSON object read from a file, named in messages; a wrong entry raises a DamagedError."""

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
        return self._fitting(
            key, lambda v: type(v) is int and v >= least, f"a whole number from {least} on"
        )

    def number(self, key: str) -> float:
        """Return a number, which may be infinite."""
        return float(self._fitting(key, lambda v: is_number(v) and not isnan(v), "a number"))

    def finite(self, key: str) -> float:
        """Return a finite number."""
        self.number(key)
        return float(self._fitting(key, isfinite, "finite"))

    def text(self, key: str) -> str:
        """Return a text."""
        return str(self._fitting(key, lambda v: isinstance(v, str), "a text"))

    def word(self, key: str) -> str:
        """Return a text that is not empty."""
        text = self.text(key)
        if not text:
            raise DamagedError(f"{key} of {self.name} must not be empty")
        return text

    def items(self, key: str, length: int | None = None) -> list[Any]:
        """Return a list."""
        what = "a list" if length is None else f"a list of {length}"
        return self._fitting(key, lambda v: isinstance(v, list) and length in (None, len(v)), what)

    def numbers(self, key: str) -> Array:
        """Return a list of numbers."""
        self._fitting(key, lambda v: isinstance(v, list), "a list")
        values = self._fitting(key, lambda v: all(map(is_number, v)), "a list of numbers")
        return np.array(values, dtype=float)

    def objects(self, key: str) -> list[Fields]:
        """Return a list of JSON objects, each named by the place in the list."""
        return [Fields(f"entry {i} of {key}", item) for i, item in enumerate(self.items(key))]

    def _fitting(self, key: str, fits: Callable[[Any], bool], what: str) -> Any:
        """Return an entry that fits; the words ``what`` say what would fit."""
        value = self.entry(key)
        if not fits(value):
            raise DamagedError(f"{key} of {self.name} must be {what}, got {str(value)[:40]}")
        return value


def is_number(value: Any) -> bool:
    """Tell whether a JSON value is a number that a float can hold."""
    try:
        return type(value) is float or (type(value) is int and isfinite(float(value)))
    except OverflowError:
        return False


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
    searched, points = graph.searched, (*graph.nodes, *graph.starts)
    header: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "interval": graph.interval,
        "parameter": graph.parameter,
        "searched": [searched.what, int(searched.promise), searched.spent],
        "gap": searched.gap,
        "nodes": [_header(point) for point in graph.nodes],
        "starts": [_header(start) for start in graph.starts],
        "pieces": [_header(piece) for piece in graph.pieces],
        "infinite": [[*row[:2], row.lo_closed, row.hi_closed] for row in graph.infinite],
    }
    with suppress(InvalidSystemError):  # names that do not fit: the numbers are kept
        if graph.quantities.is_named and graph.nodes:
            header["names"] = graph.names
    if proof is not None:
        header["proof"] = proof.plain()
    arrays = {
        "nodes": stacked([point.z for point in graph.nodes]),
        "starts": stacked([start.z for start in graph.starts]),
        "errors": records.first_digits(stacked([point.error for point in points])),
        "points": stacked([piece.points for piece in graph.pieces]),
    }
    write_archive(path, header, arrays)


def _header(each: SpecialPoint | Piece) -> dict[str, Any]:
    """Return all of a special point or a piece that is not an array of numbers."""
    if isinstance(each, Piece):
        names = "id start end label det_sign"
        values = {"signs": str(each.character), "count": len(each.points)}
    else:  # for a recorded value that fails, a text says why
        names = "id message backward piece digits lost events"
        values = {"kind": str(each.kind), "alpha": float(each.alpha)}
        values["recorded"] = records.attempted(each)
    return {name: getattr(each, name) for name in names.split()} | values


def read(path: str | Path) -> tuple[Contents, BoxProof | None]:
    """Read what :func:`write` wrote, or refuse a file that is damaged or something else."""
    header, arrays = read_archive(path, FORMAT, ARRAYS)
    try:
        fields = Fields("the header", header)
        if (kind := fields.entry("format")) != FORMAT:
            raise GraphFileError(f"{path} holds {kind!r}, not a {FORMAT}")
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
    interval = _interval(header)
    names = header.items("names", next(iter(sizes), None)) if header.has("names") else None
    if not all(isinstance(name, str) for name in names or ()):
        raise DamagedError("names must be texts")
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
        for number, alpha in (piece.start, piece.alpha[0]), (piece.end, piece.alpha[-1]):
            if not abs(alpha - nodes[number].alpha) <= SAME_END * (hi - lo):
                raise DamagedError(f"piece {piece.id} does not reach node {number}: {alpha}")
        if not lo <= piece.interval[0] <= piece.interval[1] <= hi:
            raise DamagedError(f"piece {piece.id} leaves the interval: {piece.interval}")
    if len({len(bytes(piece.character)) for piece in pieces}) > 1:
        raise DamagedError("pieces have different numbers of signs")


def _proof(header: dict[str, Any]) -> BoxProof | None:
    """Return what was proved, which files of graphs without proof lack."""
    try:
        return BoxProof.read(header["proof"]) if "proof" in header else None
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedError(f"the proof makes no sense: {error}") from error


def _table(name: str, values: Any) -> Array:
    if not isinstance(values, np.ndarray):  # numpy returns bytes for a member that is no array
        raise DamagedError(f"{name} must be rows of numbers")
    if values.dtype not in (float, np.uint16) or values.ndim != 2:
        raise DamagedError(f"{name} must be rows of numbers, got {values.dtype}{values.shape}")
    numbers = records.from_first_digits(values) if values.dtype == np.uint16 else values
    if not (np.abs(numbers) <= LARGEST_STORED).all():
        raise DamagedError(f"{name} must be finite, and at most {LARGEST_STORED:g}")
    return numbers


def _special_points(
    header: Fields, kind: str, states: Array, errors: Array, names: list[str] | None
) -> list[SpecialPoint]:
    """Return special points of a kind: the nodes, or the starts; old files lack some entries."""
    found, headers = list[SpecialPoint](), header.objects(kind)
    if len(states) != len(headers):
        raise DamagedError(f"there are {len(headers)} {kind} with {len(states)} states")
    for each, z, error in zip(headers, states, errors, strict=True):
        recorded = Fields(f"recorded of {each.name}", each.data.get("recorded", {}))
        kept = {  # a text says why a quantity failed
            name: Kept(value if isinstance(value, str) else recorded.finite(name))
            for name, value in recorded.data.items()
        }
        point = SpecialPoint(
            id=each.integer("id", -1),
            kind=kind_of(each.word("kind")),
            place=Place(np.append(z, each.finite("alpha")), error),
            message=each.text("message"),
            backward=each.text("backward"),
            piece=None if each.entry("piece") is None else each.integer("piece", 0),
            digits=each.number("digits"),
            lost=each.integer("lost", 0),
            quantities=Quantities(names, kept),
            events=each.text("events") if each.has("events") else "",
        )
        found.append(point)
    return found


def _pieces(headers: list[Fields], points: Array) -> list[Piece]:
    """Return the pieces, each with the next rows of the points."""
    counts = [header.integer("count", 2) for header in headers]
    if sum(counts) != len(points):
        raise DamagedError(f"pieces have {sum(counts)} points, there are {len(points)}")
    found, ends = list[Piece](), np.cumsum(counts, dtype=int).tolist()
    for header, count, end in zip(headers, counts, ends, strict=True):
        signs = header.text("signs")
        if set(signs) - {"+", "-"}:
            raise DamagedError(f"signs of {header.name} must be + or -")
        piece = Piece(
            id=header.integer("id", 0),
            start=header.integer("start", 0),
            end=header.integer("end", 0),
            character=Character.read(signs),
            naming=partial(_named, header.text("label")),
            points=points[end - count : end],
            det_sign=header.integer("det_sign", -MOST_STORED),  # any number along an interface
        )
        found.append(piece)
    return found


def _named(name: str, _: Character) -> str:
    """Return the name that the system gave to a piece's character."""
    return name


def _interval(header: Fields) -> tuple[float, float]:
    ends = Fields("the interval", dict(zip(("lo", "hi"), header.items("interval", 2), strict=True)))
    lo, hi = ends.finite("lo"), ends.finite("hi")
    if not lo < hi:
        raise DamagedError(f"the interval needs lo < hi, got ({lo}, {hi})")
    return lo, hi


def _searched(header: Fields) -> SearchScope:
    items = zip(("what", "promise", "spent"), header.items("searched", 3), strict=True)
    searched = Fields("searched", dict(items))
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
    pieces, points = contents["pieces"], contents["points"]
    interval: Range = contents["interval"]
    name, words = type(system).__name__, f"{path} is of another system: it has"
    if pieces:
        point, piece = points[0], pieces[0]
        if len(point.z) != (size := shown_size(system)):
            raise InvalidInputError(f"{words} {len(point.z)} unknowns, {name} has {size}")
        z, stored = completed(system, point.z, point.alpha), len(bytes(piece.character))
        if stored != (tests := len(bytes(system.character(z, point.alpha)))):
            raise InvalidInputError(f"{words} {stored} tests, {name} has {tests}")
        _refuse_apart(path, contents, Box.of(system).period[:size])
    # a system without a scale is fitted also to the solutions
    states = [completed(system, point.z, point.alpha) for point in points]
    sizes = np.max(np.abs(states), axis=0, initial=0.0)
    usual = (sizes == 0.0) | ((sizes > 1.0 / ORDER_OF_ONE) & (sizes < ORDER_OF_ONE))
    found = None if system.gives_scale or usual.all() else np.where(usual, 1.0, sizes)
    fitted = system.within(*interval, found)
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
    nodes = {point.id: point.place.x for point in contents["points"]}
    pieces, metric = contents["pieces"], Metric(np.ones(len(period) + 1), period=period)
    sizes = SAME_END * np.abs(np.vstack([piece.points for piece in pieces])).max(axis=0)
    for piece in pieces:
        for number, x in zip((piece.start, piece.end), piece.points[[0, -1]], strict=True):
            if (np.abs(metric.difference(x, nodes[number])) > sizes).any():
                raise InvalidInputError(f"{path}: piece {piece.id} does not reach node {number}")
