"""The block of ``benchmarks/block.py`` by GetFEM's continuation, with all unknowns of the mesh.

GetFEM's solver of systems of equations is made for sparse matrices. On the dense ones of condensed
bodies MUMPS stops with "error -9" from 40 contact nodes on, so that GetFEM gets the stiffness
matrix of the mesh. ``python benchmarks/block_by_getfem.py NODES ...`` prints what it finds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from pwscont_coulomb.elastic.scenes import block_body
from scale import run

sys.path.insert(0, str(Path(__file__).parent / "peers"))
from ask import ask
from by_getfem import AUTHORS

SETTINGS = {"defaults": {"min_cos": 0.9}, "authors": AUTHORS | {"min_cos": 0.99999, "h_max": 0.1}}


def by_getfem(nodes: int, interval: tuple[float, float]) -> dict[str, Any]:
    """Return seconds and points for each setting, or why there are none.

    Also: ``end``, the last alpha; ``stood on``, on how many pieces of the exact path there is a
    point; ``off``, the largest distance of contact forces from the exact ones, relative.
    """
    problem = block_body(nodes).condensed()
    graph, _, _ = run(problem.along_load(), interval)
    answer = ask("getfem.py", _given(problem, graph, interval))
    if "missing" in answer:
        return {"missing": answer["missing"]}
    rows = (_judged(graph, nodes, curve) for curve in answer["curves"])
    return dict(zip(SETTINGS, rows, strict=True))


def _given(problem: Any, graph: Any, interval: tuple[float, float]) -> dict[str, Any]:
    elastic, full = problem.elastic, problem.elastic.full()
    start = graph.solutions(interval[0])[0].z
    u = problem.displacements(start, interval[0]).ravel()[elastic.free]
    forces = np.concatenate(problem.multipliers(start))
    arrays = {"F": problem.friction, "f0": full.load.f0, "f1": full.load.f1}
    matrices = {"A": full.body.A, "N": full.body.N, "T": full.body.T}
    return {
        **{name: array.tolist() for name, array in arrays.items()},
        **{name: _entries(matrix) for name, matrix in matrices.items()},
        "r": 1.0,
        "start": [*u.tolist(), *forces.tolist(), interval[0]],
        "interval": interval,
        "settings": list(SETTINGS.values()),
        "runs": 1,
    }


def _entries(matrix: Any) -> dict[str, Any]:
    found = sp.coo_matrix(matrix)
    entries = zip(found.row.tolist(), found.col.tolist(), found.data.tolist(), strict=True)
    return {"shape": found.shape, "entries": list(entries)}


def _judged(graph: Any, nodes: int, curve: dict[str, Any]) -> dict[str, Any]:
    points = np.array(curve["points"])
    alphas = points[:, -1]
    ends = np.sort([point.alpha for point in graph.special_points()])
    inside = points[(ends[0] <= alphas) & (alphas <= ends[-1])]
    stood_on = np.unique(np.searchsorted(ends, inside[:, -1], side="right"))
    off, size = 0.0, 0.0
    for point in inside:
        exact = graph.solutions(point[-1])[0].z[-2 * nodes :]
        off = max(off, np.abs(exact - point[-1 - 2 * nodes : -1]).max())
        size = max(size, np.abs(exact).max())
    return {
        "seconds": curve["seconds"][0],
        "points": len(points),
        "end": float(alphas[-1]),
        "stood on": len(stood_on),
        "pieces": len(graph.pieces),
        "off": off / size,
    }


if __name__ == "__main__":
    for word in sys.argv[1:]:
        print(word, by_getfem(int(word), (-2.0, 2.0)), flush=True)
