"""Exact maps of two parameters that enter affinely.

The solutions of each cell lie over a convex polygon. The sides of all polygons cut the window into
regions; a point of a region tells which polygons contain the region. No locus is followed and no
point is sampled, so no region wider than rounding can be missing.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import EPS, GUARD, Array, counted, finite_array, shown_size
from pwscont.two_parameters.affine import AffineFamily, Window
from pwscont.two_parameters.arrangement import Arrangement, Patch, arrange, shapely
from pwscont.two_parameters.cells import COARSE, cells_of
from pwscont.two_parameters.family import MakeSystem
from pwscont.two_parameters.half_planes import width_of
from pwscont.two_parameters.joints import Joints, Solved, edges, joints
from pwscont.two_parameters.loci import LocusPart, Passing
from pwscont.two_parameters.plane import Found, Group, Meeting, Plane, Region, Sector, gathered

#: Points of the window's square closer than this count as one point: 1.5e-11 leaves room for
#: rounding; ill-conditioned cells raise the tolerance to the largest blur.
TOLERANCE = 2.0**-36
#: Area of narrow regions, in tolerances, that the sum of all areas may lack.
SLIVERS = 1e4
HEADINGS = {
    Passing.FOLD: "Edges that are folds",
    Passing.TRANSITION: "Edges that solutions pass",
    Passing.VERTICAL: "Edges with infinitely many solutions",
}


@final
@dataclass(frozen=True, eq=False, repr=False)
class ExactPlane(Plane):
    """The solutions at all points of a window of the plane; see :func:`pwscont.plane`.

    Attributes
    ----------
    alphas, mus : tuple of float
        The window.
    parts : tuple of tuple of LocusPart
        The edges, segments on which the same cells meet: folds, transitions and vertical edges.
    sectors : tuple of Sector
        The regions, grouped by the cells of the solutions.
    """

    _family: AffineFamily | None = None
    _solved: Solved | None = None
    _doubts: tuple[str, ...] = ()
    _narrow: int = 0

    @classmethod
    def of(cls, make: MakeSystem, window: Window) -> ExactPlane:
        """Return the map of a family over a window; errors as of :func:`pwscont.plane`."""
        family = AffineFamily.of(make, window)
        cells, strips = cells_of(family)
        tolerance = max([TOLERANCE, *(c.blur for c in cells), *(s.blur for s in strips)])
        wide = [cell for cell in cells if width_of(cell.polygon) > tolerance]
        labels = [family.system.label(strip.character) for strip in strips]
        thin = [cell for cell in cells if width_of(cell.polygon) <= tolerance]
        solved = Solved(wide, thin, strips, labels, family.scale, tolerance)
        return _drawn(family, solved, arrange(_segments(solved), tolerance))

    @property
    def resolution(self) -> float:
        """Part of the window; closer points count as one, narrower regions are left out."""
        return 0.5 * self._known[1].tolerance

    @property
    def folds(self) -> tuple[LocusPart, ...]:
        """The edges on which two solutions meet and end."""
        return self._of(Passing.FOLD)

    @property
    def transitions(self) -> tuple[LocusPart, ...]:
        """The edges on which a solution passes into another cell."""
        return self._of(Passing.TRANSITION)

    @property
    def vertical(self) -> tuple[LocusPart, ...]:
        """The edges, and single points, with infinitely many solutions over each point."""
        return self._of(Passing.VERTICAL)

    def _of(self, kind: Passing) -> tuple[LocusPart, ...]:
        return _those([part for some in self.parts for part in some], kind)

    @property
    def searched(self) -> str:
        """The extent of the search, in words."""
        solved = self._known[1]
        over = counted(len(solved.cells), "polygon")
        if solved.thin:
            over += f", {len(solved.thin)} that are points or segments,"
        return (
            f"all cells; {over} over which they have solutions, cut with each other; points "
            f"closer than {self.resolution:.1g} of the window are one"
        )

    @property
    def guarantee(self) -> str:
        """The guarantee of completeness of the map, in words."""
        if self._doubts:
            return f"not certain: {'; '.join(self._doubts)}"
        if self._narrow:
            return f"complete, except for {counted(self._narrow, 'region')} narrower than rounding"
        return "complete"

    def proof(self, region: Region) -> str:
        """Return "proven", or "not certain" if the map is not certain."""
        return "not certain" if self._doubts else "proven"

    def groups(self) -> Iterator[Group]:
        """Yield the groups of folds, transitions and vertical edges."""
        for some in self.parts:
            yield Group(HEADINGS[some[0].crossing], some)

    def count(self, alpha: float, mu: float) -> int | float:
        """Return the number of solutions at a point of the window; infinite on vertical edges.

        On an edge solutions that meet are counted once.

        Raises
        ------
        InvalidInputError
            If the point lies outside the window.
        """
        point = self._squared(alpha, mu)
        if self._known[1].strips_at(point):
            return math.inf
        return len(self.solutions(alpha, mu))

    def solutions(self, alpha: float, mu: float) -> tuple[Found, ...]:
        """Return the isolated solutions at a point of the window.

        Raises
        ------
        InvalidInputError
            If the point lies outside the window.
        """
        family, solved = self._known
        point = self._squared(alpha, mu)
        return _found(family, solved, solved.touching(point), point)

    def meetings(self) -> Iterator[tuple[Meeting, Array]]:
        """Yield the points inside the window at which edges of common cells end."""
        family, solved = self._known
        ends = [end for some in self.parts for part in some for end in part.points]
        size = (
            np.concatenate([family.scale[: len(ends[0]) - 2], family.window.half]) if ends else 1.0
        )
        keys = [tuple(np.round(end / size / (1e3 * solved.tolerance))) for end in ends]
        several = Counter(keys)
        for key, end in dict(zip(keys, ends, strict=True)).items():
            inside = np.abs(family.window.squared(end[-2:])) < 1.0 - 1e3 * solved.tolerance
            if inside.all():
                yield Meeting.KINK if several[key] == 2 else Meeting.OF_SEVERAL, end[-2:]

    @property
    def _known(self) -> tuple[AffineFamily, Solved]:
        assert self._family is not None
        assert self._solved is not None
        return self._family, self._solved

    def _squared(self, alpha: float, mu: float) -> Array:
        """Return the point (s, t) of the square for a point of the window."""
        window = self._known[0].window
        point = window.squared(finite_array("(alpha, mu)", [alpha, mu], (2,)))
        rounding = GUARD * EPS * (1.0 + np.abs(window.centre) / window.half)  # far from zero
        if (np.abs(point) > 1.0 + rounding).any():
            raise InvalidInputError(
                f"(alpha, mu) = ({alpha:.10g}, {mu:.10g}) lies outside the window of the map, "
                f"{window.alphas} x {window.mus}"
            )
        return np.clip(point, -1.0, 1.0)


def _those(parts: Sequence[LocusPart], kind: Passing) -> tuple[LocusPart, ...]:
    return tuple(part for part in parts if part.crossing is kind)


def _segments(solved: Solved) -> Array:
    """Return the sides of all polygons and shadows, shape (k, 2, 2)."""
    outlines = [cell.polygon for cell in solved.cells]
    outlines += [strip.shadow for strip in solved.strips if len(strip.shadow) > 1]
    rings = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in outlines]
    return np.concatenate([np.zeros((0, 2, 2)), *rings])


def _drawn(family: AffineFamily, solved: Solved, arrangement: Arrangement) -> ExactPlane:
    """Return the map from cells and the patches between all sides."""
    patches, window = arrangement.patches, family.window
    members = [solved.around(patch.inside) for patch in patches]
    pairs = zip(members, patches, strict=True)
    solutions = [solved.groups(cells, patch.inside) for cells, patch in pairs]
    joined = joints(solved, arrangement, solutions)
    size = shown_size(family.system)
    found = edges(joined.found, window, size, solved.tolerance)
    parts = tuple(some for kind in Passing if (some := _those(found, kind)))
    sectors = gathered(
        sector
        for patch, cells in zip(patches, members, strict=True)
        for sector in _sectors(family, solved, patch, cells)
    )
    plane = (window.alphas, window.mus, parts, sectors)
    doubts = tuple(_doubts(family, solved, arrangement, joined, sectors))
    return ExactPlane(
        *plane, _family=family, _solved=solved, _doubts=doubts, _narrow=arrangement.narrow
    )


def _sectors(
    family: AffineFamily, solved: Solved, patch: Patch, cells: Sequence[int]
) -> Iterator[Sector]:
    """Yield a sector for each outline of a patch, with the solutions in the middle."""
    nothing, window = np.zeros((0, 2)), family.window
    for corners, inside in patch.outlines:
        solutions = _found(family, solved, cells, inside)
        region = Region(window.inside(corners), window.inside(inside), nothing)
        infinite = bool(solved.strips_at(inside))
        yield Sector((region,), solutions, math.inf if infinite else len(solutions))


def _found(
    family: AffineFamily, solved: Solved, cells: Sequence[int], point: Array
) -> tuple[Found, ...]:
    """Return the solutions of cells at a point of the square; a shared solution occurs once."""
    size = shown_size(family.system)
    groups = [[solved.cell(i) for i in group] for group in solved.groups(cells, point)]
    return tuple(
        Found(
            group[0].at(point)[:size],
            group[0].label,
            group[0].det_sign if len({cell.det_sign for cell in group}) == 1 else 0,
        )
        for group in groups
    )


def _doubts(
    family: AffineFamily,
    solved: Solved,
    arrangement: Arrangement,
    joined: Joints,
    sectors: Sequence[Sector],
) -> Iterator[str]:
    """Yield in words each finding that contradicts a complete map."""
    area = sum(patch.area for patch in arrangement.patches)
    if abs(area - 4.0) > SLIVERS * solved.tolerance:
        yield f"the regions fill {area / 4.0:.6g} of the window"
    if solved.tolerance > COARSE:
        yield f"rounding moves edges by up to {0.5 * solved.tolerance:.1g} of the window"
    if singular := sum(cell.det_sign == 0 for cell in solved.cells):
        yield f"{counted(singular, 'cell')} with solutions are singular within rounding"
    if undecided := sum(not strip.is_certain for strip in solved.strips):
        yield f"{counted(undecided, 'cell')} with solutions are singular by rounding or not at all"
    if joined.doubtful:
        alpha, mu = family.window.inside(joined.doubtful[0])
        number = counted(len(joined.doubtful), "edge")
        yield f"solutions do not go on across {number}, such as at ({alpha:.6g}, {mu:.6g})"
    isolated = [s for s in sectors if all(f.det_sign for f in s.solutions)]
    sums = {_balance(s) for s in isolated if math.isfinite(s.count)}
    degree = family.system.degree
    if degree is not None and sums - {degree}:
        yield f"the signs of det(dH/dz) do not sum to {degree:+d} everywhere"


def _balance(sector: Sector) -> int:
    return sum(found.det_sign for found in sector.solutions)


def plane(family: MakeSystem, alphas: tuple[float, float], mus: tuple[float, float]) -> ExactPlane:
    """Return the map of all solutions over a window of the plane of two parameters.

    Alpha and mu must enter affinely: in every cell H and the tests are affine in z, alpha and mu
    together, as with two components of a load. Then the solutions of a regular cell lie over a
    convex polygon of the plane. All polygons are intersected; no point is sampled.

    Parameters
    ----------
    family : callable
        mu -> :class:`~pwscont.PiecewiseLinearSystem` with the parameter alpha; all systems have
        equal sizes and the same tests.
    alphas, mus : tuple of float
        The window, (lo, hi) for each parameter.

    Returns
    -------
    ExactPlane

    Raises
    ------
    InvalidInputError
        If a range is empty or too narrow for rounding, or a parameter does not enter affinely.
    InvalidSystemError
        If the family does not return systems, a system breaks a promise of the class, or a singular
        cell has solutions by rounding only.
    MissingPackageError
        If Shapely is not installed.

    Examples
    --------
    >>> from pwscont import LCP, plane
    >>> def family(mu):
    ...     return LCP([[1, 2], [2, 1]], q=[mu, -1], d=[0, 1])
    >>> found = plane(family, (-2.0, 2.0), (-2.0, 2.0))
    >>> found.count(0.0, -1.0), found.guarantee
    (3, 'complete')
    """
    shapely()
    return ExactPlane.of(family, Window.of(alphas, mus))
