"""Other programs beside pwscont's steppers: one table, one picture, one run.

    python benchmarks/peers/report.py [PROBLEM ...] [-o DIR] [--quick]

pwscont's bench runs on the problems that others can do, and each peer that is on this machine
(Debian packages python3-getfem, python3-siconos, auto-07p with gfortran) runs on the same
problems beside it. What is not there is said to be not there. ``-o`` writes ``bench.json`` and
``bench.png``, as ``pwscont bench`` does. Compare figures of one run with each other only.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import auto07p
import by_getfem
import by_siconos
from curve import row_of

from pwscont.bench.cases import Case, load_case
from pwscont.bench.measure import Row
from pwscont.bench.report import as_dict, as_text, machine
from pwscont.commands.bench import measured, write
from pwscont.commands.run import make_directory

PROBLEMS = ("fig7", "example1", "bratu")
#: Peers that follow curves.
PEERS = (auto07p, by_getfem)
PACKAGES = ("auto-07p", "python3-getfem", "python3-siconos")


def peer_rows(case: Case) -> tuple[list[Row], dict[str, str]]:
    """Return a row for each peer and setting, and why a peer has none."""
    rows: list[Row] = []
    missing: dict[str, str] = {}
    for peer in PEERS:
        print(f"{case.name}, {peer.NAME} ...", file=sys.stderr)
        found = peer.curves(case)
        if isinstance(found, str):
            missing[f"{peer.NAME}, {case.name}"] = found
        else:
            rows += [row_of(case, curve) for curve in found]
    return rows, missing


def versions() -> dict[str, str]:
    """Return the versions of the Debian packages; empty on other systems."""
    if not shutil.which("dpkg-query"):
        return {}
    command = ["dpkg-query", "-W", "-f", "${Package} ${Version}\n", *PACKAGES]
    lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.split("\n")
    pairs = (line.split() for line in lines)
    return {pair[0]: pair[1] for pair in pairs if len(pair) == 2}


def _summary(cases: list[Case], rows: list[Row]) -> Iterator[str]:
    """Yield at how many settings each line was right, and what a process of AUTO's takes."""
    for case in cases:
        yield f"\n{case.name}, right at so many of its settings:"
        mine = [row for row in rows if row.case == case.name]
        for name in dict.fromkeys(row.stepper for row in mine):
            right = [not row.wrong for row in mine if row.stepper == name]
            yield f"  {name:<37}{sum(right)} of {len(right)}"
    idle = auto07p.idle(cases[0])
    if idle is not None:
        yield f"\nAUTO-07p: {1e3 * idle:.1f} ms at least are the start and end of a process"


def run(names: list[str], output: Path | None, quick: bool) -> None:
    """Measure, print the table, write picture and data."""
    if output:
        make_directory(output)
    cases, rows = [load_case(name) for name in names], []
    left_out = {"Siconos": "solves at one load and follows no curve: figures below, no line"}
    for case in cases:
        found, missing = peer_rows(case)
        rows += [*measured(case, quick), *found]
        left_out |= missing
    print(as_text(cases, rows, left_out, machine()))
    print("\n".join(_summary(cases, rows)))
    print(f"peers: {', '.join(map(' '.join, versions().items())) or 'versions not known'}")
    if output:
        data = as_dict(cases, rows, left_out, quick) | {"peers": versions()}
        print(f"written: {', '.join(map(str, write(output, cases, rows, data)))}", file=sys.stderr)


def main() -> None:
    """Read the arguments and run."""
    parser = argparse.ArgumentParser(description="other programs beside pwscont's steppers")
    parser.add_argument("problem", nargs="*", default=PROBLEMS, help="of the bench")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="picture and data there")
    parser.add_argument("--quick", action="store_true", help="few settings of pwscont's own")
    options = parser.parse_args()
    sys.stdout.reconfigure(line_buffering=True)
    run(list(options.problem), options.output, options.quick)
    print(by_siconos.report())


if __name__ == "__main__":
    main()
