"""The patches into which segments cut the square [-1, 1]^2, by Shapely (optional).

Failure modes and answers
-------------------------
- Two polygons share a side, whose line differs by rounding: corners closer than the tolerance
  become one corner, and a side that passes a corner within the tolerance is led through the corner.
  Then sides of several polygons along a line are equal segments, and each segment is kept once.
- Patches are narrower than the tolerance, as between three lines through a point: such patches are
  left out and counted.
- A patch around another patch has a hole: the outer patch is cut in two, because a region has a
  single outline.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Any, final

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pwscont import MissingPackageError
from pwscont.extending import Array, Indices
from pwscont.two_parameters.half_planes import SQUARE

#: Distance of a corner from a side of the square, in tolerances, up to which the corner is put onto
#: the side: the merging of corners moves a corner by a few tolerances.
ON_A_SIDE = 4.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A part of the square that no segment crosses.

    Attributes
    ----------
    outlines : tuple of (ndarray, ndarray), shapes (k, 2) and (2,)
        The corners of a polygon, counter-clockwise, and the middle of the largest circle inside;
        for a patch with a hole several polygons that fill the patch.
    inside : ndarray, shape (2,)
        The middle of the largest circle inside the patch.
    radius, area : float
        The radius of this circle, and the area of the patch.
    """

    outlines: tuple[tuple[Array, Array], ...]
    inside: Array
    radius: float
    area: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """A segment, with the numbers of the patches on the left and on the right."""

    ends: Array
    left: int
    right: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """The patches between segments, and the segments between two patches.

    Attributes
    ----------
    patches : tuple of Patch
    sides : tuple of Side
    narrow : int
        Number of patches that are left out, being narrower than the tolerance.
    """

    patches: tuple[Patch, ...]
    sides: tuple[Side, ...]
    narrow: int


def shapely() -> Any:
    """Return the module Shapely."""
    try:
        return import_module("shapely")
    except ImportError as error:
        raise MissingPackageError(
            "an exact map needs Shapely: pip install 'shapely>=2', or pip install '.[maps]' in a "
            "checkout of pwscont"
        ) from error


def arrange(segments: Array, tolerance: float) -> Arrangement:
    """Return the patches into which segments cut the square, and the sides between patches.

    Parameters
    ----------
    segments : ndarray, shape (k, 2, 2)
        The ends of each segment.
    tolerance : float
        Points closer than this count as one point.
    """
    geometry = shapely()
    sides_of_square = np.stack([SQUARE, np.roll(SQUARE, -1, axis=0)], axis=1)
    pieces = _meeting(np.concatenate([sides_of_square, segments]), tolerance)
    lines = geometry.get_parts(geometry.unary_union(geometry.linestrings(pieces)))
    polygons = geometry.get_parts(geometry.polygonize(lines))
    circles = [geometry.maximum_inscribed_circle(polygon) for polygon in polygons]
    radii = geometry.length(circles)
    wide = np.flatnonzero(radii > tolerance)
    patches = tuple(_patch(geometry, polygons[i], circles[i]) for i in wide)
    sides = tuple(_sides(geometry, polygons[wide]))
    return Arrangement(patches, sides, len(radii) - len(wide))


def _meeting(segments: Array, tolerance: float) -> Array:
    """Return the segments between merged corners, cut at every corner on the way, each once."""
    corners, names = _corners(segments.reshape(-1, 2), tolerance)
    pieces: set[tuple[int, int]] = set()
    for first, last in names.reshape(-1, 2).tolist():
        stops = _stops(corners, first, last, tolerance)
        pieces.update((min(a, b), max(a, b)) for a, b in pairwise(stops))
    found = np.array(sorted(pieces), dtype=np.intp).reshape(-1, 2)
    return corners[found]


def _corners(points: Array, tolerance: float) -> tuple[Array, Indices]:
    """Return merged corners for close points, and the number of each point's corner."""
    close = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    links = sp.coo_array((np.ones(len(close)), close.T), shape=(len(points), len(points)))
    count, names = connected_components(links, directed=False)
    first = np.full(count, len(points))
    np.minimum.at(first, names, np.arange(len(points)))
    corners = points[first]
    edge = np.abs(np.abs(corners) - 1.0) <= ON_A_SIDE * tolerance
    corners[edge] = np.sign(corners[edge])
    return corners, names


def _stops(corners: Array, first: int, last: int, tolerance: float) -> list[int]:
    """Return the corners on a segment, from the first to the last."""
    way = corners[last] - corners[first]
    length = float(np.hypot(*way))
    if length <= tolerance:
        return []
    way = way / length
    along = (corners - corners[first]) @ way
    aside = (corners - corners[first]) @ np.array([-way[1], way[0]])
    passed = (np.abs(aside) <= tolerance) & (along > 0.0) & (along < length)
    passed[[first, last]] = False
    inner = np.flatnonzero(passed)
    return [first, *inner[np.argsort(along[inner])].tolist(), last]


def _patch(geometry: Any, polygon: Any, circle: Any) -> Patch:
    outlines = tuple(
        (geometry.get_coordinates(part)[:-1], _middle(geometry, part))
        for part in _whole(geometry, polygon)
    )
    inside, area = geometry.get_coordinates(circle)[0], float(geometry.area(polygon))
    return Patch(outlines, inside, float(geometry.length(circle)), area)


def _middle(geometry: Any, polygon: Any) -> Array:
    middle: Array = geometry.get_coordinates(geometry.maximum_inscribed_circle(polygon))[0]
    return middle


def _whole(geometry: Any, polygon: Any) -> Iterator[Any]:
    """Yield polygons without holes that fill a polygon."""
    if not geometry.get_num_interior_rings(polygon):
        yield geometry.reverse(geometry.normalize(polygon))
        return
    height = float(geometry.get_coordinates(geometry.get_interior_ring(polygon, 0))[:, 1].mean())
    for low, high in ((-2.0, height), (height, 2.0)):
        half = geometry.intersection(polygon, geometry.box(-2.0, low, 2.0, high))
        for part in geometry.get_parts(half):
            if geometry.area(part) > 0.0:
                yield from _whole(geometry, part)


def _sides(geometry: Any, polygons: Sequence[Any]) -> Iterator[Side]:
    """Yield the segments between two polygons."""
    on_the_left: dict[tuple[bytes, bytes], int] = {}
    for number, polygon in enumerate(polygons):
        for ring in (polygon.exterior, *polygon.interiors):
            points = geometry.get_coordinates(ring)
            if bool(geometry.is_ccw(ring)) == (ring in polygon.interiors):
                points = points[::-1]
            keys = [point.tobytes() for point in points + 0.0]
            on_the_left.update(dict.fromkeys(pairwise(keys), number))
    for (a, b), left in on_the_left.items():
        right = on_the_left.get((b, a))
        if right is not None and left < right:
            ends = np.array([np.frombuffer(a), np.frombuffer(b)])
            yield Side(ends, left, right)
