"""Time and memory of condensing a block, against the bare factorisation of its interior.

``python benchmarks/condensation.py [NODES ...]`` prints a table, by default for 50, 100, 200 and
400 contact nodes. Each row is measured in a process of its own. Columns:

- unknowns, and contact nodes p;
- body: mesh, assembly, supports and loads (s);
- SuperLU: bare factorisation of the whole matrix, minimum degree order, diagonal pivots (s), and
  its factors (MB);
- condense: dissection, elimination, Schur complement (s), and its ratio to SuperLU;
- factor: what is stored (MB); peak: most memory held during condensation (MB, by tracemalloc, the
  matrix itself not counted), and its ratio to the factor;
- load, recover: one condensed load, one full field (ms);
- solves: elimination with SuperLU and one solution per kept unknown (s), where asked for with
  ``--solves``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from pwscont_coulomb.elastic import Multifrontal, SuperLU
from pwscont_coulomb.elastic.scenes import block_body
from scipy.sparse.linalg import splu

COLUMNS = {
    "unknowns": "{:9d}",
    "p": "{:5d}",
    "body s": "{:7.2f}",
    "SuperLU s": "{:9.2f}",
    "SuperLU MB": "{:10.0f}",
    "condense s": "{:10.2f}",
    "ratio": "{:6.2f}",
    "factor MB": "{:9.1f}",
    "peak MB": "{:8.1f}",
    "peak/factor": "{:11.2f}",
    "load ms": "{:7.1f}",
    "recover ms": "{:10.1f}",
    "SuperLU solves s": "{:16.2f}",
}


def timed(action: Callable[[], Any]) -> tuple[Any, float]:
    """Return what an action returns, and the seconds it took."""
    begin = time.perf_counter()
    found = action()
    return found, time.perf_counter() - begin


def measure(nodes: int, solves: bool) -> dict[str, Any]:
    """Return the row of a block with some number of contact nodes."""
    body, assembly = timed(lambda: block_body(nodes))
    given = (body.A, body.contact_unknowns, body.positions[:, body.free // 2])
    row = {"unknowns": body.A.shape[0], "p": nodes, "body s": assembly}
    row |= bare(body.A)
    row |= condensed(body, given)
    row["ratio"] = row["condense s"] / row["SuperLU s"]
    row |= memory(given)
    if solves:
        row["SuperLU solves s"] = timed(lambda: SuperLU().eliminate(*given))[1]
    return row


def bare(A: Any) -> dict[str, Any]:
    """Return time and memory (values and indices) of SuperLU's factors of the whole matrix."""
    symmetric = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    whole = A.tocsc()
    lu, seconds = timed(lambda: splu(whole, permc_spec="MMD_AT_PLUS_A", **symmetric))
    return {"SuperLU s": seconds, "SuperLU MB": lu.nnz * 12e-6}


def condensed(body: Any, given: tuple[Any, ...]) -> dict[str, Any]:
    """Return the times of condensation, load and recovery; the field recovered is checked."""
    found, condense = timed(lambda: Multifrontal().eliminate(*given))
    f = body.load(1.0)
    reduced, load = timed(lambda: found.reduce(f))
    kept = np.linalg.solve(found.schur, reduced)
    u, recover = timed(lambda: found.recover(f, kept))
    assert np.abs(body.A @ u - f).max() < 1e-9 * abs(body.A).max() * np.abs(u).max()
    return {"condense s": condense, "load ms": 1e3 * load, "recover ms": 1e3 * recover}


def memory(given: tuple[Any, ...]) -> dict[str, Any]:
    """Return what the factor takes, and the most that its making takes."""
    tracemalloc.start()
    found = Multifrontal().eliminate(*given)
    peak = 1e-6 * tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    factor = 8e-6 * found.stored
    return {"factor MB": factor, "peak MB": peak, "peak/factor": peak / factor}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Measure the condensation of a block.")
    parser.add_argument("nodes", nargs="*", type=int, default=[50, 100, 200, 400])
    parser.add_argument("--solves", action="store_true", help="also eliminate by solutions")
    parser.add_argument("--row", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        print(json.dumps(measure(options.row, options.solves)))
        return
    print("  ".join(name.rjust(_width(form)) for name, form in COLUMNS.items()))
    for nodes in options.nodes:
        command = [sys.executable, __file__, "--row", str(nodes)]
        command += ["--solves"] if options.solves else []
        run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        row = json.loads(run.stdout)
        cells = [
            form.format(row[name]) if name in row else "-".rjust(_width(form))
            for name, form in COLUMNS.items()
        ]
        print("  ".join(cells), flush=True)


def _width(form: str) -> int:
    return int(form[2:].rstrip("df}").split(".")[0])


if __name__ == "__main__":
    main()
