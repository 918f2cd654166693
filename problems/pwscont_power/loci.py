"""The plane of the loading and a reactive limit: where limits are met, and where the nose is.

While Q_max grows, the loading at which a generator meets Q_max draws a locus, and the loading of
the nose draws a locus, too. A nose that reaches the interface of a limit ends there: beyond, the
limit itself is the largest loading, a limit-induced bifurcation (Dobson and Lu, *Voltage collapse
precipitated by the immediate change in stability when generator reactive power limits are
encountered*, 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import TypeAlias, final

import numpy as np

from pwscont import BranchGraph, FoldLocus, MultiStart, TransitionLocus, explore, trace
from pwscont.extending import Array, Report, Solution, SpecialPoint, dense, uninterrupted
from pwscont_power.flow import PowerFlow

#: Points of a part of a locus, for pictures.
POINTS = 30
#: The search for curves at a level: the curve from equal voltages is most often the only curve.
FEW = MultiStart(count=4)
#: Distance, per unit and in radians, below which two states coincide.
SAME = 1e-6


@final
class Crossing(StrEnum):
    """The behaviour of the loading at a locus."""

    LIMIT = "limit, the loading goes on"
    LIMIT_NOSE = "limit and nose at once"
    NOSE = "nose"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of a locus.

    Attributes
    ----------
    crossing : Crossing
    label : str
        The modes of generators there.
    plane : ndarray, shape (k, 2)
        The points (loading, Q_max) of the part.
    """

    crossing: Crossing
    label: str
    plane: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Loci:
    """All loci of limits and noses that were followed.

    Attributes
    ----------
    graphs : tuple of BranchGraph
        The graph of each locus, with Q_max as parameter and the loading as last unknown.
    parts : tuple of Part
    meetings : ndarray, shape (k, 2)
        The points (loading, Q_max) at which a nose reaches a limit.
    """

    graphs: tuple[BranchGraph, ...]
    parts: tuple[Part, ...]
    meetings: Array


Family: TypeAlias = Callable[[float], PowerFlow]
Range: TypeAlias = tuple[float, float]
Locus: TypeAlias = TransitionLocus | FoldLocus


def follow_loci(
    family: Family, loadings: Range, limits: Range, levels: tuple[float, ...], report: Report
) -> Loci:
    """Follow the limits and noses that :func:`pwscont.explore` finds at some values of Q_max.

    Parameters
    ----------
    family : callable
        Q_max -> PowerFlow.
    loadings, limits : tuple of float
        The window of loading and Q_max.
    levels : tuple of float
        Values of Q_max.
    report : callable
        As for :func:`pwscont.trace`.
    """
    found: list[tuple[Locus, BranchGraph]] = []
    for level in levels:
        system = family(level)
        graph = explore(system, loadings, search=FEW, parameter="lambda", report=report)
        for point in uninterrupted(graph).special_points():
            start = _start(family, system, point, level, loadings)
            if start and not any(_passes(known, *start, level) for known in found):
                locus, y = start
                followed = trace(locus, (y, level), limits, parameter="Q_max", report=report)
                found.append((locus, uninterrupted(followed)))
    meetings = np.array([m for _, graph in found for m in _meetings(graph)]).reshape(-1, 2)
    parts = tuple(part for each in found for part in _parts(*each, meetings[:, 1]))
    return Loci(tuple(graph for _, graph in found), parts, meetings)


def _start(
    family: Family, system: PowerFlow, point: SpecialPoint, level: float, loadings: Range
) -> tuple[Locus, Array] | None:
    """Return the locus of a special point, and a point on the locus; None for ends."""
    if point.kind == "fold":
        noses = FoldLocus(family, level, loadings)
        return noses, noses.start(point.z, point.alpha, level)[0]
    if point.kind not in ("transition", "nonsmooth fold"):
        return None
    test = int(np.argmin(np.abs(system.test_functions(point.z, point.alpha))))
    return TransitionLocus(family, test, level, loadings), np.append(point.z, point.alpha)


def _passes(known: tuple[Locus, BranchGraph], locus: Locus, y: Array, level: float) -> bool:
    """Tell whether a known locus of the same kind passes through y = (z, loading)."""
    other, graph = known
    if type(other) is not type(locus):
        return False
    shown = [*range(locus.family.sample.size), -1]  # without null vectors, which have either sign
    apart = [np.abs(solution.z - y)[shown].max() for solution in graph.solutions(level)]
    return bool(min(apart, default=np.inf) <= SAME)


def _meetings(graph: BranchGraph) -> Iterator[tuple[float, float]]:
    """Yield where a nose ends at the interface of a limit, as (loading, Q_max)."""
    for end in graph.special_points("end"):
        if "reaches the interface" in end.message:
            yield float(end.z[-1]), end.alpha


def _parts(locus: Locus, graph: BranchGraph, cuts: Array) -> Iterator[Part]:
    """Yield the parts of a locus; the locus of a limit is cut where noses meet the locus."""
    for piece in graph.pieces:
        lo, hi = piece.interval
        limits = isinstance(locus, TransitionLocus)
        inner = sorted(cut for cut in cuts if limits and lo < cut < hi)
        for ends in pairwise([lo, *inner, hi]):
            levels = np.linspace(*ends, POINTS)
            found = [s for mu in levels for s in graph.solutions(mu) if s.piece == piece.id]
            plane = np.array([(solution.z[-1], solution.alpha) for solution in found])
            yield Part(_crossing(locus, found[len(found) // 2]), piece.label, plane)


def _crossing(locus: Locus, solution: Solution) -> Crossing:
    """Return the behaviour of the loading: a turn at a limit if det(dH/dz) changes sign."""
    if isinstance(locus, FoldLocus):
        return Crossing.NOSE
    system, z, loading = locus.at(solution.alpha), solution.z[:-1], float(solution.z[-1])
    matrices = (system.jacobian(z, loading, side) for side in locus.sides(solution.character))
    one, other = (np.linalg.slogdet(dense(matrix)[:, :-1])[0] for matrix in matrices)
    return Crossing.LIMIT if one == other else Crossing.LIMIT_NOSE
