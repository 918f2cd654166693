"""Tables of the plane of two parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pwscont.extending import DUST, number
from pwscont.two_parameters.axes import PlaneShown
from pwscont.two_parameters.loci import LocusPart, Passing
from pwscont.two_parameters.plane import Plane, Sector

WORDS = {
    Passing.FOLD: "fold",
    Passing.TRANSITION: "transition",
    Passing.VERTICAL: "transition, with infinitely many solutions on it",
}


def report(scene: PlaneShown, plane: Plane) -> str:
    """Return loci and sectors as text, and the lowest fold if the scene names a lowest fold."""
    axes, (a, b), (c, d) = scene.axes, plane.alphas, plane.mus
    lines = [
        f"{scene.name}: {scene.title}",
        f"{axes.alpha} in [{number(a)}, {number(b)}], {axes.mu} in [{number(c)}, {number(d)}]",
        *_loci(scene, plane),
        "",
        *_sectors(scene, plane),
        *_mixed(scene, plane),
        f"Searched: {plane.searched}",
        f"Guarantee: {plane.guarantee}",
        *plane.remarks,
        *_most(scene, plane),
    ]
    return "\n".join(lines)


def _loci(scene: PlaneShown, plane: Plane) -> Iterator[str]:
    for group in plane.groups():
        yield ""
        yield group.heading
        for part in group.parts:
            yield f"  {part.label}: {WORDS[part.crossing]}"
            yield f"    {_extent(scene, part)}"
        for end, message in group.ends:
            yield f"  end at {_point(scene, *end)}: {message}"


def _extent(scene: PlaneShown, part: LocusPart) -> str:
    (a, c), (b, d) = part.plane[0], part.plane[-1]
    return f"{_point(scene, a, c)} → {_point(scene, b, d)}"


def _point(scene: PlaneShown, alpha: float, mu: float) -> str:
    """Return a point of the plane as text; values within rounding of zero read as zero."""
    scales = np.ptp([scene.alphas, scene.mus], axis=1)
    values = [x if abs(x) > DUST * s else 0.0 for x, s in zip((alpha, mu), scales, strict=True)]
    return f"({scene.axes.alpha}, {scene.axes.mu}) = ({number(values[0])}, {number(values[1])})"


def _sectors(scene: PlaneShown, plane: Plane) -> Iterator[str]:
    yield "Solutions in the sectors"
    for sector in plane.sectors:
        name = scene.sector_name(sector)
        heading = f"{name}, {how_many(sector)}" if name else how_many(sector)
        region = sector.regions[0]
        yield f"  {heading} at {_point(scene, *region.inside)}, {plane.proof(region)}"
        for found in sector.solutions:
            yield f"    {found.label}, det {found.det_sign:+d}"


def _mixed(scene: PlaneShown, plane: Plane) -> Iterator[str]:
    for point in plane.mixed:
        why = "a locus is missing (give more levels), or solutions run to infinity"
        yield f"  other solutions at {_point(scene, *point)}: {why}"


def how_many(sector: Sector) -> str:
    """Return the number of solutions in words."""
    if math.isinf(sector.count):
        return "infinitely many solutions"
    return f"{sector.count} solution{'' if sector.count == 1 else 's'}"


def _most(scene: PlaneShown, plane: Plane) -> Iterator[str]:
    if not scene.lowest_fold:
        return
    yield ""
    yield f"Most solutions that an {scene.axes.alpha} has, by {scene.axes.mu}"
    for lo, hi, count in plane.most_solutions():
        yield f"  ({number(lo)}, {number(hi)}): {count}"
    tips = plane.lowest_folds
    if not tips:
        yield f"No folds were found: a {scene.lowest_fold} in this window is not known"
        return
    if tips[0][-1] <= plane.mus[0]:
        end = number(plane.mus[0])
        yield f"Folds reach the lower end {end} of the window: the {scene.lowest_fold} is below"
        return
    where = " and ".join(_point(scene, *tip[-2:]) for tip in tips)
    yield f"The {scene.lowest_fold} is {number(tips[0][-1])}: folds begin at {where}"
