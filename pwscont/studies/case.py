"""Cases of a study: a pure function from the number of a case to a row of the table.

A row depends only on the number of the case, except for the seconds.

Failure modes and answers
-------------------------
- The problem cannot be made or explored: the row has no values, and ``failure`` says why.
- A measure fails: the value of the measure is None, ``failure`` says why, and the row keeps all
  further values.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from typing import final

from pwscont import PwscontError
from pwscont.extending import one_thread
from pwscont.studies.measures import ExploredCase, Measure, Measured
from pwscont.studies.problem import Grid, Problem, Setting

#: Packages whose versions may change the last digits.
PACKAGES = ("pwscont", "numpy", "scipy")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    return {"python": python_version()} | {name: version(name) for name in PACKAGES}


@final
@dataclass(frozen=True, slots=True)
class StudyRow:
    """A row of the table of a study.

    Attributes
    ----------
    case : int
        The number of the case, from 0.
    settings : mapping of str to value
    values : mapping of str to value
        The measured values; None where there is nothing to measure or a measure failed.
    proven : bool
        Whether all graphs of the case are complete; else counts are least numbers.
    guarantee : str
        The guarantee of completeness of the graph, in words.
    seconds : float
    failure : str
        The part that failed, and why; empty if nothing failed.
    """

    case: int
    settings: Mapping[str, Setting]
    values: Mapping[str, Measured] = field(default_factory=dict)
    proven: bool = False
    guarantee: str = ""
    seconds: float = 0.0
    failure: str = ""

    @property
    def numbers(self) -> tuple[object, ...]:
        """All parts of the row except the seconds, equal for every run of the case."""
        values = tuple(self.values.items())
        return self.case, *self.settings.items(), values, self.guarantee, self.failure


@final
@dataclass(frozen=True, slots=True)
class CaseRunner:
    """Runs single cases of a study; worker processes get a copy.

    Attributes
    ----------
    problem : callable
    grid : Grid
    measures : mapping of str to Measure
    graphs : Path or None
        The directory that takes the graph of each case.
    """

    problem: Problem
    grid: Grid
    measures: Mapping[str, Measure]
    graphs: Path | None = None

    def __call__(self, number: int) -> StudyRow:
        """Return the row of a case, run here; no error leaves the call."""
        begin = time.perf_counter()
        row = self._row(number)
        return replace(row, seconds=time.perf_counter() - begin)

    def _row(self, number: int) -> StudyRow:
        row = self.failed(number, "")
        case, values = ExploredCase(self.problem, row.settings), dict(row.values)
        failures: list[str] = []
        if self.graphs:
            with _noted(failures, case, "graph"):
                case.graph.save(graph_file(self.graphs, number))
        for name, measure in self.measures.items():
            with _noted(failures, case, name):
                values[name] = measure.of(case)
        return replace(
            row,
            values=values,
            proven=case.is_proven,
            guarantee=case.guarantee,
            failure="; ".join(dict.fromkeys(failures)),
        )

    def failed(self, number: int, why: str) -> StudyRow:
        """Return the row of a case that has no graph."""
        nothing: dict[str, Measured] = dict.fromkeys(self.measures)
        return StudyRow(number, self.grid.settings(number), nothing, failure=why)


def graph_file(directory: Path, number: int) -> Path:
    """Return the file of the graph of a case."""
    return directory / f"{number:06d}.npz"


@contextmanager
def _noted(failures: list[str], case: ExploredCase, what: str) -> Iterator[None]:
    """Record an error in ``failures`` instead of raising; SystemExit counts as an error."""
    try:
        yield
    except (Exception, SystemExit) as error:
        where = "" if error is case.failure else f"{what}: "
        kind = "" if isinstance(error, PwscontError) else f"{type(error).__name__}: "
        failures.append(" ".join(f"{where}{kind}{error}".split()))


def in_process(run: CaseRunner, numbers: Iterable[int]) -> Iterator[StudyRow]:
    """Yield the rows of cases, with one thread of BLAS as in worker processes."""
    with one_thread():
        yield from map(run, numbers)
