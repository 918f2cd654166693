"""What is proved of the solutions in a box: plain numbers, which the file of a graph keeps.

The theorem stands on the page "Proofs" of the manual; the room ``proof`` makes the records.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any, Protocol, final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.outcome import Kind
from pwscont.basics.printing import counted
from pwscont.basics.rounding import CONFIDENCE
from pwscont.curve.metric import Range
from pwscont.graph.balance import is_blurred, listed
from pwscont.graph.queries import solutions_at
from pwscont.graph.records import Solution
from pwscont.graph.structure import ConnectedPieces
from pwscont.system.abilities import completed
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem

#: A solution of the graph is a proved solution if closer than this part of a typical magnitude, or
#: of the largest unknown, or closer than the errors.
NEAR_A_PROVED_SOLUTION = 1e-6
#: Values of H are those of the same formula if they agree within this part.
SAME_VALUES = 1e-9
Corners = tuple[Array, Array]


class Proof(Protocol):
    """What is proved of the solutions of a graph, see ``graph.proof``."""

    def judged(self, graph: ConnectedPieces, words: str) -> str:
        """Return the guarantee of a graph with what is proved, from the guarantee without."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class CountedStretch:
    """A stretch of alpha between folds, without its ends except for ends of the interval."""

    lo: float
    hi: float
    alpha: float  #: Where solutions were counted.
    #: The least and largest unknowns of each solution at alpha; None for an uncertain count.
    solutions: list[Corners] | None

    @property
    def count(self) -> int | None:
        """The proved number of solutions in the box; None where the count is not certain."""
        return None if self.solutions is None else len(self.solutions)


