"""Time and memory of exact paths and curved ones against the number of contact nodes.

    python benchmarks/scale.py [--nodes 100 200 400 1000] [--curved 200]

Prints for every size the pieces, the seconds of the path, the milliseconds of the start and of one
transition, the share of its stages, the largest relative residual over all special points, and the
memory above the condensed body in a second run; then the slope of the time per transition over p
in double logarithm. Set OPENBLAS_NUM_THREADS=1 where other programs run.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import numpy as np
from pwscont_coulomb import CoulombFriction, CoulombLoad
from pwscont_coulomb.contact_algebra import ContactMatrix
from strip import strip

from pwscont import trace
from pwscont.numerics.row_replacement import Updating

STAGES = {
    "solves": (ContactMatrix, "solve"),
    "products": (ContactMatrix, "__matmul__"),
    "updates": (Updating, "_update"),
    "factorisations": (Updating, "_factorise"),
}


@contextmanager
def timed() -> Iterator[dict[str, float]]:
    """Measure the seconds within each stage; a stage within another counts as its own."""
    seconds: dict[str, float] = defaultdict(float)
    stack: list[float] = []

    def watched(stage: str, original: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(original)
        def run(*arguments: Any) -> Any:
            stack.append(0.0)
            begin = time.perf_counter()
            result = original(*arguments)
            spent = time.perf_counter() - begin
            seconds[stage] += spent - stack.pop()
            if stack:
                stack[-1] += spent
            return result

        return run

    originals = {stage: vars(owner)[name] for stage, (owner, name) in STAGES.items()}
    for stage, (owner, name) in STAGES.items():
        setattr(owner, name, watched(stage, originals[stage]))
    try:
        yield seconds
    finally:
        for stage, (owner, name) in STAGES.items():
            setattr(owner, name, originals[stage])


def residual(system: Any, point: Any) -> float:
    """Return how far a special point is from equilibrium, relative to the terms."""
    n, p, z, A = system.body.n, system.body.p, point.z, system.body.A
    rest = A @ z[:n] - system.load_at(point.alpha)
    rest[:p] -= z[n : n + p]
    rest[p:] -= z[n + p :]
    return float(np.abs(rest).max() / np.abs(z[n:]).max())


def run(system: Any, interval: tuple[float, float]) -> tuple[Any, float, float]:
    """Return the graph, the seconds of the whole run and those until the first piece."""
    marks: list[float] = []
    begin = time.perf_counter()
    graph = trace(
        system,
        (np.zeros(system.size), interval[0]),
        interval,
        report=lambda *_: marks.append(time.perf_counter()),
    )
    return graph, time.perf_counter() - begin, marks[0] - begin


def measured(p: int) -> float:
    """Print a line for one size, return the seconds per transition."""
    body, load = strip(p)
    with timed() as stages:
        graph, total, first = run(CoulombLoad(body, load, 0.3), (0.0, 1.0))
    count = len(graph.pieces)
    each = (total - first) / (count - 1)
    system = CoulombLoad(body, load, 0.3)
    worst = max(residual(system, point) for point in graph.special_points())
    shares = ", ".join(f"{name} {100 * s / total:.0f} %" for name, s in stages.items())
    del graph
    tracemalloc.start()
    run(CoulombLoad(body, load, 0.3), (0.0, 1.0))
    memory = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    print(
        f"p = {p:5d}: {count:5d} pieces, {total:7.2f} s, start {1e3 * first:7.1f} ms, "
        f"{1e3 * each:7.2f} ms per transition, residual {worst:.1e}, peak {memory:6.1f} MB; "
        f"{shares}",
        flush=True,
    )
    return each


def curved(p: int) -> None:
    """Print the time with F as parameter, and along a curved load path."""
    body, load = strip(p)

    def path(alpha: float) -> Any:
        return load(0.5 - 0.5 * np.cos(np.pi * alpha)) + 0.1 * alpha * (1.0 - alpha) * load.f1

    for name, system, interval in (
        ("F from 0.1 to 2", CoulombFriction(body, load(0.6)), (0.1, 2.0)),
        ("curved load path", CoulombLoad(body, path, 0.3), (0.0, 1.0)),
    ):
        graph, total, _ = run(system, interval)
        print(f"p = {p:5d}: {name}, {len(graph.pieces)} pieces, {total:.2f} s", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, nargs="+", default=[100, 200, 400, 1000])
    parser.add_argument("--curved", type=int, default=200)
    arguments = parser.parse_args()
    curved(arguments.curved)
    each = [measured(p) for p in arguments.nodes]
    if len(each) > 1:
        slope = np.polyfit(np.log(arguments.nodes), np.log(each), 1)[0]
        print(f"time per transition grows like p^{slope:.2f}")


if __name__ == "__main__":
    main()
