"""From discovered nodes and pieces to the branch graph.

So no event changes a step, a piece or what is found: the graph is the one without events, and has
the events besides.

Failure modes and answers
-------------------------
- Two points of a piece mean a straight one: a part of a curved piece has a third point.
- At an end of a piece, as at a corner, the tangent may not be known: the chord stands for it.
- An event where tracing began: the point is the event.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count, pairwise
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, Kind, SearchScope
from pwscont.basics.quantities import Function
from pwscont.basics.rounding import CONVERGED, SAME_ALPHA
from pwscont.continuation.detector_words import keep_words
from pwscont.continuation.discovery import Discovery, Edge, Node
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import CurvedSegment, Segment, StraightSegment
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.graph.place import Lifted, Place, Stored, Track, WithoutHidden
from pwscont.graph.place import place as place_of
from pwscont.graph.records import Accuracy, Begun, Change, Passage, Said, Stretch
from pwscont.system.abilities import Ending, HidesUnknowns, Reduction, shown_points
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import TransitionDetector
from pwscont.transitions.events import EventMark, Events


def named_by_events(
    points: Sequence[SpecialPoint], pieces: Sequence[Piece], metric: Metric, events: Events
) -> list[SpecialPoint]:
    """Return special points with the names of the events that are zero there."""
    beyond: dict[int, list[Array]] = defaultdict(list)
    for piece in pieces:
        first, last = _inside(piece)
        beyond[piece.start].append(first)
        beyond[piece.end].append(last)
    return [
        point if point.kind == Kind.EVENT else _named(point, beyond[point.id], metric, events)
        for point in points
    ]


def _inside(piece: Piece) -> tuple[Array, Array]:
    """Return the points of a piece next to its ends; of a straight one both are its middle."""
    points = piece.points
    if len(points) == 2:
        middle: Array = 0.5 * (points[0] + points[1])
        return middle, middle
    return points[1], points[-2]


def _named(
    point: SpecialPoint, beyond: Sequence[Array], metric: Metric, events: Events
) -> SpecialPoint:
    names = events.names_at(metric, point.place.x, point.error, beyond)
    return replace(point, events=", ".join(filter(None, [point.events, names])))


def mark(
    discovery: Discovery,
    system: PiecewiseSystem,
    metric: Metric,
    added: Sequence[TransitionDetector | Events],
) -> None:
    """Mark what users' detectors see at special points, and divide the pieces at events."""
    keep_words(discovery, system, metric, [d for d in added if isinstance(d, TransitionDetector)])
    for events in added:
        if isinstance(events, Events):
            _divide(discovery, system, metric, events)


def _divide(discovery: Discovery, system: PiecewiseSystem, metric: Metric, events: Events) -> None:
    """Divide the pieces of a discovery at the events on them, which become nodes."""
    numbers = count(1 + max(discovery.nodes, default=-1))
    edges, discovery.edges = discovery.edges, []
    for edge in edges:
        whole = _EdgeWithEvents.of(edge, system, metric, events)
        nodes = {next(numbers): node for node in whole.nodes()}
        discovery.nodes.update(nodes)
        discovery.edges.extend(whole.parts(nodes))


