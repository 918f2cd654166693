"""Time and memory of all solutions at one load, and of a complete search.

    python benchmarks/enumeration.py [LARGEST]

Random bodies, strongly coupled, with one inner displacement and friction 4 (as in
tests/random_bodies.py). LARGEST is the largest number of contact nodes, 12 by default: most of a
minute.
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import AllTransitions, enumerate_solutions, explore

FRICTION = 4.0
#: AllTransitions tries 3 p times as many cells as one slice has.
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


def report(p: int, seed: int) -> None:
    """Print the figures of one body."""
    system, begin = random_problem(p, seed), time.perf_counter()
    found = enumerate_solutions(system, 0.3)
    seconds, complete = time.perf_counter() - begin, ""
    if p <= LARGEST_COMPLETE:
        begin = time.perf_counter()
        graph = explore(system, (-5.0, 5.0), search=AllTransitions())
        complete = f"explore {time.perf_counter() - begin:7.3f} s ({graph.guarantee})"
    print(
        f"p = {p:2}, body {seed}: {4**p:>10,} cells, enumerate_solutions {seconds:7.3f} s for "
        f"{len(found)}, {megabytes():4.0f} MB at most; {complete}"
    )


if __name__ == "__main__":
    report(2, 1)  # imports and first calls are in no figure below
    for nodes in range(5, int(sys.argv[1] if len(sys.argv) > 1 else 12) + 1):
        for body in (1, 2):
            report(nodes, body)
