"""The plane of two parameters, cut by the loci of all transitions into sectors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.kind import Kind
from pwscont.continuation.plan import Report, silent
from pwscont.curve.metric import Metric
from pwscont.enumeration import solve_slice
from pwscont.graph.presentation import number
from pwscont.system.system import SlicewiseLinearSystem
from pwscont.two_parameters.loci import Locus, follow_transitions, parts_of
from pwscont.two_parameters.plane import Found, Group, Meeting, Plane, Sector, gathered
from pwscont.two_parameters.regions import Region, regions

#: Kinds of special points of loci that get no mark.
UNMARKED = (Kind.START,)


@final
@dataclass(frozen=True, eq=False, repr=False)
class LociPlane(Plane):
    """Loci and sectors in a window of the plane of alpha and mu.

    Attributes
    ----------
    loci : tuple of Locus
    parts : tuple of tuple of LocusPart
        The parts of each locus.
    sectors : tuple of Sector
    mixed : tuple of ndarray, shape (2,)
        Points (alpha, mu) whose solutions lie in other cells than those of the region around them:
        a locus that was not found passes there. Without such points the loci need not be complete:
        three points of each region are tried.
    levels : tuple of float
        Values of mu at which loci were looked for.
    """

    levels: tuple[float, ...] = ()

    @property
    def searched(self) -> str:
        """The values of mu at which loci were looked for, in words."""
        levels = ", ".join(map(number, sorted(self.levels)))
        return f"loci of all transitions at {levels}; solutions at three points of each region"

    @property
    def guarantee(self) -> str:
        """What is known about the completeness of the loci, in words; nothing proves it."""
        if self.mixed:
            return f"a locus is missing near {len(self.mixed)} of the points tried"
        if len(set(self.balances())) > 1:
            return "not balanced: a locus is missing"
        return "balanced; loci that meet none of the values searched may be missing"

    def groups(self) -> Iterator[Group]:
        """Yield the parts of each locus, and why it ends where it does."""
        for i, (locus, some) in enumerate(zip(self.loci, self.parts, strict=True), start=1):
            ends = tuple(
                (np.array([end.z[-1], end.alpha]), end.message)
                for end in locus.graph.special_points("end")
                if end.message != "end of the interval"
            )
            yield Group(f"Locus {i} (test function {locus.system.test})", some, ends)

    def meetings(self) -> Iterator[tuple[Meeting, Array]]:
        """Yield the points of the window at which loci meet or have a kink."""
        (a, b), (c, d) = self.alphas, self.mus
        for locus in self.loci:
            for point in locus.graph.special_points():
                if c < point.alpha < d and a < point.z[-1] < b and point.kind not in UNMARKED:
                    kind = Meeting.KINK if point.kind == Kind.TRANSITION else Meeting.OF_SEVERAL
                    yield kind, np.array([point.z[-1], point.alpha])

    @classmethod
    def between(
        cls,
        family: Callable[[float], SlicewiseLinearSystem],
        alphas: tuple[float, float],
        mus: tuple[float, float],
        levels: Sequence[float],
        *,
        parameter: str = "mu",
        report: Report = silent,
    ) -> LociPlane:
        """Follow all loci that meet some levels, and list the solutions between them.

        A region with different solutions is crossed by a locus that meets no level:
        the values of mu at such points become levels, too.

        Parameters and errors as for :func:`pwscont.two_parameters.loci.follow_transitions`.
        """
        known: list[Locus] = []
        searched = set(levels)
        while True:
            loci = follow_transitions(
                family, alphas, mus, levels, known=known, parameter=parameter, report=report
            )
            plane = replace(cls._cut(family, alphas, mus, loci), levels=tuple(searched))
            if not plane.mixed or len(loci) == len(known):
                return plane
            known, levels = loci, sorted({float(point[1]) for point in plane.mixed})
            searched.update(levels)

    @classmethod
    def _cut(
        cls,
        family: Callable[[float], SlicewiseLinearSystem],
        alphas: tuple[float, float],
        mus: tuple[float, float],
        loci: Sequence[Locus],
    ) -> LociPlane:
        """Return the sectors between loci."""
        parts = tuple(tuple(parts_of(locus)) for locus in loci)
        curves = [part.plane for some in parts for part in some]
        found = regions(curves, alphas, mus)
        sectors = gathered(_sector(family, alphas, region) for region in found)
        mixed = tuple(_mixed(family, alphas, sectors))
        return cls(alphas, mus, parts, sectors, tuple(loci), mixed)


def _sector(
    family: Callable[[float], SlicewiseLinearSystem], alphas: tuple[float, float], region: Region
) -> Sector:
    """Return one region with the solutions in its middle."""
    solutions, faces = _solutions(family, alphas, region.inside)
    return Sector((region,), solutions, math.inf if faces else len(solutions))


def _mixed(
    family: Callable[[float], SlicewiseLinearSystem],
    alphas: tuple[float, float],
    sectors: Sequence[Sector],
) -> Iterator[Array]:
    """Yield points of regions with other solutions than those in their middle."""
    for sector in sectors:
        for point in (point for region in sector.regions for point in region.others):
            solutions, _ = _solutions(family, alphas, point)
            if {found.label for found in solutions} != set(sector.labels):
                yield point


def _solutions(
    family: Callable[[float], SlicewiseLinearSystem], alphas: tuple[float, float], point: Array
) -> tuple[tuple[Found, ...], bool]:
    """Return the isolated solutions at (alpha, mu), and whether whole faces are solutions."""
    alpha, mu = map(float, point)
    system = family(mu)
    found = solve_slice(system, Metric.of(system, alphas), alpha)
    isolated = tuple(
        Found(point.x[:-1], system.label(point.characters[0]), point.det_sign)
        for point in found.points
    )
    return isolated, bool(found.faces)
