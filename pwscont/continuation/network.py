"""Discovery: rays leave nodes, pieces arrive at nodes, until no ray is left.

Two pieces meet at one node if it has a ray on the same cell, at the same place, in the
opposite direction: that is how loops close and how nothing is drawn twice.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import final

import numpy as np

from pwscont.continuation.membership import lies_on
from pwscont.continuation.walk import Follower, Walk
from pwscont.foundation.arrays import Array
from pwscont.foundation.kind import Kind
from pwscont.foundation.rounding import CONFIDENCE, EPS
from pwscont.numerics.curve import State
from pwscont.numerics.metric import Metric
from pwscont.numerics.uncertainty import magnitude
from pwscont.transitions.detector import Arrival
from pwscont.transitions.rays import Ray

#: Places closer than this times their size are one, if the rays there agree as well.
#: Far above the accuracy of a located point, far below what separates equal transitions.
JOIN = EPS**0.5


@final
@dataclass(slots=True)
class Node:
    """A special point under discovery."""

    kind: Kind
    x: Array
    message: str
    rays: list[Ray]
    taken: list[bool] = field(init=False)

    def __post_init__(self) -> None:
        self.taken = [False] * len(self.rays)

    def stop(self, message: str) -> None:
        """Note that a ray could not be followed; a degenerate point stays what it is."""
        if self.kind != Kind.DEGENERATE:
            self.kind = Kind.STOPPED
        self.message = f"{self.message}; {message}"


@final
@dataclass(frozen=True, slots=True)
class Edge:
    """A piece under discovery, from the node where it was begun to the node it reached.

    ``begun_at`` is the point in its middle where tracing began, if it began there.
    """

    start: int
    end: int
    ray: Ray
    points: Array
    begun_at: Array | None = None


@final
class Network:
    """All nodes and pieces that can be reached from the starts given so far.

    Parameters
    ----------
    walker : Follower
    report : callable
        Called with the number of pieces and the alpha reached after each piece.
    """

    def __init__(self, walker: Follower, report: Callable[[int, float], None]) -> None:
        self._walker = walker
        self._report = report
        self._queue: deque[tuple[int, int]] = deque()
        self._by_cell: dict[bytes, list[tuple[int, int]]] = defaultdict(list)
        self.nodes: dict[int, Node] = {}
        self.edges: list[Edge] = []

    def add(self, arrival: Arrival) -> None:
        """Start from a special point, and follow everything that can be reached from it."""
        lo, hi = self._walker.interval
        rays = tuple(ray for ray in arrival.rays if _points_inside(ray, lo, hi))
        interior = arrival.kind == Kind.START and len(rays) == len(arrival.rays)
        arrival = replace(arrival, rays=rays)
        known = [match for ray in rays if (match := self._match(ray))]
        if known:
            self._absorb(known[0][0], arrival)
            self._follow_all(after_first=None)
        if known or self._is_isolated_twin(arrival) or (interior and self._is_known(rays[0])):
            return
        start = self._new(arrival)
        if not interior:
            self._register(start)
        self._follow_all(after_first=(lambda: self._dissolve(start)) if interior else None)

    def _follow_all(self, after_first: Callable[[], None] | None) -> None:
        """Work through the queue; both rays of an interior start come first and are joined."""
        for _ in range(2 if after_first else 0):
            self._follow(*self._queue.popleft())
        if after_first:
            after_first()
        while self._queue:
            self._follow(*self._queue.popleft())

    def _follow(self, node: int, index: int) -> None:
        if self.nodes[node].taken[index]:
            return
        self.nodes[node].taken[index] = True
        ray = self.nodes[node].rays[index]
        walk = self._walker.walk(ray).sharing(ray)
        if len(walk.points) == 1:  # not a single step could be taken
            self.nodes[node].stop(walk.arrival.message)
            return
        self.edges.append(Edge(node, self._reach(walk), ray, walk.points))
        self._report(len(self.edges), float(walk.points[-1, -1]))

    def _reach(self, walk: Walk) -> int:
        """Return the node at which a walk arrived, and take its ray there."""
        matches = [self._match(ray) for ray in walk.arrival.rays]
        near = next(filter(None, matches), None)
        if near is None:
            node = self._new(walk.arrival)
            self._register(node)
        else:
            node = near[0]
            self._absorb(node, walk.arrival)
        back = self._match(walk.arrival.rays[0])
        if back is not None:
            self.nodes[back[0]].taken[back[1]] = True
        return node

    def _absorb(self, node: int, arrival: Arrival) -> None:
        """Add to a node the rays that only this arrival shows.

        Transitions apart by no more than rounding may be one corner or two special points,
        depending on where they are reached from; what is known of both is joined.
        """
        news = [ray for ray in arrival.rays if self._match(ray) is None]
        if not news:
            return
        here = self.nodes[node]
        first = len(here.rays)
        here.rays += news
        here.taken += [False] * len(news)
        here.kind, here.message = arrival.kind, arrival.message
        self._queue.extend((node, first + i) for i in range(len(news)))
        self._register(node, first)

    def _match(self, ray: Ray) -> tuple[int, int] | None:
        """Return the node and ray that ``ray`` is, if it is known.

        At a branch point several rays of one cell leave one place: the best aligned is it.
        """
        metric = ray.curve.metric
        covector = metric.covector(ray.state.tangent)
        best, found = 0.0, None
        candidates = chain.from_iterable(self._by_cell[cell] for cell in ray.cells)
        for node, index in candidates:
            known = self.nodes[node].rays[index].state
            cosine = float(covector.dot(known.tangent))
            if cosine > best and _same_place(metric, known, ray.state):
                best, found = cosine, (node, index)
        return found

    def _is_known(self, ray: Ray) -> bool:
        """Tell whether a ray starts on a piece that has been followed."""
        cells, interval = set(ray.cells), self._walker.interval
        return any(
            not cells.isdisjoint(edge.ray.cells)
            and lies_on(edge.ray.curve, edge.points, ray.state, interval)
            for edge in self.edges
        )

    def _is_isolated_twin(self, arrival: Arrival) -> bool:
        """Tell whether a solution without rays is a node already."""
        if arrival.rays:
            return False
        return any(
            np.abs(node.x - arrival.x).max() <= JOIN * (1.0 + np.abs(arrival.x).max())
            for node in self.nodes.values()
        )

    def _new(self, arrival: Arrival) -> int:
        """Add a node whose rays will be followed."""
        node = max(self.nodes, default=-1) + 1
        self.nodes[node] = Node(arrival.kind, arrival.x, arrival.message, list(arrival.rays))
        self._queue.extend((node, index) for index in range(len(arrival.rays)))
        return node

    def _register(self, node: int, first: int = 0) -> None:
        """Let walks arrive at a node, by its rays from the given one on."""
        for index, ray in enumerate(self.nodes[node].rays[first:], start=first):
            for cell in ray.cells:
                self._by_cell[cell].append((node, index))

    def _dissolve(self, start: int) -> None:
        """Join the two halves of the piece in whose middle tracing began."""
        halves = [edge for edge in self.edges if edge.start == start]
        if len(halves) != 2:
            return
        forth, back = halves
        if _same_side(forth, back):
            self.nodes[start].kind = Kind.FOLD
            self.nodes[start].message = f"fold on {forth.ray.curve.selection.label}"
            self._register(start)
            return
        straight = len(forth.points) == 2 and len(back.points) == 2
        rest = forth.points[1:] if straight else forth.points
        points = np.vstack([back.points[:0:-1], rest])
        self.edges = [edge for edge in self.edges if edge not in halves]
        begun_at = self.nodes.pop(start).x
        self.edges.append(Edge(back.end, forth.end, forth.ray, points, begun_at))


def _same_place(metric: Metric, a: State, b: State) -> bool:
    """Tell whether two states are at one place, or no further apart than they are uncertain."""
    if metric.norm(a.x - b.x) <= JOIN * (1.0 + metric.norm(b.x)):
        return True
    errors = magnitude(a.x, a.error) + magnitude(b.x, b.error)
    return bool((np.abs(a.x - b.x) <= CONFIDENCE * errors).all())


def _same_side(forth: Edge, back: Edge) -> bool:
    """Tell whether alpha turns at the point where two halves begin: it is a fold."""
    (first, second) = (edge.points[1, -1] - edge.points[0, -1] for edge in (forth, back))
    return bool(first * second > 0.0)


def _points_inside(ray: Ray, lo: float, hi: float) -> bool:
    """Tell whether a ray from a point of the interval stays in it at first."""
    alpha, slope = ray.state.alpha, ray.curve.slope(ray.state)
    return not ((alpha <= lo and slope < 0.0) or (alpha >= hi and slope > 0.0))
