"""A study: the same measures of a problem under many settings.

Failure modes and answers
-------------------------
- Ctrl-C: the study ends with the finished rows, and says that the study is not finished.
- The program is killed: with a store, a study that resumes runs the cases that are missing.
- The functions have changed since the store was begun: other code, constants or closures are
  refused; for all else a finished case is run again before further cases, and its row is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, TypeAlias, final

from pwscont import InvalidInputError
from pwscont.extending import card, counted, named
from pwscont.studies.case import CaseRunner, StudyRow, digest, in_process, versions
from pwscont.studies.cluster import on_cluster
from pwscont.studies.measure_names import checked_measures
from pwscont.studies.measures import Measure
from pwscont.studies.problem import Grid, Problem, check_settings, checked_problem, described
from pwscont.studies.result import StudyResult
from pwscont.studies.store import Store
from pwscont.studies.workers import on_workers

#: Called with the number of finished cases and the number of all cases.
CasesDone: TypeAlias = Callable[[int, int], None]


def silent_cases(done: int, total: int) -> None:
    """Report nothing."""


@final
class Study:
    """The same measures of a problem under many settings.

    Parameters
    ----------
    problem : callable or str
        A function that takes settings by keyword and returns a :class:`pwscont.Scene`, a pair
        ``(system, (lo, hi))``, or a graph; or the name of a scene that a package offers.
    over : mapping of str to iterable
        The values of each setting; every combination is a case, numbered from 0, and the last
        setting changes fastest.
    measure : mapping of str to Measure, callable or str, or iterable of str
        Name of the column -> a measure, a function of the graph that returns a number, a text,
        several numbers or texts, or None, or the name of a measure, such as ``"max-count"``.

    Raises
    ------
    InvalidInputError, UnknownNameError, SceneNotFoundError
        If the problem does not take a setting, a measure is not known, a setting has no values, or
        a name occurs twice.

    Examples
    --------
    >>> from pwscont import Study
    >>> study = Study("wedge", {"friction": [0.3, 0.5]}, ["max-count"])
    >>> len(study)
    2
    """

    def __init__(
        self,
        problem: Problem | str,
        over: Mapping[str, Iterable[Any]],
        measure: Mapping[str, Measure | Callable[..., Any] | str] | Iterable[str],
    ) -> None:
        self._problem = checked_problem(problem)
        self._grid = Grid(over)
        self._measures = checked_measures(measure)
        further = [name for one in self._measures.values() for name in one.varied]
        check_settings(self._problem, [*self._grid.values, *further])
        _check_twice([*self._grid.values], [*self._measures], "both a setting and a measure")
        _check_twice([*self._grid.values], further, "varied by the study and by a measure at once")

    def __len__(self) -> int:
        """Return the number of cases."""
        return len(self._grid)

    def __repr__(self) -> str:
        shape = " x ".join(f"{len(v)} {name}" for name, v in self._grid.values.items())
        return named(self, described(self._problem), shape, *self._measures)

    def _repr_html_(self) -> str:
        over = ", ".join(f"{name} ({len(v)})" for name, v in self._grid.values.items())
        rows = [("over", over), ("measure", ", ".join(self._measures)), ("cases", len(self))]
        return card(f"Study of {described(self._problem)}", rows)

    def run(
        self,
        workers: int = 1,
        scheduler: str | None = None,
        store: str | Path | None = None,
        resume: bool = False,
        graphs: str | Path | None = None,
        report: CasesDone = silent_cases,
    ) -> StudyResult:
        """Run all cases; every number except the seconds is the same on every machine.

        Parameters
        ----------
        workers : int
            Number of processes; with 1 the cases run in this process.
        scheduler : str, optional
            Address of a Dask scheduler, whose workers run the cases instead.
        store : path, optional
            The file in which every finished row is stored at once; default memory.
        resume : bool
            Whether to go on with the study that the store holds. Rows in the store stay, including
            failed rows.
        graphs : path, optional
            A directory that takes the graph of each case. Workers of a cluster write into the
            directory, too, and must share the file system.
        report : callable
            Called with the number of finished cases and the number of all cases.

        Returns
        -------
        StudyResult
            The result, after Ctrl-C with the finished rows only.

        Raises
        ------
        InvalidInputError
            If there is no store to resume from; if the store is of another study, has rows that are
            not to be resumed, or cannot be written; if the study cannot be sent to other processes;
            if no scheduler answers.
        MissingPackageError
            If there is a scheduler, and Dask is not installed.
        """
        _check_places(workers, scheduler)
        if resume and store is None:
            raise InvalidInputError("resume needs a store, the file with the finished rows")
        run = CaseRunner(self._problem, self._grid, self._measures, _directory(graphs))
        kept = Store(store)
        try:
            self._check_store(kept, run, resume)
            rows = _rows(run, kept, workers, scheduler)
            interrupted = _keep(rows, kept, len(self), report)
        except BaseException:
            kept.close()
            raise
        return StudyResult(kept, run.graphs, interrupted)

    def _about(self) -> dict[str, Any]:
        return {
            "problem": described(self._problem),
            "over": self._grid.values,
            "measure": {name: described(what) for name, what in self._measures.items()},
            "functions": digest([self._problem, *self._measures.values()]),
            "versions": versions(),
        }

    def _check_store(self, kept: Store, run: CaseRunner, resume: bool) -> None:
        """Refuse a store whose rows may be lost, or differ from what the cases give now."""
        if len(kept) and not resume:
            raise kept.refusal(
                f"it holds {counted(len(kept), 'row')}: resume goes on with them; remove it to "
                "begin again"
            )
        kept.check(self._about())
        if len(kept) < len(self):
            _check_quickest(kept, run)


def _check_quickest(kept: Store, run: CaseRunner) -> None:
    """Run the quickest stored case again, and refuse a store whose row differs."""
    finished = (row for row in kept if not row.failure)
    row = min(finished, key=lambda row: row.seconds, default=None)
    if row is not None and next(in_process(run, [row.case])).numbers != row.numbers:
        words = f"case {row.case} gives other numbers now: its functions have changed"
        raise kept.refusal(f"{words}; remove it, or write elsewhere")


def _rows(
    run: CaseRunner, kept: Store, workers: int, scheduler: str | None
) -> Generator[StudyRow, None, None]:
    """Yield the missing rows as the cases finish, on a cluster, on workers or in this process."""
    left = len(run.grid) - len(kept)
    missing = (number for number in range(len(run.grid)) if number not in kept)
    if not left:
        return
    if scheduler is not None:
        yield from on_cluster(run, missing, scheduler)
    elif workers > 1:
        yield from on_workers(run, missing, min(workers, left))
    else:
        yield from in_process(run, missing)


def _keep(
    rows: Generator[StudyRow, None, None], kept: Store, total: int, report: CasesDone
) -> bool:
    """Store every finished row at once, and return whether Ctrl-C ended the study."""
    try:
        with closing(rows):
            before = len(kept)
            report(before, total)
            for done, row in enumerate(rows, start=before + 1):
                kept.add(row)
                report(done, total)
    except KeyboardInterrupt:
        return True
    return False


def _check_twice(names: list[str], others: list[str], what: str) -> None:
    for name in others:
        if name in names:
            raise InvalidInputError(f"{name!r} is {what}; choose another name")


def _check_places(workers: int, scheduler: str | None) -> None:
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise InvalidInputError(f"workers must be a positive whole number, got {workers!r}")
    if scheduler is not None and workers > 1:
        raise InvalidInputError("workers are processes of this machine: give them or a scheduler")


def _directory(path: str | Path | None) -> Path | None:
    if path is None:
        return None
    directory = Path(path).absolute()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        words = f"cannot make the directory {directory}: {error.strerror or error}"
        raise InvalidInputError(words) from error
    return directory
