"""The work of ``pwscont bench``: measure, print a table, write a picture and the data."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from pwscont import InvalidInputError
from pwscont.bench.cases import Case, case_names, load_case
from pwscont.bench.contestants import contestants
from pwscont.bench.measure import Row, measure
from pwscont.bench.report import as_dict, as_text, machine
from pwscont.bench.truth.known_answer import UnknownAnswerError
from pwscont.commands.run import make_directory
from pwscont.scenes.registry import BrokenSceneError

#: Problems that ``--quick`` measures: straight pieces, curved pieces, a smooth fold.
QUICK = ("fig7", "fig13", "two-curves")


def run(
    names: Sequence[str],
    output: Path | None,
    quick: bool,
    settings: Mapping[str, str] | None = None,
) -> int:
    """Measure problems, default all problems with a known answer, and return the exit status."""
    if output:
        make_directory(output)
    cases, left_out = _load(names, quick, settings or {})
    rows = [row for case in cases for row in measured(case, quick)]
    print(as_text(cases, rows, left_out, machine()))  # noqa: T201
    if output:
        data = as_dict(cases, rows, left_out, quick)
        print(f"written: {', '.join(map(str, write(output, cases, rows, data)))}", file=sys.stderr)  # noqa: T201
    return 0


def _load(
    names: Sequence[str], quick: bool, settings: Mapping[str, str]
) -> tuple[list[Case], dict[str, str]]:
    """Return the cases, and {problem left out: reason}; no named problem is left out."""
    if settings and len(names) != 1:
        raise InvalidInputError("settings are those of one scene: name it")
    if names:
        return [_wanted(name, settings) for name in names], {}
    installed = case_names()
    cases, left_out = [], {}
    for name in [name for name in QUICK if name in installed] if quick else installed:
        try:
            cases.append(load_case(name))
        except (UnknownAnswerError, BrokenSceneError) as unknown:
            left_out[name] = str(unknown)
    return cases, left_out


def _wanted(name: str, settings: Mapping[str, str]) -> Case:
    try:
        return load_case(name, settings)
    except UnknownAnswerError as unknown:
        why = f"the bench does not know the answer of {name}: {unknown}"
        raise InvalidInputError(why) from unknown


def measured(case: Case, quick: bool) -> list[Row]:
    """Return the measurements of a problem, a row for each stepper that applies."""
    print(f"{case.name} ...", file=sys.stderr)  # noqa: T201
    return [measure(case, one, quick) for one in contestants(case.is_straight, quick)]


def write(
    directory: Path, cases: Sequence[Case], rows: Sequence[Row], data: dict[str, object]
) -> list[Path]:
    """Write the data and the work-precision picture, and return the files."""
    from pwscont.bench.picture import draw  # noqa: PLC0415  only where asked for

    file, picture = directory / "bench.json", directory / "bench.png"
    file.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    draw([case.name for case in cases], rows).savefig(picture, dpi=110)
    return [file, picture]
