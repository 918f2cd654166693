"""Discovery: rays leave nodes, pieces arrive at nodes, until no ray is left.

A piece arrives at a known node if the node has a ray in the same cell, at the same place, in the
opposite direction. So loops close.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial, reduce
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.budget import current_budget
from pwscont.basics.outcome import CROSSED, IN_VAIN, FailureReason, Kind, Remark, says
from pwscont.basics.printing import counted
from pwscont.basics.rounding import EPS, GUARD, SAME_ALPHA
from pwscont.continuation.follow import LONG_CHANGE, Follow, PieceFollower, is_cut
from pwscont.continuation.known import (
    EVERY,
    JOIN,
    SAME,
    SAME_CROSSING,
    Edge,
    KnownRay,
    Node,
    accumulating,
    match,
    repeated_shift,
    shift_along_row,
    shrinking_shift,
)
from pwscont.continuation.plan import Report
from pwscont.curve.crossing import loses_rank
from pwscont.curve.error_samples import magnitude
from pwscont.graph.records import Place
from pwscont.system.abilities import Ending
from pwscont.system.selection import Selection
from pwscont.transitions.corner import Corner
from pwscont.transitions.detector import SpecialPointFound, worded
from pwscont.transitions.ends import points_inside
from pwscont.transitions.rays import Ray, opposite


def place_of_arrival(arrival: SpecialPointFound) -> Place:
    """Return the place of an arrival, with the error of its least certain ray."""
    x = arrival.x
    if not arrival.rays:
        return Place(x, magnitude(x, np.zeros((1, len(x)))))
    first, *others = [ray.state.size for ray in arrival.rays]
    return Place(x, reduce(np.maximum, [size for size in others if size is not first], first))


def _sharing(arrival: SpecialPointFound, ray: Ray) -> SpecialPointFound:
    """Return an arrival whose rays along an interface share cells and index of the piece's ray."""
    if not ray.interface_cells:
        return arrival
    along = len(arrival.rays) if arrival.kind == Kind.EVENT else 1
    share = partial(replace, interface_cells=ray.interface_cells, index=ray.index)
    return arrival.leading((*map(share, arrival.rays[:along]), *arrival.rays[along:]))


#: Along a path to infinity other unknowns may oscillate, so that the distance of the path from zero
#: shrinks for a while; this is the smallest factor of such a decrease.
NEARLY_AS_FAR = 0.5
#: How far from where a path to infinity was left alpha may still change, as a part of the interval:
#: a few times as far as is estimated when the path is left.
STILL_AHEAD = 5.0 * LONG_CHANGE


def _is_past(x: Array, back: Ray) -> bool:
    """Tell whether a path to infinity passes a point, from the ray back from where it was left."""
    scale, rest = back.curve.metric.scale, STILL_AHEAD * back.curve.metric.width
    end, point = (back.state.x / scale)[:-1], (x / scale)[:-1]
    ahead = (x[-1] - back.state.alpha) * -np.sign(back.state.tangent[-1])
    return bool(0.0 <= ahead <= rest and end @ point >= NEARLY_AS_FAR * (end @ end))


def _leads_nowhere(points: Sequence[Array], arrival: SpecialPointFound, ray: Ray) -> bool:
    """Tell whether a curved piece is hardly longer than a point, or one of a double root."""
    if ray.curve.selection.is_straight:
        return False
    gone = ray.curve.metric.norm(ray.curve.metric.difference(points[-1], points[0]))
    return gone < NOWHERE or says(worded(arrival.said), FailureReason.TWICE)


def _is_a_point(left: KnownRay, points: Sequence[Array], ray: Ray) -> bool:
    metric, size = ray.curve.metric, ray.state.size
    return all(left.is_at(metric, x, size) for x in points[::-1])


