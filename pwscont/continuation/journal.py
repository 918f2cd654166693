"""The journal of a long run: every finished piece is kept at once, and not computed again.

A run is the same sequence of walks each time, and walks are all that takes long. So a run goes on
where it stopped by being repeated with the walks that the journal knows.

The file is a line that says what the file is, and records behind each other, each with a checksum
and never written to again. So whatever is lost at the end, the rest is the journal of a run that
was stopped earlier, and leads to the same graph.

Failure modes and answers
-------------------------
- The process is killed between any two instructions, or the power fails: a last record that is
  not whole is left out.
- Bytes change: a checksum does not fit, and the journal is refused. A checksum covers the place of
  its record in the file, too, so that no record is missing between others.
- The disk is full: the run goes on and is not recorded any more, see ``Journal.trouble``.
- Two processes work on one journal: the first locks it until it ends, however it ends.
- The journal is of another problem, perhaps one that begins alike: names, interval, stepper, and
  the values of H and of the tests at generic points are compared before any work, and each walk
  with the ray from which it was recorded.
- The search yields its starts while pieces are followed: starts are recorded, too, so that in the
  repeated run each comes at its turn.
"""

from __future__ import annotations

import errno
import json
import os
import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import counted, named
from pwscont.basics.rounding import EPS
from pwscont.continuation.follow import FollowedPiece, Follower
from pwscont.continuation.locking import lock
from pwscont.continuation.transcript import Transcript, walk_of, written
from pwscont.search.enumeration import Found
from pwscont.transitions.rays import Ray

FIRST_LINE = b"pwscont journal 2\n"
#: A record begins with its kind, the lengths of its header and of its rows, and a checksum.
LENGTHS, CHECKSUM = struct.Struct("<cQQ"), 16
PREFIX = LENGTHS.size + CHECKSUM
ABOUT, START, SEARCHED, WALK, FINISHED = b"a", b"s", b"e", b"w", b"f"

#: Values of the same functions, evaluated in another order, differ by far less than this.
SAME = EPS**0.5
ADVICE = "remove it, or write elsewhere"


class _Record(NamedTuple):
    """A record: its kind, a header in JSON, and rows of doubles."""

    kind: bytes
    header: bytes = b""
    rows: bytes = b""

    def at(self, place: int) -> bytes:
        """Return what stands in the file from a place on."""
        lengths = LENGTHS.pack(self.kind, len(self.header), len(self.rows))
        checksum = blake2b(lengths, digest_size=CHECKSUM)
        for part in (place.to_bytes(8, "little"), self.header, self.rows):
            checksum.update(part)
        return b"".join([lengths, checksum.digest(), self.header, self.rows])


