"""The table of other programs in the manual's page on accuracy, from the data of a run.

python benchmarks/peers/report.py -o out && python benchmarks/peers/summary.py out/bench.json

One line for each program and problem: at how many settings it was right, and of these the fastest.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HEADINGS = (
    *("Problem", "Program", "Right", "Fastest that is right"),
    *("ms, median [least; most]", "Points", "Branch", "Points off", "Folds"),
)
#: How the names of pwscont's own steppers begin, and which of them are shown.
OWN = ("exact linear", "arclength", "natural parameter")
SHOWN = ("exact linear", "arclength, Hermite, Newton")
KINDS = ("branch_max", "points_max", "folds")


def table(data: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of a table in reStructuredText."""
    yield ".. csv-table::"
    yield f"   :header: {_quoted(HEADINGS)}"
    yield ""
    for problem, name in dict.fromkeys((row["problem"], row["stepper"]) for row in data["rows"]):
        if name in SHOWN or not name.startswith(OWN):
            mine = [r for r in data["rows"] if (r["problem"], r["stepper"]) == (problem, name)]
            yield f"   {_quoted((problem, name, *_cells(mine)))}"


def _cells(rows: list[dict[str, Any]]) -> tuple[str, ...]:
    right = [row for row in rows if row["right"]]
    share = f"{len(right)} of {len(rows)}"
    if not right:
        return share, *[""] * 6
    row = min(right, key=lambda row: row["seconds"]["median"])
    median, least, most = (1e3 * row["seconds"][key] for key in ("median", "least", "most"))
    time = f"{median:.1f} [{least:.1f}; {most:.1f}]"
    errors = (_number(row["errors"][kind]) for kind in KINDS)
    return share, _setting(row["setting"]), time, str(row["points"]), *errors


def _setting(numbers: dict[str, float] | None) -> str:
    """Return the numbers that vary along a line."""
    shown = ("largest", "DSMAX", "ITNW", "min_cos", "h_max")
    return ", ".join(f"{name} {numbers[name]:g}" for name in shown if name in (numbers or {}))


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.0e}" if value else "0"


def _quoted(cells: tuple[str, ...]) -> str:
    return ", ".join(f'"{cell}"' for cell in cells)


if __name__ == "__main__":
    print("\n".join(table(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))))
