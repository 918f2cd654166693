"""Random curved systems against closed forms: no step may jump, nothing be wrong unsaid.

    python benchmarks/curved_sweep.py [--family NAME ...] [--count N] [--seed S] [--workers W]
    python benchmarks/curved_sweep.py --family NAME --seed S --only NUMBER      one case again

Prints for each family how many cases were

right     every count, solution, fold and transition agrees with the truth
said so   something is left out, and the graph stops there, is not balanced, or was refused
unfound   whole components are left out that the guarantee does not promise ("balanced" promises
          nothing, "complete but for closed loops" no loops)
missed    a cell thinner than a step was passed unseen, all else is right: a statement, no fault
wrong     anything else: a wrong or missing solution without a word, a point that is not there,
          equal solutions, an exception, a hang

and in how many of all these the system was asked outside the interval of alpha; then each case
that is wrong or asked outside, with its parameters. Exit status 1 if there is any.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from curved.families import FAMILIES, case_of
from curved.judge import Verdict, judge

WORDS = ("right", "said so", "unfound", "missed", "wrong")


class Row(NamedTuple):
    """A case that was judged."""

    family: str
    number: int
    parameters: dict[str, Any]
    width: float | None
    verdict: Verdict


def judged(number: int, family: str, seed: int, limit: float) -> Row:
    """Return what came of one case."""
    case, rng = case_of(family, seed, number)
    verdict = judge(case, rng, limit)
    return Row(family, number, case.parameters, case.width, verdict)


def rows(family: str, numbers: range, seed: int, limit: float, workers: int) -> Iterator[Row]:
    """Yield the cases of a family, in order."""
    one = partial(judged, family=family, seed=seed, limit=limit)
    if workers == 1:
        yield from map(one, numbers)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(one, numbers, chunksize=4)


def plain(value: Any) -> Any:
    """Return drawn parameters as Python's own numbers, lists and so on."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return type(value)(plain(item) for item in value)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def show(row: Row, seed: int) -> None:
    """Print a case so that it can be run again."""
    verdict = row.verdict
    print(f"  {verdict.word}: --family {row.family} --seed {seed} --only {row.number}")
    print(f"    {plain(row.parameters)}")
    print(f"    guarantee: {verdict.guarantee}, {verdict.seconds:.2f} s")
    for reason, example in verdict.reasons.items():
        print(f"    {reason}: {example[:240]}")


def summary(family: str, done: list[Row]) -> None:
    """Print how many cases came out how, the reasons, and the times."""
    words = Counter(row.verdict.word for row in done)
    seconds = np.array([row.verdict.seconds for row in done])
    outside = sum(row.verdict.is_outside for row in done)
    counts = "".join(f"{words[word]:9d}" for word in WORDS)
    print(
        f"{family:12s}{len(done):7d}{counts}{outside:9d}{seconds.sum():10.1f}{seconds.max():9.2f}"
    )
    for word in WORDS:
        reasons = Counter(
            r for row in done if row.verdict.word == word for r in row.verdict.reasons
        )
        if reasons:
            print(f"    {word}: " + ", ".join(f"{r} {n}" for r, n in reasons.most_common()))


def thin_table(done: list[Row]) -> None:
    """Print the share of thin cells that were seen, by their width."""
    tried = [row for row in done if row.width is not None and row.verdict.word != "wrong"]
    for low in range(-6, 0):
        of_width = [row for row in tried if 10.0**low <= (row.width or 0.0) < 10.0 ** (low + 1)]
        if of_width:
            seen = sum(
                not any(r.startswith("thin") for r in row.verdict.reasons) for row in of_width
            )
            print(f"    cells 1e{low} to 1e{low + 1} wide: all seen in {seen} of {len(of_width)}")


def arguments() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--family", action="append", choices=list(FAMILIES), help="default all")
    parser.add_argument("--count", type=int, default=400, help="cases per family")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", type=int, help="one case, shown whatever comes of it")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=20.0, help="seconds of CPU per case")
    parser.add_argument("--quiet", action="store_true", help="show no single cases")
    return parser.parse_args()


def main() -> int:
    """Run, print, and return the exit status."""
    given = arguments()
    numbers = range(given.first, given.first + given.count)
    if given.only is not None:
        numbers = range(given.only, given.only + 1)
    words = "".join(f"{word:>9s}" for word in (*WORDS, "outside"))
    print(f"{'family':12s}{'cases':>7s}{words}{'seconds':>10s}{'longest':>9s}")
    faults = 0
    for family in given.family or FAMILIES:
        done = list(rows(family, numbers, given.seed, given.limit, given.workers))
        summary(family, done)
        thin_table(done)
        bad = [row for row in done if row.verdict.is_fault]
        faults += len(bad)
        for row in done if given.only is not None else bad:
            if not given.quiet:
                show(row, given.seed)
        sys.stdout.flush()
    print(f"{faults} faults")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
