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
from dataclasses import dataclass, field, fields, is_dataclass, replace
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from types import CodeType, FunctionType
from typing import Any, final

import numpy as np

from pwscont import PwscontError
from pwscont.extending import one_thread
from pwscont.studies.measures import ExploredCase, Measure, Measured
from pwscont.studies.problem import Grid, Problem, Setting, described

#: Packages whose versions may change the last digits.
PACKAGES = ("pwscont", "numpy", "scipy")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    return {"python": python_version()} | {name: version(name) for name in PACKAGES}


#: Values that are told by their words, and the parts of what wraps a function.
PLAIN = bool | int | float | complex | str | bytes | np.generic | None
WRAPPED = ("func", "args", "fget", "__func__", "__wrapped__")


def digest(things: Iterable[Any]) -> str:
    """Return a few letters, other ones for functions with other code, constants or closures.

    Lists, dictionaries and objects may change in a run and do not count; functions and classes of
    other packages count by name.
    """
    told = repr([_told(thing, {}, {}) for thing in things])
    return blake2b(told.encode(), digest_size=8).hexdigest()


def _told(thing: Any, scope: Mapping[str, Any], seen: dict[int, Any]) -> str:
    """Return what a thing computes; ``scope`` has the names that are known to its code."""
    parts: list[Any] = []
    if isinstance(thing, PLAIN):
        return repr(thing)
    if isinstance(thing, tuple | frozenset):
        parts = [*thing] if isinstance(thing, tuple) else sorted(thing, key=repr)
    elif isinstance(thing, np.ndarray):
        parts = [repr(thing.tolist())]
    elif isinstance(thing, CodeType):
        parts = [thing.co_code, thing.co_names, *thing.co_consts, *map(scope.get, thing.co_names)]
    elif id(thing) not in seen:
        seen[id(thing)] = thing
        scope, parts = _reached(thing, scope)
    return f"{type(thing).__name__}({', '.join(_told(part, scope, seen) for part in parts)})"


def _reached(thing: Any, scope: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[Any]]:
    """Return the scope within a function, a class or an object, and the parts that count."""
    if isinstance(thing, type | FunctionType):
        own, home = (str(n).split(".")[0] for n in (thing.__module__, scope.get("__name__")))
        if own == "pwscont" or (scope and own != home):
            return scope, [described(thing)]
        if isinstance(thing, type):
            kept = (
                part for part in vars(thing).items() if part[0][:2] != "__" or callable(part[1])
            )
            return {"__name__": own}, [*thing.__bases__, *sorted(kept)]
        cells = (c for c in thing.__closure__ or () if not repr(c).endswith("empty>"))
        defaults = (thing.__defaults__, *(thing.__kwdefaults__ or {}).items())
        known = {**thing.__globals__, "__name__": own}  # decorators live in other packages
        return known, [thing.__code__, defaults, *(c.cell_contents for c in cells)]
    names = [name for name in ("__qualname__", *WRAPPED) if hasattr(thing, name)]
    names += [part.name for part in fields(thing)] if is_dataclass(thing) else []
    return scope, [type(thing), *(getattr(thing, name) for name in names)]


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