@final
class Journal:
    """A file in which a run records what it has finished.

    Parameters
    ----------
    path : path
        Made if it does not exist; otherwise the run goes on from there.

    Attributes
    ----------
    trouble : OSError or None
        Why nothing more is recorded, such as a full disk; the run does not stop for it.

    Raises
    ------
    InvalidInputError
        If the file cannot be opened, is in use, is damaged, or is no journal.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.trouble: OSError | None = None
        self._places: dict[bytes, list[int]] = defaultdict(list)
        self._end = 0
        try:
            self._file = self.path.open("a+b", buffering=0)  # a record is one call of the system
        except OSError as error:
            why = error.strerror or error
            raise InvalidInputError(f"cannot write the journal {path}: {why}") from error
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        if not lock(self._file):
            why = "another process is writing to it: wait for it, or write elsewhere"
            raise InvalidInputError(f"the journal {self.path} is in use; {why}")
        first = self._bytes(0, len(FIRST_LINE))
        if not FIRST_LINE.startswith(first):
            raise InvalidInputError(f"{self.path} is no journal of a run; write elsewhere")
        if first == FIRST_LINE:
            self._scan()
        else:  # new, or killed at once
            self._write(FIRST_LINE)

    def __len__(self) -> int:
        """Return the number of finished pieces."""
        return len(self._places[WALK])

    def __repr__(self) -> str:
        return named(self, self.path, counted(len(self), "finished piece"))

    @property
    def is_finished(self) -> bool:
        """Whether the run came to its end."""
        return bool(self._places[FINISHED])

    @property
    def _of_another_run(self) -> str:
        return f"the journal {self.path} is of another run"

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def remove(self) -> None:
        """Close and delete the file, when what it holds is kept elsewhere."""
        self.close()
        self.path.unlink(missing_ok=True)

    # -- records -------------------------------------------------------------------------

    def _scan(self) -> None:
        """Note where the records are, and where the last one ends that is whole."""
        self._end, size = len(FIRST_LINE), self._file.seek(0, os.SEEK_END)
        while self._end < size:
            record = self._record(self._end, size)
            if record is not None:
                self._places[record.kind].append(self._end)
                self._end += len(record.at(self._end))
            elif self._is_cut_off(size):
                return
            else:
                where = f"after {len(self)} pieces (byte {self._end})"
                raise InvalidInputError(f"the journal {self.path} is damaged {where}; {ADVICE}")

    def _record(self, place: int, size: int) -> _Record | None:
        """Return the record at a place, None if there is none in a file of this size."""
        prefix = self._bytes(place, PREFIX)
        if len(prefix) < PREFIX or place + _length(prefix) > size:
            return None
        kind, header, _ = LENGTHS.unpack_from(prefix)
        content = self._bytes(place + PREFIX, _length(prefix) - PREFIX)
        record = _Record(kind, content[:header], content[header:])
        return record if record.at(place) == prefix + content else None

    def _is_cut_off(self, size: int) -> bool:
        """Tell whether what is no record may be the last one, not written to its end."""
        prefix = self._bytes(self._end, PREFIX)
        if len(prefix) < PREFIX or self._end + _length(prefix) >= size:
            return True
        return not self._bytes(self._end, size - self._end).strip(b"\0")  # the power failed

    def _bytes(self, place: int, count: int) -> bytes:
        self._file.seek(place)
        return self._file.read(count) or b""

    def _nth(self, kind: bytes, number: int) -> _Record | None:
        """Return a record of a kind, None if there are not so many."""
        places = self._places[kind]
        if number >= len(places):
            return None
        record = self._record(places[number], self._end)
        if record is None:
            raise InvalidInputError(f"the journal {self.path} was written to by others; {ADVICE}")
        return record

    def _add(self, record: _Record) -> None:
        place = self._end
        if self._write(record.at(place)):
            self._places[record.kind].append(place)

    def _write(self, content: bytes) -> bool:
        """Append, behind what is whole; returns False if nothing is recorded any more."""
        if self.trouble is not None:
            return False
        try:
            self._file.truncate(self._end)
            if self._file.write(content) != len(content):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            self.trouble = error
            return False
        self._end += len(content)
        return True

    # -- what a run records --------------------------------------------------------------

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
        known = self._nth(ABOUT, 0)
        if known is None:
            self._add(_Record(ABOUT, json.dumps([dict(facts), list(probes)]).encode()))
            return
        before, values = json.loads(known.header)
        different = [
            f"{name}: {before.get(name) or 'none'} when it was begun, {now or 'none'} now"
            for name, now in facts.items()
            if before.get(name, "") != now
        ]
        if not different and not _agree(values, probes):
            different = ["the values of its functions have changed"]
        if different:
            raise InvalidInputError(f"{self._of_another_run}: {'; '.join(different)}; {ADVICE}")

    def starts(self, searched: Iterable[Found]) -> Iterator[Found]:
        """Yield the starts that are recorded, then further ones, which are recorded first."""
        known = 0
        while record := self._nth(START, known):
            everything = _rows(record.rows, json.loads(record.header))
            known += 1
            yield everything[0], everything[1:]
        if self._places[SEARCHED]:
            return
        for number, (x, error) in enumerate(searched):
            if number >= known:
                rows = np.vstack([x[np.newaxis], error])
                self._add(_Record(START, json.dumps(rows.shape[1]).encode(), rows.tobytes()))
                yield x, error
        self._add(_Record(SEARCHED))

    def find(self, number: int, ray: Ray) -> FollowedPiece | None:
        """Return a recorded walk, None if there is none.

        Raises
        ------
        InvalidInputError
            If it was begun from another ray.
        """
        found = self._nth(WALK, number)
        if found is None:
            return None
        digest = _digest(ray)
        if not found.rows.startswith(digest):
            where = f"piece {number + 1} began elsewhere"
            raise InvalidInputError(f"{self._of_another_run}: {where}; {ADVICE}")
        return walk_of(Transcript(found.header.decode(), found.rows[len(digest) :]), ray)

    def add(self, ray: Ray, walk: FollowedPiece) -> None:
        """Record the next walk."""
        transcript = written(walk)
        self._add(_Record(WALK, transcript.header.encode(), _digest(ray) + transcript.rows))

    def finish(self) -> None:
        """Record that the run came to its end."""
        if not self.is_finished:
            self._add(_Record(FINISHED))


def _length(prefix: bytes) -> int:
    """Return the length of the record that begins so."""
    _, header, rows = LENGTHS.unpack_from(prefix)
    return PREFIX + int(header) + int(rows)


def _agree(values: Sequence[float], others: Sequence[float]) -> bool:
    return len(values) == len(others) and np.allclose(values, others, rtol=SAME, atol=0.0)


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

    def walk(self, ray: Ray) -> FollowedPiece:
        """Return the recorded piece that ``ray`` begins, or follow and record it."""
        number, self._number = self._number, self._number + 1
        known = self._journal.find(number, ray)
        if known is None:
            known = self._follower.walk(ray)
            if not known.is_cut:
                self._journal.add(ray, known)
        return known
