"""Ways on that are recorded in a journal, and read where they are recorded."""

from __future__ import annotations

import json
from hashlib import blake2b
from math import inf
from typing import TYPE_CHECKING, final

import numpy as np

from pwscont.basics.arrays import generic
from pwscont.basics.errors import InvalidInputError
from pwscont.continuation.journal import Journal
from pwscont.evolution.ways import Evolver, Moment, Way, WaysOn

if TYPE_CHECKING:
    from pwscont.evolution.memory import SystemWithMemory

#: The kind of a record in the journal.
KIND = "ways"


@final
class RecordedWays:
    """The ways on that an evolver finds, kept in a journal in the order of the run.

    Parameters
    ----------
    evolver : Evolver
    journal : Journal
    system : SystemWithMemory
    interval : tuple of float
    """

    def __init__(
        self,
        evolver: Evolver,
        journal: Journal,
        system: SystemWithMemory,
        interval: tuple[float, float],
    ) -> None:
        self._evolver, self._journal, self._number = evolver, journal, 0
        facts = {"evolution of": type(system).__name__, "interval": repr(interval)}
        memory = np.asarray(system.initial_memory(), dtype=float)
        law = system.remembering(memory)
        z, t = generic(law.size), 0.5 * sum(interval)
        values = [law.test_functions(z, t), law.residual(z, t, law.character(z, t))]
        journal.check(facts, np.concatenate([memory, *values]).tolist())

    def __call__(self, moment: Moment) -> WaysOn:
        """Return the recorded ways on, or find and record the ways."""
        place, number = _place(moment), self._number
        self._number += 1
        known = self._journal.recorded(KIND, number)
        if known is None:
            self._evolver.forget()
            found = self._evolver.ways_on(moment)
            self._journal.record(KIND, place + _header(found), _rows(found))
            return found
        text, rows = known
        if not text.startswith(place):
            raise InvalidInputError(
                f"cannot use the journal {self._journal.path}: it is of another run: event "
                f"{number + 1} began elsewhere; remove it, or write elsewhere"
            )
        return _read(text.removeprefix(place), rows)


def _place(moment: Moment) -> str:
    """Return a digest of a moment; a run on the same machine repeats every bit."""
    return blake2b(np.append(moment.z, moment.t).tobytes(), digest_size=16).hexdigest()


def _header(found: WaysOn) -> str:
    until = [None if way.until == inf else way.until for way in found.ways]
    ways = [
        {"label": way.label, "mode": way.mode.hex(), "until": end}
        for way, end in zip(found.ways, until, strict=True)
    ]
    return json.dumps({"complete": found.complete, "remark": found.remark, "ways": ways})


def _rows(found: WaysOn) -> bytes:
    return b"".join(way.z.tobytes() + way.rate.tobytes() for way in found.ways)


def _read(text: str, rows: bytes) -> WaysOn:
    header, numbers = json.loads(text), np.frombuffer(rows).copy()
    ways = header["ways"]
    vectors = numbers.reshape(2 * len(ways), -1) if ways else numbers
    modes = [bytes.fromhex(way["mode"]) for way in ways]
    return WaysOn(
        tuple(
            Way(way["label"], z, rate, inf if way["until"] is None else way["until"], mode)
            for way, z, rate, mode in zip(ways, vectors[::2], vectors[1::2], modes, strict=True)
        ),
        header["complete"],
        header["remark"],
    )
