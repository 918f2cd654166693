"""Does the wedge jam on every mesh? The interval with several solutions against mesh size.

``python benchmarks/wedge.py [NODES ...]``: for so many contact nodes on each wall, the pieces of
the branch graph, the interval of alpha with more than one solution, and how many there are.
"""

from __future__ import annotations

import sys
import time

from pwscont_coulomb.elastic.scenes import wedge, wedge_body

from pwscont import explore


def main() -> None:
    """Print the table."""
    print("nodes per wall  unknowns  pieces  from      to        most  seconds")
    for nodes in [int(word) for word in sys.argv[1:]] or [5, 9, 17, 33]:
        body = wedge_body(nodes)
        begin = time.perf_counter()
        graph = explore(body.condensed().along_load(), wedge().interval)
        seconds = time.perf_counter() - begin
        several = [(lo, hi, count) for lo, hi, count in graph.multiplicity() if count > 1]
        lo, hi = several[0][0], several[-1][1]
        most = max(count for *_, count in several)
        print(
            f"{nodes:14d}  {len(body.free):8d}  {len(graph.pieces):6d}  {lo:.6f}  {hi:.6f}  "
            f"{most:4d}  {seconds:7.2f}"
        )


if __name__ == "__main__":
    main()
