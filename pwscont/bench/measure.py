"""One row of the report: a problem, a stepper at one setting, its time, calls and errors."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.bench.calls import counted
from pwscont.bench.cases import Case
from pwscont.bench.contestants import Contestant
from pwscont.bench.errors import Errors, errors, verdict
from pwscont.bench.truth.known_answer import Truth
from pwscont.continuation import explore
from pwscont.continuation.plan import uninterrupted
from pwscont.curve.metric import Metric
from pwscont.graph import BranchGraph
from pwscont.search import Search
from pwscont.system.system import PiecewiseSystem

#: Runs that are timed, and seconds after which no further one is begun.
RUNS, FEW_RUNS = 5, 2
ENOUGH = 0.2


@final
@dataclass(frozen=True, slots=True)
class Row:
    """The result of one stepper at one setting on one problem.

    Attributes
    ----------
    case, stepper, setting : str
        The stepper, or another program, gives its name to a line of the picture.
    step_size : mapping or None
        First and longest step and least cosine; None where there is no step size. For another
        program, its own settings by its own names.
    seconds : tuple of float
        The time of every timed run.
    calls : mapping
        Number of calls by kind, see :mod:`pwscont.bench.calls`; empty if they are not known.
    points, pieces : int
    errors : Errors
    wrong : str
        What is wrong with the answer; empty if it is right.
    """

    case: str
    stepper: str
    setting: str
    step_size: Mapping[str, float] | None
    seconds: tuple[float, ...]
    calls: Mapping[str, int]
    points: int
    pieces: int
    errors: Errors
    wrong: str

    @property
    def median(self) -> float:
        """The median of the seconds."""
        return statistics.median(self.seconds)


@final
@dataclass(frozen=True, slots=True, eq=False)
class OneStartEach(Search):
    """One true point inside every component: so a run measures the stepper, not a search."""

    truth: Truth

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the points."""
        for x in self.truth.starts:
            yield x.copy(), np.zeros((1, len(x)))


def follow(case: Case, contestant: Contestant) -> BranchGraph:
    """Follow every component of a problem from one true start each."""
    search = OneStartEach(case.truth)
    stepper = contestant.stepper
    return uninterrupted(explore(case.system, case.interval, search=search, stepper=stepper))


def measure(case: Case, contestant: Contestant, quick: bool = False) -> Row:
    """Return time, calls and errors of one stepper on one problem."""
    with counted(case.system) as calls:
        graph = follow(case, contestant)  # warms up, too
    size = contestant.step_size
    return Row(
        case=case.name,
        stepper=contestant.name,
        setting=contestant.setting,
        step_size=size and {name: getattr(size, name) for name in SETTINGS},
        seconds=tuple(_timed(case, contestant, FEW_RUNS if quick else RUNS)),
        calls=dict(calls),
        points=sum(len(piece.points) for piece in graph.pieces),
        pieces=len(graph.pieces),
        errors=errors(graph, case.truth, case.system),
        wrong=verdict(graph, case.truth, case.system),
    )


SETTINGS = ("first", "largest", "least_cosine")


def _timed(case: Case, contestant: Contestant, runs: int) -> Iterator[float]:
    """Yield the seconds of each run; at least one."""
    total = 0.0
    for _ in range(runs):
        begin = time.perf_counter()
        follow(case, contestant)
        seconds = time.perf_counter() - begin
        yield seconds
        total += seconds
        if total > ENOUGH:
            return
