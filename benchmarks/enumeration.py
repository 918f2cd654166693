"""Time and memory of all solutions at one load, and of a complete search.

    OPENBLAS_NUM_THREADS=1 python benchmarks/enumeration.py [LARGEST]

Random bodies, strongly coupled, with one inner displacement and friction 4 (as in
tests/random_bodies.py), and an elastic strip (benchmarks/strip.py) of as many contact nodes.
LARGEST is the largest number of contact nodes, 12 by default: half a minute; 14 takes minutes.

"One solve per cell" is what trying all cells would cost in the same process: numpy solves stacks
of 2 p equations for a sample of cells, and nothing else.
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from strip import strip

from pwscont import AllTransitions, enumerate_solutions, explore

FRICTION = 4.0
#: Cells that are solved to see what one costs.
SAMPLE = 4096
#: Largest number of nodes for which AllTransitions tries all cells, with the load as an unknown.
LARGEST_COMPLETE = 8


def random_problem(p: int, seed: int) -> CoulombLoad:
    """Return a random body under a random affine load."""
    rng = np.random.default_rng([seed, p, 1])
    n = 2 * p + 1
    root = rng.normal(size=(n, n))
    pick = np.eye(n)
    body = ContactBody(root @ root.T + 0.2 * np.eye(n), pick[0 : 2 * p : 2], pick[1 : 2 * p : 2])
    f0, f1 = (np.random.default_rng([1, end, n, 99]).normal(size=n) for end in (0, 1))
    return CoulombLoad(body, AffineLoad(f0, f1), FRICTION)


def megabytes() -> float:
    """Return the largest resident size so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def seconds_of_all_cells(p: int) -> float:
    """Return what numpy would take to solve 2 p equations in each of 4^p cells."""
    rng = np.random.default_rng(p)
    matrices = rng.normal(size=(SAMPLE, 2 * p, 2 * p)) + 4.0 * np.eye(2 * p)
    right = rng.normal(size=(SAMPLE, 2 * p, 1))
    begin = time.perf_counter()
    np.linalg.solve(matrices, right)
    return (time.perf_counter() - begin) / SAMPLE * 4.0**p


def report(p: int, what: str, system: CoulombLoad) -> None:
    """Print the figures of one body."""
    begin = time.perf_counter()
    found = enumerate_solutions(system, 0.3)
    seconds, complete = time.perf_counter() - begin, ""
    ratio = seconds / seconds_of_all_cells(p)
    if p <= LARGEST_COMPLETE:
        begin = time.perf_counter()
        graph = explore(system, (-5.0, 5.0), search=AllTransitions())
        complete = f"; explore {time.perf_counter() - begin:.3f} s ({graph.guarantee})"
    print(
        f"p = {p:2}, {what}: {4**p:>11,} cells, enumerate_solutions {seconds:7.3f} s for "
        f"{len(found)} ({found.guarantee}), {ratio:.2g} of one solve per cell, "
        f"{megabytes():4.0f} MB at most{complete}",
        flush=True,
    )


if __name__ == "__main__":
    report(2, "body 1", random_problem(2, 1))  # imports and first calls are in no figure below
    for nodes in range(5, int(sys.argv[1] if len(sys.argv) > 1 else 12) + 1):
        for number in (1, 2):
            report(nodes, f"body {number}", random_problem(nodes, number))
        report(nodes, "strip ", CoulombLoad(*strip(nodes), 0.4))