@final
@dataclass(frozen=True, slots=True)
class _EdgeWithEvents:
    """A piece, its curve, and the events on it in order."""

    edge: Edge
    curve: Curve
    segments: Sequence[Segment]
    marks: Sequence[EventMark]

    @classmethod
    def of(
        cls, edge: Edge, system: PiecewiseSystem, metric: Metric, events: Events
    ) -> _EdgeWithEvents:
        """Return a piece with the events on it."""
        first, *beside = edge.followed.selection
        curve = Curve(Selection(system, first, tuple(beside)), metric)
        segments, points = list(_segments(curve, edge.track)), edge.track.points
        start, end = edge.track.start, edge.track.end
        along = events.along(curve, start.x, start.error)
        for after, (segment, (a, b)) in enumerate(zip(segments, pairwise(points), strict=True), 1):
            along.look(segment, metric.norm(b - a), after)
        return cls(edge, curve, segments, along.before(end.x, end.error))

    def nodes(self) -> Iterator[Node]:
        """Yield the nodes that the events make."""
        system, character = self.curve.selection.system, self.curve.selection.character
        for mark in self.marks:
            place = place_of(system, character, mark.state.x, mark.state.size)
            yield Node(Kind.EVENT, place, mark.names)

    def parts(self, nodes: Mapping[int, Node]) -> Iterator[Edge]:
        """Yield the parts of the piece between these nodes."""
        if not nodes:
            yield self.edge
            return
        track, points = self.edge.track, self.edge.track.points
        ends = pairwise([track.start, *(node.place for node in nodes.values()), track.end])
        joints = pairwise([self.edge.start, *nodes, self.edge.end])
        cuts = pairwise([1, *(mark.after for mark in self.marks), len(points) - 1])
        begun = self._begun()
        for i, ((a, b), (start, end), (lo, hi)) in enumerate(zip(ends, joints, cuts, strict=True)):
            part = Track(a, self._inner(points[lo:hi], a, b), b)
            begun_at = self.edge.begun_at if i == begun else None
            yield Edge(start, end, self.edge.followed, part, begun_at)

    def _inner(self, inner: Array, start: Place, end: Place) -> Array:
        """Return the points inside a part; of a curved one there is one at least."""
        if len(inner) or len(self.edge.track.inner) == 0:
            return inner
        chord = self.curve.metric.normalised(end.x - start.x)
        first, last = (_state(self.curve, at.x, chord, at.error) for at in (start, end))
        segment = CurvedSegment.between(self.curve, first, last, 0.0)
        middle = segment.point(0.5 * segment.length, None)
        return inner if middle is None else middle[np.newaxis]

    def _begun(self) -> int | None:
        """Return the part in which tracing began, None where it is at an event."""
        begun, metric = self.edge.begun_at, self.curve.metric
        if begun is None or any(
            metric.norm(begun.x - mark.state.x) <= metric.slack(begun.x, CONVERGED)
            for mark in self.marks
        ):
            return None
        apart = [metric.norm(begun.x - x) for x in self.edge.track.points]
        after = int(np.argmin(apart)) if len(self.edge.track.inner) else 0
        segment = self.segments[min(after, len(self.segments) - 1)]
        here = after + 1, segment.position(begun.x)
        return sum((mark.after, mark.position) < here for mark in self.marks)


def _segments(curve: Curve, track: Track) -> Iterator[Segment]:
    """Yield the stretches between the points of a piece."""
    points, metric = track.points, curve.metric
    chords = [metric.normalised(b - a) if (b != a).any() else b - a for a, b in pairwise(points)]
    if len(points) == 2:
        yield StraightSegment(curve, State(points[0], chords[0], track.start.error[np.newaxis], 1))
        return
    errors = [track.start.error, *[np.zeros_like(x) for x in points[1:-1]], track.end.error]
    states = [
        _state(curve, x, chord, error)
        for x, chord, error in zip(points, [*chords, chords[-1]], errors, strict=True)
    ]
    for start, end in pairwise(states):
        yield CurvedSegment.between(curve, start, end, 0.0)


def _state(curve: Curve, x: Array, way: Array, error: Array) -> State:
    """Return the state at a point of a piece that goes on in about this direction."""
    found = BorderedNewton().correct(curve, x, way)
    tangent = way if isinstance(found, Failure) else found.state.tangent
    return State(x, tangent, error[np.newaxis], 1)


#: Kinds of special points of which the change says everything.
CROSSED = frozenset({Kind.TRANSITION, Kind.NONSMOOTH_FOLD})


