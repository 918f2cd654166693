"""Time per piece and per point on the paper's examples and on a random body.

    python benchmarks/paper.py

Prints, per case and stepper, the median and spread of several runs of ``explore`` (search for
starts included) and of the tracing alone. Compare rows of one run with each other only: the
machine's speed is in all of them.
"""

from __future__ import annotations

import platform
import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np
import scipy
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.scenes import example3, fig7

from pwscont import (
    BranchGraph,
    ExactLinear,
    PiecewiseSystem,
    PseudoArclength,
    Stepper,
    explore,
    trace,
)

RUNS = 9


def random_body(p: int, seed: int) -> ContactBody:
    """Return a body of p nodes whose stiffness matrix is a random positive definite one."""
    root = np.random.default_rng(seed).normal(size=(2 * p, 2 * p))
    picks = np.eye(2 * p)
    return ContactBody(root @ root.T + np.eye(2 * p), picks[0::2], picks[1::2])


def random_path(p: int = 8, seed: int = 1) -> CoulombLoad:
    """Return a random body pressed on the obstacle and dragged along it."""
    rng = np.random.default_rng(seed)
    load = AffineLoad(rng.normal(size=2 * p) + np.tile([2.0, 0.0], p), rng.normal(size=2 * p))
    return CoulombLoad(random_body(p, seed), load, 0.5)


def cases() -> Iterator[tuple[str, PiecewiseSystem, tuple[float, float], Stepper]]:
    """Yield name, system, interval and stepper."""
    for stepper in (ExactLinear(), PseudoArclength()):
        yield "fig7", fig7().system, fig7().interval, stepper
        yield "random p = 8", random_path(), (-5.0, 5.0), stepper
    yield "example3", example3().system, example3().interval, PseudoArclength()


def timed(run: Callable[[], BranchGraph]) -> tuple[list[float], BranchGraph]:
    """Return the seconds of each of several runs after one to warm up, and the graph."""
    graph, seconds = run(), []
    for _ in range(RUNS):
        begin = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - begin)
    return seconds, graph


def row(name: str, what: str, seconds: list[float], graph: BranchGraph) -> str:
    """Return one line of the table."""
    median = statistics.median(seconds)
    pieces, points = len(graph.pieces), sum(len(piece.points) for piece in graph.pieces)
    return (
        f"{name:<14} {what:<26} {1e3 * median:9.2f} ms [{1e3 * min(seconds):.2f}, "
        f"{1e3 * max(seconds):.2f}] {pieces:5d} pieces {points:6d} points "
        f"{1e6 * median / pieces:9.0f} us/piece {1e6 * median / points:8.0f} us/point"
    )


def main() -> None:
    """Print the table."""
    print(
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, "
        f"{platform.machine()}; median [min, max] of {RUNS} runs"
    )
    for name, system, interval, stepper in cases():
        kind = type(stepper).__name__

        def trace_all(
            system: PiecewiseSystem = system,
            interval: tuple[float, float] = interval,
            stepper: Stepper = stepper,
        ) -> BranchGraph:
            return trace(system, (np.zeros(system.size), interval[0]), interval, stepper=stepper)

        print(row(name, f"trace, {kind}", *timed(trace_all)))
        if not name.startswith("random"):
            print(
                row(
                    name,
                    f"explore, {kind}",
                    *timed(lambda s=system, i=interval, t=stepper: explore(s, i, stepper=t)),
                )
            )


if __name__ == "__main__":
    main()
