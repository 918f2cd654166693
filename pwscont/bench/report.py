"""The figures as plain lists and numbers, for a JSON file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pwscont.bench.cases import Case
from pwscont.bench.errors import Errors
from pwscont.bench.machine import machine
from pwscont.bench.measure import Row

#: Version of the file's layout, raised by one whenever readers have to change.
SCHEMA = 1
#: A double of size one errs by about this; smaller errors are shown as this in the picture.
FLOOR = 1e-17


def as_dict(
    cases: Sequence[Case], rows: Sequence[Row], left_out: Mapping[str, str], quick: bool
) -> dict[str, Any]:
    """Return machine, problems, what was left out and why, and a row per run."""
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
    """Return one row; errors that mean nothing or are not finite are null."""
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
    """Return the rows of a report read from its file, for drawing the picture again."""
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