def assemble(
    discovery: Discovery,
    system: PiecewiseSystem,
    metric: Metric,
    parameter: str,
    searched: SearchScope,
    reduction: Reduction | None,
    record: Mapping[str, Function] | None = None,
    events: Events | None = None,
    infinite: Sequence[Stretch] = (),
) -> BranchGraph:
    """Return the branch graph of a finished discovery.

    Pieces are directed and numbered along the positive orientation of their component. Unknowns
    and signs that a reduction left out are put back. Special points have the names of the events
    there. The metric is that of the system.
    """
    interval = metric.interval
    width = interval[1] - interval[0]
    accuracy = Accuracy(shown_points(system, metric.scale))
    lift = Lift(system, reduction, metric, accuracy, isinstance(system, HidesUnknowns))
    edges = [_Directed(edge, width, lift) for edge in discovery.edges]
    order = list(_in_order(edges))
    numbers = _numbers(order, discovery)
    points = [
        _special_point(number, discovery.nodes[node], meeting, lift)
        for (node, number), meeting in zip(numbers.items(), _meetings(order, numbers), strict=True)
    ]
    pieces = [edge.piece(i, numbers) for i, edge in enumerate(order)]
    starts = [_inner_start(edge, i, lift) for i, edge in enumerate(order)]
    return BranchGraph(
        named_by_events(points, pieces, _shown(system, metric), events) if events else points,
        pieces,
        interval,
        starts=filter(None, starts),
        system=system,
        parameter=parameter,
        searched=searched,
        record=record,
        infinite=infinite,
    )


@final
@dataclass(frozen=True, slots=True)
class Lift:
    """The way from what the followed system knows to what a user sees.

    Unknowns that a reduction left out are put back, unknowns that a system hides are left out.
    """

    system: PiecewiseSystem
    reduction: Reduction | None
    metric: Metric
    accuracy: Accuracy
    hides: bool

    def place(self, place: Place) -> Place:
        """Return a place with the user's unknowns."""
        whole = Lifted(place, self.reduction, self.system.size) if self.reduction else place
        return WithoutHidden(whole, self.system) if self.hides else whole

    def track(self, track: Track) -> Track:
        """Return the points of a piece with the user's unknowns."""
        if self.reduction is None and not self.hides:
            return track
        inner = track.inner
        if self.reduction is not None:
            inner = self.reduction.points(inner, self.system.size)
        inner = shown_points(self.system, inner)
        return Track(self.place(track.start), inner, self.place(track.end))

    def character(self, character: Character) -> Character:
        """Return the character with all signs."""
        if self.reduction is None:
            return character
        whole = self.reduction.character(character)
        whole.pack()
        return whole


def _shown(system: PiecewiseSystem, metric: Metric) -> Metric:
    """Return the metric of the unknowns that a user sees."""
    if not isinstance(system, HidesUnknowns):
        return metric
    period = Box.of(system).period[: system.shown]
    return Metric(shown_points(system, metric.scale), metric.interval, period)


class _Directed:
    """An edge, turned into the direction of the positive orientation."""

    def __init__(self, edge: Edge, width: float, lift: Lift) -> None:
        self.edge, followed = edge, edge.followed
        forward = followed.orientation > 0
        self.start, self.end = (edge.start, edge.end) if forward else (edge.end, edge.start)
        followed_track = edge.track if forward else edge.track.reversed()
        #: Where it begins and ends, in the followed system.
        self.places = followed_track.start, followed_track.end
        self.track = lift.track(followed_track)
        self.character = lift.character(followed.character)
        self.naming = lift.system.label
        rise = self.track.end.alpha - self.track.start.alpha
        is_level = abs(rise) <= SAME_ALPHA * width
        rises = 0 if is_level else 1 if rise > 0.0 else -1
        self.det_sign = followed.index if followed.along_interface else self._direction(rises)
        if is_level and not self.det_sign:
            self.track = _vertical(self.track)

    def _direction(self, rises: int) -> int:
        """Return the direction of alpha: on the positive orientation, the sign of det(dH/dz)."""
        if rises:
            return rises
        followed = self.edge.followed
        return int(np.sign(followed.slope)) * followed.orientation

    def piece(self, number: int, numbers: dict[int, int]) -> Piece:
        return Piece(
            id=number,
            start=numbers[self.start],
            end=numbers[self.end],
            character=self.character,
            naming=self.naming,
            track=self.track,
            det_sign=self.det_sign,
        )


def _vertical(track: Track) -> Track:
    """Return the track with one alpha, as its ends differ by rounding only."""
    points = track.points
    points[:, -1] = track.start.alpha
    return Track.of(points)


