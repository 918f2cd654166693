"""The work of ``pwscont sweep``: run a study, print a summary, write table and pictures."""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from itertools import islice
from pathlib import Path
from typing import Any

from pwscont import InvalidInputError
from pwscont.commands.progress import CaseProgress
from pwscont.commands.run import make_directory
from pwscont.extending import counted
from pwscont.studies.problem import RegisteredScene
from pwscont.studies.result import StudyResult
from pwscont.studies.study import Study

DEFAULT_MEASURE = "max-count"
#: Most rows that are printed one by one; more rows are summed up.
MOST_ROWS = 24
#: Most failures, and most different values of a measure, that are listed.
MOST_LISTED = 5


def run(options: argparse.Namespace) -> int:
    """Run a sweep by the command line's options, and return the exit status: 1 if all failed."""
    measures = options.measure or [DEFAULT_MEASURE]
    scene = RegisteredScene(options.scene, dict(options.settings))
    study = Study(scene, _over(options.over), measures)
    result = _result(study, options)
    try:
        failed = all(row.failure for row in result)
        print(_as_text(study, result), flush=True)  # noqa: T201
        if options.output:
            written = _write(result, options.output)
            print(f"written: {', '.join(map(str, written))}", file=sys.stderr)  # noqa: T201
    finally:
        result.close()
    if result.interrupted:
        raise KeyboardInterrupt
    return 1 if failed else 0


def _over(ranges: list[tuple[str, list[Any]]]) -> dict[str, list[Any]]:
    names = Counter(name for name, _ in ranges)
    if twice := [name for name, times in names.items() if times > 1]:
        raise InvalidInputError(f"--over varies {twice[0]} twice")
    return dict(ranges)


def _result(study: Study, options: argparse.Namespace) -> StudyResult:
    """Return the result of the study; finished cases are stored in the user's directory, if any."""
    directory = _directory(options)
    if options.scheduler:
        print(f"pwscont: asking the scheduler at {options.scheduler}", file=sys.stderr)  # noqa: T201
    progress = CaseProgress()
    try:
        return study.run(
            options.workers,
            options.scheduler,
            directory and directory / "study.db",
            options.resume,
            directory / "graphs" if directory and options.graphs else None,
            progress,
        )
    finally:
        progress.close()


def _directory(options: argparse.Namespace) -> Path | None:
    directory: Path | None = options.output
    if directory is None:
        for name in ("resume", "graphs"):
            if getattr(options, name):
                raise InvalidInputError(f"--{name} needs -o DIR")
        return None
    make_directory(directory)
    return directory


# -- what is printed and written -----------------------------------------------------------------


def _as_text(study: Study, result: StudyResult) -> str:
    lines = [f"{study}: {len(result)} of {counted(result.total, 'case')}"]
    rows = list(result) if len(result) <= MOST_ROWS else []
    lines += _table(result, rows) if rows else [_summary(result, name) for name in result.measures]
    kinds = Counter("failed" if row.failure else row.proven for row in result)
    lines.append(f"  proven {kinds[True]}, not proven {kinds[False]}, failed {kinds['failed']}")
    failed = (f"  case {row.case} failed: {row.failure}" for row in result if row.failure)
    return "\n".join([*lines, *islice(failed, MOST_LISTED)])


def _table(result: StudyResult, rows: list[Any]) -> list[str]:
    """Return the table as text: a heading, and a line for each case."""
    heads = [*result.over, *result.measures, "guarantee"]
    cells = [[*row.settings.values(), *row.values.values(), row.guarantee] for row in rows]
    words = [heads, *([_word(cell) for cell in line] for line in cells)]
    widths = [max(map(len, column)) for column in zip(*words, strict=True)]
    return ["  " + "  ".join(map(str.ljust, line, widths)).rstrip() for line in words]


def _word(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, tuple):
        return f"({', '.join(map(_word, value))})"
    return f"{value:.8g}" if isinstance(value, float) else str(value)


def _summary(result: StudyResult, name: str) -> str:
    """Return a line about a measure: the count of each value, or the range of the values."""
    column = result.column(name)
    values, missing = column.compressed().tolist(), int(column.mask.sum())
    nothing = f"; nothing in {missing}" if missing else ""
    numbers = Counter(values)
    if len(numbers) <= MOST_LISTED or not all(isinstance(value, int | float) for value in values):
        often = [f"{_word(value)} in {numbers[value]}" for value in sorted(numbers, key=str)]
        return f"  {name}: {', '.join(often[:MOST_LISTED])}{nothing}"
    return f"  {name}: from {_word(min(values))} to {_word(max(values))}{nothing}"


def _write(result: StudyResult, directory: Path) -> list[Path]:
    """Write the table and a picture of each measure that can be drawn, and return the files."""
    table = directory / "study.csv"
    result.write_csv(table)
    return [table, *(file for name in result.measures for file in _drawn(result, name, directory))]


def _drawn(result: StudyResult, name: str, directory: Path) -> list[Path]:
    file = directory / f"{name.replace(os.sep, '-').replace(':', '-').replace('=', '-')}.png"
    from matplotlib.figure import Figure  # noqa: PLC0415  only where pictures are written

    try:
        result.plot(name, Figure()).savefig(file, dpi=150)
    except InvalidInputError as error:
        print(f"no picture: {error}", file=sys.stderr)  # noqa: T201
        return []
    return [file]
