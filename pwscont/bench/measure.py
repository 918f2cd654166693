"""A row of the report: a problem, a stepper with a setting, and time, calls and errors."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import BranchGraph, PiecewiseSystem, Search, explore
from pwscont.bench.calls import counted
from pwscont.bench.cases import Case
from pwscont.bench.contestants import Contestant
from pwscont.bench.errors import Errors, errors, verdict
from pwscont.bench.truth.known_answer import Truth
from pwscont.extending import Array, Metric, uninterrupted

#: Number of runs that are timed, usually and with ``quick``, and seconds after which no further run
#: is begun.
RUNS, FEW_RUNS = 5, 2
ENOUGH = 0.2


@final
@dataclass(frozen=True, slots=True)
class Row:
    """The result of a stepper with a setting on a problem.

    Attributes
    ----------
    case, stepper, setting : str
        The name of the stepper, or of another program, is the name of a line of the picture.
    step_size : mapping or None
        First and longest step and least cosine; None without step size. For another program, the
        settings of that program.
    seconds : tuple of float
        The time of every timed run.
    calls : mapping
        Number of calls by kind, see :mod:`pwscont.bench.calls`; empty if not known.
    points, pieces : int
    errors : Errors
    wrong : str
        The mistake in the answer, in words; empty if the answer is right.
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
    """The search that yields a true point inside every component: no search is measured."""

    truth: Truth

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the true points, each with error zero."""
        for x in self.truth.starts:
            yield x.copy(), np.zeros((1, len(x)))


def follow(case: Case, contestant: Contestant) -> BranchGraph:
    """Return the graph of a problem, every component followed from a true start."""
    search = OneStartEach(case.truth)
    stepper = contestant.stepper
    return uninterrupted(explore(case.system, case.interval, search=search, stepper=stepper))


def measure(case: Case, contestant: Contestant, quick: bool = False) -> Row:
    """Return time, calls and errors of a stepper on a problem."""
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
    """Yield the seconds of each run, of at least one run."""
    total = 0.0
    for _ in range(runs):
        begin = time.perf_counter()
        follow(case, contestant)
        seconds = time.perf_counter() - begin
        yield seconds
        total += seconds
        if total > ENOUGH:
            return
