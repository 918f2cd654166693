"""The journal of a long run.

A run follows the same pieces in the same order each time. So an interrupted run is repeated, and
the journal supplies the recorded pieces, the starts of the search, and the magnitudes with which
the run had begun again.

The file is an SQLite database of numbered records, each written in a transaction of its own, with a
checksum. A journal without the last records is the journal of a run that was stopped earlier. Every
other change is refused, and so is the journal of another problem: names, interval, stepper, and
values at generic points are compared before any work, and each piece with the ray that begins it.
A change that touches neither these values nor a recorded piece is not noticed.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from itertools import count, pairwise
from os import PathLike
from pathlib import Path
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Kind, kind_of
from pwscont.basics.printing import counted, named
from pwscont.basics.rounding import EPS
from pwscont.continuation.follow import Follow, Followed, is_cut
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import Found
from pwscont.curve.metric import Gauge
from pwscont.system.selection import Selection, unexplained
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray

#: What is said of a journal that does not fit.
OTHER_RUN, OTHER_VALUES = "it is of another run", "the values of its functions have changed"


def written(piece: Followed) -> tuple[str, bytes]:
    """Return a piece as a text, which is a JSON object, and different rows of n + 1 doubles."""
    numbers: dict[bytes, int] = {}  # of each row that is different from all rows before

    def add(rows: Iterable[Array]) -> list[int]:
        """Return the numbers of these rows."""
        return [numbers.setdefault(row.tobytes(), len(numbers)) for row in rows]

    def told(ray: Ray) -> dict[str, Any]:
        state, selection = ray.state, ray.curve.selection
        return {
            "signs": str(selection.character),
            "beside": [str(cell) for cell in selection.adjacent_cells],
            "shared": [str(cell) for cell in ray.interface_cells],
            "index": int(ray.index),
            "state": add(np.stack([state.x, state.tangent])),
            "error": add(state.error),
            "orientation": int(state.orientation),
            "is_singular": state.is_singular,
        }

    points, arrival = piece
    header = {
        "kind": str(arrival.kind),
        "message": arrival.message,
        "points": add(points),
        "x": add(arrival.x[np.newaxis]),
        "rays": [told(ray) for ray in arrival.rays],
    }
    return json.dumps(header), b"".join(numbers)


def piece_of(record: tuple[str, bytes], ray: Ray) -> Followed:
    """Return the piece that was written; the first ray, ``ray``, has the system and the metric."""
    header = json.loads(record[0])
    rows = np.frombuffer(record[1]).reshape(-1, len(ray.state.x)).copy()
    system, metric = ray.curve.selection.system, ray.curve.metric

    def read(data: dict[str, Any]) -> Ray:
        beside = tuple(map(Character.read, data["beside"]))
        curve = Curve(Selection(system, Character.read(data["signs"]), beside), metric)
        x, tangent = rows[data["state"]]
        state = State(x, tangent, rows[data["error"]], data["orientation"])
        state.is_singular = data.get("is_singular", False)
        return Ray(curve, state, tuple(map(Character.read, data["shared"])), data["index"])

    rays, x = tuple(map(read, header["rays"])), rows[header["x"][0]]
    arrival = SpecialPointFound(kind_of(header["kind"]), x, header["message"], rays)
    return list(rows[header["points"]]), arrival


#: The lock is kept from one transaction to the next, and ends with the process.
LOCK = "PRAGMA locking_mode = EXCLUSIVE; PRAGMA synchronous = NORMAL; BEGIN EXCLUSIVE"
#: SQLite keeps this text: a journal of another version has another text.
TABLE = "CREATE TABLE journal_4 (number INTEGER PRIMARY KEY, kind, text, rows, checksum)"
#: With a log, a record does not wait for the disk; with a rollback journal each record would wait.
LOG = "PRAGMA journal_mode = WAL"
#: Damage may turn rows into something else than bytes.
READ = "SELECT kind, text, rows, checksum FROM journal_4 WHERE number = ? AND typeof(rows) = 'blob'"
#: A record of this number is there where Ctrl-C came before the record was counted.
WRITE = "REPLACE INTO journal_4 (number, kind, text, rows, checksum) VALUES (?, ?, ?, ?, ?)"

ADVICE = "remove it, or write elsewhere"
NO_JOURNAL = f"it is no journal of this version; if it is of an earlier one, {ADVICE}"
NOT_WRITABLE = "it cannot be written: see that its directory exists, and that you may write there"
#: What errors of SQLite mean, by the beginning of their names; every other error means damage.
MEANINGS = {
    "SQLITE_BUSY": "another process is writing to it, or it is open here: wait for it or close it, "
    "or write elsewhere",
    "SQLITE_NOTADB": NO_JOURNAL,
    "SQLITE_CANTOPEN": NOT_WRITABLE,
    "SQLITE_READONLY": NOT_WRITABLE,
    "SQLITE_IOERR": NOT_WRITABLE,
}
CLOSED = "it is closed; Journal(path) opens it again"
FULL_DISK = {"SQLITE_FULL", "SQLITE_IOERR_WRITE"}

#: Values of the same functions, evaluated in another order, differ by far less than this.
SAME_PROBES = EPS**0.5


@final
class Journal:
    """A file in which a run records every finished piece.

    A journal is a context manager: ``with Journal(path) as journal`` closes the file at the end.
    After a kill, the last records are in ``NAME-wal`` beside the journal: move the two files
    together.

    Parameters
    ----------
    path : path
        A new file is made; an existing journal is continued.

    Attributes
    ----------
    trouble : Exception or None
        Why nothing more is recorded, such as the ``sqlite3.OperationalError`` of a full disk; the
        run does not stop for this.

    Raises
    ------
    InvalidInputError
        If the file cannot be opened, is in use, is damaged, or is no journal.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from pwscont import LCP, Journal, explore
    >>> problem = LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0])
    >>> with TemporaryDirectory() as folder, Journal(Path(folder, "run.journal")) as journal:
    ...     graph = explore(problem, (-1.0, 2.0), journal=journal)
    ...     journal.is_finished
    True
    """

    def __init__(self, path: str | Path) -> None:
        import sqlite3  # noqa: PLC0415  most runs keep no journal

        if not isinstance(path, str | PathLike):
            raise InvalidInputError(f"a journal needs the path of a file, got {path!r}")
        self.path = Path(path)
        self.trouble: Exception | None = None
        #: The revised typical magnitudes of the unknowns, shape (n,), None until a revision.
        self.magnitudes: Array | None = None
        self._numbers: dict[str, list[int]] = defaultdict(list)
        self._count = 0
        path = self.path.absolute()  # SQLite would make no file for ":memory:" alone
        how: Any = {"timeout": 0.0, "isolation_level": None, "check_same_thread": False}
        try:
            self._data = sqlite3.connect(path, **how)
            try:
                self._open()
            except BaseException:
                self.close()
                raise
        except (sqlite3.Error, UnicodeDecodeError) as error:  # damage may be quoted in the error
            name = getattr(error, "sqlite_errorname", "")
            if name not in FULL_DISK:  # else the run goes on without a record
                meaning = MEANINGS.get("_".join(name.split("_")[:2]), f"{error}; {ADVICE}")
                raise self._refusal(meaning) from error
            self.trouble = error
        except MemoryError as error:
            raise self._refusal(f"it is damaged (its pages have no end); {ADVICE}") from error

    def __len__(self) -> int:
        """Return the number of finished pieces; of an evolution, the number of finished events."""
        return len(self._numbers["walk"]) + len(self._numbers["ways"])

    def __enter__(self) -> Journal:
        """Return the journal; the file is closed at the end of the ``with`` block."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return named(self, self.path, counted(len(self), "finished piece"))

    @property
    def is_finished(self) -> bool:
        """Whether the run is finished."""
        return bool(self._numbers["finished"])

    def close(self) -> None:
        """Close the file."""
        self._data.close()

    def remove(self) -> None:
        """Close and delete the file, when the graph is kept elsewhere."""
        self.close()
        for suffix in ("", "-wal", "-journal"):
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)

    def _open(self) -> None:
        """Lock the file, begin a new file, or read an old file once from end to end."""
        self._data.executescript(LOCK)
        table = self._value("SELECT group_concat(sql) FROM sqlite_master")
        if table not in {None, TABLE}:
            raise self._refusal(NO_JOURNAL)
        if (found := self._value("PRAGMA quick_check")) != "ok":
            raise self._refusal(f"it is damaged ({found}); {ADVICE}")
        for statement in ([TABLE] if table is None else []) + ["COMMIT", LOG]:
            self._data.execute(statement)
        for _ in range(self._value("SELECT count(*) FROM journal_4")):
            kind, _text, rows = self._read(self._count)
            self._keep(kind, rows)

    def _keep(self, kind: str, rows: bytes) -> None:
        """Count the next record; the records before new magnitudes count no more."""
        if kind == "magnitudes":
            self.magnitudes = np.frombuffer(rows)
            self._numbers.clear()
        else:
            self._numbers[kind].append(self._count)
        self._count += 1

    def _refusal(self, why: str) -> InvalidInputError:
        return InvalidInputError(f"cannot use the journal {self.path}: {why}")

    def _value(self, query: str) -> Any:
        return self._data.execute(query).fetchone()[0]

    def _read(self, number: int) -> tuple[str, str, bytes]:
        """Return kind, text and rows of a record."""
        try:
            found = self._data.execute(READ, [number]).fetchall()
        except self._data.ProgrammingError as error:
            raise self._refusal(CLOSED) from error
        for kind, text, rows, checksum in found:
            if checksum == _digest(repr((number, kind, text)).encode(), rows):
                return kind, text, rows
        raise self._refusal(f"it is damaged (record {number} is missing or changed); {ADVICE}")

    def recorded(self, kind: str, n: int) -> tuple[str, bytes] | None:
        """Return text and rows of the n-th record of a kind, None if there are not so many."""
        numbers = self._numbers[kind]
        return self._read(numbers[n])[1:] if n < len(numbers) else None

    def record(self, kind: str, text: str = "", rows: bytes = b"") -> None:
        """Write a record of a kind, unless there was trouble."""
        if self.trouble is not None:
            return
        number = self._count
        checksum = _digest(repr((number, kind, text)).encode(), rows)
        try:
            self._data.execute(WRITE, (number, kind, text, rows, checksum))
        except self._data.ProgrammingError as error:
            raise self._refusal(CLOSED) from error
        except (self._data.Error, OverflowError) as error:
            self.trouble = error
        else:
            self._keep(kind, rows)

    def check(self, facts: Mapping[str, str], probes: Sequence[float]) -> None:
        """Refuse the journal of another run; the first time, record what this run is about.

        ``facts`` are compared word by word, ``probes`` to half of the digits.
        """
        known = self.recorded("about", 0)
        if known is None:
            self.record("about", json.dumps([dict(facts), list(probes)]))
            return
        before, values = json.loads(known[0])
        different = [
            f"{name}: {before.get(name) or 'none'} when it was begun, {now or 'none'} now"
            for name, now in facts.items()
            if before.get(name, "") != now
        ]
        alike = len(values) == len(probes) and np.allclose(values, probes, SAME_PROBES, 0.0, True)
        if different or not alike:
            what = "; ".join(different) or OTHER_VALUES
            raise self._refusal(f"{OTHER_RUN}: {what}; {ADVICE}")

    def starts(self, searched: Iterable[Found]) -> Iterator[Found]:
        """Yield the starts that are recorded, then further starts, each recorded first.

        The search begins again, and may yield recorded starts again, which their bytes tell.
        """
        known: set[bytes] = set()
        for number in self._numbers["start"]:
            _, columns, data = self._read(number)
            rows = np.frombuffer(data).reshape(-1, int(columns)).copy()
            known.add(data)
            yield rows[0], rows[1:]
        if self._numbers["searched"]:
            return
        for x, error in searched:
            data = np.vstack([x, error]).tobytes()
            if data not in known:
                known.add(data)
                self.record("start", str(len(x)), data)
                yield x, error
        self.record("searched")

    def recording(self, follow: Follow, gauge: Gauge | None) -> Follow:
        """Return a function that reads the pieces of a run, or follows and records them."""
        numbers = count()

        def read_or_follow(ray: Ray) -> Followed:
            number = next(numbers)
            begun, known = _place(ray), self.recorded("walk", number)
            if known is None:
                piece = follow(ray)
                if not is_cut(piece[1]):
                    text, rows = written(piece)
                    self.record("walk", begun + text, rows)
                return piece
            if not known[0].startswith(begun):
                raise self._refusal(f"{OTHER_RUN}: piece {number + 1} began elsewhere; {ADVICE}")
            piece = piece_of((known[0].removeprefix(begun), known[1]), ray)
            if _is_of_other_values(ray, piece):
                raise self._refusal(f"{OTHER_RUN}: {OTHER_VALUES}; {ADVICE}")
            if gauge and not ray.curve.selection.is_straight:
                # the step that a special point ended was not seen in the first run
                points, arrival = piece
                is_whole = arrival.kind == Kind.STOPPED
                for step in pairwise(points if is_whole else points[:-1]):
                    gauge.see(*step)
            return piece

        return read_or_follow

    def finish(self) -> None:
        """Record that the run is finished."""
        if not self.is_finished:
            self.record("finished")


def _is_of_other_values(ray: Ray, piece: Followed) -> bool:
    """Tell whether H does not vanish inside of a piece; at the ends a change may not be seen."""
    (points, arrival), selection, metric = piece, ray.curve.selection, ray.curve.metric
    x = points[len(points) // 2] if len(points) > 2 else 0.5 * (points[0] + points[-1])
    error = np.vstack([ray.state.error, *(r.state.error for r in arrival.rays[:1])])
    return bool(unexplained(selection.system, selection.character, x, metric.scale, error))


def _place(ray: Ray) -> str:
    """Return a digest of the cells, the place and the direction of a ray."""
    return _digest(*ray.cells, ray.state.x.tobytes(), ray.state.tangent.tobytes())


def _digest(*parts: bytes) -> str:
    return blake2b(b"".join(parts), digest_size=16).hexdigest()
