"""Evolutions against increments: error and time over the number of increments.

    OPENBLAS_NUM_THREADS=1 python benchmarks/evolution_increments.py [--into FILE]

FILE is docs/data/increments.json. The scheme of increments is tests/helpers/increments.py, in plain
numpy.
Errors are the largest differences of contact forces at the corners of the load, as a part of the
largest force.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from pwscont_coulomb import ContactBody, QuasiStaticCoulomb
from pwscont_coulomb.elastic.scenes import block_body

from pwscont import LoadHistory, evolve

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))
from evolution_truth import random_problem
from increments import increments

#: Primes, so that no division of the load contains another one.
STEPS = (1, 2, 5, 11, 23, 47, 101, 211, 499, 997, 2003, 4001)
TO_AND_FRO = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
#: A random history of three nodes without branchings; increments need not be aligned with events.
SEED = 26
TIMES = 3


def block(nodes):
    """Return a block from a mesh, pressed and sheared to and fro."""
    problem = block_body(nodes).condensed()
    loads = np.array([a * problem.load.f0 + b * problem.load.f1 for a, b in TO_AND_FRO])
    body, friction = problem.body, np.full(nodes, 0.3)
    return f"block, {nodes} contact nodes, F = 0.3", body, loads, friction, np.zeros(nodes)


def random_nodes(seed):
    """Return a random body."""
    some = random_problem(seed)
    body = ContactBody(some.A, some.N, some.T, some.gap)
    words = f"{some.p} nodes, F = {some.F.max():.2g}"
    return words, body, some.loads, some.F, some.slip


def best_of(call):
    """Return the answer of a function, and the shortest time of some calls."""
    times, answer = [], None
    for _ in range(TIMES):
        begin = time.perf_counter()
        answer = call()
        times.append(time.perf_counter() - begin)
    return answer, min(times)


def compared(name, body, loads, friction, slip, steps=STEPS):
    """Return the errors and times of one history."""
    history = LoadHistory(loads)
    system = QuasiStaticCoulomb(body, history, friction, slip)
    evolution, seconds = best_of(lambda: evolve(system, history.interval))
    path = evolution.paths()[0]
    exact = np.array([path.state(t).z[-2 * body.p :] for t in history.times])
    rows = []
    for count in steps:
        arguments = body.A, body.N, body.T, body.gap, friction, loads, count, slip
        found, taken = best_of(lambda arguments=arguments: increments(*arguments))
        error = np.abs(np.array([forces for forces, _ in found]) - exact).max()
        rows.append({"steps": count, "error": error / np.abs(exact).max(), "seconds": taken})
    return {
        "name": name,
        "evolutions": evolution.paths().number,
        "pieces": len(evolution.pieces),
        "evolve": seconds,
        "guarantee": evolution.guarantee,
        "increments": rows,
    }


def main():
    """Compare all histories, print a table, and write the data if asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--into", type=Path, help="write the data to this file")
    into = parser.parse_args().into
    found = [compared(*case) for case in (block(12), block(50), random_nodes(SEED))]
    for case in found:
        print(f"{case['name']}: {case['pieces']} pieces in {case['evolve']:.3f} s")
        for row in case["increments"]:
            print(f"  {row['steps']:5d} per line: {row['error']:.1e}, {row['seconds']:.3f} s")
    if into:
        into.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
