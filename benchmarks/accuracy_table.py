"""The table of the manual's page on accuracy, from the data of a run.

pwscont bench -o out && python benchmarks/accuracy_table.py out/bench.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HEADINGS = (
    *("Problem", "Stepper", "Step", "ms, median [least; most]", "Points", "LU"),
    *("Branch", "Points off", "Transitions", "Folds"),
)
#: What is shown; tangent, secant, Moore-Penrose and steps by angle are in the data and the picture.
SHOWN = {
    "exact linear": (None,),
    "arclength, Hermite, Newton": (0.1, 0.01),
    "natural parameter": (0.01,),
}
KINDS = ("branch_max", "points_max", "transitions", "folds")


def table(data: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of a table in reStructuredText."""
    yield ".. csv-table::"
    yield f"   :header: {', '.join(_quoted(HEADINGS))}"
    yield ""
    for row in data["rows"]:
        if _longest(row) in SHOWN.get(row["stepper"], ()):
            yield f"   {', '.join(_quoted(_cells(row)))}"


def _longest(row: dict[str, Any]) -> float | None:
    return row["setting"].get("largest") if row["setting"] else None


def _quoted(cells: tuple[str, ...]) -> Iterator[str]:
    return (f'"{cell}"' for cell in cells)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    seconds, longest = row["seconds"], _longest(row)
    least, most = 1e3 * seconds["least"], 1e3 * seconds["most"]
    found = [_number(row["errors"][kind]) for kind in KINDS]
    return (
        row["problem"],
        row["stepper"],
        "" if longest is None else f"{longest:g}",
        f"{1e3 * seconds['median']:.1f} [{least:.1f}; {most:.1f}]",
        str(row["points"]),
        str(row["calls"]["factorisations"]),
        *(found if row["right"] else (f"wrong: {row['wrong']}", "", "", "")),
    )


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.0e}" if value else "0"


if __name__ == "__main__":
    print("\n".join(table(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))))
