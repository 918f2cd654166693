"""The plane of two parameters, cut by the loci of all transitions into sectors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.looks import UNNAMED, counted, named, short, state
from pwscont.continuation.plan import Report, silent
from pwscont.curve.metric import Metric
from pwscont.enumeration import solve_slice
from pwscont.graph.presentation import number
from pwscont.system.system import SlicewiseLinearSystem
from pwscont.two_parameters.loci import (
    SAME_LOCUS,
    Locus,
    LocusPart,
    Passing,
    follow_transitions,
    parts_of,
)
from pwscont.two_parameters.regions import Region, area_and_centre, regions


@final
@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A solution in the middle of a region.

    Attributes
    ----------
    z : ndarray, shape (n,)
    label : str
    det_sign : int
        Sign of det(dH/dz).
    """

    z: Array
    label: str
    det_sign: int

    def __repr__(self) -> str:
        return named(self, short(self.label), f"det {self.det_sign:+d}", state(UNNAMED, self.z))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sector:
    """All regions whose solutions lie in the same cells.

    Attributes
    ----------
    regions : tuple of Region
        The largest first.
    solutions : tuple of Found
        In the middle of the largest region.
    count : int or float
        Number of solutions; infinite where whole faces are solutions.
    """

    regions: tuple[Region, ...]
    solutions: tuple[Found, ...]
    count: int | float

    def __repr__(self) -> str:
        return named(self, counted(len(self.regions), "region"), counted(self.count, "solution"))

    @property
    def labels(self) -> tuple[str, ...]:
        """The cells of the solutions."""
        return tuple(found.label for found in self.solutions)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """Loci and sectors in a window of the plane of alpha and mu.

    Attributes
    ----------
    alphas, mus : tuple of float
        The window.
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

    alphas: tuple[float, float]
    mus: tuple[float, float]
    loci: tuple[Locus, ...]
    parts: tuple[tuple[LocusPart, ...], ...]
    sectors: tuple[Sector, ...]
    mixed: tuple[Array, ...] = ()
    levels: tuple[float, ...] = ()

    def __repr__(self) -> str:
        axes = zip(("alpha", "mu"), (self.alphas, self.mus), strict=True)
        window = [f"{axis} in [{lo:.6g}, {hi:.6g}]" for axis, (lo, hi) in axes]
        sizes = [f"{len(self.loci)} loci", counted(len(self.sectors), "sector")]
        return named(self, *window, *sizes)

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
    ) -> Plane:
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
    ) -> Plane:
        """Return the sectors between loci."""
        parts = tuple(tuple(parts_of(locus)) for locus in loci)
        curves = [part.plane for some in parts for part in some]
        sectors = tuple(_sectors(family, alphas, regions(curves, alphas, mus)))
        return cls(alphas, mus, tuple(loci), parts, sectors, tuple(_mixed(family, alphas, sectors)))

    @property
    def lowest_folds(self) -> list[Array]:
        """The points (z, alpha, mu) with the smallest mu at which alpha turns.

        Two loci begin to be folds at one point of the plane; it is listed once.
        """
        folds = [s.lowest for some in self.parts for s in some if s.crossing is Passing.FOLD]
        lowest = min((float(x[-1]) for x in folds), default=math.inf)
        scale = np.array([np.ptp(self.alphas), np.ptp(self.mus)])
        tips: list[Array] = []
        for x in folds:
            known = any((np.abs(x - tip)[-2:] <= SAME_LOCUS * scale).all() for tip in tips)
            if x[-1] - lowest <= SAME_LOCUS * scale[1] and not known:
                tips.append(x)
        return tips

    def most_solutions(self) -> list[tuple[float, float, int | float]]:
        """Return (lo, hi, count): for mu in between, the most solutions that an alpha has."""
        spans = [(*_span(r), s.count) for s in self.sectors for r in s.regions]
        heights = sorted({mu for lo, hi, _ in spans for mu in (lo, hi)})
        table: list[tuple[float, float, int | float]] = []
        for lo, hi in pairwise(heights):
            most = max(count for a, b, count in spans if a <= lo and hi <= b)
            begin = table.pop()[0] if table and table[-1][2] == most else lo
            table.append((begin, hi, most))
        return table

    def balances(self) -> list[int]:
        """Return the sum of the signs of det(dH/dz) over the solutions of each finite sector."""
        finite = [sector for sector in self.sectors if math.isfinite(sector.count)]
        return [sum(found.det_sign for found in sector.solutions) for sector in finite]


def _span(region: Region) -> tuple[float, float]:
    mus = region.polygon[:, 1]
    return float(mus.min()), float(mus.max())


def _sectors(
    family: Callable[[float], SlicewiseLinearSystem],
    alphas: tuple[float, float],
    found: list[Region],
) -> list[Sector]:
    """Return the regions, those with solutions in the same cells together."""
    together: dict[tuple[str, ...], list[Sector]] = {}
    for region in sorted(found, key=lambda r: -area_and_centre(r.polygon)[0]):
        sector = _sector(family, alphas, region)
        together.setdefault(tuple(sorted(sector.labels)), []).append(sector)
    return [
        Sector(tuple(s.regions[0] for s in some), some[0].solutions, some[0].count)
        for some in together.values()
    ]


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
