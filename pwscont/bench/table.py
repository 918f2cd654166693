"""The figures as text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pwscont.bench.cases import Case
from pwscont.bench.measure import Row

#: Heading and the short names of the kinds of calls.
CALLS = {
    "residual": "res",
    "jacobian": "jac",
    "test_functions": "tests",
    "test_jacobian": "tjac",
    "factorisations": "LU",
    "solves": "solves",
    "determinant signs": "dets",
}
STEPPER, SETTING = 37, 27


def as_text(
    cases: Sequence[Case],
    rows: Sequence[Row],
    left_out: Mapping[str, str],
    facts: Mapping[str, Any],
) -> str:
    """Return a table per problem."""
    lines = list(_about(facts))
    for case in cases:
        lines += ["", *_problem(case, [row for row in rows if row.case == case.name])]
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


def _problem(case: Case, rows: Sequence[Row]) -> Iterator[str]:
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
