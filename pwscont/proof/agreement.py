"""A branch graph, compared with what is proved: the words of ``graph.guarantee``."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONFIDENCE
from pwscont.system.box import Box

if TYPE_CHECKING:
    from pwscont.graph import BranchGraph

#: A solution of the graph is a proved solution if closer than this part of a typical magnitude, or
#: of the solution, or closer than the errors.
CLOSE = 1e-6


def judged(proof: Any, graph: BranchGraph, words: str) -> str:
    """Return the guarantee of a graph with what is proved, from the guarantee without."""
    wrong = next(disagreements(proof, graph), None)
    if wrong is not None:
        alpha, count, found = wrong
        return (
            f"{count} solutions proved in the box at {graph.parameter} = {alpha:.8g}, but "
            f"{found} of them found; {words}"
        )
    return f"{proof.words}; {words}" if proof.holds else f"{words}; {proof.words}"


def disagreements(proof: Any, graph: BranchGraph) -> Iterator[tuple[float, int, int]]:
    """Yield where a graph has not the proved solutions: alpha, and the numbers proved and found."""
    middles = [0.5 * (lo + hi) for lo, hi in pairwise(graph.breaks())]
    for alpha in [*(each.alpha for each in proof.stretches), *middles]:
        count = proof.count(alpha)
        if count is None:
            continue
        found = _inside(proof, graph, alpha)
        if len(found) != count or not _are_matched(proof, alpha, found):
            yield alpha, count, len(found)


def _inside(proof: Any, graph: BranchGraph, alpha: float) -> list[tuple[Array, Array]]:
    """Return the solutions of a graph in the box, with their errors."""
    lower, upper = proof.box
    own = Box.of(graph.system) if graph.system is not None else None
    found = []
    for solution in graph.solutions(alpha):
        z, error = solution.z, solution.error[: len(solution.z)]
        if own is not None and own.is_periodic:
            z = own.wrapped(np.append(z, np.zeros(len(own.period) - len(z))))[: len(z)]
        if ((z >= lower) & (z <= upper)).all():
            found.append((z, error if len(error) else np.zeros_like(z)))
    return found


def _are_matched(proof: Any, alpha: float, found: list[tuple[Array, Array]]) -> bool:
    """Tell whether every proved solution is one of the solutions found."""
    proved = proof.solutions(alpha) or ()
    return all(any(_is_close(lo, hi, *each) for each in found) for lo, hi in proved)


def _is_close(lo: Array, hi: Array, z: Array, error: Array) -> bool:
    """Tell whether a solution found may be the solution between lo and hi."""
    slack = (hi - lo) + CONFIDENCE * error + CLOSE * (1.0 + np.abs(z))
    return bool((np.abs(z - 0.5 * (lo + hi)) <= slack).all())
