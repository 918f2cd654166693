"""The journal of a long run: every finished piece is kept at once, and not computed again.

A run is the same sequence of walks each time, and walks are all that takes long. So a run goes on
where it stopped by being repeated with the walks that the journal knows.

Failure modes and answers
-------------------------
- The process is killed between any two instructions: each walk is one transaction of an SQLite
  database with a write-ahead log, and is there whole or not at all.
- Two processes work on one journal: the first locks it until it ends, however it ends.
- The journal is of another problem, perhaps one that begins alike: names, interval, stepper, and
  the values of H and of the tests at generic points are compared before any work, and each walk
  with the ray from which it was recorded.
- The search yields its starts while pieces are followed: starts are recorded, too, so that later
  ones cannot overtake what is known.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from pathlib import Path
from typing import final

import numpy as np

from pwscont.continuation.transcript import Transcript, walk_of, written
from pwscont.continuation.walk import Follower, Walk
from pwscont.foundation.arrays import Array
from pwscont.foundation.errors import InvalidInputError
from pwscont.foundation.rounding import EPS
from pwscont.search.enumeration import Found
from pwscont.transitions.rays import Ray

TABLES = """
create table if not exists about (facts text);
create table if not exists starts (number integer primary key, header text, rows blob);
create table if not exists walks (number integer primary key, ray blob, header text, rows blob);
"""

#: Values of the same functions, evaluated in another order, differ by far less than this.
SAME = EPS**0.5
#: Seconds to wait for another process to close the file.
PATIENCE = 0.5
ADVICE = "remove it, or write elsewhere"


@final
class Journal:
    """A file in which a run records what it has finished.

    Parameters
    ----------
    path : path
        Made if it does not exist; otherwise the run goes on from there.

    Raises
    ------
    InvalidInputError
        If the file cannot be opened, or is no journal.
    """

    def __init__(self, path: str | Path) -> None:
        import sqlite3  # noqa: PLC0415  only for runs that keep a journal

        self.path = Path(path)
        self._errors = sqlite3.Error
        try:
            self._base = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None)
            self._base.execute("pragma locking_mode = exclusive")
            self._base.execute("pragma journal_mode = wal")
            self._base.execute("pragma synchronous = normal")
            self._base.executescript(TABLES)
        except sqlite3.OperationalError as error:
            if "locked" in str(error):
                why = "another process is writing to it: wait for it, or write elsewhere"
                raise InvalidInputError(f"the journal {self.path} is in use; {why}") from error
            raise InvalidInputError(f"cannot write the journal {self.path}: {error}") from error
        except sqlite3.Error as error:
            raise InvalidInputError(f"{self.path} is no journal of a run: {error}") from error

    def __len__(self) -> int:
        """Return the number of finished pieces."""
        return int(self._base.execute("select count(*) from walks").fetchone()[0])

    @property
    def _of_another_run(self) -> str:
        return f"the journal {self.path} is of another run"

    def close(self) -> None:
        """Close the file."""
        self._base.close()

    def remove(self) -> None:
        """Close and delete the file, when what it holds is kept elsewhere."""
        self.close()
        self.path.unlink(missing_ok=True)

    def check(self, facts: Mapping[str, str], probes: Sequence[float]) -> None:
        """Compare what the run is about with what was recorded of it; record it the first time.

        Parameters
        ----------
        facts : mapping
            What is compared word by word.
        probes : sequence of float
            Values that tell problems apart, compared to half of their digits.

        Raises
        ------
        InvalidInputError
            If they differ.
        """
        known = self._base.execute("select facts from about").fetchone()
        if known is None:
            recorded = json.dumps([dict(facts), list(probes)])
            self._base.execute("insert into about values (?)", (recorded,))
            return
        before, values = json.loads(known[0])
        different = [
            f"{name} was {before[name]}, is {now}"
            for name, now in facts.items()
            if before[name] != now
        ]
        if not different and not np.allclose(values, probes, rtol=SAME, atol=0.0):
            different = ["the values of its functions have changed"]
        if different:
            raise InvalidInputError(f"{self._of_another_run}: {'; '.join(different)}; {ADVICE}")

    def starts(self, searched: Iterable[Found]) -> Iterator[Found]:
        """Yield the starts that are recorded, then further ones, which are recorded first."""
        known = self._base.execute("select header, rows from starts order by number").fetchall()
        for header, rows in known:
            everything = _rows(rows, json.loads(header))
            yield everything[0], everything[1:]
        if self._search_is_finished:
            return
        for number, (x, error) in enumerate(searched):
            if number >= len(known):
                self._add_start(number, np.vstack([x[np.newaxis], error]))
                yield x, error
        self._base.execute("pragma user_version = 1")

    @property
    def _search_is_finished(self) -> bool:
        return bool(self._base.execute("pragma user_version").fetchone()[0])

    def _add_start(self, number: int, rows: Array) -> None:
        values = (number, json.dumps(rows.shape[1]), rows.tobytes())
        self._base.execute("insert into starts values (?, ?, ?)", values)

    def find(self, number: int, ray: Ray) -> Walk | None:
        """Return a recorded walk, None if there is none.

        Raises
        ------
        InvalidInputError
            If it was begun from another ray.
        """
        query = "select ray, header, rows from walks where number = ?"
        found = self._base.execute(query, (number,)).fetchone()
        if found is None:
            return None
        if found[0] != _digest(ray):
            where = f"piece {number + 1} began elsewhere"
            raise InvalidInputError(f"{self._of_another_run}: {where}; {ADVICE}")
        return walk_of(Transcript(found[1], found[2]), ray)

    def add(self, number: int, ray: Ray, walk: Walk) -> None:
        """Record a walk, in one transaction."""
        transcript = written(walk)
        values = (number, _digest(ray), transcript.header, transcript.rows)
        self._base.execute("insert into walks values (?, ?, ?, ?)", values)


def _rows(data: bytes, columns: int) -> Array:
    rows: Array = np.frombuffer(data).reshape(-1, columns).copy()
    return rows


def _digest(ray: Ray) -> bytes:
    """Return what tells rays apart: their cells, place and direction."""
    state, parts = ray.state, blake2b(digest_size=16)
    for part in (*ray.cells, state.x.tobytes(), state.tangent.tobytes()):
        parts.update(part)
    return parts.digest()


@final
class Recorded(Follower):
    """Walks as another follower does, and records it; known walks are not walked again.

    Parameters
    ----------
    follower : Follower
    journal : Journal
    """

    def __init__(self, follower: Follower, journal: Journal) -> None:
        self.interval, self.bounds = follower.interval, follower.bounds
        self._follower, self._journal, self._number = follower, journal, 0

    def walk(self, ray: Ray) -> Walk:
        """Return the recorded piece that ``ray`` begins, or follow and record it."""
        number, self._number = self._number, self._number + 1
        known = self._journal.find(number, ray)
        if known is None:
            known = self._follower.walk(ray)
            self._journal.add(number, ray, known)
        return known
