"""One transition of a straight path against its limit, in one process.

    python benchmarks/straight.py [--strip 50 200 400] [--string 250 1000 2000] [--lasso 200]
        [--runs 5] [--into docs/data/scale.json]

- strip: contact with friction, dense, against a bare loop (strip_by_hand.py) and against one
  product with the condensed stiffness, the least that any method does that looks at all of it.
- string: an obstacle, Jacobians banded or sparse, against a bare loop with one elimination by
  LAPACK, and one by hand with two calls of ``scipy.linalg.solve_banded`` (obstacle.py).
- LASSO: dense, against ``lars_path`` of scikit-learn, where that is installed (lasso.py).

Every way has to end at the same state after the same number of transitions. The first run of each
is dropped, the others take turns. Printed, as a table of reStructuredText, are the medians in
milliseconds per transition and their ratios. The start of a path counts for neither side, that of
the LASSO for both. Set OPENBLAS_NUM_THREADS=1 where other programs run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from figures import store
from lasso import Lasso, breaks, is_installed
from obstacle import INTERVAL as PRESSED
from obstacle import String, by_hand, solved, solved_at_once
from pwscont_coulomb import CoulombLoad
from scale import INTERVAL, run
from strip import strip
from strip_by_hand import StripByHand

from pwscont import BranchGraph, trace

FRICTION = 0.3
#: Ends and break points agree to this part of the largest.
AGREE = 1e-9
#: Products that are timed together.
PASSES = 100
#: Ratios that are shown: of which to which.
RATIOS = (("trace", "bare"), ("trace", "by hand"), ("trace", "pass"))
WAYS = ("trace", "bare", "by hand", "pass")
HEADINGS = (
    *("path", "size", "transitions", "trace (ms)", "bare (ms)", "by hand (ms)", "one pass (ms)"),
    *(" / ".join(ratio) for ratio in RATIOS),
)


class Run(NamedTuple):
    """What one run gives: milliseconds per transition; their number; where it ends."""

    each: float
    transitions: int | None = None
    end: np.ndarray | None = None


Way = Callable[[], Run]


def measured(ways: dict[str, Way], runs: int) -> dict[str, Any]:
    """Return the median time of each way and the transitions, if all agree."""
    first = [way() for way in ways.values()]
    check(*(found for found in first if found.end is not None))
    rounds = [{name: way().each for name, way in ways.items()} for _ in range(runs)]
    medians = {name: median(each[name] for each in rounds) for name in ways}
    return {"transitions": first[0].transitions} | medians


def check(true: Run, *others: Run) -> None:
    """Refuse to compare ways that do not end at the same state."""
    for other in others:
        if other.transitions != true.transitions:
            raise SystemExit(f"{true.transitions} or {other.transitions} transitions")
        far = np.abs(other.end - true.end).max() / np.abs(true.end).max()
        if not far <= AGREE:
            raise SystemExit(f"the ends differ by {far:.1e} of the largest")


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return a result, and its milliseconds."""
    begin = time.perf_counter()
    result = work()
    return result, 1e3 * (time.perf_counter() - begin)


def traced(system: Any, interval: tuple[float, float]) -> Run:
    """Follow a path from rest; its start does not count."""
    graph, _, marks = run(system, interval)
    spent, transitions = time.perf_counter() - marks[0], len(marks) - 1
    return Run(1e3 * spent / transitions, transitions, ends(graph)[1].z)


def ends(graph: BranchGraph) -> tuple[Any, Any]:
    """Return the special points with the smallest and the largest alpha."""
    points = sorted(graph.special_points(), key=lambda point: point.alpha)
    return points[0], points[-1]


def strip_ways(p: int) -> dict[str, Way]:
    """Return the ways along a strip with p contact nodes."""
    system = CoulombLoad(*strip(p), FRICTION)
    graph, *_ = run(system, INTERVAL)
    start = ends(graph)[0]
    (cell,) = (piece.character for piece in graph.pieces if start.id in (piece.start, piece.end))
    A, x = np.asarray(system.body.A), np.ones(2 * p)

    def bare() -> Run:
        path = StripByHand(system, start.z, cell)
        transitions, spent = timed(path.follow)
        return Run(spent / transitions, transitions, np.concatenate([path.u, path.lam]))

    def one_pass() -> Run:
        return Run(timed(lambda: [A @ x for _ in range(PASSES)])[1] / PASSES)

    return {"trace": partial(traced, system, INTERVAL), "bare": bare, "pass": one_pass}


def string_ways(banded: bool, size: int) -> dict[str, Way]:
    """Return the ways along a string."""
    string = String(size, banded)

    def loop(solve: Callable[..., np.ndarray]) -> Run:
        (transitions, end), spent = timed(partial(by_hand, string, solve))
        return Run(spent / transitions, transitions, end)

    loops = {"bare": partial(loop, solved_at_once), "by hand": partial(loop, solved)}
    return {"trace": partial(traced, string, PRESSED)} | loops


def lasso_ways(size: int) -> dict[str, Way]:
    """Return the ways along the LASSO's path; without scikit-learn there is one."""
    lasso = Lasso(size)

    def follow() -> Run:
        graph, spent = timed(lambda: trace(lasso, (lasso.start, lasso.interval[1]), lasso.interval))
        return broken([point.alpha for point in graph.special_points("transition")], spent)

    def bare() -> Run:
        return broken(*timed(partial(breaks, lasso)))

    return {"trace": follow} | ({"bare": bare} if is_installed() else {})


def broken(alphas: Iterable[float], spent: float) -> Run:
    """Return what a run that broke the path at these alphas gives."""
    found = np.sort(np.asarray(alphas))
    return Run(spent / len(found), len(found), found)


CASES: dict[str, Callable[[int], dict[str, Way]]] = {
    "strip": strip_ways,
    "string, banded": partial(string_ways, True),
    "string, sparse": partial(string_ways, False),
    "LASSO": lasso_ways,
}


def told(row: dict[str, Any]) -> str:
    """Return the line of one row, in reStructuredText."""
    each = (f"{row[way]:.3g}" if way in row else "" for way in WAYS)
    ratios = (_ratio(row[a] / row[b]) if a in row and b in row else "" for a, b in RATIOS)
    return _line(row["path"], f"{row['size']:,}", f"{row['transitions']:,}", *each, *ratios)


def _ratio(value: float) -> str:
    return f"{value:.1f}" if value < 10.0 else f"{value:,.0f}"


def _line(*cells: str) -> str:
    return "   " + ", ".join(f'"{cell}"' for cell in cells)


def rows_of(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the row of each case and size."""
    for path, ways in CASES.items():
        for size in vars(options)[path.split(",")[0].lower()]:
            yield {"path": path, "size": size} | measured(ways(size), options.runs)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strip", type=int, nargs="*", default=[50, 200, 400])
    parser.add_argument("--string", type=int, nargs="*", default=[250, 1000, 2000])
    parser.add_argument("--lasso", type=int, nargs="*", default=[200])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--into", type=Path, help="a file of data to put the figures into")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    print(".. csv-table::", f"   :header: {_line(*HEADINGS).strip()}", "", sep="\n")
    for row in rows_of(options):
        print(told(row), flush=True)
        rows.append(row)
    if options.lasso and not is_installed():
        print("scikit-learn is not installed: nothing beside the LASSO")
    if options.into:
        store(options.into, straight=rows)


if __name__ == "__main__":
    main()
