"""Other programs on problems that pwscont solves, side by side in one run.

    python benchmarks/peers/report.py

Each runs only if it is on this machine (Debian packages python3-siconos, auto-07p with gfortran);
what is not is said to be not there. Compare figures of one run with each other only.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import auto07p
import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import PiecewiseSystem, enumerate_solutions

#: The Python for which the peers' packages are installed.
PYTHON = os.environ.get("PEER_PYTHON", "/usr/bin/python3")
HERE = Path(__file__).parent
FRICTION, LOADS, NODES = 4.0, 20, (1, 2, 3, 4)


def chain(p: int, seed: int = 1) -> ContactBody:
    """Return a body whose p contact nodes hang together in a row."""
    rng = np.random.default_rng(seed)
    off = -0.9 * rng.uniform(size=2 * p - 1)
    A = np.diag(np.full(2 * p, 2.0)) + np.diag(off, 1) + np.diag(off, -1)
    picks = np.eye(2 * p)
    return ContactBody(A, picks[0::2], picks[1::2])


def siconos() -> str:
    """Return how many solutions Siconos and pwscont find under random loads, and the time."""
    lines = [f"Siconos, all solutions of chains under {LOADS} random loads, F = {FRICTION:g}:"]
    for p in NODES:
        body, loads = chain(p), np.random.default_rng(p).normal(size=(LOADS, 2 * p))
        answer = _ask("siconos.py", _problem(body, loads))
        if "missing" in answer:
            return str(answer["missing"])
        theirs = [len(run["solutions"]) for run in answer["runs"]]
        median = statistics.median(run["seconds"] for run in answer["runs"])
        ours, seconds = _ours(body, loads)
        same = sum(a == b for a, b in zip(theirs, ours, strict=True))
        lines.append(
            f"  {p} nodes: Siconos {1e3 * median:8.3f} ms, pwscont {1e3 * seconds:8.3f} ms per "
            f"load; same number of solutions at {same} of {LOADS} (most: {max(ours)})"
        )
    return "\n".join(lines)


def _problem(body: ContactBody, loads: Any) -> dict[str, Any]:
    matrices = {"A": body.A, "N": body.N, "T": body.T, "loads": loads}
    return {"F": FRICTION} | {name: array.tolist() for name, array in matrices.items()}


def _ask(program: str, problem: dict[str, Any]) -> dict[str, Any]:
    """Run a peer's program in its own Python."""
    missing = {"missing": f"{program.removesuffix('.py')}: not on this machine"}
    if not Path(PYTHON).exists():
        return missing
    command = [PYTHON, "-I", str(HERE / program)]
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    run = subprocess.run(
        command,
        input=json.dumps(problem),
        capture_output=True,
        text=True,
        check=False,
        env=one_thread,  # for such small matrices more of them cost a hundred times the work
    )
    if run.returncode:
        return {"missing": f"{program} failed: {run.stderr.strip().splitlines()[-1:]}"}
    answer: dict[str, Any] = json.loads(run.stdout.strip().splitlines()[-1])
    return answer


def _ours(body: ContactBody, loads: Any) -> tuple[list[int], float]:
    """Return the number of solutions at each load, and the median of the seconds."""
    counts, seconds = [], []
    for load in loads:
        system: PiecewiseSystem = CoulombLoad(body, AffineLoad(load, 0.0 * load), FRICTION)
        begin = time.perf_counter()
        counts.append(len(enumerate_solutions(system, 0.0)))
        seconds.append(time.perf_counter() - begin)
    return counts, statistics.median(seconds)


def main() -> None:
    """Print what each peer did."""
    sys.stdout.reconfigure(line_buffering=True)
    print(siconos())
    print(auto07p.report())


if __name__ == "__main__":
    main()
