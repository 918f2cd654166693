"""The plane of two parameters, cut into regions.

Horizontal lines through all vertices and crossings of the curves cut the plane into slabs. Within a
slab no curve begins, ends or crosses another curve, so a slab is a row of trapezoids (Preparata and
Shamos 1985, section 2.2). Trapezoids of successive slabs between the same two curves make a region,
whose solutions are enumerated at a point.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations, pairwise
from typing import final

import numpy as np

from pwscont.extending import EPS, Array, Quantities, counted, named, short
from pwscont.two_parameters.loci import SAME_LOCUS, Locus, LocusPart, Passing

#: Slabs and trapezoids thinner than this part of the window are left out: half of the digits.
THIN = EPS**0.5
#: Distance of points beside an edge from the edge, as a part of the window: the edge is a polyline,
#: whose chords are not exact.
BESIDE = 5e-4
#: Distance of the lowest and of the highest point from the edge, as a part of the height there.
LOW = 0.02


@final
@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A part of the plane between two curves.

    Attributes
    ----------
    polygon : ndarray, shape (k, 2)
        Corners (alpha, mu).
    inside : ndarray, shape (2,)
        A point in the middle of the widest part of the region.
    others : ndarray, shape (k, 2)
        More points: beside the lowest, highest, left and right edges.
    """

    polygon: Array
    inside: Array
    others: Array

    def __repr__(self) -> str:
        alpha, mu = self.inside
        corners = counted(len(self.polygon), "corner")
        return named(self, f"around alpha={alpha:.6g}, mu={mu:.6g}", corners)


def regions(
    curves: Sequence[Array], alphas: tuple[float, float], mus: tuple[float, float]
) -> list[Region]:
    """Return the regions into which curves cut a rectangle.

    Parameters
    ----------
    curves : sequence of ndarray, shape (k, 2)
        Polylines (alpha, mu) with increasing mu.
    alphas, mus : tuple of float
        The rectangle.

    Returns
    -------
    list of Region
        Regions that fill the rectangle; adjacent regions may have the same solutions.
    """
    growing: dict[tuple[int, int], list[_Trapezoid]] = {}
    finished: list[list[_Trapezoid]] = []
    for below, above in pairwise(_levels(curves, mus)):
        row = {t.between: t for t in _row(curves, alphas, (below, above))}
        finished += [chain for key, chain in growing.items() if key not in row]
        growing = {key: [*growing.get(key, []), t] for key, t in row.items()}
    beside = BESIDE * (alphas[1] - alphas[0])
    return [_region(chain, beside) for chain in [*finished, *growing.values()]]


@final
@dataclass(frozen=True, slots=True)
class _Trapezoid:
    """The part of a slab between two neighbouring curves, -1 and -2 for the window's sides."""

    between: tuple[int, int]
    mus: tuple[float, float]
    left: Array
    right: Array

    @property
    def widths(self) -> Array:
        return self.right - self.left

    @property
    def middle(self) -> Array:
        return np.array([0.25 * (self.left + self.right).sum(), 0.5 * sum(self.mus)])

    def at(self, part: float, distance: float) -> Array:
        """Return the middle at a part of the height, at half the height if too narrow."""
        if np.interp(part, (0.0, 1.0), self.widths) < 4.0 * distance:
            return self.middle
        alphas = 0.5 * (self.left + self.right)
        return np.array([np.interp(part, (0.0, 1.0), each) for each in (alphas, self.mus)])

    def beside(self, distance: float) -> list[Array]:
        """Return the middles of the left and right side, moved inwards; none if too narrow."""
        if self.widths.mean() < 4.0 * distance:
            return []
        mu = 0.5 * sum(self.mus)
        alphas = self.left.mean() + distance, self.right.mean() - distance
        return [np.array([alpha, mu]) for alpha in alphas]


def _levels(curves: Sequence[Array], mus: tuple[float, float]) -> list[float]:
    """Return the heights mu of all vertices and crossings, without repetition."""
    lo, hi = mus
    vertices = [float(mu) for curve in curves for mu in curve[:, 1]]
    heights = sorted([*vertices, *_crossings(curves), hi])
    levels = [lo]
    for mu in heights:
        if lo < mu <= hi and mu - levels[-1] > THIN * (hi - lo):
            levels.append(mu)
    return [*levels[:-1], hi]


def _crossings(curves: Sequence[Array]) -> Iterator[float]:
    """Yield the heights mu at which two polylines cross."""
    for one, other in combinations(curves, 2):
        heights = np.union1d(one[:, 1], other[:, 1])
        lo, hi = max(one[0, 1], other[0, 1]), min(one[-1, 1], other[-1, 1])
        heights = heights[(heights >= lo) & (heights <= hi)]
        gaps = _at(one, heights) - _at(other, heights)
        for i in np.flatnonzero(gaps[:-1] * gaps[1:] < 0.0):
            part = gaps[i] / (gaps[i] - gaps[i + 1])
            yield float(heights[i] + part * (heights[i + 1] - heights[i]))


def _at(curve: Array, mu: Array) -> Array:
    """Return alpha of a polyline at heights mu."""
    return np.interp(mu, curve[:, 1], curve[:, 0])


