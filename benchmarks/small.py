"""What a small scene costs: fig7, a curved point, files and pictures of a long path, the import.

    python benchmarks/small.py [--runs 20]

Printed are milliseconds, the least of several runs, and what they are in solves of five equations
by numpy, measured in the same process: figures of one machine are compared by these.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from pwscont_coulomb import CoulombLoad
from pwscont_coulomb.scenes import fig7, fig10
from scale import INTERVAL, run
from strip import strip

from pwscont import BranchGraph, PseudoArclength, StepSize, explore, plot, trace
from pwscont.scenes.scene import Scene

FRICTION = 0.3
SOLVES = 1000
SPAN = 1.0
IMPORT = """
import numpy, scipy.linalg, scipy.sparse, time
begin = time.perf_counter()
from pwscont import explore, trace
print(time.perf_counter() - begin)
"""


def least(work: Callable[[], Any], runs: int) -> float:
    """Return the shortest of several runs, in milliseconds, after one that is dropped.

    Short work is repeated for a second: bursts of other programs last tenths of one.
    """
    work()
    taken: list[float] = []
    end = time.perf_counter() + SPAN
    while len(taken) < runs or time.perf_counter() < end:
        begin = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begin)
    return 1e3 * min(taken)


def solves() -> None:
    """Solve five equations many times."""
    matrix, right = np.eye(5) + 0.1, np.ones(5)
    for _ in range(SOLVES):
        np.linalg.solve(matrix, right)


def small(runs: int) -> Iterator[tuple[str, float]]:
    """Yield the figures of fig7, of an import and of a curved point."""
    system, interval = fig7().system, fig7().interval
    start = np.zeros(system.size), interval[0]
    yield "fig7, trace", least(lambda: trace(system, start, interval), runs)
    yield "fig7, explore", least(lambda: explore(system, interval), runs)
    yield "import, above numpy and scipy", imported()
    yield "fig7 by arclength, per point", per_point(fig7(), runs)
    yield "curved, per point", per_point(fig10(), runs)


def imported() -> float:
    """Return the time that the import takes in a fresh interpreter, in milliseconds.

    Modules are compiled by the first, which is not the least, and kept, as after an installation.
    """
    keeping = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    fresh = partial(subprocess.check_output, [sys.executable, "-c", IMPORT], env=keeping)
    return 1e3 * min(float(fresh()) for _ in range(5))


def per_point(scene: Scene, runs: int) -> float:
    """Return the time of one point by short steps along a scene's curves, in milliseconds."""
    system, interval = scene.system, scene.interval
    stepper = PseudoArclength(step_size=StepSize(largest=0.01))

    def follow() -> BranchGraph:
        return trace(system, (np.zeros(system.size), interval[0]), interval, stepper=stepper)

    points = sum(len(piece.alpha) for piece in follow().pieces)
    return least(follow, max(runs // 4, 1)) / points


def long_path() -> Iterator[tuple[str, float]]:
    """Yield the times of saving, loading and drawing a path of many pieces."""
    system = CoulombLoad(*strip(330), FRICTION)
    graph, *_ = run(system, INTERVAL)
    what = f"{len(graph.pieces)} pieces, {system.size} unknowns"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "path.npz"
        yield f"{what}: save", least(lambda: graph.save(file), 3)
        yield f"{what}: load", least(lambda: BranchGraph.load(file), 3)
        picture = Path(folder) / "path.png"
        yield f"{what}: plot and save the picture", least(lambda: drawn(graph, picture), 3)


def drawn(graph: BranchGraph, into: Path) -> None:
    """Draw one unknown of a path."""
    figure = Figure()
    plot(graph, 0, ax=figure.subplots())
    figure.savefig(into)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    runs = parser.parse_args().runs
    yardstick = least(solves, 10) / SOLVES
    print(f"one solve of five equations: {1e3 * yardstick:.1f} us")
    for part in (small(runs), long_path()):
        for name, taken in part:
            print(f"{name:55s} {taken:10.3f} ms {taken / yardstick:10.0f} solves", flush=True)


if __name__ == "__main__":
    main()