class _Meeting(NamedTuple):
    """The edges that end and that begin at a node."""

    before: list[_Directed]
    after: list[_Directed]

    def places(self) -> list[Place]:
        """Return where they end and begin, in the followed system."""
        return [edge.places[1] for edge in self.before] + [edge.places[0] for edge in self.after]


def _meetings(edges: list[_Directed], nodes: Iterable[int]) -> Iterable[_Meeting]:
    """Return which edges meet at each node, in the order of the nodes."""
    meetings = {node: _Meeting([], []) for node in nodes}
    for edge in edges:
        meetings[edge.start].after.append(edge)
        meetings[edge.end].before.append(edge)
    return meetings.values()


def _in_order(edges: list[_Directed]) -> Iterator[_Directed]:
    """Yield the edges so that each component is walked through, sources first."""
    leaving: dict[int, list[_Directed]] = defaultdict(list)
    entered = {edge.end for edge in edges}
    for edge in edges:
        leaving[edge.start].append(edge)
    sources = [edge.start for edge in edges if edge.start not in entered]
    for source in [*sources, *(edge.start for edge in edges)]:
        node = source
        while leaving[node]:
            edge = leaving[node].pop(0)
            yield edge
            node = edge.end


def _numbers(order: list[_Directed], discovery: Discovery) -> dict[int, int]:
    """Return a number for each node: first for those of the pieces in order, then isolated ones."""
    ends = [node for edge in order for node in (edge.start, edge.end)]
    return {node: i for i, node in enumerate(dict.fromkeys([*ends, *discovery.nodes]))}


def _special_point(number: int, node: Node, meeting: _Meeting, lift: Lift) -> SpecialPoint:
    place = lift.place(_covering(node, meeting.places(), lift))
    said, kind = _passage(lift.system, node, meeting), _kind(node, meeting)
    also = ", ".join(node.also)
    return SpecialPoint(
        number, kind, place, said, accuracy=lift.accuracy, lost=node.lost, events=also
    )


def _kind(node: Node, meeting: _Meeting) -> Kind | str:
    """Return the kind of a node; where one cell is left for another alpha tells whether it turns.

    Slopes at the node itself may be zero to rounding: a smooth fold may lie on the interface.
    """
    edges = [*meeting.before, *meeting.after]
    if node.kind not in CROSSED or len(meeting.before) != 1 or len(meeting.after) != 1:
        return node.kind
    if any(directed.edge.followed.along_interface for directed in edges):
        return node.kind  # their signs are those of several solutions close by
    signs = edges[0].det_sign * edges[1].det_sign
    turns = Kind.NONSMOOTH_FOLD if signs < 0 else Kind.TRANSITION
    return turns if signs else node.kind


def _covering(node: Node, ends: list[Place], lift: Lift) -> Place:
    """Return the place of a node, with an error that covers all ends and rays joined in it."""
    here = node.place
    others = [one for one in (*ends, *[key.place for key in node.keys]) if one is not here]
    if not others:
        return here  # nearly always
    errors = [
        np.maximum(one.error, np.abs(lift.metric.difference(one.x, here.x))) for one in others
    ]
    return Stored(here.x, np.max([here.error, *errors], axis=0))


def _inner_start(directed: _Directed, piece: int, lift: Lift) -> SpecialPoint | None:
    """Return the point in the middle of a piece where tracing began, if it did."""
    edge = directed.edge
    if edge.begun_at is None:
        return None
    place = lift.place(edge.begun_at)
    begun = Begun(lift.system, directed.character)
    return SpecialPoint(-1, Kind.START, place, begun, piece, lift.accuracy)


def _passage(system: PiecewiseSystem, node: Node, meeting: _Meeting) -> Passage:
    """Return what is said at a node: what changes, and what else is known."""
    if len(meeting.before) != 1 or len(meeting.after) != 1:
        return Said(node.message)
    before, after = meeting.before[0].character, meeting.after[0].character
    if before == after or (node.kind == Kind.END and isinstance(system, Ending)):
        return Said(node.message)
    note = "" if node.kind in CROSSED else node.message
    return Change(system, before, after, note)
