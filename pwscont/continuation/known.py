"""What a run knows: the rays at which pieces arrive, the branches followed, the past of a path.

A ray is recognised by cells, place and direction. Directions are compared by the cosine between
sketches of the directions, see :meth:`~pwscont.curve.metric.Metric.sketch`.

Failure modes and answers
-------------------------
- At a branch point several rays of one cell leave one place: the best aligned ray is taken.
- Special points are closer than places are told apart by digits: then only errors tell which of
  several points is at this place. A walk that has never left that distance may have passed such
  points: only errors tell whether the walk has come back to a known point.
- Special points come closer and closer for a while, and then no more: no path is stopped for that.
  Only the message of a path that was stopped for another reason says that points accumulate.
- Special points come closer so slowly that they reach any alpha (roots of the whole numbers): the
  differences must shrink fast enough for their sum to be finite, by Raabe's test.
- Several kinds of special points take turns: the sequences of every second, third and fourth point
  are tested, too.
- A path with many equal teeth, each in cells of its own, ends: a path repeats itself only in the
  same cells, shifted by the same vector again and again, at the same alphas.
- A path that repeats itself for a while may end all the same: a user who sets limits decides.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from hashlib import blake2b
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.outcome import ACCUMULATE, Failure
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.graph.queries import solve_between
from pwscont.graph.records import Place, Track
from pwscont.search.search import KnownBranches
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.rays import Ray

#: A name of a cell with more bytes than the first number is replaced by a digest, with the second
#: number of bytes.
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


@final
class Edge(NamedTuple):
    """A piece under discovery, from the node where the piece begins to the node it reached.

    ``begun_at`` is the point inside the piece where tracing began, None if tracing began at a node.
    """

    start: int
    end: int
    followed: FollowedRay
    track: Track
    begun_at: Place | None = None


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


#: A curve strays from the chord between two stored points by less than this part of its length.
NEAR = 0.2
TINY = 1e-300


@final
class FollowedBranches(KnownBranches):
    """The pieces of a discovery.

    Attributes
    ----------
    edges : callable
        Returns the pieces; none before the discovery begins.
    """

    def __init__(self) -> None:
        self.edges: Sequence[Edge] = ()

    def at(self, alpha: float) -> list[Array]:
        """Return a point for each known solution, by straight lines between stored points."""
        return [x for edge in self.edges for x in _crossings(edge.track.points, alpha)]

    def near(self, x: Array, metric: Metric) -> Array | None:
        """Return the nearest point on the straight lines between stored points, if it is near."""
        found = (_nearest(edge.track.points, x, metric) for edge in self.edges)
        near = [(distance / length, point) for distance, length, point in found]
        part, point = min(near, key=lambda each: each[0], default=(np.inf, x))
        return point if part <= NEAR else None

    def extremes(self) -> list[Array]:
        """Return the points of pieces at which alpha or an unknown is extremal."""
        return [x for edge in self.edges for x in _extremes(edge.track.points)]

    def are_all(self) -> bool:
        """Tell that nothing is proved by following branches."""
        return False


def _crossings(points: Array, alpha: float) -> list[Array]:
    """Return where the polygon through some points has an alpha."""
    sides = np.sign(points[:, -1] - alpha)
    found = [points[i] for i in np.flatnonzero(sides == 0.0)]
    for i in np.flatnonzero(sides[1:] * sides[:-1] < 0.0):
        a, b = points[i], points[i + 1]
        found.append(a + (alpha - a[-1]) / (b[-1] - a[-1]) * (b - a))
    return found


def _nearest(points: Array, x: Array, metric: Metric) -> tuple[float, float, Array]:
    """Return the distance to the nearest point of a polygon, the length of its chord, the point."""
    starts, chords = points[:-1] / metric.scale, np.diff(points, axis=0) / metric.scale
    away = metric.difference(x, points[:-1]) / metric.scale
    lengths = np.maximum((chords**2).sum(axis=1), TINY)
    parts = np.clip((away * chords).sum(axis=1) / lengths, 0.0, 1.0)
    distances = np.linalg.norm(away - parts[:, np.newaxis] * chords, axis=1)
    i = int(np.argmin(distances / np.sqrt(lengths)))
    point = (starts[i] + parts[i] * chords[i]) * metric.scale
    return float(distances[i]), float(np.sqrt(lengths[i])), point


def _extremes(points: Array) -> list[Array]:
    """Return the points at which a coordinate is largest or smallest, each once."""
    numbers = {*points.argmin(axis=0).tolist(), *points.argmax(axis=0).tolist()}
    return [points[i] for i in sorted(numbers)]


#: What a user reads at an end of a path that repeats itself.
REPEATS = "the path repeats itself without end: set limits=Limits(pieces=...) to follow it further"
#: Pieces after which a path is looked at again; odd, so that the ends of a path take turns.
EVERY = 13
#: Differences that must fit a convergent sequence, and most kinds of points that may take turns.
TERMS, MOST_TURNS = 6, 4
#: How far 1 / (1 - q) may stray from a straight line, q the ratio of successive differences.
STRAY = 0.25
#: Largest slope of that line: 0 for geometric sequences, 1/2 for 1 / k, 1 where the sum diverges.
STEEPEST_LINE = 0.8
#: Periods after which a path is taken to repeat itself, and their longest length in pieces.
PERIODS, LONGEST = 8, 8
#: Two shifts are one up to this part of their length.
SAME_SHIFT = 1e-5


@final
class Past:
    """The way by which each special point of a run was first reached."""

    def __init__(self) -> None:
        self._steps: dict[int, tuple[int, Place, object]] = {}

    def add(self, start: int, end: int, place: Place, cells: object) -> None:
        """Remember that a piece in some cells led from a node to another one, and its place."""
        self._steps.setdefault(end, (start, place, cells))

    def _leading_to(self, node: int, most: int) -> list[tuple[Place, object]]:
        """Return the last places on the way to a node, each with the cells before it."""
        found: list[tuple[Place, object]] = []
        while len(found) < most and node in self._steps:
            node, place, cells = self._steps[node]
            found.append((place, cells))
        return found[::-1]

    def repeats(self, node: int, scale: Array) -> bool:
        """Tell whether the path to a node repeats itself; the scale is that of (z, alpha)."""
        way = self._leading_to(node, PERIODS * LONGEST + 1)
        periods = _periods([cells for _, cells in way[1:]])
        if not periods:  # nearly always, and places are not looked at
            return False
        points = np.array([place.x / scale for place, _ in way])
        return any(_is_shifted(points, period) for period in periods)

    def accumulation(self, node: int, is_special: bool) -> str:
        """Return at which alpha the special points up to a node accumulate, in words."""
        way = self._leading_to(node, TERMS * MOST_TURNS + 2)
        alphas = [place.alpha for place, _ in way]
        limit = accumulation(alphas if is_special else alphas[:-1])
        return "" if limit is None else f"; {ACCUMULATE} {limit:.6g}"


def accumulation(alphas: Sequence[float]) -> float | None:
    """Return the alpha at which special points accumulate, None where nothing looks like it.

    Parameters
    ----------
    alphas : sequence of float
        The alphas of successive special points of a path.
    """
    for turns in range(1, MOST_TURNS + 1):
        terms = np.array(alphas[::-1][::turns][: TERMS + 1][::-1])
        if len(terms) > TERMS and (limit := _limit(terms)) is not None:
            return limit
    return None


def _limit(terms: Array) -> float | None:
    """Return the limit of a sequence, by the tail of its differences."""
    steps = np.diff(terms)
    if (steps == 0.0).any():
        return None
    ratios = steps[1:] / steps[:-1]
    if ratios.min() <= 0.0 or ratios.max() >= 1.0:
        return None
    rests = 1.0 / (1.0 - ratios)
    slope = float(np.median(np.diff(rests)))
    if slope >= STEEPEST_LINE or np.abs(np.diff(rests) - slope).max() > STRAY:
        return None
    return float(terms[-1] + steps[-1] * (rests[-1] - 1.0) / (1.0 - slope))


def _periods(cells: Sequence[object]) -> list[int]:
    """Return after how many pieces a path is in the same cells again and again."""
    return [
        period
        for period in range(1, min(LONGEST, len(cells) // PERIODS) + 1)
        if cells[-PERIODS * period : -period] == cells[-(PERIODS - 1) * period :]
    ]


def _is_shifted(points: Array, period: int) -> bool:
    """Tell whether each period shifts a path by as much, without coming nearer to an end.

    Parameters
    ----------
    points : ndarray, shape (k, n + 1)
        Successive special points (z, alpha), each unknown divided by its typical magnitude.
    period : int
        A number of pieces after which the path is in the same cells again.
    """
    shifts = np.diff(points[-1 - PERIODS * period :: period], axis=0)
    length = float(np.linalg.norm(shifts[-1]))
    spread = np.linalg.norm(shifts - shifts[-1], axis=1).max()
    return bool(length > 0.0 and spread <= SAME_SHIFT * length) and _stays(shifts, length)


def _stays(shifts: Array, length: float) -> bool:
    """Tell whether a period leads back to the alpha where it began."""
    return bool(np.abs(shifts[:, -1]).max() <= SAME_SHIFT * length)
