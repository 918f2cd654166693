"""The plane of two parameters, cut into sectors: what all such planes can be asked."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.looks import UNNAMED, counted, named, short, state
from pwscont.two_parameters.loci import SAME_LOCUS, Locus, LocusPart, Passing
from pwscont.two_parameters.regions import Region, area_and_centre


@final
class Meeting(StrEnum):
    """The kind of a point at which a locus does not simply go on."""

    OF_SEVERAL = "loci meet"
    KINK = "kink of a locus"


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
class Group:
    """Curves between sectors that belong together, as a reader sees them.

    Attributes
    ----------
    heading : str
    parts : tuple of LocusPart
    ends : tuple of (ndarray, str)
        Points (alpha, mu) at which a curve ends within the window, and why.
    """

    heading: str
    parts: tuple[LocusPart, ...]
    ends: tuple[tuple[Array, str], ...] = ()

    def __repr__(self) -> str:
        return named(self, self.heading, counted(len(self.parts), "part"))


@dataclass(frozen=True, eq=False)
class Plane(ABC):
    """A window of the plane of alpha and mu: what bounds its sectors, and their solutions.

    Attributes
    ----------
    alphas, mus : tuple of float
        The window.
    parts : tuple of tuple of LocusPart
        The curves between sectors, those that belong together together.
    sectors : tuple of Sector
    """

    alphas: tuple[float, float]
    mus: tuple[float, float]
    parts: tuple[tuple[LocusPart, ...], ...]
    sectors: tuple[Sector, ...]

    #: The loci that were followed; none where sectors were not found by loci.
    loci: tuple[Locus, ...] = ()
    #: Points (alpha, mu) whose solutions lie in other cells than those of the region around them.
    mixed: tuple[Array, ...] = ()
    #: What else a reader should know, each a line.
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        axes = zip(("alpha", "mu"), (self.alphas, self.mus), strict=True)
        window = [f"{axis} in [{lo:.6g}, {hi:.6g}]" for axis, (lo, hi) in axes]
        edges = sum(map(len, self.parts))
        sizes = [f"{len(self.loci)} loci"] if self.loci else [counted(edges, "edge")]
        return named(self, *window, *sizes, counted(len(self.sectors), "sector"))

    @property
    @abstractmethod
    def searched(self) -> str:
        """What was searched, in words."""

    @property
    @abstractmethod
    def guarantee(self) -> str:
        """What is known about the completeness of regions and solutions, in words."""

    @abstractmethod
    def proof(self, region: Region) -> str:
        """Return what is proven about the solutions in a region, in words."""

    @abstractmethod
    def groups(self) -> Iterator[Group]:
        """Yield the parts under their headings."""

    @abstractmethod
    def meetings(self) -> Iterator[tuple[Meeting, Array]]:
        """Yield the points (alpha, mu) of the window at which loci meet or have a kink."""

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


def gathered(sectors: Iterable[Sector]) -> tuple[Sector, ...]:
    """Return sectors of one region each, those with solutions in the same cells as one."""
    together: dict[tuple[str, ...], list[Sector]] = {}
    for sector in sorted(sectors, key=lambda s: -area_and_centre(s.regions[0].polygon)[0]):
        together.setdefault(tuple(sorted(sector.labels)), []).append(sector)
    return tuple(
        Sector(tuple(s.regions[0] for s in some), some[0].solutions, some[0].count)
        for some in together.values()
    )
