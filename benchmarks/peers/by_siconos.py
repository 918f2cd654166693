"""All solutions at one load by Siconos, beside pwscont's enumeration.

Siconos follows no curve: it has no place in the work-precision picture, and is reported as text.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np
from ask import ask
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import PiecewiseSystem, enumerate_solutions

NAME = "Siconos"
FRICTION, LOADS, NODES = 4.0, 20, (1, 2, 3, 4)


def chain(p: int, seed: int = 1) -> ContactBody:
    """Return a body whose p contact nodes hang together in a row."""
    rng = np.random.default_rng(seed)
    off = -0.9 * rng.uniform(size=2 * p - 1)
    A = np.diag(np.full(2 * p, 2.0)) + np.diag(off, 1) + np.diag(off, -1)
    picks = np.eye(2 * p)
    return ContactBody(A, picks[0::2], picks[1::2])


def report() -> str:
    """Return how many solutions Siconos and pwscont find under random loads, and the time."""
    lines = [f"Siconos, all solutions of chains under {LOADS} random loads, F = {FRICTION:g}:"]
    for p in NODES:
        body, loads = chain(p), np.random.default_rng(p).normal(size=(LOADS, 2 * p))
        answer = ask("siconos.py", _problem(body, loads))
        if "missing" in answer:
            return f"{NAME}: {answer['missing']}"
        lines.append(f"  {p} nodes: {_compared(answer['runs'], body, loads)}")
    return "\n".join(lines)


def _compared(runs: list[dict[str, Any]], body: ContactBody, loads: Any) -> str:
    theirs = [len(run["solutions"]) for run in runs]
    median = statistics.median(run["seconds"] for run in runs)
    ours, seconds = _ours(body, loads)
    same = sum(a == b for a, b in zip(theirs, ours, strict=True))
    return (
        f"Siconos {1e3 * median:8.3f} ms, pwscont {1e3 * seconds:8.3f} ms per "
        f"load; same number of solutions at {same} of {LOADS} (most: {max(ours)})"
    )


def _problem(body: ContactBody, loads: Any) -> dict[str, Any]:
    matrices = {"A": body.A, "N": body.N, "T": body.T, "loads": loads}
    return {"F": FRICTION} | {name: array.tolist() for name, array in matrices.items()}


def _ours(body: ContactBody, loads: Any) -> tuple[list[int], float]:
    """Return the number of solutions at each load, and the median of the seconds."""
    counts, seconds = [], []
    for load in loads:
        system: PiecewiseSystem = CoulombLoad(body, AffineLoad(load, 0.0 * load), FRICTION)
        begin = time.perf_counter()
        counts.append(len(enumerate_solutions(system, 0.0)))
        seconds.append(time.perf_counter() - begin)
    return counts, statistics.median(seconds)
