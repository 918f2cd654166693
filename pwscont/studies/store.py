"""The store of a study's rows: in memory, or in a file that survives crashes.

The file is an SQLite database in the manner of :class:`pwscont.Journal`: each row is written in a
separate transaction, with a checksum over number and content.

Failure modes and answers
-------------------------
- The process is killed: all rows stay, the latest rows in the log of SQLite beside the file until
  the file is opened again and closed.
- The power fails: the last rows may be missing, and the cases of these rows run again.
- Bytes of the file change: the store is refused.
- The disk is full: the study ends with an error; all written rows stay.
- Two processes work on one store: the first process locks the store until that process ends.
- The store is of another study, or of different versions: an error names the difference before any
  work.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from hashlib import blake2b
from pathlib import Path
from typing import Any, final
from weakref import finalize

from pwscont import InvalidInputError
from pwscont.extending import counted, named, short
from pwscont.studies.case import StudyRow

LOCK = "PRAGMA locking_mode = EXCLUSIVE; PRAGMA synchronous = NORMAL; BEGIN EXCLUSIVE"
#: SQLite keeps this text, which differs in a store of another version.
TABLE = "CREATE TABLE study_1 (number INTEGER PRIMARY KEY, text, checksum)"
#: With a write-ahead log, writing a row does not wait for the disk.
LOG = "PRAGMA journal_mode = WAL"
READ = "SELECT number, text, checksum FROM study_1 WHERE number >= 0 ORDER BY number"
WRITE = "REPLACE INTO study_1 (number, text, checksum) VALUES (?, ?, ?)"
#: The number of the record that says what the study is about.
ABOUT = -1

ADVICE = "remove it, or write elsewhere"
NO_STORE = f"it is no store of a study of this version; {ADVICE}"
NOT_WRITABLE = "it cannot be written: see that its directory exists, and that you may write there"
MEANINGS = {
    "SQLITE_BUSY": "another process is writing to it: wait for it, or write elsewhere",
    "SQLITE_NOTADB": NO_STORE,
    "SQLITE_CANTOPEN": NOT_WRITABLE,
    "SQLITE_READONLY": NOT_WRITABLE,
    "SQLITE_IOERR": NOT_WRITABLE,
    "SQLITE_FULL": "the disk is full; what was written stays",
}


@final
class Store:
    """The rows of a study, by number of the case.

    Parameters
    ----------
    path : path or None
        The file, which is created if missing; None for memory.
    """

    def __init__(self, path: str | Path | None = None) -> None:
        import sqlite3  # noqa: PLC0415  only where there is a study

        self.path = None if path is None else Path(path)
        place = ":memory:" if self.path is None else self.path.absolute()
        self._error = sqlite3.Error
        try:
            self._data = sqlite3.connect(
                place, timeout=0.0, isolation_level=None, check_same_thread=False
            )
            finalize(self, self._data.close)
            try:
                self._open()
            except BaseException:
                self.close()
                raise
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise self._in_words(error) from error
        except MemoryError as error:
            raise self.refusal(f"it is damaged (its pages have no end); {ADVICE}") from error

    def __repr__(self) -> str:
        return named(self, self.path or "in memory", counted(len(self), "row"))

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self._value("SELECT count(*) FROM study_1 WHERE number >= 0"))

    def __contains__(self, number: int) -> bool:
        """Tell whether the store has the row of a case."""
        found = self._data.execute("SELECT 1 FROM study_1 WHERE number = ?", [number])
        return found.fetchone() is not None

    def __iter__(self) -> Iterator[StudyRow]:
        """Yield the rows in the order of the numbers, row by row from the file."""
        for number, text, checksum in self._data.execute(READ):
            self._check(number, text, checksum)
            yield _row(text)

    def close(self) -> None:
        """Close the file."""
        self._data.close()

    def add(self, row: StudyRow) -> None:
        """Write a row."""
        self._write(row.case, json.dumps(_parts(row)))

    @property
    def about(self) -> Any:
        """The description of the study, None for an empty store."""
        query = "SELECT text, checksum FROM study_1 WHERE number = ?"
        found = self._data.execute(query, [ABOUT]).fetchone()
        if found is None:
            return None
        self._check(ABOUT, *found)
        return json.loads(found[0])

    def check(self, about: Mapping[str, Any]) -> None:
        """Refuse the store of another study; describe this study in an empty store.

        Parameters
        ----------
        about : mapping
            The description of this study, as lists, numbers and texts, which JSON can hold.
        """
        given, known = json.loads(json.dumps(about)), self.about
        if known is None:
            self._write(ABOUT, json.dumps(given))
            return
        different = [
            f"{name}: {short(str(known[name]))} when it was begun, {short(str(now))} now"
            for name, now in given.items()
            if name != "functions" and _differ(known.get(name, now), now)
        ]
        now = given.get("functions")  # which a store of an earlier version does not have
        if not different and known.get("functions", now) != now:
            different = ["its functions have changed"]
        if different:
            raise self.refusal(f"it is of another study: {'; '.join(different)}; {ADVICE}")

    def refusal(self, why: str) -> InvalidInputError:
        """Return an error that names the store."""
        return InvalidInputError(f"cannot use the store {self.path or 'in memory'}: {why}")

    def _open(self) -> None:
        """Lock the file, set up a new file, and check the pages of an old file."""
        self._data.executescript(LOCK)
        table = self._value("SELECT group_concat(sql) FROM sqlite_master")
        if table not in {None, TABLE}:
            raise self.refusal(NO_STORE)
        if (found := self._value("PRAGMA quick_check")) != "ok":
            raise self.refusal(f"it is damaged ({found}); {ADVICE}")
        for statement in ([TABLE] if table is None else []) + ["COMMIT", LOG]:
            self._data.execute(statement)

    def _write(self, number: int, text: str) -> None:
        try:
            self._data.execute(WRITE, (number, text, _checksum(number, text)))
        except self._data.ProgrammingError:
            raise  # the store is closed: a mistake of the caller
        except self._error as error:
            raise self._in_words(error) from error

    def _check(self, number: int, text: str, checksum: str) -> None:
        if not isinstance(text, str) or checksum != _checksum(number, text):
            raise self.refusal(f"it is damaged (record {number}); {ADVICE}")

    def _value(self, query: str) -> Any:
        return self._data.execute(query).fetchone()[0]

    def _in_words(self, error: Exception) -> InvalidInputError:
        name = "_".join(getattr(error, "sqlite_errorname", "").split("_")[:2])
        return self.refusal(MEANINGS.get(name, f"{error}; {ADVICE}"))


def _checksum(number: int, text: str) -> str:
    return blake2b(f"{number} {text}".encode(), digest_size=16).hexdigest()


def _differ(known: Any, now: Any) -> bool:
    """Tell whether two values differ, also in the order of parts, which numbers the cases."""
    return known != now or list(known) != list(now)


def _parts(row: StudyRow) -> list[Any]:
    """Return a row as lists for JSON, which keeps all bits of floats."""
    told = [row.proven, row.guarantee, row.seconds, row.failure]
    return [row.case, dict(row.settings), dict(row.values), *told]


def _row(text: str) -> StudyRow:
    case, settings, values, *told = json.loads(text)
    return StudyRow(case, settings, {k: _tuples(v) for k, v in values.items()}, *told)


def _tuples(value: Any) -> Any:
    """Return a value of JSON with tuples in place of lists."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
