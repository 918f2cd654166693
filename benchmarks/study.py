"""What a study costs beside its cases, and what a second process brings.

    python benchmarks/study.py [--cases 2000] [--many 100000] [--dask]

Example 1 over friction and the angle of the load, by one process and by two in turn: the ratio of
the times, and what it would be on idle processors, by the work that these do for either. And cases
that cost nothing: the time of each, and how the memory of the process grows with their number. Only
ratios and counts mean something: the machine's speed is in all else.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.scenes import fig7, two_nodes

from pwscont import BranchGraph, PiecewiseSystem, Study, explore

ROUNDS = 4
INTERVAL = (-8.0, 2.0)


def example1(friction: float, angle: float) -> tuple[PiecewiseSystem, tuple[float, float]]:
    """Return Example 1, whose growing load is turned by an angle, in degrees."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    load = AffineLoad([0.4, 0.0, 1.8, 0.0], [s, c, 0.2 * c + s, c])
    return CoulombLoad(two_nodes(), load, friction), INTERVAL


def cases(count: int) -> Iterator[Study]:
    """Yield studies of Example 1 that make up one of so many cases."""
    frictions = np.linspace(0.5, 5.0, max(count // 40, ROUNDS))
    for some in np.array_split(frictions, ROUNDS):
        over = {"friction": some, "angle": np.linspace(-40.0, 40.0, 40)}
        yield Study(example1, over, ["max-count", "first-fold"])


def processor() -> float:
    """Return the seconds that processors have worked for this process and its children."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def timed(study: Study, workers: int) -> tuple[float, float, list[object]]:
    """Return the seconds of a study, those of processors, and its rows."""
    begin, worked = time.perf_counter(), processor()
    result = study.run(workers)
    seconds = time.perf_counter() - begin
    return seconds, processor() - worked, [row.numbers for row in result]


def compare(count: int) -> None:
    """Print what two processes bring, and what they would on processors of their own."""
    times, works, same = [], [], True
    for study in cases(count):
        (one, work, rows), (two, more_work, others) = timed(study, 1), timed(study, 2)
        times.append(one / two)
        works.append(2.0 * work / more_work)
        same &= rows == others
        print(f"  {len(study)} cases: {one:.1f} s and {two:.1f} s, ratio {one / two:.2f}")
    print(
        f"two processes: {statistics.median(times):.2f} times as fast as one; "
        f"{statistics.median(works):.2f} by the work of the processors; rows are the same: {same}"
    )


@cache
def graph() -> BranchGraph:
    """Return a graph that costs nothing the second time."""
    return explore(fig7().system, (-2.0, 2.0))


def over_many(count: int) -> dict[str, range]:
    """Return settings with so many combinations."""
    return {"number": range(max(count // 100, 1)), "further": range(min(count, 100))}


def known(number: int, further: int) -> BranchGraph:
    """Return the same graph for every case."""
    return graph()


def constant(graph: BranchGraph) -> int:
    """Measure nothing."""
    return 1


def megabytes() -> float:
    """Return the most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def overhead(many: int) -> None:
    """Print time and memory of cases that cost nothing."""
    _ = graph().guarantee
    for count in (many // 100, many // 10, many):
        with tempfile.TemporaryDirectory() as directory:
            study = Study(known, over_many(count), {"one": constant})
            begin = time.perf_counter()
            result = study.run(store=Path(directory, "study.db"))
            each = (time.perf_counter() - begin) / count
            assert len(result) == count
            result.close()
        print(f"{count} cases in a store: {1e3 * each:.3f} ms each, {megabytes():.1f} MB at most")


def on_dask(count: int = 2000) -> None:
    """Print the time of a case that costs nothing on a cluster of this machine."""
    from distributed import LocalCluster  # noqa: PLC0415  optional

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        study = Study(known, over_many(count), {"one": constant})
        begin = time.perf_counter()
        study.run(scheduler=cluster.scheduler_address)
        print(f"on Dask: {1e3 * (time.perf_counter() - begin) / count:.2f} ms each")


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--many", type=int, default=100_000)
    parser.add_argument("--dask", action="store_true")
    options = parser.parse_args()
    overhead(options.many)
    if options.dask:
        on_dask()
    compare(options.cases)


if __name__ == "__main__":
    main()
