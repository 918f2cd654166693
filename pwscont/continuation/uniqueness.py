"""The promise that there is at most one solution at every alpha, checked on a graph."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.basics.rounding import CONFIDENCE
from pwscont.graph import BranchGraph
from pwscont.graph.records import Solution


def unique(searched: SearchScope) -> SearchScope:
    """Return what a search promises of a system that has one solution at most."""
    what = f"{searched.what}; at most one solution, by the system's promise"
    return replace(searched, what=what, promise=Guarantee.UNIQUE)


def check_unique(graph: BranchGraph) -> None:
    """Refuse a graph with two different solutions at one alpha.

    Raises
    ------
    InvalidSystemError
        Naming both solutions.
    """
    breaks = graph.breaks()
    for alpha in [*breaks, *(0.5 * (lo + hi) for lo, hi in pairwise(breaks))]:
        if graph.count(alpha) > 1:
            _check_at(graph, alpha)


def _check_at(graph: BranchGraph, alpha: float) -> None:
    for first, second in combinations(graph.solutions(alpha), 2):
        if _differ(first, second):
            raise InvalidSystemError(
                f"{type(graph.system).__name__}.unique promises one solution at one "
                f"{graph.parameter}, but there are two at {graph.parameter} = {alpha:.10g}: "
                f"{first!r} and {second!r}; set unique = False"
            )


def _differ(first: Solution, second: Solution) -> bool:
    """Tell whether two solutions are apart by more than their errors."""
    apart = np.abs(first.z - second.z)
    errors = (first.error + second.error)[:-1] if len(first.error) else np.zeros_like(apart)
    return bool((apart > CONFIDENCE * errors).any())
