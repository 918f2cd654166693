"""What a run knows: the special points, the rays on which pieces arrive, the pieces followed.

A ray is recognised by cells, place and direction, and next to other special points by errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, Kind, Remark
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve
from pwscont.curve.metric import Metric, nearest_on_chords
from pwscont.graph.queries import solve_between
from pwscont.graph.records import Place
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import Said, worded
from pwscont.transitions.rays import Ray

#: Places closer than this times the size of the place are the same, if the rays there agree.
#: Far above the accuracy of a located point, far below what separates equal transitions.
JOIN = EPS**0.5


@final
@dataclass(slots=True, eq=False)
class KnownRay:
    """What a special point remembers of a ray, by which pieces leave and arrive."""

    place: Place  # where the ray starts
    names: tuple[bytes, ...]  # the cells in which the ray may be met
    direction: Array  # the sketch of the tangent, see Metric.sketch: of few numbers
    ray: Ray | None = None  # as long as no piece has left or arrived on the ray
    node: int = -1  # the number of the special point

    @classmethod
    def of(cls, ray: Ray, place: Place) -> KnownRay:
        """Return what to remember of a ray that leaves a place."""
        return cls(place, ray.cells, ray.curve.metric.sketch(ray.state.tangent), ray)

    def is_at(self, metric: Metric, x: Array, size: Array) -> bool:
        """Tell whether a point with an error of this size is where the ray starts."""
        return self.distance(metric, x) <= metric.slack(x, JOIN) or self.is_within(metric, x, size)

    def is_within(self, metric: Metric, x: Array, size: Array) -> bool:
        """Tell whether the two errors alone explain how far a point is from this place."""
        apart = np.abs(metric.difference(self.place.x, x))
        return bool((apart <= CONFIDENCE * (self.place.error + size)).all())

    def distance(self, metric: Metric, x: Array) -> float:
        """Return how far a point is from this place."""
        return metric.norm(metric.difference(self.place.x, x))


@final
@dataclass(slots=True)
class Node:
    """A special point under discovery."""

    kind: Kind | str
    place: Place
    said: Said
    rays: list[KnownRay] = field(default_factory=list)
    #: The node from which a piece first arrived, with the names of the piece's cells.
    before: tuple[int, tuple[bytes, ...]] | None = None
    lost: int = 0
    also: list[str] = field(default_factory=list)  # words of users' detectors, of another kind

    def stop(self, message: str, rays: int = 1) -> None:
        """Note that rays could not be followed; a degenerate point keeps its kind."""
        if self.kind != Kind.DEGENERATE:
            self.kind = Kind.STOPPED
        self.lost += rays
        if message not in self.message:  # said already, of another ray
            self.said = f"{self.message}; {message}"

    @property
    def message(self) -> str:
        """What is said of the point."""
        return worded(self.said)


def match(
    known: Mapping[bytes, Sequence[KnownRay]], new: KnownRay, left: KnownRay | None = None
) -> KnownRay | None:
    """Return which of the known rays, listed by cell, a ray is, None for a new ray.

    Of several rays in one cell, as at a branch point, the best aligned is taken. ``left`` is the
    ray on which a piece left that was never clearly away from the node: never the answer.
    """
    assert new.ray is not None
    metric, state = new.ray.curve.metric, new.ray.state
    found = [
        (cosine, each)
        for cell in new.names
        for each in known.get(cell, ())
        if (cosine := float(each.direction.dot(new.direction))) > 0.0
        and each.is_at(metric, state.x, state.size)
    ]
    if not found:
        return None  # nearly always
    if left or len({each.node for _, each in found}) > 1:
        surely = [one for one in found if one[1].is_within(metric, state.x, state.size)]
        found = [one for one in surely if one[1] is not left] if left else surely or found
    if len({each.node for _, each in found}) > 1:
        nearest = min((each for _, each in found), key=lambda each: each.distance(metric, state.x))
        found = [one for one in found if one[1].node == nearest.node]
    return max(found, key=lambda one: one[0])[1] if found else None


#: Solutions at one alpha in one cell are the same when closer than this times the size of either.
SAME = EPS**0.5
#: Where two curves cross, up to three solutions meet at fixed alpha, and Newton gives a point to
#: the cube root of the rounding.
SAME_CROSSING = 2.0 * EPS ** (1.0 / 3.0)


@final
class Edge(NamedTuple):
    """A piece under discovery, from the node where the piece begins to the node it reached."""

    start: int
    end: int
    cells: tuple[Character, ...]  # the frozen character, then all cells that an interface joins
    names: tuple[bytes, ...]  # of the cells in which the piece may be met again
    orientation: int  # +1 or -1, in which the piece was followed
    det_sign: int  # of det(dH/dz) at an end of the piece; along an interface the index of the ray
    first: Place
    inner: Array  # the points between, shape (k, n + 1)
    last: Place
    begun_at: Place | None = None  # the point inside where tracing began, if not at a node

    @classmethod
    def of(
        cls, ray: Ray, left: KnownRay, points: Sequence[Array], end: int, last: Place, back: Ray
    ) -> Edge:
        """Return the piece that a known ray began, from its points and the ray that leads back.

        At a fold det(dH/dz) is zero, and at the piece's other end only on a vertical piece.
        """
        det_sign = ray.index if ray.interface_cells else ray.det_sign or back.det_sign
        cells = (ray.curve.selection.character, *ray.interface_cells)
        inner = np.array(points[1:-1]).reshape(-1, len(points[0]))
        known = left.names, ray.state.orientation, det_sign, left.place, inner, last
        return cls(left.node, end, cells, *known)

    @property
    def points(self) -> Array:
        """All points, shape (k, n + 1), a new array."""
        return np.concatenate([self.first.x[np.newaxis], self.inner, self.last.x[np.newaxis]])

    def reversed(self) -> Edge:
        """Return the piece from the end to the start, with the same orientation."""
        start, end, first, last = self.end, self.start, self.last, self.first
        return self._replace(start=start, end=end, first=first, inner=self.inner[::-1], last=last)

    def span(self) -> tuple[float, float]:
        """Return the least and the largest alpha."""
        alpha = self.points[:, -1]
        return float(alpha.min()), float(alpha.max())

    @property
    def along_interface(self) -> bool:
        """Whether the piece runs along an interface."""
        return len(self.cells) > 1

    def curve(self, system: PiecewiseSystem, metric: Metric) -> Curve:
        """Return the curve of the piece."""
        return Curve(Selection(system, self.cells[0], self.cells[1:]), metric)

    def is_in(self, names: Iterable[bytes]) -> bool:
        """Tell whether the piece may be met in one of these cells."""
        return not set(self.names).isdisjoint(names)

    def passes(self, here: Curve, x: Array, size: Array, same: float = SAME) -> bool:
        """Tell whether a solution x in a cell of the piece, with an error of this size, lies on it.

        ``here``: any curve of the same system and metric.
        """
        metric, alpha, points = here.metric, float(x[-1]), self.points
        if not points[:, -1].min() <= alpha <= points[:, -1].max():
            return False
        part, nearest, _ = nearest_on_chords(points, x, metric)
        if len(points) > 2:
            if part > OFF_THE_PIECE:
                return False
            system, cell = here.selection.system, self.cells[0]
            nearest = solve_between(system, cell, points, alpha, metric.interval)[0]
        apart, both = metric.difference(nearest, x), 2.0 * size  # the piece is as uncertain as x
        is_near = metric.norm(apart) <= metric.slack(x, same)
        return is_near or bool((np.abs(apart) <= CONFIDENCE * both).all())

    def passes_fold(self, here: Curve, x: Array) -> bool:
        """Tell whether a smooth fold x in a cell of the piece lies on the piece.

        At the alpha of a fold Newton may lead to another solution: the curve is met at a right
        angle.
        """
        metric, curve = here.metric, self.curve(here.selection.system, here.metric)
        part, nearest, chord = nearest_on_chords(self.points, x, metric)
        if part > OFF_THE_PIECE:
            return False
        met = BorderedNewton().correct(curve, nearest, metric.normalised(chord))
        if isinstance(met, Failure):
            return False
        return metric.norm(metric.difference(met.state.x, x)) <= metric.slack(x, SAME)


#: A point farther from each chord than this part of the chord's length is not on the piece.
OFF_THE_PIECE = 1.0

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
#: Special points in a row, each shifted as the last, after which a net of paths repeats itself.
IN_A_ROW = 6
#: Two shifts are one up to this part of their length.
SAME_SHIFT = 1e-5
#: Special points in few cells, after which a path whose special points accumulate has no end.
NO_END = 64


def _way_to(nodes: Mapping[int, Node], number: int, most: int) -> list[tuple[Place, object]]:
    """Return the last places on the way to a node, each with the cells of the piece before."""
    found: list[tuple[Place, object]] = []
    while len(found) < most and number in nodes and (before := nodes[number].before):
        found.append((nodes[number].place, before[1]))
        number = before[0]
    return found[::-1]


def repeated_shift(nodes: Mapping[int, Node], number: int, scale: Array) -> Array | None:
    """Return the shift of (z, alpha) after which the path to a node repeats itself, None if never.

    After each period the path is in the same cells again, shifted by the same vector, at the same
    alpha. Such a path may end all the same: a user who sets limits decides.
    """
    way = _way_to(nodes, number, PERIODS * LONGEST + 1)
    cells = [names for _, names in way[1:]]
    for period in range(1, min(LONGEST, len(cells) // PERIODS) + 1):
        if cells[-PERIODS * period : -period] != cells[-(PERIODS - 1) * period :]:
            continue  # nearly always, and places are not looked at
        points = np.array([place.x / scale for place, _ in way[-1 - PERIODS * period :: period]])
        shifts = np.diff(points, axis=0)
        spread = np.linalg.norm(shifts - shifts[-1], axis=1).max()
        most = SAME_SHIFT * float(np.linalg.norm(shifts[-1]))
        if most > 0.0 and max(spread, np.abs(shifts[:, -1]).max()) <= most:
            return np.asarray(shifts[-1] * scale)
    return None


def shift_along_row(nodes: Mapping[int, Node], number: int, scale: Array) -> Array | None:
    """Return the shift of a row of special points of one kind and alpha that ends at a node.

    Where paths branch, their net may repeat itself in several directions, although none of the
    paths does. None where no row has :data:`IN_A_ROW` points.
    """
    here, same = nodes[number], SAME_SHIFT * scale[-1]
    cells = here.before and here.before[1]
    alike = [
        node.place.x
        for node in nodes.values()
        if node.kind == here.kind
        and abs(node.place.alpha - here.place.alpha) <= same
        and (node.before and node.before[1]) == cells
    ]
    if len(alike) < IN_A_ROW:
        return None  # nearly always
    apart = (np.array(alike) - here.place.x) / scale
    for shift in apart[np.linalg.norm(apart, axis=1) > SAME_SHIFT]:
        row = np.arange(2, IN_A_ROW)[:, np.newaxis, np.newaxis] * shift
        off = np.linalg.norm(apart - row, axis=2).min(axis=1).max()
        if off <= SAME_SHIFT * float(np.linalg.norm(shift)):
            return np.asarray(-shift * scale)
    return None


def shrinking_shift(nodes: Mapping[int, Node], number: int) -> Array | None:
    """Return the last shift of a path that turns ever more closely, None of any other path.

    Along alpha = sin(z) / z folds follow each other without end, and no period repeats.
    """
    way = _way_to(nodes, number, NO_END)
    few = len(way) == NO_END and len({names for _, names in way[1:]}) <= LONGEST
    if not few or accumulation([place.alpha for place, _ in way]) is None:
        return None
    return np.asarray(way[-1][0].x - way[-1 - MOST_TURNS][0].x)


def accumulating(nodes: Mapping[int, Node], number: int) -> str:
    """Return at which alpha the special points up to a node accumulate, in words."""
    way = _way_to(nodes, number, TERMS * MOST_TURNS + 2)
    alphas = [place.alpha for place, _ in way]
    limit = accumulation(alphas if nodes[number].lost else alphas[:-1])
    return "" if limit is None else f"; {Remark.ACCUMULATE} {limit:.6g}"


def accumulation(alphas: Sequence[float]) -> float | None:
    """Return the alpha at which successive special points of a path accumulate, None for none.

    Kinds of points may take turns: every second, third and fourth point is tested, too.
    """
    for turns in range(1, MOST_TURNS + 1):
        terms = np.array(alphas[::-1][::turns][: TERMS + 1][::-1])
        if len(terms) > TERMS and (limit := _limit(terms)) is not None:
            return limit
    return None


def _limit(terms: Array) -> float | None:
    """Return the limit of a sequence whose differences have a finite sum, by Raabe's test."""
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
