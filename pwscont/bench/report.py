"""The figures of the bench as text, as plain lists, and as a picture."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import numpy as np

from pwscont.bench.cases import Case
from pwscont.bench.errors import Errors
from pwscont.bench.measure import Row

#: Variables that limit the threads of the usual BLAS libraries.
LIMITS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def machine() -> dict[str, Any]:
    """Return platform, cores, versions, and name and threads of BLAS."""
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return {
        "system": platform.system(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("pwscont", "numpy", "scipy", "networkx")},
        "blas": f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip(),
        "blas_threads": _blas_threads(),
    }


def _blas_threads() -> str:
    """Return the limit that the environment sets; the matrices here are too small for threads."""
    found = [f"{name}={os.environ[name]}" for name in LIMITS if name in os.environ]
    return ", ".join(found) or "not limited"


#: Version of the file's layout, increased whenever readers have to change.
SCHEMA = 1
#: Least error in the picture, about a tenth of the unit roundoff: smaller errors are drawn at this
#: value.
FLOOR = 1e-17


def as_dict(
    cases: Sequence[Case], rows: Sequence[Row], left_out: Mapping[str, str], quick: bool
) -> dict[str, Any]:
    """Return machine, problems, {problem left out: reason}, and a row for each run."""
    return {
        "schema": SCHEMA,
        "quick": quick,
        "machine": machine(),
        "problems": [_problem(case) for case in cases],
        "left_out": dict(left_out),
        "rows": [row_as_dict(row) for row in rows],
    }


def _problem(case: Case) -> dict[str, Any]:
    truth = case.truth
    return {
        "name": case.name,
        "interval": list(case.interval),
        "known_by": truth.known_by,
        "unknowns": case.system.size,
        "pieces": len(truth.pieces),
        "transitions": [float(x[-1]) for x in truth.transitions],
        "folds": [float(x[-1]) for x in truth.folds],
    }


def row_as_dict(row: Row) -> dict[str, Any]:
    """Return a row as plain lists and numbers; errors that are not finite are None."""
    seconds = {
        "median": row.median,
        "least": min(row.seconds),
        "most": max(row.seconds),
        "runs": len(row.seconds),
    }
    found = {name: _finite(value) for name, value in asdict(row.errors).items()}
    return {
        "problem": row.case,
        "stepper": row.stepper,
        "setting": dict(row.step_size) if row.step_size else None,
        "seconds": seconds,
        "calls": dict(row.calls),
        "points": row.points,
        "pieces": row.pieces,
        "errors": found,
        "right": not row.wrong,
        "wrong": row.wrong,
    }


def rows_of(data: Mapping[str, Any]) -> list[Row]:
    """Return the rows from the data of a report's file, for drawing the picture again."""
    return [_row_of(row) for row in data["rows"]]


def _row_of(row: Mapping[str, Any]) -> Row:
    seconds = row["seconds"]
    found = {name: math.nan if e is None else e for name, e in row["errors"].items()}
    return Row(
        case=row["problem"],
        stepper=row["stepper"],
        setting="",
        step_size=row["setting"],
        seconds=(seconds["least"], seconds["median"], seconds["most"]),
        calls=row["calls"],
        points=row["points"],
        pieces=row["pieces"],
        errors=Errors(**found),
        wrong=row["wrong"],
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


#: Kind of calls -> short name in the heading.
CALLS = {
    "residual": "res",
    "jacobian": "jac",
    "test_functions": "tests",
    "test_jacobian": "tjac",
    "factorisations": "LU",
    "solves": "solves",
    "determinant signs": "dets",
}
STEPPER, SETTING = 37, 27  # widths of two columns in letters


def as_text(
    cases: Sequence[Case],
    rows: Sequence[Row],
    left_out: Mapping[str, str],
    facts: Mapping[str, Any],
) -> str:
    """Return the report as text, a table for each problem."""
    lines = list(_about(facts))
    for case in cases:
        lines += ["", *_problem_lines(case, [row for row in rows if row.case == case.name])]
    lines += ["", *(f"left out: {name}: {why}" for name, why in left_out.items())]
    return "\n".join(lines).rstrip()


def _about(facts: Mapping[str, Any]) -> Iterator[str]:
    versions = ", ".join(f"{name} {number}" for name, number in facts["versions"].items())
    where = f"{facts['system']} {facts['processor']}, {facts['cores']} cores"
    yield f"{where}, Python {facts['python']}"
    yield f"{versions}; {facts['blas']}, threads {facts['blas_threads']}"
    yield "ms: median [least, most]; ratio: to the problem's first row; compare rows of one run."
    yield "Errors as parts of the problem's scale. branch: from true solutions to the chords;"
    yield "points: of the stored points."


def _problem_lines(case: Case, rows: Sequence[Row]) -> Iterator[str]:
    truth = case.truth
    yield (
        f"{case.name}: {len(truth.pieces)} pieces, {len(truth.transitions)} transitions, "
        f"{len(truth.folds)} folds; answer by {truth.known_by}"
    )
    yield _heading()
    first = next(iter(rows), None)
    for row in rows:
        yield _line(row, row.median / first.median if first else 1.0)


def _heading() -> str:
    calls = " ".join(f"{name:>6}" for name in CALLS.values())
    kinds = " ".join(f"{name:>8}" for name in ("branch", "(rms)", "points", "transit.", "folds"))
    numbers = f"{'ms':>27} {'ratio':>6} {'points':>6} {calls} {kinds}"
    return f"  {'stepper':<{STEPPER}}{'setting':<{SETTING}}{numbers}"


def _line(row: Row, ratio: float) -> str:
    found = row.errors
    spread = f"[{1e3 * min(row.seconds):.2f}, {1e3 * max(row.seconds):.2f}]"
    calls = " ".join(f"{row.calls.get(kind, '-'):>6}" for kind in CALLS)
    values = (found.branch_max, found.branch_rms, found.points_max, found.transitions, found.folds)
    text = " ".join(f"{_number(value):>8}" for value in values)
    time = f"{1e3 * row.median:8.2f} {spread:>18}"
    line = (
        f"  {row.stepper:<{STEPPER}}{row.setting:<{SETTING}}{time} {ratio:6.1f} "
        f"{row.points:6d} {calls} {text}"
    )
    return f"{line}  WRONG: {row.wrong}" if row.wrong else line


def _number(value: float) -> str:
    return f"{value:.1e}" if math.isfinite(value) else "-"
