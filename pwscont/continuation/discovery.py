"""Discovery: rays leave nodes, pieces arrive at nodes, until no ray is left.

A piece arrives at a known node if the node has a ray on the same cell, at the same place, in the
opposite direction: that is how loops close, and how no piece is followed twice.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.budget import Budget
from pwscont.basics.kind import Kind
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.endless import EVERY, REPEATS, Past
from pwscont.continuation.follow import FollowedPiece, Follower
from pwscont.continuation.joints import Edge, Node
from pwscont.continuation.membership import lies_on
from pwscont.continuation.ray_keys import JOIN, FollowedRay, direction, names
from pwscont.curve.uncertainty import magnitude
from pwscont.graph.packing import place as place_of
from pwscont.graph.place import Place, Stored
from pwscont.graph.records import Track
from pwscont.system.ending import Ending
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray


@final
class Discovery:
    """All nodes and pieces that can be reached from the starts given so far.

    Parameters
    ----------
    follower : Follower
    report : callable
        Called with the number of pieces and the alpha reached after each piece.
    budget : Budget
        Where it is spent, rays are left that nobody has followed, see :meth:`close`.
    """

    def __init__(
        self, follower: Follower, report: Callable[[int, float], None], budget: Budget
    ) -> None:
        self._follower = follower
        self._report = report
        self._budget = budget
        self._queue: deque[tuple[int, int]] = deque()
        self._by_cell: dict[bytes, list[tuple[int, int]]] = defaultdict(list)
        self._past = Past()
        self._next = 0
        self.nodes: dict[int, Node] = {}
        self.edges: list[Edge] = []

    def add(self, arrival: SpecialPointFound) -> None:
        """Start from a special point, and follow everything that can be reached from it."""
        rays = self._staying(arrival.rays)
        interior = arrival.kind == Kind.START and len(rays) == len(arrival.rays)
        arrival = replace(arrival, rays=rays)
        known = self._known(arrival)
        if known is not None:
            self._absorb(known, arrival, _place(arrival))
            self._follow_all(after_first=None)
            return
        if self._is_isolated_twin(arrival) or self._stands_on_pieces(arrival, interior):
            return
        if not self._budget.allows(len(self.edges)):
            return
        start = self._new(arrival, _place(arrival))
        if not interior:
            self._register(start, arrival.rays)
        dissolve = partial(self._dissolve, start, rays) if interior else None
        self._follow_all(after_first=dissolve)

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
        """Note at the nodes that they have rays left, and why; nothing can be added then."""
        for node in self.nodes.values():
            left = sum(ray is not None for ray in node.rays)
            if left:
                node.stop(f"{why}, {left} piece{'' if left == 1 else 's'} not followed", left)
                node.kind = Kind.STOPPED
        for number, node in self.nodes.items():
            if node.kind == Kind.STOPPED:
                node.message += self._past.accumulation(number, is_special=node.lost > 0)

    def _follow(self, node: int, index: int) -> None:
        ray = self.nodes[node].rays[index]
        if ray is None:
            return
        if self._is_endless(node, ray):
            self.nodes[node].rays[index] = None
            self.nodes[node].stop(REPEATS)
            return
        walk = self._within(self._follower.walk(ray).sharing(ray))
        if walk.is_cut and len(walk.points) == 1:
            return
        self.nodes[node].rays[index] = None
        if len(walk.points) == 1:  # not a single step could be taken
            self.nodes[node].stop(walk.arrival.message)
            return
        start, end = self.nodes[node].keys[index].place, _place(walk.arrival)
        track = Track(start, walk.points[1:-1].copy(), end)
        edge = Edge(node, self._reach(walk, end, node), FollowedRay.of(ray), track)
        self.edges.append(edge)
        self._past.add(node, edge.end, end, edge.followed.names)
        self._report(len(self.edges), float(walk.points[-1, -1]))

    def _is_endless(self, node: int, ray: Ray) -> bool:
        """Tell now and then whether the path to a node repeats itself; not where limits are set."""
        if self._budget.is_limited or (len(self.edges) + 1) % EVERY:
            return False
        return self._past.repeats(node, ray.curve.metric.scale)

    def _staying(self, rays: Iterable[Ray]) -> tuple[Ray, ...]:
        """Return the rays that leave neither the interval nor the bounds at once."""
        lo, hi = self._follower.interval
        return tuple(
            ray
            for ray in rays
            if _points_inside(ray, lo, hi) and not self._follower.bounds.left_by(ray)
        )

    def _within(self, walk: FollowedPiece) -> FollowedPiece:
        """Return a walk without the rays that leave interval or bounds where it arrived.

        A transition at an end but for rounding may be met before that end is.
        """
        back, *others = walk.arrival.rays
        inside = self._staying(others)
        if len(inside) == len(others):
            return walk
        arrival = replace(walk.arrival, rays=(back, *inside))
        if not inside:
            bounds = filter(None, map(self._follower.bounds.left_by, others))
            message = next(bounds, "end of the interval")
            arrival = replace(arrival, kind=Kind.END, message=message)
        return replace(walk, arrival=arrival)

    def _reach(self, walk: FollowedPiece, place: Place, begin: int) -> int:
        """Return the node at which a walk arrived, and take the ray back from there.

        A walk that stops so close to its beginning that both seem to be one node is no loop.
        """
        near = self._known(walk.arrival)
        if near is None:
            node = self._new(walk.arrival, place)
            self._register(node, walk.arrival.rays)
        else:
            node = near
            self._absorb(node, walk.arrival, place)
            if node == begin and walk.arrival.kind == Kind.STOPPED:
                self.nodes[node].stop(walk.arrival.message)
        back = self._match(walk.arrival.rays[0])
        if back is not None:
            self.nodes[back[0]].rays[back[1]] = None
        return node

    def _known(self, arrival: SpecialPointFound) -> int | None:
        """Return the node that a special point is, if one of its rays is known.

        Curves that end at one place on purpose share a node, though none goes on as another.
        """
        matches = (self._match(ray) for ray in arrival.rays)
        return next((match[0] for match in matches if match), self._end_at(arrival))

    def _end_at(self, arrival: SpecialPointFound) -> int | None:
        """Return the node at which other curves end on purpose, at the place of such an end."""
        if not _ends_on_purpose(arrival):
            return None
        alike = (n for n, node in self.nodes.items() if node.kind == arrival.kind)
        return next((n for n in alike if self.nodes[n].keys[0].is_where(arrival.rays[0])), None)

    def _absorb(self, node: int, arrival: SpecialPointFound, place: Place) -> None:
        """Add to a node the rays that only this arrival shows.

        Transitions apart by no more than rounding may be one corner or two special points,
        depending on where they are reached from; the rays known from either side are joined.
        """
        news = [ray for ray in arrival.rays if self._match(ray) is None]
        if not news:
            return
        here = self.nodes[node]
        first = len(here.rays)
        here.add(news, place)
        here.kind, here.message = arrival.kind, arrival.message
        self._queue.extend((node, first + i) for i in range(len(news)))
        self._register(node, news, first)

    def _match(self, ray: Ray) -> tuple[int, int] | None:
        """Return the node and ray that ``ray`` is, if it is known.

        At a branch point several rays of one cell leave one place: the best aligned is taken.
        """
        best, found, towards = 0.0, None, direction(ray)
        candidates = chain.from_iterable(self._by_cell[cell] for cell in names(ray))
        for node, index in candidates:
            cosine = self.nodes[node].keys[index].alignment(ray, towards)
            if cosine > best:
                best, found = cosine, (node, index)
        return found

    def _is_known(self, ray: Ray) -> bool:
        """Tell whether a ray starts on a piece that has been followed."""
        cells, interval = set(names(ray)), self._follower.interval
        return any(
            not cells.isdisjoint(edge.followed.names)
            and lies_on(edge.followed.curve(ray.curve), edge.track.points, ray.state, interval)
            for edge in self.edges
        )

    def _stands_on_pieces(self, arrival: SpecialPointFound, interior: bool) -> bool:
        """Tell whether a start is a point of known pieces.

        A start that rounding alone puts on an interface is a point of the pieces on both sides.
        """
        rays = arrival.rays
        two_sided = (Kind.TRANSITION, Kind.NONSMOOTH_FOLD, Kind.EVENT)
        crossed = arrival.kind in two_sided and len(rays) == 2
        asked = rays if crossed else rays[:1] if interior else ()
        return bool(asked) and all(self._is_known(ray) for ray in asked)

    def _is_isolated_twin(self, arrival: SpecialPointFound) -> bool:
        """Tell whether a solution without rays is a node already."""
        if arrival.rays:
            return False
        (lo, hi), alpha = self._follower.interval, float(arrival.x[-1])
        same = SAME_ALPHA * max(abs(alpha), hi - lo)
        return any(
            abs(node.place.alpha - alpha) <= same and _is_near(node.place.x[:-1], arrival.x[:-1])
            for node in self.nodes.values()
        )

    def _new(self, arrival: SpecialPointFound, place: Place) -> int:
        """Add a node whose rays will be followed."""
        node, self._next = self._next, self._next + 1
        self.nodes[node] = Node(arrival.kind, place, arrival.message)
        self.nodes[node].add(arrival.rays, place)
        self._queue.extend((node, index) for index in range(len(arrival.rays)))
        return node

    def _register(self, node: int, rays: Iterable[Ray], first: int = 0) -> None:
        """Let walks arrive at a node, by these rays of it, numbered from ``first`` on."""
        for index, ray in enumerate(rays, start=first):
            for cell in names(ray):
                self._by_cell[cell].append((node, index))

    def _dissolve(self, start: int, rays: Sequence[Ray]) -> None:
        """Join the two halves of the piece in whose middle tracing began."""
        halves = [edge for edge in self.edges if edge.start == start]
        if len(halves) != 2:
            return
        forth, back = halves
        if _same_side(forth, back):
            self.nodes[start].kind = Kind.FOLD
            self.nodes[start].message = f"fold on {rays[0].curve.selection.label}"
            self._register(start, rays)
            return
        straight = not len(forth.track.inner) and not len(back.track.inner)
        middle = forth.track.points[0 if not straight else 1 : -1]
        inner = np.vstack([back.track.inner[::-1], middle])
        self.edges = [edge for edge in self.edges if edge not in halves]
        begun_at = self.nodes.pop(start).place
        track = Track(back.track.end, inner, forth.track.end)
        self.edges.append(Edge(back.end, forth.end, forth.followed, track, begun_at))


def _ends_on_purpose(arrival: SpecialPointFound) -> bool:
    """Tell whether the system, or an event, ends curves at a special point."""
    rays = arrival.rays
    stops = arrival.kind == Kind.EVENT and len(rays) == 1
    ends = arrival.kind == Kind.END and len(rays) > 0
    return stops or (ends and isinstance(rays[0].curve.selection.system, Ending))


def _is_near(z: Array, other: Array) -> bool:
    return bool(np.abs(z - other).max() <= JOIN * (1.0 + np.abs(z).max()))


def _place(arrival: SpecialPointFound) -> Place:
    """Return where an arrival is, as certain as its least certain ray.

    It is stored as a solution of the piece that arrived.
    """
    x = arrival.x
    if not arrival.rays:
        return Stored(x, magnitude(x, np.zeros((1, len(x)))))
    selection = arrival.rays[0].curve.selection
    error = np.max([magnitude(x, ray.state.error) for ray in arrival.rays], axis=0)
    return place_of(selection.system, selection.character, x, error)


def _same_side(forth: Edge, back: Edge) -> bool:
    """Tell whether alpha turns at the point where two halves begin: it is a fold."""
    first, second = (float(np.subtract(*edge.track.alpha[1::-1])) for edge in (forth, back))
    return first * second > 0.0


def _points_inside(ray: Ray, lo: float, hi: float) -> bool:
    """Tell whether a ray from a point of the interval stays in it at first.

    At a fold at an end the rays' own alphas may be beside that end by rounding.
    """
    alpha, slope, same = ray.state.alpha, ray.curve.slope(ray.state), SAME_ALPHA * (hi - lo)
    return not ((alpha - lo <= same and slope < 0.0) or (hi - alpha <= same and slope > 0.0))
