"""Time and memory of a block against contact nodes p and unknowns n, stage by stage.

    python benchmarks/block.py [NODES ...] [--curved 200] [--into docs/data/scale.json]

The block of the scene ``block`` under constant pressure and a shear that is alpha, from -2 to 2:
from all nodes in slip to the left to all in slip to the right, about 2 p transitions. Every size
runs in processes of its own, one for time and one for memory. Columns:

- p, n: contact nodes, unknowns of the mesh;
- assembly: mesh, stiffness, supports (s); condensation: to 2 p unknowns (s);
- tracing: the whole path (s); start: its part until the first piece (s); pieces; ms per transition
  without the start; to 1,000: seconds until the 1,000th transition;
- recovery: the displacements of the whole mesh at one point (s);
- residual: the largest of all transitions, of the condensed equilibrium, relative to the largest
  contact force; full: that of one recovered field on the whole mesh, relative to its terms;
- MB: most memory of tracing above the condensed problem, up to the 1,000th transition and of the
  whole path, by tracemalloc in the second process; RSS: the most of the first process at all.

GetFEM on the same block: ``benchmarks/block_by_getfem.py``.

Then the time of PseudoArclength with the friction coefficient from 0.1 to 2 as parameter, at
alpha = 1. Set OPENBLAS_NUM_THREADS=1 where other programs run.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from condensation import timed
from figures import store
from pwscont_coulomb.elastic.scenes import block_body
from scale import memory, path

INTERVAL = (-2.0, 2.0)
FRICTIONS = (0.1, 2.0)
#: Longest path (s) that is traced again for its memory.
LONGEST = 240.0
COLUMNS = {
    "p": "{:5d}",
    "n": "{:8d}",
    "assembly": "{:8.3f}",
    "condensation": "{:12.3f}",
    "tracing": "{:8.2f}",
    "start": "{:7.3f}",
    "pieces": "{:6d}",
    "ms each": "{:7.2f}",
    "to 1,000": "{:8.2f}",
    "recovery": "{:8.3f}",
    "residual": "{:8.0e}",
    "full": "{:8.0e}",
    "MB 1,000": "{:8.1f}",
    "MB": "{:8.1f}",
    "RSS": "{:8.0f}",
}


def times(nodes: int) -> dict[str, Any]:
    """Return the seconds of each stage and what the path is like."""
    body, assembly = timed(lambda: block_body(nodes))
    problem, condensation = timed(body.condensed)
    row = {"p": nodes, "n": body.A.shape[0], "assembly": assembly, "condensation": condensation}
    graph, following = path(problem.along_load(), INTERVAL, sliding_left)
    row |= following
    at = graph.special_points()[len(graph.pieces) // 2]
    u, row["recovery"] = timed(lambda: problem.displacements(at.z, at.alpha))
    row["full"] = unbalanced(problem, at, u)
    row["RSS"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1.024e-3
    return row


def sliding_left(system: Any, alpha: float) -> Any:
    """Return the state in which all nodes touch and slide to the left.

    From rest Newton's iteration does not converge at 1,000 contact nodes.
    """
    p, A, f = system.body.p, system.body.A, system.load_at(alpha)
    F = system.friction[:, np.newaxis]
    slip = np.linalg.solve(A[p:, p:] + F * A[:p, p:], f[p:] + F[:, 0] * f[:p])
    u = np.concatenate([np.zeros(p), slip])
    return np.concatenate([u, A @ u - f])


def unbalanced(problem: Any, point: Any, displacements: Any) -> float:
    """Return how far a recovered field is from equilibrium on the whole mesh, relative."""
    elastic = problem.elastic
    u = displacements.ravel()[elastic.free]
    forces = np.concatenate(problem.multipliers(point.z))
    rest = elastic.A @ u - elastic.load(point.alpha)
    rest[elastic.contact_unknowns] -= elastic.contact.rotation().T @ forces
    return float(np.abs(rest).max() / (abs(elastic.A) @ np.abs(u)).max())


def space(nodes: int) -> dict[str, Any]:
    """Return the most memory of tracing above the condensed problem."""
    return memory(block_body(nodes).condensed().along_load, INTERVAL, sliding_left)


def curved(nodes: int) -> dict[str, Any]:
    """Return pieces and seconds with the friction coefficient as parameter."""
    system = block_body(nodes).condensed().along_friction(1.0)
    return {"p": nodes} | path(system, FRICTIONS)[1]


MEASURES = {"times": times, "memory": space, "curved": curved}


def apart(name: str, nodes: int) -> dict[str, Any]:
    """Return what one measurement gives in a process of its own."""
    command = [sys.executable, __file__, "--only", name, str(nodes)]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(run.stdout)
    return row


def measured(nodes: int) -> dict[str, Any]:
    """Return the row of one size."""
    row = apart("times", nodes)
    if row["tracing"] < LONGEST:
        row |= apart("memory", nodes)
    return row


def shown(row: dict[str, Any]) -> str:
    """Return the line of one size."""
    return "  ".join(
        form.format(row[name]) if name in row else "-".rjust(_width(name, form))
        for name, form in COLUMNS.items()
    )


def _width(name: str, form: str) -> int:
    return max(len(name), int(form[2:].rstrip("dfe}").split(".")[0]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Measure a block stage by stage.")
    parser.add_argument("nodes", nargs="*", type=int, default=[10, 20, 50, 100, 200, 400, 1000])
    parser.add_argument("--curved", type=int, default=200)
    parser.add_argument("--into", type=Path, help="a file of data to put the figures into")
    parser.add_argument("--only", choices=MEASURES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        print(json.dumps(MEASURES[options.only](options.nodes[0])))
        return
    print("  ".join(name.rjust(_width(name, form)) for name, form in COLUMNS.items()))
    rows = []
    for nodes in options.nodes:
        rows.append(measured(nodes))
        print(shown(rows[-1]), flush=True)
    found = apart("curved", options.curved)
    print("F from 0.1 to 2, p = {p}: {pieces} pieces, {tracing:.2f} s".format(**found))
    if options.into:
        store(options.into, block=rows, curved=found)


if __name__ == "__main__":
    main()