@final
@dataclass(frozen=True, eq=False, repr=False)
class BoxProof:
    """All solutions of a formula in a box of (z, alpha), as far as proved: ``graph.proof``."""

    box: Corners  #: The least and largest unknowns; nothing is said of solutions outside.
    interval: Range  #: The values of alpha.
    stretches: list[CountedStretch]  #: The stretches between folds, windows and open boxes.
    #: The narrow ranges (lo, hi, turn) of alpha between stretches. The number of solutions only
    #: grows in the range (turn 1), only falls (-1), or stays (0); not a number: not known.
    turns: list[tuple[float, float, float]]
    open: list[Corners]  #: Boxes (least, largest) of (z, alpha) that are not decided.
    boxes: int  #: How many boxes were looked at.
    assumed: str  #: What the proof assumes.
    #: Points (z, alpha) of the box and H there, which tell whether a system is that of the proof.
    values: Sequence[Corners] = ()

    @cached_property
    def folds(self) -> list[Range]:
        """Narrow ranges (lo, hi) of alpha with folds that all turn the same way.

        Folds, or places where curves leave the box: the number of solutions is proved to go from
        the number before to the number after without turning.
        """
        counts = [(x.lo, x.hi, x.count) for x in self.stretches if x.count is not None]
        before, after = {hi: k for _, hi, k in counts}, {lo: k for lo, _, k in counts}
        return [
            (lo, hi)
            for lo, hi, turn in self.turns
            if lo in before and hi in after and np.sign(after[hi] - before[lo]) in (0.0, turn)
            if not np.isnan(turn)
        ]

    @cached_property
    def windows(self) -> list[Range]:
        """Ranges (lo, hi) of alpha, off folds and open boxes, in which the count is not said."""
        return [
            (lo, hi)
            for lo, hi, _ in self.turns
            if (lo, hi) not in self.folds
            and not any(least[-1] <= hi and largest[-1] >= lo for least, largest in self.open)
        ]

    def count(self, alpha: float) -> int | None:
        """Return the proved number of solutions in the box; None where undecided, and at folds."""
        alpha = float(finite_array("alpha", alpha, ()))
        if not self.interval[0] <= alpha <= self.interval[1]:
            raise InvalidInputError(f"alpha = {alpha} lies outside the interval {self.interval}")
        if any(lo <= alpha <= hi for lo, hi, _ in self.turns):
            return None
        return next((each.count for each in self.stretches if each.lo <= alpha <= each.hi), None)

    @property
    def holds(self) -> bool:
        """Whether the number of solutions is proved at every alpha but at folds and in windows."""
        return not self.open and all(each.count is not None for each in self.stretches)

    @property
    def words(self) -> str:
        """What is proved, in a few words."""
        if not self.holds:
            vague = sum(each.count is None for each in self.stretches)
            parts = ((len(self.open), "box"), (vague, "stretch"))
            open_parts = (counted(number, what, "es") for number, what in parts if number)
            return f"not proved in {' and in '.join(open_parts)}"
        windows = counted(len(self.windows), "window")
        but = f", except in {windows} of alpha of width up to {_widest(self.windows):.1g}"
        return "complete in the box, proved" + but * bool(self.windows)

    @property
    def where(self) -> str:
        """The box, in words."""
        return f"the box: {self._ranges}; nothing is said of solutions outside"

    @property
    def statements(self) -> tuple[str, ...]:
        """What is proved, of which box, and what is assumed, a sentence each."""
        folds = (
            f"folds in {counted(len(self.folds), 'range')} of alpha of width up to "
            f"{_widest(self.folds):.1g}: there the number of solutions goes from the number before "
            "to the number after without turning"
        )
        return self.words, *[folds] * bool(self.folds), self.where, self.assumed

    def judged(self, graph: ConnectedPieces, words: str) -> str:
        """Return the guarantee of a graph with what is proved, from the guarantee without."""
        if graph.searched.spent:  # branches are missing because the run ended early
            return words
        wrong, known = list[tuple[float, int, int]](), list[Range]()
        with suppress(SystemNeededError), np.errstate(all="ignore"):  # loaded without the system
            wrong = list(self.disagreements(graph))
        stops = [point.alpha for point in graph.special_points(Kind.STOPPED)]
        for alpha in (alpha for alpha, count, found in wrong if found < count):
            part = next(part for part in self._parts(graph) if part[0] <= alpha <= part[1])
            if any(graph.same(np.array(part), stop).any() for stop in stops):
                known.append(part)  # a piece was stopped at an end
        if known and self.holds and len(known) == len(wrong):
            return (
                f"not complete: solutions that are proved are missing for {graph.parameter} in "
                f"{listed(known)}, where a piece was stopped inside the box; elsewhere "
                f"{self.words}; {words}"
            )
        if wrong:
            alpha, count, number = wrong[0]
            which = "others" if number == count else f"{number} of them"
            return (
                f"not complete: {counted(count, 'solution')} proved in the box at "
                f"{graph.parameter} = {alpha:.8g}, but {which} found; {words}"
            )
        if not self.holds:
            return f"{words}; {self.words}"
        where = "" if graph.pieces else f" ({self._ranges})"  # all may lie outside
        return f"{self.words}{where}; {words}"

    @property
    def _ranges(self) -> str:
        return ", ".join(f"[{lo:.8g}, {hi:.8g}]" for lo, hi in zip(*self.box, strict=True))

    def __repr__(self) -> str:
        return f"BoxProof({self.words}; {counted(self.boxes, 'box', 'es')})"

    def disagreements(self, graph: ConnectedPieces) -> Iterator[tuple[float, int, int]]:
        """Yield where a graph has not the proved solutions: alpha, and how many are proved, found.

        Numbers are compared between special points, too: a piece may have been stopped there.
        """
        known = {each.alpha: each.solutions for each in self.stretches}
        parts = ((lo, hi) for lo, hi in self._parts(graph) if not is_blurred(graph, lo, hi))
        middles = ((lo, 0.5 * (lo + hi), hi) for lo, hi in parts)
        between = [at for lo, at, hi in middles if not any(lo < alpha < hi for alpha in known)]
        far = (np.abs(piece.points[:, : len(self.box[0])]).max(axis=0) for piece in graph.pieces)
        typical = np.max([0.0 * self.box[0], *far], axis=0)
        for alpha in [*known, *between]:
            if (count := self.count(alpha)) is not None:
                found = list(self._inside(graph, alpha, typical))
                proved = known.get(alpha)
                if len(found) != count or (proved and not are_matched(proved, found)):
                    yield alpha, count, len(found)

    def _parts(self, graph: ConnectedPieces) -> list[Range]:
        """Return the parts of the interval between special points and ends of stretches."""
        ends = {end for each in self.stretches for end in (each.lo, each.hi)}
        return list(pairwise(sorted(ends.union(graph.breaks()))))

    def _inside(self, graph: ConnectedPieces, alpha: float, typical: Array) -> Iterator[Corners]:
        """Yield the solutions of a graph in the box, with their slack."""
        own = Box.of(graph.system) if graph.system is not None else None
        for solution in solutions_at(graph, alpha):
            z, slack = with_slack(solution, typical)
            if own is not None and own.is_periodic:  # by whole periods to above the least unknowns
                period = own.period[: len(z)]
                z = np.where(period < np.inf, self.box[0] + (z - self.box[0]) % period, z)
            if ((z >= self.box[0]) & (z <= self.box[1])).all():
                yield z, slack

    def is_of(self, system: PiecewiseSystem) -> bool:
        """Tell whether a system has the values of H that the proof remembers."""
        with np.errstate(all="ignore"), suppress(Exception):  # of other unknowns, or one that fails
            pairs = [(H, value_of(system, x)) for x, H in self.values]
            return bool(pairs) and all(np.allclose(*p, SAME_VALUES, 0.0, True) for p in pairs)
        return False

    def plain(self) -> dict[str, Any]:
        """Return the proof as lists and numbers, for a file."""
        return {each.name: _plain(getattr(self, each.name)) for each in fields(self)}

    @classmethod
    def read(cls, plain: Mapping[str, Any]) -> BoxProof:
        """Return the proof that :meth:`plain` wrote down, or raise Python's errors."""
        box, *opened = _corners([plain["box"], *plain["open"]])
        values = [(np.array(x), np.array(H, dtype=float)) for x, H in plain.get("values", ())]
        lo, hi = map(float, plain["interval"])
        stretches = [
            CountedStretch(float(a), float(b), float(at), None if s is None else _corners(s))
            for a, b, at, s in plain["stretches"]
        ]
        turns: Any = map(tuple, np.array(plain["turns"], dtype=float).reshape(-1, 3).tolist())
        boxes, assumed = int(plain["boxes"]), str(plain["assumed"])
        return cls(box, (lo, hi), stretches, list(turns), opened, boxes, assumed, values)


