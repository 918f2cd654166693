"""Discovery: rays leave nodes, pieces arrive at nodes, until no ray is left.

A piece arrives at a known node if the node has a ray in the same cell, at the same place, in the
opposite direction. So loops close.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.budget import Budget
from pwscont.basics.outcome import ON_BOUND, Kind
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.follow import FollowedPiece, Follower
from pwscont.continuation.known import (
    EVERY,
    JOIN,
    REPEATS,
    SAME,
    SAME_CROSSING,
    Edge,
    FollowedRay,
    KnownRay,
    KnownRays,
    Past,
    RayKey,
    name_of,
    placed,
    ray_back,
    starts_on,
)
from pwscont.curve.error_samples import magnitude
from pwscont.graph.records import Place, Track
from pwscont.system.abilities import Ending
from pwscont.transitions.corner.cone import opposite
from pwscont.transitions.departures import Standing
from pwscont.transitions.detector import Said, SpecialPointFound, worded
from pwscont.transitions.ends import Bounds, points_inside
from pwscont.transitions.rays import Ray


@final
@dataclass(slots=True)
class Node:
    """A special point under discovery.

    Only the key is kept of a ray that was followed, or on which a piece arrived. ``also`` are the
    words of users' detectors that would have marked the point, which is of another kind.
    """

    kind: Kind | str
    place: Place
    said: Said
    rays: list[Ray | None] = field(default_factory=list)
    keys: list[RayKey] = field(default_factory=list)
    lost: int = 0
    also: list[str] = field(default_factory=list)

    def add(self, rays: Iterable[Ray], keys: Iterable[RayKey]) -> None:
        """Let more rays leave, which are known by these keys."""
        self.rays.extend(rays)
        self.keys.extend(keys)

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


def ends_on_purpose(arrival: SpecialPointFound) -> bool:
    """Tell whether the system, or an event, ends curves at a special point."""
    rays = arrival.rays
    stops = arrival.kind == Kind.EVENT and len(rays) == 1
    ends = arrival.kind == Kind.END and len(rays) > 0
    return stops or (ends and isinstance(rays[0].curve.selection.system, Ending))


def place_of_arrival(arrival: SpecialPointFound) -> Place:
    """Return the place of an arrival, with the error of its least certain ray."""
    x = arrival.x
    if not arrival.rays:
        return Place(x, magnitude(x, np.zeros((1, len(x)))))
    first, *others = [ray.state.size for ray in arrival.rays]
    error = reduce(np.maximum, [size for size in others if size is not first], first)
    return Place(x, error)


def keys_at_end(walk: FollowedPiece, ray: Ray, key: RayKey, end: Place) -> list[RayKey]:
    """Return the keys of the rays at the end of a piece, which began with a ray with this key."""
    back, *others = walk.arrival.rays
    is_straight = len(walk.points) == 2 and back.curve is ray.curve
    first = key.reversed(end) if is_straight else RayKey.of(back, end)
    return [first, *[RayKey.of(other, end) for other in others]]


def without_leaving(
    arrival: SpecialPointFound, staying: tuple[Ray, ...], bounds: Bounds
) -> SpecialPointFound:
    """Return a special point with the rays that stay, and words on bounds that the rest leaves."""
    gone = [ray for ray in arrival.rays if ray not in staying]
    why = next(filter(None, map(bounds.left_by, gone)), None)
    if why is None:
        return arrival.leading(staying)
    if len(staying) == 1:
        return SpecialPointFound(Kind.END, arrival.x, why, staying)
    said = partial(_also, arrival.said, f"{ON_BOUND}: {why}")
    return SpecialPointFound(arrival.kind, arrival.x, said, staying)


def _also(said: Said, more: str) -> str:
    return f"{worded(said)}; {more}"


#: Closer to an end of a piece than this distance, in the metric, two branches of a fold are hard to
#: tell apart: nothing is said to have been passed over there.
BESIDE_AN_END = 1e-3
#: Kinds of special points at which a curve leaves one cell for another: the change says all.
CROSSED = (Kind.TRANSITION, Kind.NONSMOOTH_FOLD)


@final
class Discovery:
    """All nodes and pieces that can be reached from the starts given so far.

    Parameters
    ----------
    follower : Follower
    report : callable
        Called with the number of pieces and the alpha reached after each piece.
    budget : Budget
        Where the budget is spent, some rays are not followed, see :meth:`close`.
    """

    def __init__(
        self, follower: Follower, report: Callable[[int, float], None], budget: Budget
    ) -> None:
        self._follower = follower
        self._report = report
        self._budget = budget
        self._queue: deque[tuple[int, int]] = deque()
        self._known_rays = KnownRays()
        self._past = Past()
        self._next = 0
        self.nodes: dict[int, Node] = {}
        self.edges: list[Edge] = []
        #: Rays that leave the interval.
        self.leaving: list[Ray] = []
        self._starts: list[Place] = []
        self._again: set[tuple[int, int]] = set()
        self._repeats = False

    def add(self, arrival: SpecialPointFound) -> None:
        """Start from a special point, and follow everything that can be reached from it."""
        rays, place = self._staying(arrival.rays), place_of_arrival(arrival)
        interior = arrival.kind == Kind.START and len(rays) == len(arrival.rays)
        outside = [ray for ray in arrival.rays if ray not in rays]
        arrival = without_leaving(arrival, rays, self._follower.bounds)
        keys = [RayKey.of(ray, place) for ray in rays]
        known = self._known(arrival, keys)
        if known is not None:
            self._absorb(known, arrival, keys)
            self._follow_all(after_first=None)
            return
        if self._is_isolated_twin(arrival) or self._stands_on_pieces(arrival, interior):
            return
        if not self._budget.allows(len(self.edges)):
            return
        start = self._new(arrival, place, keys)
        self.leaving += outside
        if not interior:
            self._known_rays.add(start, keys)
        dissolve = partial(self._dissolve, start, rays) if interior else None
        self._follow_all(after_first=dissolve)

    def has(self, standing: Standing) -> bool:
        """Tell whether a solution on an interface is a known transition between the two cells.

        One ray leaves into each (F1): there is nothing else to be found.
        """
        if standing.other is None:
            return False
        cells = (name_of(curve.selection.cell) for curve in (standing.curve, standing.other))
        one, other = map(self._known_rays.nodes_in, cells)
        metric, size = standing.curve.metric, magnitude(standing.x, standing.error)
        nodes = (self.nodes[node] for node in one & other)
        return any(
            node.kind in CROSSED
            and len(node.keys) == 2
            and node.keys[0].is_at(metric, standing.x, size)
            for node in nodes
        )

    def is_beyond(self, x: Array) -> bool:
        """Tell whether a start lies farther out than a path was followed that never ends.

        From there the same path would be followed again, to where that path repeats itself.
        """
        if not self._repeats:
            return False
        points = np.vstack([edge.track.points for edge in self.edges])[:, :-1]
        return bool(((x[:-1] < points.min(axis=0)) | (x[:-1] > points.max(axis=0))).any())

    def spans(self, lo: float, hi: float) -> bool:
        """Tell whether at every alpha from lo to hi there is a piece."""
        reached = lo
        for edge in sorted(self.edges, key=lambda edge: float(edge.track.alpha.min())):
            if edge.track.alpha.min() > reached:
                return False
            reached = max(reached, float(edge.track.alpha.max()))
        return reached >= hi

    def _follow_all(self, after_first: Callable[[], None] | None) -> None:
        """Work through the queue; both rays of an interior start come first and are joined."""
        for _ in range(2 if after_first else 0):
            self._follow(*self._queue.popleft())
        if after_first:
            after_first()
        while self._queue:
            node, index = self._queue.popleft()
            if self.nodes[node].rays[index] is None:
                continue
            if not self._budget.allows(len(self.edges)):
                return
            self._follow(node, index)

    def close(self, why: str) -> None:
        """Mark the nodes with rays that were not followed, and say why; ends the discovery."""
        for node in self.nodes.values():
            left = len(node.rays) - node.rays.count(None)
            if left:
                why = why or "special points were passed over"
                node.stop(f"{why}, {left} piece{'' if left == 1 else 's'} not followed", left)
                node.kind = Kind.STOPPED
        for number, node in self.nodes.items():
            if node.kind == Kind.STOPPED:
                node.said = node.message + self._past.accumulation(number, is_special=node.lost > 0)

    def _follow(self, node: int, index: int) -> None:
        here = self.nodes[node]
        ray = here.rays[index]
        if ray is None:
            return
        if (len(self.edges) + 1) % EVERY == 0 and self._is_endless(node, ray):
            here.rays[index], self._repeats = None, True
            here.stop(REPEATS)
            return
        walk = self._within(self._follower.walk(ray).sharing(ray))
        if walk.is_cut and len(walk.points) == 1:
            return
        here.rays[index] = None
        if len(walk.points) == 1:  # not a single step could be taken
            here.stop(walk.arrival.message)
            return
        if walk.arrival.kind == Kind.END:
            self.leaving.append(walk.arrival.rays[0].reversed())
        key, end = here.keys[index], place_of_arrival(walk.arrival)
        keys = keys_at_end(walk, ray, key, end)
        reached = self._reach(walk, end, keys, KnownRay(node, index, key))
        track = Track(key.place, walk.inner, end)
        edge = Edge(node, reached, FollowedRay.of(ray, key), track)
        self.edges.append(self._with_start(edge, ray))
        self._past.add(node, edge.end, end, edge.followed.names)
        if not ray.curve.selection.is_straight:  # straight pieces pass over nothing
            self._settle(self.edges[-1], KnownRay(node, index, key), ray)
        self._report(len(self.edges), float(walk.points[-1][-1]))

    def _is_endless(self, node: int, ray: Ray) -> bool:
        """Tell whether the path to a node repeats itself; not where limits are set."""
        return not self._budget.is_limited and self._past.repeats(node, ray.curve.metric.scale)

    def _staying(self, rays: Iterable[Ray]) -> tuple[Ray, ...]:
        """Return the rays that leave neither the interval nor the bounds at once."""
        return tuple(filter(self._stays, rays))

    def _stays(self, ray: Ray) -> bool:
        """Tell whether a ray leaves neither the interval nor the bounds at once."""
        lo, hi = self._follower.interval
        return points_inside(ray, lo, hi) and not self._follower.bounds.left_by(ray)

    def _within(self, walk: FollowedPiece) -> FollowedPiece:
        """Return a walk without the rays that leave interval or bounds where it arrived.

        A transition that only rounding tells from an end may be met before the end.
        """
        back, *others = walk.arrival.rays
        if all(map(self._stays, others)):
            return walk  # nearly always
        rays = back, *self._staying(others)
        inside = without_leaving(walk.arrival, rays, self._follower.bounds)
        if len(rays) == 1 and inside.kind != Kind.END:
            inside = SpecialPointFound(Kind.END, inside.x, "end of the interval", rays)
        return replace(walk, arrival=inside)

    def _reach(
        self, walk: FollowedPiece, place: Place, keys: Sequence[RayKey], begun: KnownRay
    ) -> int:
        """Return the node at which a walk arrived, and remove its ray that leads back.

        A walk that stops so close to its beginning that both ends seem one node is no loop, and may
        have come from another node as close by.
        """
        rays, left = walk.arrival.rays, None
        node = self._known(walk.arrival, keys)
        if node is not None and _has_stayed(walk, begun.key):
            left, node = begun, self._known(walk.arrival, keys, left=begun)
        if node is None:
            node = self._new(walk.arrival, place, keys, first=1)
            self._known_rays.add(node, keys)
            return node
        self._absorb(node, walk.arrival, keys, left if node == begun.node else None)
        if node == begun.node and walk.arrival.kind == Kind.STOPPED:
            self.nodes[node].stop(walk.arrival.message)
        if back := self._known_rays.match(rays[0], keys[0], left):
            self.nodes[back.node].rays[back.number] = None
        return node

    def _known(
        self, arrival: SpecialPointFound, keys: Sequence[RayKey], left: KnownRay | None = None
    ) -> int | None:
        """Return the node that a special point is, if one of its rays is known.

        Curves that end at one place on purpose share a node, though none goes on as another.
        """
        for ray, key in zip(arrival.rays, keys, strict=True):
            if found := self._known_rays.match(ray, key, left):
                return found.node
        return self._end_at(arrival)

    def _end_at(self, arrival: SpecialPointFound) -> int | None:
        """Return the node at which other curves end on purpose, at the place of such an end."""
        if not ends_on_purpose(arrival):
            return None
        alike = (n for n, node in self.nodes.items() if node.kind == arrival.kind)
        return next((n for n in alike if self.nodes[n].keys[0].is_where(arrival.rays[0])), None)

    def _absorb(
        self,
        node: int,
        arrival: SpecialPointFound,
        keys: Sequence[RayKey],
        left: KnownRay | None = None,
    ) -> None:
        """Add to a node the rays that only this arrival shows.

        Transitions apart by no more than rounding may look like one corner from one side and like
        two special points from the other; the rays found from both sides are joined.
        """
        both = zip(arrival.rays, keys, strict=True)
        news = [(ray, key) for ray, key in both if not self._known_rays.match(ray, key, left)]
        if not news:
            return
        here, (rays, unknown) = self.nodes[node], zip(*news, strict=True)
        first = len(here.rays)
        here.add(rays, unknown)
        here.kind, here.said = arrival.kind, arrival.said
        self._queue.extend((node, first + i) for i in range(len(news)))
        self._known_rays.add(node, unknown, first)

    def _is_known(self, ray: Ray) -> bool:
        """Tell whether a ray starts on a piece that has been followed."""
        return any(starts_on(ray, edge.followed, edge.track) for edge in self.edges)

    def _settle(self, edge: Edge, left: KnownRay, ray: Ray) -> None:
        """Keep the shorter of two pieces that overlap: the longer piece passed over an end.

        A step may pass over two branch points, or over a thin cell. The rest of the longer piece is
        followed from the other end. A longer piece that comes second is forgotten: another piece
        will arrive on its ray.
        """
        beside = [e for e in self.edges if edge.end in (e.start, e.end) and e is not edge]
        for other in beside:
            if self._passes_over(other, edge, ray):
                self._forget(other)
                self._follow_again(other, edge.end, ray)
            elif self._passes_over(edge, other, ray):
                self._forget(edge)
                self.nodes[left.node].rays[left.number] = ray
                return

    def _passes_over(self, longer: Edge, shorter: Edge, ray: Ray) -> bool:
        """Tell whether one piece passes over the end of another one that it shares an end with."""
        far = {shorter.start, shorter.end} - {longer.start, longer.end}
        if len(far) != 1 or shorter.start == shorter.end:
            return False
        if set(longer.followed.names).isdisjoint(shorter.followed.names):
            return False
        node, metric = self.nodes[far.pop()], ray.curve.metric
        ends = longer.track.start, longer.track.end
        if any(metric.norm(metric.difference(node.place.x, e.x)) < BESIDE_AN_END for e in ends):
            return False
        crossed = node.kind == Kind.BRANCH_POINT
        at_end = placed(ray, longer.followed, node.place)
        return starts_on(at_end, longer.followed, longer.track, SAME_CROSSING if crossed else SAME)

    def _forget(self, edge: Edge) -> None:
        self.edges[:] = [each for each in self.edges if each is not edge]
        self._starts += [] if edge.begun_at is None else [edge.begun_at]

    def _follow_again(self, edge: Edge, shared: int, ray: Ray) -> None:
        """Follow a forgotten piece from the end that is not shared with a shorter one."""
        track = edge.track if edge.start == shared else edge.track.reversed()
        back = ray_back(ray, edge.followed, track)
        known = back and self._known_rays.match(back, RayKey.of(back, track.end))
        if known and (known.node, known.number) not in self._again:
            self._again.add((known.node, known.number))
            self.nodes[known.node].rays[known.number] = back
            self._queue.append((known.node, known.number))

    def _with_start(self, edge: Edge, ray: Ray) -> Edge:
        """Return a piece with the place where tracing began, if a forgotten piece had it here."""
        for place in self._starts:
            if starts_on(placed(ray, edge.followed, place), edge.followed, edge.track):
                self._starts.remove(place)
                return edge._replace(begun_at=place)
        return edge

    def _stands_on_pieces(self, arrival: SpecialPointFound, interior: bool) -> bool:
        """Tell whether a start is a point of known pieces.

        A start that rounding alone puts on an interface is a point of the pieces on both sides; one
        where a path along interfaces passes through is a point of that path.
        """
        rays = arrival.rays
        crossed = arrival.kind in (*CROSSED, Kind.EVENT) and len(rays) == 2
        passed = len(rays) == 2 and opposite(*rays)
        asked = rays if crossed or passed else rays[:1] if interior else ()
        return bool(asked) and all(self._is_known(ray) for ray in asked)

    def _is_isolated_twin(self, arrival: SpecialPointFound) -> bool:
        """Tell whether a solution without rays is already a node."""
        if arrival.rays:
            return False
        (lo, hi), alpha = self._follower.interval, float(arrival.x[-1])
        same = SAME_ALPHA * max(abs(alpha), hi - lo)
        return any(
            abs(node.place.alpha - alpha) <= same and _is_near(node.place.x[:-1], arrival.x[:-1])
            for node in self.nodes.values()
        )

    def _new(
        self, arrival: SpecialPointFound, place: Place, keys: Sequence[RayKey], first: int = 0
    ) -> int:
        """Add a node whose rays will be followed, from the first one on that was not."""
        node, self._next = self._next, self._next + 1
        rays = [*[None] * first, *arrival.rays[first:]]
        self.nodes[node] = Node(arrival.kind, place, arrival.said, rays, [*keys])
        self._queue += [(node, index) for index in range(first, len(rays))]
        return node

    def _dissolve(self, start: int, rays: Sequence[Ray]) -> None:
        """Join the two halves of the piece in whose middle tracing began."""
        halves = [edge for edge in self.edges if edge.start == start]
        if len(halves) != 2:
            return
        forth, back = halves
        if _same_side(forth, back):
            self.nodes[start].kind = Kind.FOLD
            self.nodes[start].said = f'fold within "{rays[0].curve.selection.label}"'
            self._known_rays.add(start, self.nodes[start].keys)
            return
        straight = not len(forth.track.inner) and not len(back.track.inner)
        middle = forth.track.points[0 if not straight else 1 : -1]
        inner = np.vstack([back.track.inner[::-1], middle])
        self.edges[:] = [edge for edge in self.edges if edge not in halves]
        begun_at = self.nodes.pop(start).place
        track = Track(back.track.end, inner, forth.track.end)
        self.edges.append(Edge(back.end, forth.end, forth.followed, track, begun_at))


def _has_stayed(walk: FollowedPiece, key: RayKey) -> bool:
    """Tell whether a walk never was clearly anywhere else than where it began."""
    end = walk.arrival.rays[0]
    return all(key.is_at(end.curve.metric, x, end.state.size) for x in walk.points[::-1])


def _is_near(z: Array, other: Array) -> bool:
    return bool(np.abs(z - other).max() <= JOIN * (1.0 + np.abs(z).max()))


def _same_side(forth: Edge, back: Edge) -> bool:
    """Tell whether alpha turns where two halves of a piece begin: the point is a fold."""
    first, second = (float(np.subtract(*edge.track.alpha[1::-1])) for edge in (forth, back))
    return first * second > 0.0