#: Closer to an end of a piece than this distance, in the metric, two branches of a fold are hard to
#: tell apart: nothing is said to have been passed over there.
BESIDE_AN_END = 1e-3
#: Largest distance in the metric between two roundings of one solution, and the part of the way
#: between both at which H must be rounding.
FARTHEST_TWIN, BETWEEN = 1e-3, 0.381966
#: Most steps along curves on which H seems to vanish twice, or which are no longer than this.
MOST_IN_VAIN, NOWHERE = 300, 1e-5
#: What is said of starts that are not followed.
NO_DIGIT = "not followed, for no digit of them is certain"
NO_SOLUTION = "not followed, for H does not vanish there"
#: A path that repeats itself is followed to a bound that is at most this many periods away.
MOST_SHIFTS = 1000


@final
class Discovery:
    """All nodes and pieces that can be reached from the starts given so far.

    ``report`` is called after each piece; ``follow`` is in place of the follower's own, as where a
    journal has pieces.
    """

    def __init__(
        self, follower: PieceFollower, report: Report, follow: Follow | None = None
    ) -> None:
        self._follower, self._report = follower, report
        self._piece_from = follow or follower.follow
        self._queue: deque[KnownRay] = deque()
        self._known_rays: dict[bytes, list[KnownRay]] = defaultdict(list)  # by cell
        self._next = self._first = 0  # numbers of the next node, and of the component's first node
        self.nodes: dict[int, Node] = {}
        self.edges: list[Edge] = []
        self.leaving: list[Ray] = []  # rays that leave the interval
        self._starts: list[Place] = []  # where tracing began on pieces that were forgotten
        self._left_at: list[tuple[Array, Array]] = []  # where endless paths were left, and ways on
        self._endless: list[Ray] = []  # back from where paths to infinity were left
        self._in_vain = 0  # number of steps that led next to nowhere
        self.is_net = False  # whether paths that branch repeat themselves in several directions
        #: The number of starts that were not followed, by the reason in words.
        self.left_out = {NO_DIGIT: 0, IN_VAIN: 0, NO_SOLUTION: 0}

    def add(self, arrival: SpecialPointFound, start: Corner | None = None) -> None:
        """Start from a special point, and follow everything that can be reached from it."""
        place, inside = place_of_arrival(arrival), self._inside(arrival, back=0)
        outside = [ray for ray in arrival.rays if ray not in inside.rays]
        interior = arrival.kind == Kind.START and not outside
        rays = [KnownRay.of(ray, place) for ray in inside.rays]
        if (node := self._node_of(inside, rays)) is not None:
            self._absorb(node, inside, rays)
            self._follow_all()
            return
        if self._stands_on_pieces(inside, interior) or (start and self._is_twin(start)):
            return
        if arrival.rays and self._is_in_vain(arrival.rays[0]):
            self.left_out[IN_VAIN] += 1
            return
        if not current_budget().allows(len(self.edges)):
            return
        first = self._first = self._new(inside, place, rays)
        self.leaving += outside
        if interior:  # both rays come first and are joined
            self._follow(self._queue.popleft())
            self._follow(self._queue.popleft())
            self._dissolve(first, inside.rays[0].curve.selection)
        else:
            self._remember(rays)
        self._follow_all()

    def is_beyond(self, x: Array) -> bool:
        """Tell whether a start lies farther out, on an endless path that has been followed."""
        farther = any((x - place)[:-1] @ way > 0.0 for place, way in self._left_at)
        return farther or any(_is_past(x, back) for back in self._endless)

    def spans(self, lo: float, hi: float) -> bool:
        """Tell whether at every alpha from lo to hi there is a piece."""
        reached = lo
        for least, most in sorted(edge.span() for edge in self.edges):
            if least > reached:
                return False
            reached = max(reached, most)
        return reached >= hi

    def close(self, why: str) -> None:
        """Mark the nodes with rays that were not followed, and say why; ends the discovery."""
        why = why or "special points were passed over"
        for number, node in self.nodes.items():
            if left := sum(known.ray is not None for known in node.rays):
                node.stop(f"{why}, {counted(left, 'piece')} not followed", left)
                node.kind = Kind.STOPPED
            if node.kind == Kind.STOPPED:
                node.said = node.message + accumulating(self.nodes, number)

    def _follow_all(self) -> None:
        while self._queue:
            known = self._queue.popleft()
            if known.ray is not None and not current_budget().allows(len(self.edges)):
                return
            self._follow(known)

    def _follow(self, left: KnownRay) -> None:
        """Follow a ray to the end of its piece, if no piece has arrived on the ray."""
        here, ray = self.nodes[left.node], left.ray
        if ray is None or self._is_useless(left, ray):
            return
        points, arrival = self._piece_from(ray)
        self._in_vain += len(points) if _leads_nowhere(points, arrival, ray) else 0
        arrival = self._inside(_sharing(arrival, ray), back=1)
        if len(points) == 1 and is_cut(arrival):
            return
        left.ray = None
        is_rounding = arrival.kind == Kind.STOPPED and _is_a_point(left, points, ray)
        if len(points) == 1 or is_rounding:  # not a single step could be taken
            here.stop(arrival.message)
            return
        if arrival.kind == Kind.END:
            self.leaving.append(arrival.rays[0].reversed())
        if arrival.kind == Kind.STOPPED and says(worded(arrival.said), FailureReason.ENDLESS):
            self._endless.append(arrival.rays[0])
        end = place_of_arrival(arrival)
        reached = self._reach(points, arrival, end, left)
        if reached == left.node and arrival.kind != Kind.STOPPED and _is_a_point(left, points, ray):
            return  # a way along an interface that infinite slopes seem to have
        edge = Edge.of(ray, left, points, reached, end, arrival.rays[0])
        for place in self._starts:
            if _passes_place(edge, ray, place):
                self._starts.remove(place)
                edge = edge._replace(begun_at=place)
                break
        self.edges.append(edge)
        self.nodes[reached].before = self.nodes[reached].before or (left.node, left.names)
        if not ray.curve.selection.is_straight:  # straight pieces pass over nothing
            self._keep_shorter(self.edges[-1], left, ray)
        self._report(len(self.edges), float(points[-1][-1]))

    def _is_useless(self, left: KnownRay, ray: Ray) -> bool:
        """Tell whether a ray is not followed, and say why at its node; in a net, no ray is."""
        is_due = (len(self.edges) + 1) % EVERY == 0 and not current_budget().is_limited
        repeats = is_due and self._repeats_itself(left.node, ray.curve.metric.scale)
        if not (repeats or self._is_in_vain(ray)):
            return False
        why = Remark.REPEATS if repeats else FailureReason.TWICE
        for known in (left, *self._queue) if repeats and self.is_net else (left,):
            if known.ray is not None:
                self.nodes[known.node].stop(why.value)
                known.ray = None
        return True

    def _is_in_vain(self, ray: Ray) -> bool:
        """Tell whether a ray would lead next to nowhere, as rays before from such points did.

        Along a double root the Jacobian loses rank, and rounding makes folds without end.
        """
        return self._in_vain > MOST_IN_VAIN and loses_rank(ray.curve, ray.state.x)

    def _repeats_itself(self, number: int, scale: Array) -> bool:
        """Tell whether the path to a node repeats itself, and no bound is near."""
        shift, bounds = repeated_shift(self.nodes, number, scale), self._follower.bounds
        if shift is None:
            first = min(number, self._first)  # a later start may meet rays of an earlier one
            near = {key: node for key, node in self.nodes.items() if key >= first}
            shift = shift_along_row(near, number, scale)
            self.is_net |= shift is not None and bounds is None
        if shift is None:
            shift = shrinking_shift(self.nodes, number)
        place = self.nodes[number].place.x
        if shift is None or (bounds and bounds.shifts_within(place, shift) <= MOST_SHIFTS):
            return False
        self._left_at.append((place, (shift / scale**2)[:-1]))
        return True

    def _inside(self, arrival: SpecialPointFound, back: int) -> SpecialPointFound:
        """Return a special point without the rays that leave interval or bounds at once.

        The first ``back`` rays stay. A transition that only rounding tells from an end may be met
        before the end.
        """
        (lo, hi), bounds = self._follower.interval, self._follower.bounds
        rays, why = arrival.rays[:back], None
        for ray in arrival.rays[back:]:
            left_by = bounds and bounds.left_by(ray)
            if points_inside(ray, lo, hi) and not left_by:
                rays = (*rays, ray)
            why = why or left_by
        if len(rays) == len(arrival.rays):
            return arrival  # nearly always
        if len(rays) == 1 and (why or (back and arrival.kind != Kind.END)):
            return SpecialPointFound(Kind.END, arrival.x, why or "end of the interval", rays)
        if not why:
            return arrival.leading(rays)
        said = f"{worded(arrival.said)}; {Remark.ON_BOUND}: {why}"
        return SpecialPointFound(arrival.kind, arrival.x, said, rays)

    def _reach(
        self, points: Sequence[Array], arrival: SpecialPointFound, place: Place, begun: KnownRay
    ) -> int:
        """Return the node at which a piece arrived, and remove the node's ray that leads back.

        A piece that stops so close to its beginning that both ends seem one node is no loop: the
        end may be another node close by.
        """
        rays = [KnownRay.of(ray, place) for ray in arrival.rays]
        left, node = None, self._node_of(arrival, rays)
        if node is not None and _is_a_point(begun, points, arrival.rays[0]):
            left, node = begun, self._node_of(arrival, rays, left=begun)
        if node is None:
            rays[0].ray = None
            node = self._new(arrival, place, rays)
            self._remember(rays)
            return node
        self._absorb(node, arrival, rays, left if node == begun.node else None)
        if node == begun.node and arrival.kind == Kind.STOPPED:
            self.nodes[node].stop(arrival.message)
        if known := match(self._known_rays, rays[0], left):
            known.ray = None
        return node

    def _node_of(
        self, arrival: SpecialPointFound, rays: Sequence[KnownRay], left: KnownRay | None = None
    ) -> int | None:
        """Return the node that a special point is, if one of its rays is known.

        Curves that the system or an event ends at one place share a node, although no rays match.
        """
        for ray in rays:
            if found := match(self._known_rays, ray, left):
                return found.node
        if not rays:
            return None
        back = arrival.rays[0]
        ends = arrival.kind == Kind.END and isinstance(back.curve.selection.system, Ending)
        if not (ends or (arrival.kind == Kind.EVENT and len(rays) == 1)):
            return None
        there = back.curve.metric, back.state.x, back.state.size
        alike = (number for number, node in self.nodes.items() if node.kind == arrival.kind)
        return next((n for n in alike if self.nodes[n].rays[0].is_at(*there)), None)

    def _absorb(
        self,
        node: int,
        arrival: SpecialPointFound,
        rays: Sequence[KnownRay],
        left: KnownRay | None = None,
    ) -> None:
        """Add to a node the rays that only this arrival shows.

        Transitions apart by rounding may look like one corner, or from the other side like two.
        """
        if news := [ray for ray in rays if not match(self._known_rays, ray, left)]:
            self.nodes[node].kind, self.nodes[node].said = arrival.kind, arrival.said
            self._let_leave(node, news)
            self._remember(news)

    def _remember(self, rays: Iterable[KnownRay]) -> None:
        """Let pieces arrive on rays."""
        for known in rays:
            for cell in known.names:
                self._known_rays[cell].append(known)

    def _let_leave(self, node: int, rays: Sequence[KnownRay]) -> None:
        """Let rays leave a node; those that are not followed yet come into the queue."""
        for known in rays:
            known.node = node
        self.nodes[node].rays += rays
        self._queue += [known for known in rays if known.ray is not None]

    def _new(self, arrival: SpecialPointFound, place: Place, rays: Sequence[KnownRay]) -> int:
        node, self._next = self._next, self._next + 1
        self.nodes[node] = Node(arrival.kind, place, arrival.said)
        self._let_leave(node, rays)
        return node

    def _keep_shorter(self, edge: Edge, left: KnownRay, ray: Ray) -> None:
        """Keep the shorter of two pieces that overlap: the longer piece passed over an end.

        The rest of the longer piece is followed from that end. A longer piece that comes second is
        forgotten: another piece will arrive on its ray.
        """
        for other in [e for e in self.edges if edge.end in (e.start, e.end) and e is not edge]:
            if self._passes_over(other, edge, ray):
                self._forget(other)
            elif self._passes_over(edge, other, ray):
                self._forget(edge)
                left.ray = ray
                return

    def _passes_over(self, longer: Edge, shorter: Edge, ray: Ray) -> bool:
        """Tell whether one piece passes over the end of another one that it shares an end with."""
        far = {shorter.start, shorter.end} - {longer.start, longer.end}
        if len(far) != 1 or shorter.start == shorter.end or not longer.is_in(shorter.names):
            return False
        node, metric = self.nodes[far.pop()], ray.curve.metric
        ends = longer.first.x, longer.last.x
        if any(metric.norm(metric.difference(node.place.x, x)) < BESIDE_AN_END for x in ends):
            return False
        if node.kind == Kind.FOLD:
            return longer.passes_fold(ray.curve, node.place.x)
        same = SAME_CROSSING if node.kind == Kind.BRANCH_POINT else SAME
        return _passes_place(longer, ray, node.place, same)

    def _forget(self, edge: Edge) -> None:
        self.edges[:] = [each for each in self.edges if each is not edge]
        self._starts += [] if edge.begun_at is None else [edge.begun_at]

    def _stands_on_pieces(self, arrival: SpecialPointFound, interior: bool) -> bool:
        """Tell whether a start is a point of known pieces, also where rounding alone adds rays."""
        rays = arrival.rays
        crossed = arrival.kind in (*CROSSED, Kind.EVENT) and len(rays) == 2
        passed = not interior and len(rays) == 2 and opposite(*rays)
        asked = rays if crossed or passed else rays[:1] if interior else ()
        return bool(asked) and all(map(self._is_known, asked))

    def _is_known(self, ray: Ray) -> bool:
        """Tell whether a ray starts on a piece that has been followed."""
        state, beside = ray.state, (edge for edge in self.edges if edge.is_in(ray.cells))
        return any(edge.passes(ray.curve, state.x, state.size) for edge in beside)

    def _is_twin(self, start: Corner) -> bool:
        """Tell whether a solution is a node with other rays or none: H is rounding in between."""
        if self.edges and len(self.edges[0].cells[0].signs) != len(start.tests):
            return False  # the number of tests must not change: refused when followed
        metric, x = start.metric, start.x
        same = SAME_ALPHA * max(abs(float(x[-1])), metric.width)
        for node in self.nodes.values():
            if node.rays and abs(node.place.alpha - x[-1]) > same:
                continue  # nearly always
            far = metric.norm(way := metric.difference(node.place.x, x))
            if far > metric.slack(x, FARTHEST_TWIN):
                continue
            if not node.rays and far <= metric.slack(x, JOIN):
                return True
            at = x + BETWEEN * way
            own = Selection(start.system, start.system.character(at[:-1], float(at[-1])))
            if own.vanishes(at, metric.sizes(at)):
                return True
        return False

    def _dissolve(self, start: int, selection: Selection) -> None:
        """Join the two halves of the piece in whose middle tracing began."""
        halves = [edge for edge in self.edges if edge.start == start]
        if len(halves) != 2:
            return
        forth, back = halves
        alpha = float(forth.first.x[-1])
        ways = (half.points[:, -1] - alpha for half in halves)
        clear = GUARD * EPS * abs(alpha)
        first, second = (float(way[(abs(way) > clear).argmax()]) for way in ways)
        if first * second > 0.0:  # alpha turns where both halves begin
            node = self.nodes[start]
            node.kind, node.said = Kind.FOLD, f'fold within "{selection.label}"'
            self._remember(node.rays)
            return
        straight = not len(forth.inner) and not len(back.inner)
        inner = np.vstack([back.inner[::-1], forth.points[1 if straight else 0 : -1]])
        self.edges[:] = [edge for edge in self.edges if edge not in halves]
        whole = forth._replace(start=back.end, first=back.last, inner=inner)
        self.edges.append(whole._replace(begun_at=self.nodes.pop(start).place))


def _passes_place(edge: Edge, ray: Ray, place: Place, same: float = SAME) -> bool:
    """Tell whether a place lies on a piece; ``ray`` is any ray of the run."""
    return edge.passes(ray.curve, place.x, magnitude(place.x, place.error[np.newaxis]), same)