def _row(
    curves: Sequence[Array], alphas: tuple[float, float], mus: tuple[float, float]
) -> Iterator[_Trapezoid]:
    """Yield the trapezoids of a slab from left to right."""
    ends, middle = np.array(mus), 0.5 * sum(mus)
    lines = [(-1, np.full(2, alphas[0])), (-2, np.full(2, alphas[1]))]
    lines += [
        (i, np.clip(_at(curve, ends), *alphas))
        for i, curve in enumerate(curves)
        if curve[0, 1] < middle < curve[-1, 1]
    ]
    lines.sort(key=lambda line: float(line[1].sum()))
    for (i, left), (j, right) in pairwise(lines):
        if (right - left).sum() > THIN * (alphas[1] - alphas[0]):
            yield _Trapezoid((i, j), mus, left, right)


def _region(chain: list[_Trapezoid], beside: float) -> Region:
    """Return the region of a chain of trapezoids, joined from bottom to top."""
    widest = max(chain, key=lambda t: float(t.widths.sum()))
    left = [(t.left[0], t.mus[0]) for t in chain] + [(chain[-1].left[1], chain[-1].mus[1])]
    right = [(t.right[0], t.mus[0]) for t in chain] + [(chain[-1].right[1], chain[-1].mus[1])]
    tried = {id(trapezoid): trapezoid for trapezoid in (chain[0], widest, chain[-1])}.values()
    others = [chain[0].at(LOW, beside), chain[-1].at(1.0 - LOW, beside)]
    others += [x for t in tried for x in t.beside(beside)]
    return Region(np.array([*left, *right[::-1]]), widest.middle, np.array(others))


def area_and_centre(polygon: Array) -> tuple[float, Array]:
    """Return the area and the centroid of a polygon, shape (k, 2)."""
    x, y = (polygon - polygon[0]).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = 0.5 * float(cross.sum())
    centre = np.array(
        [((x + np.roll(x, -1)) * cross).sum(), ((y + np.roll(y, -1)) * cross).sum()]
    ) / (6.0 * area)
    return abs(area), polygon[0] + centre


@final
class Meeting(StrEnum):
    """The kinds of points at which loci meet or have a kink."""

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
        return named(
            self, short(self.label), f"det {self.det_sign:+d}", Quantities().in_words(self.z)
        )


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sector:
    """All regions whose solutions lie in the same cells.

    Attributes
    ----------
    regions : tuple of Region
        The regions, the largest first.
    solutions : tuple of Found
        The solutions in the middle of the largest region.
    count : int or float
        Number of solutions; infinite if whole faces are solutions.
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
    """Curves between sectors that a table lists under a common heading.

    Attributes
    ----------
    heading : str
    parts : tuple of LocusPart
    ends : tuple of (ndarray, str)
        Points (alpha, mu) at which a curve ends within the window, and the reasons.
    """

    heading: str
    parts: tuple[LocusPart, ...]
    ends: tuple[tuple[Array, str], ...] = ()

    def __repr__(self) -> str:
        return named(self, self.heading, counted(len(self.parts), "part"))


@dataclass(frozen=True, eq=False)
class Plane(ABC):
    """A window of the plane of alpha and mu, cut into sectors, with the solutions of each sector.

    Attributes
    ----------
    alphas, mus : tuple of float
        The window.
    parts : tuple of tuple of LocusPart
        The curves between sectors, in groups that belong together.
    sectors : tuple of Sector
    """

    alphas: tuple[float, float]
    mus: tuple[float, float]
    parts: tuple[tuple[LocusPart, ...], ...]
    sectors: tuple[Sector, ...]

    #: The loci that were followed; none if sectors were found without loci.
    loci: tuple[Locus, ...] = ()
    #: Points (alpha, mu) whose solutions lie in different cells than the solutions of the region.
    mixed: tuple[Array, ...] = ()
    #: Further lines for the reader of a table.
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
        """The extent of the search, in words."""

    @property
    @abstractmethod
    def guarantee(self) -> str:
        """The guarantee of completeness of regions and solutions, in words."""

    @abstractmethod
    def proof(self, region: Region) -> str:
        """Return in words whether the solutions in a region are proven."""

    @abstractmethod
    def groups(self) -> Iterator[Group]:
        """Yield the groups of curves, each with a heading."""

    @abstractmethod
    def meetings(self) -> Iterator[tuple[Meeting, Array]]:
        """Yield the points (alpha, mu) of the window at which loci meet or have a kink."""

    @property
    def lowest_folds(self) -> list[Array]:
        """The points (z, alpha, mu) of folds with the smallest mu.

        Two loci begin to be folds at the same point of the plane, which is listed once.
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
        """Return (lo, hi, count): the most solutions at any alpha, for mu between lo and hi."""
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
    """Return sectors of one region each, merged if the solutions lie in the same cells."""
    together: dict[tuple[str, ...], list[Sector]] = {}
    for sector in sorted(sectors, key=lambda s: -area_and_centre(s.regions[0].polygon)[0]):
        together.setdefault(tuple(sorted(sector.labels)), []).append(sector)
    return tuple(
        Sector(tuple(s.regions[0] for s in some), some[0].solutions, some[0].count)
        for some in together.values()
    )
