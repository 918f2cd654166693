"""Time and memory of exact paths and curved ones against the number of contact nodes.

    python benchmarks/scale.py [--nodes 100 200 400 1000] [--curved 200]
        [--into docs/data/scale.json]

Prints for every size the pieces, the seconds of the path and until the 1,000th transition, the
milliseconds of the start and of one transition, the share of its stages, the largest relative
residual over all special points, and the memory above the condensed body in a second run; then the
slope of the time per transition over p in double logarithm. Set OPENBLAS_NUM_THREADS=1 where other
programs run.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
from figures import store
from pwscont_coulomb import CoulombFriction, CoulombLoad
from pwscont_coulomb.contact_matrix import ContactMatrix
from pwscont_coulomb.row_updates import Updating
from strip import strip

from pwscont import trace

INTERVAL = (0.0, 1.0)
MANY = 1000  # transitions of the target
STAGES = {
    "solves": (ContactMatrix, "solve"),
    "products": (ContactMatrix, "dot"),
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


def at_rest(system: Any, alpha: float) -> Any:
    """Return the state to start from: nothing moves."""
    return np.zeros(system.size)


def run(
    system: Any,
    interval: tuple[float, float],
    mark: Callable[[], float] = time.perf_counter,
    guess: Callable[[Any, float], Any] = at_rest,
) -> tuple[Any, float, list[float]]:
    """Return the graph, what ``mark`` says before, and what it says at the end of each piece."""
    marks: list[float] = []
    begin = mark()
    start = (guess(system, interval[0]), interval[0])
    graph = trace(system, start, interval, report=lambda *_: marks.append(mark()))
    return graph, begin, marks


def path(
    system: Any, interval: tuple[float, float], guess: Callable[[Any, float], Any] = at_rest
) -> tuple[Any, dict[str, Any]]:
    """Return the graph, and how long it took."""
    graph, begin, marks = run(system, interval, guess=guess)
    total, start = time.perf_counter() - begin, marks[0] - begin
    row = {"tracing": total, "start": start, "pieces": len(marks)}
    row["ms each"] = 1e3 * (total - start) / (len(marks) - 1)
    if len(marks) > MANY:
        row["to 1,000"] = marks[MANY - 1] - begin
    row["residual"] = max(residual(system, point) for point in graph.special_points())
    return graph, row


def memory(
    system: Callable[[], Any],
    interval: tuple[float, float],
    guess: Callable[[Any, float], Any] = at_rest,
) -> dict[str, float]:
    """Return the most memory (MB), of the path and up to the 1,000th transition.

    All that the system holds above the body's matrices counts, and the graph.
    """
    tracemalloc.start()
    _, _, marks = run(system(), interval, _peak, guess)
    row = {"MB": _peak()}
    tracemalloc.stop()
    return row | ({"MB 1,000": marks[MANY - 1]} if len(marks) > MANY else {})


def _peak() -> float:
    return 1e-6 * tracemalloc.get_traced_memory()[1]


def measured(p: int) -> dict[str, Any]:
    """Print a line for one size, and return its figures."""
    body, load = strip(p)
    with timed() as stages:
        row = {"p": p} | path(CoulombLoad(body, load, 0.3), INTERVAL)[1]
    row["shares"] = {name: s / row["tracing"] for name, s in stages.items()}
    fresh, load = strip(p)
    row |= memory(lambda: CoulombLoad(fresh, load, 0.3), INTERVAL)
    print(told(row), flush=True)
    return row


def told(row: dict[str, Any]) -> str:
    """Return the line of one size."""
    shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in row["shares"].items())
    many = " (1,000 transitions: {to 1,000:.2f} s, {MB 1,000:.1f} MB)" if "to 1,000" in row else ""
    line = (
        "p = {p:5d}: {pieces:5d} pieces, {tracing:7.2f} s, start {start:6.3f} s, "
        "{ms each:7.2f} ms per transition, residual {residual:.1e}, peak {MB:6.1f} MB"
    )
    return (line + many).format(**row) + "; " + shares


def curved(p: int) -> list[dict[str, Any]]:
    """Print the time with F as parameter, and along a curved load path; return the figures."""
    body, load = strip(p)
    rows = []

    def bent(alpha: float) -> Any:
        return load(0.5 - 0.5 * np.cos(np.pi * alpha)) + 0.1 * alpha * (1.0 - alpha) * load.f1

    for name, system, interval in (
        ("F from 0.1 to 2", CoulombFriction(body, load(0.6)), (0.1, 2.0)),
        ("curved load path", CoulombLoad(body, bent, 0.3), INTERVAL),
    ):
        row = path(system, interval)[1]
        print(f"p = {p:5d}: {name}, {row['pieces']} pieces, {row['tracing']:.2f} s", flush=True)
        rows.append({"p": p, "what": name, **row})
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, nargs="+", default=[100, 200, 400, 1000])
    parser.add_argument("--curved", type=int, default=200)
    parser.add_argument("--into", type=Path, help="a file of data to put the figures into")
    arguments = parser.parse_args()
    bent = curved(arguments.curved)
    rows = [measured(p) for p in arguments.nodes]
    if len(rows) > 1:
        each = [row["ms each"] for row in rows]
        slope = np.polyfit(np.log(arguments.nodes), np.log(each), 1)[0]
        print(f"time per transition grows like p^{slope:.2f}")
    if arguments.into:
        store(arguments.into, strip=rows, strip_curved=bent)


if __name__ == "__main__":
    main()
