"""Every kind of work against what it may cost: the table at the end of the manual's page on scale.

    OPENBLAS_NUM_THREADS=1 python benchmarks/limits.py [--nodes 14] [--into docs/data/scale.json]

Paths of straight pieces are measured by their ratio to the loop by hand, or to ``lars_path``, in
the same process (straight.py), everything else in seconds, the least of several runs, or in
megabytes. ``--nodes`` is the largest number of contact nodes of which all solutions are listed.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import straight
from block import FRICTIONS
from enumeration import random_problem
from figures import store
from lasso import is_installed
from pwscont_coulomb import CoulombLoad
from pwscont_coulomb.elastic.scenes import block_body, wedge, wedge_body
from pwscont_coulomb.scenes import fig7, fig10
from scale import INTERVAL, memory, run
from small import drawn, imported, least, per_point
from strip import strip

from pwscont import Block, BranchGraph, PiecewiseLinearSystem, enumerate_solutions, explore, trace

HEADINGS = '   :header: "work", "measured", "limit"'
#: Path, size, to what it is compared, and how many times as long it may take.
RATIOS = (
    *(("strip", p, "bare", limit) for p, limit in ((50, 5), (200, 3), (400, 2), (1000, 2))),
    *(
        (f"string, {kind}", n, "by hand", 5)
        for kind in ("banded", "sparse")
        for n in (250, 1000, 2000)
    ),
    ("LASSO", 200, "bare", 3),
)
#: Contact nodes, and the seconds in which all solutions at one load may be listed.
LOADS = ((10, 0.6), (12, 5.0), (14, 60.0))


class Row(NamedTuple):
    """A kind of work, what it costs and what it may cost, in a unit."""

    work: str
    measured: float
    limit: float
    unit: str

    def told(self) -> str:
        """Return the line of the row, in reStructuredText."""
        measured, limit = (f"{value:.3g}{self.unit}" for value in (self.measured, self.limit))
        return f'   "{self.work}", "{measured}", "{limit}"'


class Chain(PiecewiseLinearSystem):
    """Diodes in a chain: all tests vanish at alpha = 0, and there is one solution everywhere."""

    def __init__(self, n: int) -> None:
        self.size = n

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        """Return z."""
        return z

    def residual(self, z: np.ndarray, alpha: float, character: Any) -> np.ndarray:
        """Return the currents, each diode driven by a part of the one before."""
        return z + character.array * z - np.append(alpha, 0.05 * z[:-1])

    def blocks(self) -> tuple[Block, ...]:
        """Return one block for each diode."""
        return tuple(Block((k,), (k,), ((True,), (False,))) for k in range(self.size))


def seconds(work: Callable[[], Any], runs: int = 5) -> float:
    """Return the least of several runs in seconds."""
    return 1e-3 * least(work, runs)


def ratios() -> Iterator[Row]:
    """Yield the paths of straight pieces."""
    for path, size, yardstick, limit in RATIOS:
        if path == "LASSO" and not is_installed():
            continue
        times = straight.measured(straight.CASES[path](size), 5 if size <= 400 else 3)
        words = {"bare": "a bare loop", "by hand": "a loop by hand"}[yardstick]
        words = "lars_path" if path == "LASSO" else words
        yield Row(f"{path}, {size:,}, to {words}", times["trace"] / times[yardstick], limit, " ×")


def folded() -> float:
    """Return the microseconds for each piece of a path with two folds."""
    system, interval = wedge_body(7).condensed().along_load(), wedge().interval
    ends = explore(system, interval).solutions(interval[0])
    follow = partial(trace, system, (ends[0].z, interval[0]), interval)
    return 1e3 * least(follow, 20) / len(follow().pieces)


def small() -> Iterator[Row]:
    """Yield what small problems cost."""
    system, interval = fig7().system, fig7().interval
    start = np.zeros(system.size), interval[0]
    yield Row("fig7, trace", least(lambda: trace(system, start, interval), 20), 1.0, " ms")
    yield Row("fig7, explore", least(lambda: explore(system, interval), 20), 2.5, " ms")
    yield Row("wedge, 14 nodes, a piece", folded(), 12e3 / 53, " µs")
    yield Row("fig7 by arclength, a point", 1e3 * per_point(fig7(), 20), 60.0, " µs")
    yield Row("fig10, curved, a point", 1e3 * per_point(fig10(), 20), 60.0, " µs")
    yield Row("import, above numpy and scipy", imported(), 100.0, " ms")
    wedged = wedge_body(7).condensed().along_load()
    bodies = {
        "strip": (CoulombLoad(*strip(14), 0.3), INTERVAL),
        "wedge": (wedged, wedge().interval),
    }
    for name, body in bodies.items():
        work = f"explore by default, {name}, 14 nodes"
        yield Row(work, seconds(partial(explore, *body)), 0.3, " s")


def corners() -> Iterator[Row]:
    """Yield what chains of diodes cost."""
    for n, limit in ((16, 0.2), (24, 0.2)):
        work = partial(explore, Chain(n), (-1.0, 1.0))
        yield Row(f"explore, {n} diodes that turn at once", seconds(work, 2), limit, " s")
    chain, start = Chain(100), (np.full(100, -0.01), -1.0)
    work = partial(trace, chain, start, (-1.0, 1.0))
    yield Row("trace, 100 diodes that turn at once", seconds(work, 2), 1.0, " s")


def large() -> Iterator[Row]:
    """Yield what large bodies, their files and their pictures cost."""
    system = block_body(200).condensed().along_friction(1.0)
    start = np.zeros(system.size), FRICTIONS[0]
    curved = partial(trace, system, start, FRICTIONS)
    yield Row("F as parameter, block, 200 nodes, 215 pieces", seconds(curved, 2), 2.0, " s")
    path = CoulombLoad(*strip(330), 0.3)
    graph, *_ = run(path, INTERVAL)
    what = f"a graph of {len(graph.pieces)} pieces, {path.size:,} unknowns"
    with tempfile.TemporaryDirectory() as folder:
        file, picture = Path(folder) / "path.npz", Path(folder) / "path.png"
        yield Row(f"save {what}", seconds(lambda: graph.save(file), 3), 0.2, " s")
        yield Row(f"load {what}", seconds(lambda: BranchGraph.load(file), 3), 0.2, " s")
        yield Row(f"plot {what}", seconds(lambda: drawn(graph, picture), 3), 1.0, " s")
    body = strip(1000)
    most = memory(lambda: CoulombLoad(*body, 0.3), INTERVAL)["MB"]
    yield Row("memory of a strip's path, 1,000 nodes, 1,585 pieces", most, 100.0, " MB")


def slices(largest: int) -> Iterator[Row]:
    """Yield what all solutions at one load cost, of random bodies with friction 4."""
    for p, limit in LOADS:
        if p <= largest:
            spent = max(
                seconds(partial(enumerate_solutions, random_problem(p, k), 0.3), 1) for k in (1, 2)
            )
            yield Row(f"all solutions at one load, {p} nodes", spent, limit, " s")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, default=14)
    parser.add_argument("--into", type=Path, help="a file of data to put the figures into")
    options = parser.parse_args()
    rows: list[Row] = []
    print(".. csv-table::", HEADINGS, "", sep="\n")
    for part in (ratios(), small(), corners(), large(), slices(options.nodes)):
        for row in part:
            print(row.told(), flush=True)
            rows.append(row)
    if options.into:
        store(options.into, limits=[row._asdict() for row in rows])


if __name__ == "__main__":
    main()
