"""Time and memory of eliminating a block's interior with MUMPS on several ranks.

``python benchmarks/ranks.py [NODES ...] [--ranks 1 2]`` prints a table, by default for 316, 548 and
1,000 contact nodes: 10^5, 3 10^5 and 10^6 unknowns. Each row is measured in processes of its own;
the row without ranks is Multifrontal's. Columns:

- body: mesh, assembly, supports and loads (s), on rank 0;
- eliminate: order, analysis, factor, Schur complement, check (s);
- load, recover: one condensed load, one full field (s);
- factor: entries of all ranks (MB); MUMPS: what it says it used, on the rank that used most (MB);
- body MB: most memory of rank 0 before elimination; rank 0, rank 1: most memory of all (MB, of the
  processes, with about 100 MB for Python and its libraries);
- difference: of the matrix from Multifrontal's, relative to the largest entry.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pwscont_coulomb.elastic import Multifrontal
from pwscont_coulomb.elastic.mumps import MumpsFactor, factorised
from pwscont_coulomb.elastic.ranks import hosting, mpi, serve
from pwscont_coulomb.elastic.scenes import block_body
from pwscont_coulomb.elastic.solved_interior import SolvedInterior

COLUMNS = {
    "unknowns": "{:9d}",
    "ranks": "{:5d}",
    "body s": "{:6.1f}",
    "eliminate s": "{:11.2f}",
    "load s": "{:6.2f}",
    "recover s": "{:9.2f}",
    "factor MB": "{:9.0f}",
    "MUMPS MB": "{:8d}",
    "body MB": "{:7.0f}",
    "rank 0 MB": "{:9.0f}",
    "rank 1 MB": "{:9.0f}",
    "difference": "{:10.0e}",
}


def timed(action: Callable[[], Any]) -> tuple[Any, float]:
    """Return what an action returns, and the seconds it took."""
    begin = time.perf_counter()
    found = action()
    return found, time.perf_counter() - begin


def peak() -> float:
    """Return the most memory that this process has held (MB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024e-6


def measure(nodes: int, eliminate: Callable[[Any], tuple[Any, dict[str, Any]]], file: str) -> Any:
    """Return the row of a block, and leave its Schur complement in a file."""
    body, assembly = timed(lambda: block_body(nodes))
    row: dict[str, Any] = {"unknowns": body.A.shape[0], "body s": assembly, "body MB": peak()}
    (found, more), row["eliminate s"] = timed(lambda: eliminate(body))
    np.save(file, found.schur)
    f = body.load(1.0)
    reduced, row["load s"] = timed(lambda: found.reduce(f))
    kept = np.linalg.solve(found.schur, reduced)
    u, row["recover s"] = timed(lambda: found.recover(f, kept))
    assert np.abs(body.A @ u - f).max() < 1e-9 * abs(body.A).max() * np.abs(u).max()
    return row | more


def by_fronts(body: Any) -> tuple[Any, dict[str, Any]]:
    """Eliminate by Multifrontal."""
    found = Multifrontal().eliminate(body.A, body.contact_unknowns, positions(body))
    return found, {"factor MB": 8e-6 * found.stored}


def by_mumps(body: Any) -> tuple[Any, dict[str, Any]]:
    """Eliminate by MUMPS."""
    kept = body.contact_unknowns
    interior = np.setdiff1d(np.arange(body.A.shape[0]), kept)
    factor: MumpsFactor = factorised(body.A, kept, interior, positions(body))
    found = SolvedInterior(body.A, kept, interior, factor.solve, factor.schur)
    return found, {"factor MB": 8e-6 * factor.entries, "MUMPS MB": factor.megabytes[0]}


def positions(body: Any) -> Any:
    """Return the places of the free unknowns."""
    return body.positions[:, body.free // 2]


def on_ranks(nodes: int, file: str) -> None:
    """Measure a row on all ranks of this run, and print it on rank 0."""
    comm = mpi().COMM_WORLD
    row: dict[str, Any] = {"ranks": comm.size}
    if comm.rank:
        serve(comm)
    else:
        with hosting(comm):
            row |= measure(nodes, by_mumps, file)
    peaks = comm.gather(peak())
    if comm.rank == 0:
        print(json.dumps(row | {f"rank {r} MB": mb for r, mb in enumerate(peaks)}))


def row_of(nodes: int, ranks: int, folder: str) -> dict[str, Any]:
    """Return the row of some number of ranks; 0 for Multifrontal."""
    mpiexec = ["mpiexec", "-n", str(ranks)] if ranks else []
    file = str(Path(folder) / f"{ranks}.npy")
    command = [*mpiexec, sys.executable, __file__, "--row", str(nodes), file, str(ranks)]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(run.stdout)
    if ranks:
        expected = np.load(Path(folder) / "0.npy")
        row["difference"] = np.abs(np.load(file) - expected).max() / np.abs(expected).max()
    return row


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Measure eliminations with MUMPS.")
    parser.add_argument("nodes", nargs="*", type=int, default=[316, 548, 1000])
    parser.add_argument("--ranks", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--row", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        nodes, file, ranks = int(options.row[0]), options.row[1], int(options.row[2])
        if ranks:
            on_ranks(nodes, file)
        else:
            row = measure(nodes, by_fronts, file)
            print(json.dumps(row | {"ranks": 0, "rank 0 MB": peak()}))
        return
    print("  ".join(name.rjust(_width(form)) for name, form in COLUMNS.items()))
    for nodes in options.nodes:
        with tempfile.TemporaryDirectory() as folder:
            for ranks in [0, *options.ranks]:
                row = row_of(nodes, ranks, folder)
                cells = [
                    form.format(row[name]) if name in row else "-".rjust(_width(form))
                    for name, form in COLUMNS.items()
                ]
                print("  ".join(cells), flush=True)


def _width(form: str) -> int:
    return int(form[2:].rstrip("dfe}").split(".")[0])


if __name__ == "__main__":
    main()
