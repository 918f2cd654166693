"""The plane of two parameters, cut by the loci of all transitions into sectors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import TypeAlias, final

import numpy as np

from pwscont import SlicewiseLinearSystem, enumerate_solutions
from pwscont.extending import Array, Kind, Report, number, silent
from pwscont.two_parameters.loci import Locus, LocusPart, follow_transitions, parts_of
from pwscont.two_parameters.plane import (
    Found,
    Group,
    Meeting,
    Plane,
    Region,
    Sector,
    gathered,
    regions,
)

#: mu -> a system whose solutions at a value of alpha can be enumerated.
MakeLinear: TypeAlias = Callable[[float], SlicewiseLinearSystem]
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
        Tried points (alpha, mu) whose solutions lie in different cells, or have other determinant
        signs, than the solutions of the region: near such a point passes a locus that was not
        found, or a solution runs to infinity. Without mixed points the loci may still be
        incomplete, for only a few points of each region are tried.
    levels : tuple of float
        Values of mu at which loci were looked for.
    proven : tuple of int
        For each region, in the order of the sectors, the number of points at which enumeration
        proves the number of solutions, 0 if enumeration proves nothing at a point. The points lie
        in the middle and beside the lowest, highest, left and right edges of the region. A locus
        can still cross the region between these points if the locus meets no level.
    """

    levels: tuple[float, ...] = ()
    proven: tuple[int, ...] = ()

    @property
    def searched(self) -> str:
        """The values of mu at which loci were looked for, in words."""
        levels = ", ".join(map(number, sorted(self.levels)))
        return f"loci of all transitions at {levels}; solutions in each region and along its edges"

    @property
    def guarantee(self) -> str:
        """The guarantee of completeness of the loci, in words; completeness is never proven."""
        if self.mixed:
            return (
                f"a locus is missing, or solutions run to infinity, near {len(self.mixed)} of the "
                "points tried"
            )
        if len(set(self.balances())) > 1:
            return "not balanced: a locus is missing"
        number = sum(map(bool, self.proven))
        regions = f"{len(self.proven)} regions of {len(self.sectors)} sectors"
        return (
            f"balanced; {number} of {regions} proven at the points tried; "
            "loci that meet none of the values searched may be missing"
        )

    def proof(self, region: Region) -> str:
        """Return in words whether enumeration proves the number of solutions of a region."""
        regions = [known for sector in self.sectors for known in sector.regions]
        points = next(n for known, n in zip(regions, self.proven, strict=True) if known is region)
        return f"proven at {points} points" if points else "not proven"

    def groups(self) -> Iterator[Group]:
        """Yield the parts of each locus, with the reasons for ends inside the window."""
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
        family: MakeLinear,
        alphas: tuple[float, float],
        mus: tuple[float, float],
        levels: Sequence[float],
        *,
        parameter: str = "mu",
        report: Report = silent,
    ) -> LociPlane:
        """Return the plane of all loci that meet given levels, with the solutions in between.

        A region with mixed points is crossed by a locus that meets no level: the values of mu at
        mixed points become levels, too.

        Parameters and errors as for :func:`pwscont.two_parameters.loci.follow_transitions`.
        """
        known: list[Locus] = []
        parts: list[tuple[LocusPart, ...]] = []
        searched = set(levels)
        while True:
            loci = follow_transitions(
                family, alphas, mus, levels, known=known, parameter=parameter, report=report
            )
            parts += [tuple(parts_of(locus)) for locus in loci[len(known) :]]
            plane = replace(cls._cut(family, (alphas, mus), loci, parts), levels=tuple(searched))
            if not plane.mixed or len(loci) == len(known):
                return plane
            known, levels = loci, sorted({float(point[1]) for point in plane.mixed})
            searched.update(levels)

    @classmethod
    def _cut(
        cls,
        family: MakeLinear,
        window: tuple[tuple[float, float], tuple[float, float]],
        loci: Sequence[Locus],
        parts: Sequence[tuple[LocusPart, ...]],
    ) -> LociPlane:
        """Return the plane that loci cut into sectors."""
        curves = [part.plane for some in parts for part in some]
        found = regions(curves, *window)
        tried = [_Tried.of(family, region) for region in found]
        sectors = gathered(one.sector for one in tried)
        mixed = tuple(point for one in tried for point in one.mixed)
        proven = {id(one.sector.regions[0]): one.points for one in tried}
        points = tuple(proven[id(r)] for s in sectors for r in s.regions)
        return cls(*window, tuple(parts), sectors, tuple(loci), mixed, proven=points)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Tried:
    """The result of enumeration at the points of a region.

    Attributes
    ----------
    sector : Sector
        The region, with the solutions in the middle of the region.
    mixed : tuple of ndarray, shape (2,)
        The points whose solutions lie in different cells than the solutions in the middle.
    points : int
        The number of points if the number of solutions is proven at all points; else 0.
    """

    sector: Sector
    mixed: tuple[Array, ...]
    points: int

    @classmethod
    def of(cls, family: MakeLinear, region: Region) -> _Tried:
        """Return the result of enumeration at all points of a region."""
        here, is_finite, surely = _solutions(family, region.inside)
        sector = Sector((region,), here, len(here) if is_finite else math.inf)
        kinds, mixed = _kinds(here), []
        for point in region.others:
            there, _, sure = _solutions(family, point)
            surely &= sure
            if _kinds(there) != kinds:
                mixed.append(point)
        points = 1 + len(region.others)
        return cls(sector, tuple(mixed), points if surely and not mixed else 0)


def _kinds(solutions: Sequence[Found]) -> set[tuple[str, int]]:
    return {(found.label, found.det_sign) for found in solutions}


def _solutions(family: MakeLinear, point: Array) -> tuple[tuple[Found, ...], bool, bool]:
    """Return the isolated solutions at (alpha, mu), whether no others exist, whether proven."""
    alpha, mu = map(float, point)
    found = enumerate_solutions(family(mu), alpha)
    is_isolated = (found.is_finite or one.kind != Kind.DEGENERATE for one in found)
    isolated = compress(found, is_isolated)
    points = tuple(Found(one.z, one.label, one.det_sign) for one in isolated)
    is_sure = found.is_finite and found.guarantee.startswith("complete")
    return points, found.is_finite, is_sure