def value_of(system: PiecewiseSystem, x: Array) -> Array:
    """Return H at a point (z, alpha) of the unknowns that a user knows, shape (n,)."""
    z, alpha = completed(system, x[:-1], float(x[-1])), float(x[-1])
    return np.array(system.residual(z, alpha, system.character(z, alpha))[: len(x) - 1], float)


def _widest(ranges: list[Range]) -> float:
    return max((hi - lo for lo, hi in ranges), default=0.0)


def with_slack(
    solution: Solution, typical: Any, part: float = NEAR_A_PROVED_SOLUTION, most: float = np.inf
) -> Corners:
    """Return the unknowns of a solution, and their slack: the error and a part of magnitudes.

    The slack is never more than ``most`` of the magnitudes.
    """
    z, error = solution.z, np.abs(solution.error[: len(solution.z)])
    size = np.maximum(typical, np.abs(z))
    slack = part * size + CONFIDENCE * error if len(error) else part * size
    return z, np.minimum(slack, most * size) if most < np.inf else slack


@np.errstate(invalid="ignore")
def are_matched(proved: Sequence[Corners], found: Sequence[Corners]) -> bool:
    """Tell whether solutions proved, between corners, are those found with slack, one to one."""
    unmatched = dict(enumerate(proved))
    for z, slack in found:
        far = [np.max((abs(z - 0.5 * (lo + hi)) - hi + lo) / (slack + 1e-300)) for lo, hi in proved]
        own = min(unmatched, key=far.__getitem__, default=-1)
        if own < 0 or not far[own] <= min(max(min(far), 0.0) + NEAR_A_PROVED_SOLUTION, 1.0):
            return False  # also where a number is nan
        del unmatched[own]
    return not unmatched


def _plain(thing: Any) -> Any:
    """Return arrays, tuples and stretches as lists; a number that is not known becomes None."""
    if isinstance(thing, CountedStretch):
        thing = [getattr(thing, each.name) for each in fields(thing)]
    if isinstance(thing, np.ndarray | list | tuple):
        return [_plain(each) for each in thing]
    return None if thing is None or thing != thing else thing  # noqa: PLR0124  nan


def _corners(lists: Any) -> list[Corners]:
    return [(finite_array("least", lo), finite_array("largest", hi)) for lo, hi in lists]
