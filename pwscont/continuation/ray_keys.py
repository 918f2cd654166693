"""Rays that are known, and how rays are told apart.

A ray is recognised by cells, place and direction. Directions are compared by the cosine between
sketches of the directions, see :meth:`~pwscont.curve.metric.Metric.sketch`.

Failure modes and answers
-------------------------
- At a branch point several rays of one cell leave one place: the best aligned ray is taken.
- Special points are closer than places are told apart by digits: then only errors tell which of
  several points is at this place. A walk that has never left that distance may have passed such
  points: only errors tell whether the walk has come back to a known point.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from hashlib import blake2b
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.graph.place import Place, Track
from pwscont.graph.queries import solve_between
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.rays import Ray

#: Names of cells with more bytes than this are replaced by a digest of so many.
LONG, DIGEST = 64, 20
#: Places closer than this times the size of the place are the same, if the rays there agree.
#: Far above the accuracy of a located point, far below what separates equal transitions.
JOIN = EPS**0.5


@final
class RayKey(NamedTuple):
    """What a node remembers of a ray.

    Attributes
    ----------
    place : Place
        Where the ray starts.
    names : tuple of bytes
        Cells in which the ray may be met.
    direction : ndarray
        The sketch of the tangent, of length 1.
    """

    place: Place
    names: tuple[bytes, ...]
    direction: Array

    @classmethod
    def of(cls, ray: Ray, place: Place) -> RayKey:
        """Return the key of a ray that leaves a place."""
        return cls(place, names(ray), ray.curve.metric.sketch(ray.state.tangent))

    def reversed(self, place: Place) -> RayKey:
        """Return the key of the ray that leads back from the end of a straight piece."""
        return RayKey(place, self.names, -self.direction)

    def alignment(self, ray: Ray, key: RayKey) -> float:
        """Return the cosine to a ray with another key, 0 where this ray starts elsewhere."""
        cosine = self.direction.dot(key.direction)
        return cosine if cosine > 0.0 and self.is_where(ray) else 0.0

    def is_where(self, ray: Ray) -> bool:
        """Tell whether a ray starts at this place, to within the two errors."""
        return self.is_at(ray.curve.metric, ray.state.x, ray.state.size)

    def is_at(self, metric: Metric, x: Array, size: Array) -> bool:
        """Tell whether a point with an error of this size is this place."""
        near = metric.norm(metric.difference(self.place.x, x)) <= metric.slack(x, JOIN)
        return near or self.is_within(metric, x, size)

    def is_within(self, metric: Metric, x: Array, size: Array) -> bool:
        """Tell whether the two errors alone explain how far a point is from this place."""
        apart = np.abs(metric.difference(self.place.x, x))
        return bool((apart <= CONFIDENCE * (self.place.error + size)).all())


def names(ray: Ray) -> tuple[bytes, ...]:
    """Return short names of the cells in which a ray may be met again."""
    if not ray.interface_cells:
        return (name_of(ray.curve.selection.cell),)  # nearly always
    return tuple(map(name_of, ray.cells))


def name_of(cell: bytes) -> bytes:
    """Return the short name of a cell."""
    return cell if len(cell) <= LONG else blake2b(cell, digest_size=DIGEST).digest()


class FollowedRay(NamedTuple):
    """The data of a followed ray that the edge keeps.

    Attributes
    ----------
    selection : tuple of Character
        The frozen character, and for a ray along an interface the characters of all its cells.
    names : tuple of bytes
        Names of the cells in which the ray may be met again.
    orientation : int
        The orientation, +1 or -1, in which the ray was followed.
    det_sign : int
        Sign of det(dH/dz) where the ray begins; along an interface the index of the ray.
    """

    selection: tuple[Character, ...]
    names: tuple[bytes, ...]
    orientation: int
    det_sign: int

    @classmethod
    def of(cls, ray: Ray, key: RayKey) -> FollowedRay:
        """Return what to remember of a ray with this key."""
        selection, orientation = ray.curve.selection, ray.state.orientation
        rises = int(np.sign(ray.curve.slope(ray.state)))
        det_sign = ray.index if ray.interface_cells else rises * orientation
        cells = (selection.character, *ray.interface_cells)
        return cls(cells, key.names, orientation, det_sign)

    @property
    def along_interface(self) -> bool:
        """Whether the ray runs along an interface."""
        return len(self.selection) > 1

    def curve(self, system: PiecewiseSystem, metric: Metric) -> Curve:
        """Return the curve of the piece."""
        first, *adjacent = self.selection
        return Curve(Selection(system, first, tuple(adjacent)), metric)


class KnownRay(NamedTuple):
    """A ray of a node: the number of the node, the number of the ray there, and the key."""

    node: int
    number: int
    key: RayKey


@final
class KnownRays:
    """All rays on which walks may arrive."""

    def __init__(self) -> None:
        self._by_cell: dict[bytes, list[KnownRay]] = defaultdict(list)

    def add(self, node: int, keys: Iterable[RayKey], first: int = 0) -> None:
        """Let walks arrive at a node by keys of rays, which are numbered from ``first`` on."""
        for number, key in enumerate(keys, start=first):
            for cell in key.names:
                self._by_cell[cell].append(KnownRay(node, number, key))

    def nodes_in(self, cell: bytes) -> set[int]:
        """Return the nodes that rays in a cell leave."""
        return {known.node for known in self._by_cell.get(cell, ())}

    def match(self, ray: Ray, key: RayKey, left: KnownRay | None = None) -> KnownRay | None:
        """Return the known ray that a ray is, None for a new ray.

        Parameters
        ----------
        ray : Ray
        key : RayKey
            The key of the ray.
        left : KnownRay or None
            The ray that a walk has followed without ever being clearly away from the node. This ray
            is not the ray that goes on where the walk arrives, and digits tell nothing then.
        """
        found = [
            (cosine, known)
            for cell in key.names
            for known in self._by_cell.get(cell, ())
            if (cosine := known.key.alignment(ray, key)) > 0.0
        ]
        return _best(found, ray, left) if found else None  # nearly always


def _best(found: list[tuple[float, KnownRay]], ray: Ray, left: KnownRay | None) -> KnownRay | None:
    """Return the best aligned ray of those with the same cell and, by digits, the same place."""
    if left or len({known.node for _, known in found}) > 1:
        surely = [one for one in found if _is_surely(one[1].key, ray)]
        found = [one for one in surely if one[1].key is not left.key] if left else surely or found
    if len({known.node for _, known in found}) > 1:
        nearest = min((known for _, known in found), key=lambda known: _distance(known.key, ray))
        found = [one for one in found if one[1].node == nearest.node]
    return max(found, key=lambda one: one[0])[1] if found else None


def _distance(key: RayKey, ray: Ray) -> float:
    """Return how far a ray starts from the place of a key."""
    metric = ray.curve.metric
    return metric.norm(metric.difference(key.place.x, ray.state.x))


def _is_surely(key: RayKey, ray: Ray) -> bool:
    """Tell whether a ray starts at the place of a key by the two errors, not by digits."""
    return key.is_within(ray.curve.metric, ray.state.x, ray.state.size)


#: Solutions at one alpha in one cell are the same when closer than this times the size of either.
SAME = EPS**0.5
#: Where two curves cross, up to three solutions meet at fixed alpha, and Newton gives a point to
#: the cube root of the rounding.
SAME_CROSSING = 2.0 * EPS ** (1.0 / 3.0)


def lies_on(
    curve: Curve,
    points: Array,
    state: State,
    interval: tuple[float, float],
    same: float = SAME,
) -> bool:
    """Tell whether a state lies on the piece with these points, to within the error of the state.

    Parameters
    ----------
    curve : Curve
        The curve of the piece, on whose selection the state lies as well.
    points : ndarray, shape (k, n + 1)
    state : State
    interval : tuple of float
    same : float
        Points closer than this, relative to the size of either, are one.
    """
    metric, x, alpha = curve.metric, state.x, state.alpha
    if not points[:, -1].min() <= alpha <= points[:, -1].max():
        return False
    if len(points) == 2:
        nearest = _nearest_on_chord(curve, points, x)
    else:
        around = (curve.selection.system, curve.selection.character, points, alpha, interval)
        nearest = solve_between(*around)[0]
    apart = metric.difference(nearest, x)
    if metric.norm(apart) <= metric.slack(x, same):
        return True
    both = 2.0 * state.size  # the piece is as uncertain as the state
    return bool((np.abs(apart) <= CONFIDENCE * both).all())


def _nearest_on_chord(curve: Curve, points: Array, x: Array) -> Array:
    chord = points[1] - points[0]
    row = curve.metric.covector(chord)
    s = float(row.dot(x - points[0]) / row.dot(chord))
    nearest: Array = points[0] + min(max(s, 0.0), 1.0) * chord
    return nearest


def starts_on(ray: Ray, followed: FollowedRay, track: Track, same: float = SAME) -> bool:
    """Tell whether a ray starts on a piece, to a part ``same`` of the size of the point."""
    if set(names(ray)).isdisjoint(followed.names):
        return False
    metric = ray.curve.metric
    curve = followed.curve(ray.curve.selection.system, metric)
    return lies_on(curve, track.points, ray.state, metric.interval, same)


def placed(ray: Ray, followed: FollowedRay, place: Place) -> Ray:
    """Return a ray like another one, in the cells of a piece and at a place."""
    state = State(place.x, ray.state.tangent, place.error[np.newaxis], 1)
    curve = followed.curve(ray.curve.selection.system, ray.curve.metric)
    return Ray(curve, state, followed.selection[1:])


def ray_back(ray: Ray, followed: FollowedRay, track: Track) -> Ray | None:
    """Return the ray that leads back from the end of a piece; ``ray`` is any ray of the run."""
    curve = followed.curve(ray.curve.selection.system, ray.curve.metric)
    end, way = track.end, track.points[-2] - track.end.x
    found = BorderedNewton().correct(curve, end.x, way)
    if isinstance(found, Failure):
        return None
    state = State(end.x, found.state.tangent, end.error[np.newaxis], found.state.orientation)
    return Ray(curve, state, followed.selection[1:])
