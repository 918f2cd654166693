"""The loop of an evolution: from event to event, in the order of time; and the journal of the loop.

Failure modes and answers
-------------------------
- Histories multiply: a state that was reached before is the same node, and a state on a piece
  that was reached before divides the piece.
- Events accumulate at one time: after many events without progress the node is undecided.
- A limit runs out, or Ctrl-C: nodes whose ways on were not looked for are undecided.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from hashlib import blake2b
from heapq import heappop, heappush
from math import inf
from typing import TYPE_CHECKING, NoReturn, final

import numpy as np

from pwscont.basics.arrays import generic
from pwscont.basics.budget import Budget
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.rounding import SAME_STATE
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import Report
from pwscont.evolution.memory import Evolver, Moment, Way, WaysOn, closeness
from pwscont.evolution.rays import holds, typical
from pwscont.evolution.rules import Jumps, UserEvents
from pwscont.evolution.states import EvolutionNode, EvolutionPiece, same_time
from pwscont.system.abilities import completed

if TYPE_CHECKING:
    from pwscont.evolution.memory import SystemWithMemory

#: The number of events in a row without progress in time that count as an accumulation.
MOST_AT_ONE_TIME = 200
ACCUMULATE = "events accumulate"


@final
class Run:
    """All evolutions from some states.

    Parameters
    ----------
    evolver : Evolver
    ways_on : callable
        The ways on of the evolver, or those recorded in a journal.
    interval : tuple of float
    events : UserEvents
    jumps : Jumps
    report : callable
    budget : Budget

    Attributes
    ----------
    nodes : list of EvolutionNode or None
        None for a node that turned out to be another one.
    pieces : list of EvolutionPiece
    """

    def __init__(
        self,
        evolver: Evolver,
        ways_on: Callable[[Moment], WaysOn],
        interval: tuple[float, float],
        events: UserEvents,
        jumps: Jumps,
        report: Report,
        budget: Budget,
    ) -> None:
        self._evolver, self._ways_on = evolver, ways_on
        self._events, self._jumps = events, jumps
        self._report, self._budget = report, budget
        self._sizes = evolver.sizes()
        self._end, self._same_time = interval[1], same_time(interval)
        self._memory_size = 0.0
        self.nodes: list[EvolutionNode | None] = []
        self.pieces: list[EvolutionPiece] = []
        self._moments: dict[int, Moment] = {}
        self._stops: set[int] = set()
        self._stalled: dict[int, int] = {}
        self._waiting: list[tuple[float, int]] = []
        self._done: list[int] = []
        self._into: dict[int, list[EvolutionPiece]] = defaultdict(list)
        self._open: list[EvolutionPiece] = []

    def start(self, moments: Sequence[Moment]) -> None:
        """Begin at some states."""
        for moment in moments:
            self._add(moment, "start", "")

    def follow(self) -> None:
        """Follow all evolutions to the end of the interval."""
        while self._waiting:
            t, number = heappop(self._waiting)
            node = self.nodes[number]
            if node is None or self._is_known(number, node):
                continue
            if self._is_at_end(t):
                node.kind = "end"
            elif number in self._stops:
                node.kind = "event"
            elif not self._budget.allows(len(self.pieces)):
                heappush(self._waiting, (t, number))
                return
            else:
                self._go_on(number, node)
            self._done.append(number)
            self._moments.pop(number, None)
            self._report(len(self.pieces), t)

    def _is_at_end(self, t: float) -> bool:
        return t >= self._end - self._same_time

    # -- one node ------------------------------------------------------------------------

    def _go_on(self, number: int, node: EvolutionNode) -> None:
        """Find the ways on from a node, and the next node on each."""
        moment = self._moments[number]
        if self._stalled.get(number, 0) > MOST_AT_ONE_TIME:
            node.remark, node.kind = f"{ACCUMULATE} at t = {node.t:.10g}", "undecided"
            return
        found = self._ways_on(moment)
        node.remark = found.remark if not found.complete else ""
        for way in found.ways:
            self._follow_way(number, moment, way)
        if found.ways:
            several = "branching" if len(found.ways) > 1 else "event"
            node.kind = several if node.kind == "undecided" else node.kind
            return
        node.kind = "loss" if found.complete else "undecided"
        if node.kind == "loss":
            self._jump(number, moment)

    def _follow_way(self, number: int, moment: Moment, way: Way) -> None:
        until = min(max(way.until, moment.t), self._end)
        if self._is_at_end(until):
            until = self._end
        event = self._events.first(self._evolver, moment, way, until)
        until = event.t if event else until
        reached = self._evolver.reached(moment, way, until)
        new = self._add(reached, "undecided", event.name if event else "")
        stalls = until - moment.t <= self._same_time
        self._stalled[new] = self._stalled.get(number, 0) + 1 if stalls else 0
        if event and event.stops:
            self._stops.add(new)
        self._join(EvolutionPiece(number, new, way.label, way.z, reached.z))

    def _jump(self, number: int, moment: Moment) -> None:
        """Go on elsewhere by the user's rule, where the evolution is lost."""
        for target in self._jumps.targets(self._evolver, moment):
            new = self._add(target, "jump", "")
            self._join(EvolutionPiece(number, new, "jump", moment.z, target.z, is_jump=True))

    def _join(self, piece: EvolutionPiece) -> None:
        self.pieces.append(piece)
        self._open.append(piece)
        self._into[piece.end].append(piece)

    def _add(self, moment: Moment, kind: str, name: str) -> int:
        number = len(self.nodes)
        self.nodes.append(EvolutionNode(moment.t, moment.z, moment.memory, kind, name))
        self._moments[number] = moment
        self._memory_size = max(self._memory_size, float(np.abs(moment.memory).max(initial=0.0)))
        heappush(self._waiting, (moment.t, number))
        return number

    # -- states that were reached before -------------------------------------------------

    def _is_known(self, number: int, node: EvolutionNode) -> bool:
        """Tell whether a node is another node; if so, the pieces lead there."""
        before = self._just_before(number, node.t)
        for other in self._at(node.t):
            if other not in before and self._are_same(node, self.nodes[other]):
                self._replace(number, other)
                return True
        self._divide(number, node)
        return False

    def _just_before(self, number: int, t: float) -> set[int]:
        """Return the nodes at a time that lead to a node: to merge these would make a circle."""
        found: set[int] = set()
        left = [number]
        while left:
            starts = {piece.start for piece in self._into[left.pop()]} - found
            near = [i for i in starts if (n := self.nodes[i]) and n.t >= t - 2.0 * self._same_time]
            found.update(starts)
            left += near
        return found

    def _at(self, t: float) -> Iterator[int]:
        """Yield the finished nodes at a time."""
        for number in reversed(self._done):
            node = self.nodes[number]
            if node is None or node.t < t - self._same_time:
                return
            yield number

    def _are_same(self, a: EvolutionNode, b: EvolutionNode | None) -> bool:
        if b is None or closeness(a.z, b.z, self._sizes) > SAME_STATE:
            return False
        return closeness(a.memory, b.memory, self._memory_size) <= SAME_STATE

    def _replace(self, number: int, other: int) -> None:
        """Let the pieces that end at a node end at another node."""
        gone, node = self.nodes[number], self.nodes[other]
        for piece in self._into.pop(number, []):
            piece.end = other
            self._into[other].append(piece)
        self.nodes[number] = None
        if gone is not None and node is not None and gone.name and not node.name:
            node.name = gone.name

    def _divide(self, number: int, node: EvolutionNode) -> None:
        """Let pieces that lead through the state of a node end at the node."""
        self._open = [piece for piece in self._open if self._is_open(piece, node.t)]
        for piece in self._open:
            begin, end = self.nodes[piece.start], self.nodes[piece.end]
            if begin is None or end is None or begin.t + self._same_time >= node.t:
                continue
            z = piece.between((node.t - begin.t) / (end.t - begin.t))
            passed = EvolutionNode(node.t, z, self._evolver.memory(z, node.t))
            if self._are_same(node, passed):
                self._end_at(piece, number, node)

    def _is_open(self, piece: EvolutionPiece, t: float) -> bool:
        """Tell whether a piece ends later."""
        end = self.nodes[piece.end]
        return end is not None and not piece.is_jump and end.t > t + self._same_time

    def _end_at(self, piece: EvolutionPiece, number: int, node: EvolutionNode) -> None:
        """Let a piece end at a node, and forget the old end if nothing else leads there."""
        self._into[piece.end].remove(piece)
        if not self._into[piece.end]:
            self.nodes[piece.end] = None
        piece.end, piece.last = number, node.z
        self._into[number].append(piece)


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
        self._system, self._interval = system, interval
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
            self._refuse(number, "began elsewhere")
        found = _read(text.removeprefix(place), rows)
        if not all(self._holds(moment, way) for way in found.ways):
            self._refuse(number, "went on elsewhere")
        return found

    def _holds(self, moment: Moment, way: Way) -> bool:
        """Tell whether the law holds where a recorded way ends, as under the recorded loads."""
        t = min(way.until, self._interval[1])
        law = self._system.remembering(moment.memory)
        z = self._evolver.shown(way.z + (t - moment.t) * way.rate, t)
        return holds(law, completed(law, z, t), t, typical(law, self._interval))

    def _refuse(self, number: int, why: str) -> NoReturn:
        raise InvalidInputError(
            f"cannot use the journal {self._journal.path}: it is of another run: event "
            f"{number + 1} {why}; remove it, or write elsewhere"
        )


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
