"""From discovered nodes and pieces to the branch graph.

Events are marked after everything has been found. No event changes a step or a piece: the graph is
the graph without events, plus the events.

Failure modes and answers
-------------------------
- A piece with two points is taken as straight: a part of a curved piece has a third point.
- At an end of a piece, as at a corner, the tangent may not be known: the chord replaces the
  tangent.
- An event where tracing began: the point is the event.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count, pairwise
from typing import NamedTuple, TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, Kind, SearchScope
from pwscont.basics.quantities import Function
from pwscont.basics.rounding import CONVERGED, SAME_ALPHA
from pwscont.continuation.discovery import CROSSED, Discovery, Node
from pwscont.continuation.known import Edge
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import CurvedSegment, Segment, StraightSegment
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.graph.records import Place, Stretch, Track, significant
from pwscont.system.abilities import Ending, HidesUnknowns, Reduction, shown_points
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import TransitionDetector, kinds_at
from pwscont.transitions.events import EventMark, Events

#: Puts the unknowns that a user sees into points (..., z, alpha) of the followed system, or errors.
Show: TypeAlias = Callable[[Array], Array]


def mark(
    discovery: Discovery,
    system: PiecewiseSystem,
    metric: Metric,
    added: Sequence[TransitionDetector | Events],
) -> None:
    """Mark what users' detectors see at special points, and divide the pieces at events."""
    _keep_words(discovery, system, metric, [d for d in added if isinstance(d, TransitionDetector)])
    for events in added:
        if isinstance(events, Events):
            _divide(discovery, system, metric, events)


def _keep_words(
    discovery: Discovery,
    system: PiecewiseSystem,
    metric: Metric,
    detectors: Sequence[TransitionDetector],
) -> None:
    """Add to nodes of other kinds the words of the detectors that would have marked them."""
    for edge in discovery.edges if detectors else ():
        curve, points = edge.followed.curve(system, metric), edge.track.points
        for number, place, inner in (
            (edge.start, edge.track.start, points[1]),
            (edge.end, edge.track.end, points[-2]),
        ):
            node = discovery.nodes[number]
            for detector in detectors:
                words = kinds_at(detector, curve, place.x, place.error, inner)
                node.also += [word for word in words if word not in (str(node.kind), *node.also)]


def _divide(discovery: Discovery, system: PiecewiseSystem, metric: Metric, events: Events) -> None:
    """Divide the pieces of a discovery at the events, which become nodes."""
    numbers = count(1 + max(discovery.nodes, default=-1))
    edges, discovery.edges = discovery.edges, []
    for edge in edges:
        kinds = [discovery.nodes[node].kind for node in (edge.start, edge.end)]
        crossed = kinds[0] == Kind.BRANCH_POINT, kinds[1] == Kind.BRANCH_POINT
        whole = _EdgeWithEvents.of(edge, crossed, system, metric, events)
        nodes = {next(numbers): node for node in whole.nodes()}
        discovery.nodes.update(nodes)
        discovery.edges.extend(whole.parts(nodes))


@final
@dataclass(frozen=True, slots=True)
class _EdgeWithEvents:
    """A piece, which of its ends are branch points, the curve of the piece, and events in order."""

    edge: Edge
    crossed: tuple[bool, bool]
    curve: Curve
    segments: Sequence[Segment]
    marks: Sequence[EventMark]

    @classmethod
    def of(
        cls,
        edge: Edge,
        crossed: tuple[bool, bool],
        system: PiecewiseSystem,
        metric: Metric,
        events: Events,
    ) -> _EdgeWithEvents:
        """Return a piece with all events on this piece."""
        curve = edge.followed.curve(system, metric)
        segments, points = list(_segments(curve, edge.track, crossed)), edge.track.points
        start, end = edge.track.start, edge.track.end
        along = events.along(curve, start.x, start.error)
        for after, (segment, (a, b)) in enumerate(zip(segments, pairwise(points), strict=True), 1):
            along.look(segment, metric.norm(b - a), after)
        return cls(edge, crossed, curve, segments, along.before(end.x, end.error))

    def nodes(self) -> Iterator[Node]:
        """Yield the nodes that the events make."""
        for mark in self.marks:
            yield Node(Kind.EVENT, Place(mark.state.x, mark.state.size), mark.names)

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
        """Return the points inside a part; a curved part has at least one inner point."""
        if len(inner) or len(self.edge.track.inner) == 0:
            return inner
        track = self.edge.track
        crossed = self.crossed[0] and start is track.start, self.crossed[1] and end is track.end
        points, errors = np.array([start.x, end.x]), [start.error, end.error]
        first, last = _states(self.curve, points, errors, crossed)
        segment = CurvedSegment.between(self.curve, first, last, 0.0)
        middle = segment.point(0.5 * segment.length, None)
        return inner if middle is None else middle[np.newaxis]

    def _begun(self) -> int | None:
        """Return the part in which tracing began, None where tracing began at an event."""
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


def _segments(curve: Curve, track: Track, crossed: tuple[bool, bool]) -> Iterator[Segment]:
    """Yield the stretches between the points of a piece."""
    points = track.points
    if len(points) == 2:
        way = _chords(curve, points)[0]
        yield StraightSegment(curve, State(points[0], way, track.start.error[np.newaxis], 1))
        return
    errors = [track.start.error, *[np.zeros_like(x) for x in points[1:-1]], track.end.error]
    for start, end in pairwise(_states(curve, points, errors, crossed)):
        yield CurvedSegment.between(curve, start, end, 0.0)


def _chords(curve: Curve, points: Array) -> list[Array]:
    normalised = curve.metric.normalised
    return [normalised(b - a) if (b != a).any() else b - a for a, b in pairwise(points)]


def _states(
    curve: Curve, points: Array, errors: Sequence[Array], crossed: tuple[bool, bool]
) -> list[State]:
    """Return the states at points of a piece.

    At a branch point the Jacobian gives no direction: the direction is that of the parabola through
    the branch point and the next point, along the tangent at the next point.
    """
    chords = _chords(curve, points)
    states = [
        _state(curve, x, chord, error)
        for x, chord, error in zip(points, [*chords, chords[-1]], errors, strict=True)
    ]
    for is_crossed, end, beside in zip(crossed, (0, -1), (1, -2), strict=True):
        if is_crossed:
            way = 2.0 * chords[end] - states[beside].tangent
            tangent = curve.metric.normalised(way)
            states[end] = State(states[end].x, tangent, states[end].error, 1)
    return states


def _state(curve: Curve, x: Array, way: Array, error: Array) -> State:
    """Return the state at a point of a piece that goes on in about this direction."""
    found = BorderedNewton().correct(curve, x, way)
    tangent = way if isinstance(found, Failure) else found.state.tangent
    return State(x, tangent, error[np.newaxis], 1)


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
    """Return the branch graph of a finished discovery, in the unknowns that a user sees.

    Pieces are directed and numbered along the positive orientation of the component. Unknowns
    and signs that a reduction left out are put back, and unknowns that the system hides are left
    out. Special points get the names of the events there. The metric is that of the system.
    """
    show = partial(_shown, system, reduction)
    whole = reduction.character if reduction else _unchanged
    places = _shown_places(discovery, show, partial(_shown_errors, system, reduction))
    edges = list(_in_order([_directed(edge, places, show) for edge in discovery.edges]))
    numbers = _numbers(edges, discovery)
    lo, hi = metric.interval
    pieces = [_piece(edge, i, numbers, whole, system, hi - lo) for i, edge in enumerate(edges)]
    shown = _shown_metric(system, metric)
    meetings: dict[int, _Meeting] = {node: _Meeting([], []) for node in numbers}
    for edge, piece in zip(edges, pieces, strict=True):
        meetings[edge.start].after.append((edge, piece))
        meetings[edge.end].before.append((edge, piece))
    points = [
        _special_point(i, discovery.nodes[node], meetings[node], system, places, shown, events)
        for node, i in numbers.items()
    ]
    starts = [
        _inner_start(edge.begun_at, piece, shown)
        for edge, piece in zip(edges, pieces, strict=True)
        if edge.begun_at is not None
    ]
    return BranchGraph(
        points,
        pieces,
        metric.interval,
        starts=starts,
        system=system,
        parameter=parameter,
        searched=searched,
        record=record,
        infinite=infinite,
    )


# -- from the followed system to the unknowns that a user sees ------------------------------------


def _shown(system: PiecewiseSystem, reduction: Reduction | None, points: Array) -> Array:
    """Return points (..., z, alpha) of the followed system with the user's unknowns."""
    whole = points if reduction is None else reduction.points(points, system.size)
    return shown_points(system, whole)


def _shown_errors(system: PiecewiseSystem, reduction: Reduction | None, errors: Array) -> Array:
    """Return errors of points of the followed system, with the user's unknowns."""
    whole = errors if reduction is None else reduction.errors(errors, system.size)
    return shown_points(system, whole)


def _unchanged(character: Character) -> Character:
    return character


def _shown_metric(system: PiecewiseSystem, metric: Metric) -> Metric:
    """Return the metric of the unknowns that a user sees."""
    if not isinstance(system, HidesUnknowns):
        return metric
    period = Box.of(system).period[: system.shown]
    return Metric(shown_points(system, metric.scale), metric.interval, period)


def _shown_places(discovery: Discovery, show: Show, spread: Show) -> dict[Place, Place]:
    """Return each place of a discovery with the user's unknowns, by the place itself."""
    nodes, edges = discovery.nodes.values(), discovery.edges
    known = [place for edge in edges for place in (edge.track.start, edge.track.end, edge.begun_at)]
    known += [place for node in nodes for place in (node.place, *(key.place for key in node.keys))]
    places = list(dict.fromkeys(place for place in known if place is not None))
    if not places or show(places[0].x) is places[0].x:  # no unknown is left out or put back
        return {place: place for place in places}
    points = show(np.array([place.x for place in places]))
    errors = spread(np.array([place.error for place in places]))
    return dict(zip(places, map(Place, points, errors), strict=True))


def _directed(edge: Edge, places: Mapping[Place, Place], show: Show) -> Edge:
    """Return an edge with the user's unknowns, in the direction of the positive orientation."""
    start, end, followed, track, begun = edge
    shown = Track(places[track.start], show(track.inner), places[track.end])
    begun = None if begun is None else places[begun]
    if followed.orientation > 0:
        return Edge(start, end, followed, shown, begun)
    return Edge(end, start, followed, shown.reversed(), begun)


# -- pieces ---------------------------------------------------------------------------------------


def _in_order(edges: list[Edge]) -> Iterator[Edge]:
    """Yield directed edges so that each component is walked through, from the sources on."""
    leaving: dict[int, deque[Edge]] = defaultdict(deque)
    entered = {edge.end for edge in edges}
    for edge in edges:
        leaving[edge.start].append(edge)
    sources = [edge.start for edge in edges if edge.start not in entered]
    for source in [*sources, *(edge.start for edge in edges)]:
        node = source
        while leaving[node]:
            edge = leaving[node].popleft()
            yield edge
            node = edge.end


def _numbers(edges: list[Edge], discovery: Discovery) -> dict[int, int]:
    """Return a number for each node: first the nodes of the edges in order, then isolated nodes."""
    ends = [node for edge in edges for node in (edge.start, edge.end)]
    return {node: i for i, node in enumerate(dict.fromkeys([*ends, *discovery.nodes]))}


def _piece(
    edge: Edge,
    number: int,
    numbers: Mapping[int, int],
    whole: Callable[[Character], Character],
    system: PiecewiseSystem,
    width: float,
) -> Piece:
    """Return the piece of a directed edge; ``width`` is the length of the interval."""
    track, followed = edge.track, edge.followed
    rise = track.end.alpha - track.start.alpha
    is_level = abs(rise) <= SAME_ALPHA * width
    is_known = is_level or followed.along_interface
    # on the positive orientation alpha rises where det(dH/dz) > 0
    det_sign = followed.det_sign if is_known else 1 if rise > 0.0 else -1
    return Piece(
        id=number,
        start=numbers[edge.start],
        end=numbers[edge.end],
        character=whole(followed.selection[0]),
        naming=system.label,
        track=_vertical(track) if is_level and not det_sign else track,
        det_sign=det_sign,
    )


def _vertical(track: Track) -> Track:
    """Return the track with one alpha, for a track with ends that differ by rounding only."""
    points = track.points
    points[:, -1] = track.start.alpha
    return Track.of(points)


# -- special points -------------------------------------------------------------------------------


class _Meeting(NamedTuple):
    """The directed edges, with their pieces, that end at a node and that begin at the node."""

    before: list[tuple[Edge, Piece]]
    after: list[tuple[Edge, Piece]]

    @property
    def is_passed(self) -> bool:
        """Whether one piece ends and one piece begins."""
        return len(self.before) == len(self.after) == 1


def _special_point(
    number: int,
    node: Node,
    meeting: _Meeting,
    system: PiecewiseSystem,
    places: Mapping[Place, Place],
    metric: Metric,
    events: Events | None,
) -> SpecialPoint:
    """Return the special point of a node; the metric is that of the user's unknowns."""
    ends = [edge.track.end for edge, _ in meeting.before]
    ends += [edge.track.start for edge, _ in meeting.after]
    rays = [places[key.place] for key in node.keys]
    place = _covering(places[node.place], [*ends, *rays], metric)
    also = list(node.also)
    if events is not None and node.kind != Kind.EVENT:
        inside = [_next_to_ends(piece)[1] for _, piece in meeting.before]
        inside += [_next_to_ends(piece)[0] for _, piece in meeting.after]
        also += filter(None, [events.names_at(metric, place.x, place.error, inside)])
    message, backward = _messages(system, node, meeting)
    return SpecialPoint(
        id=number,
        kind=_kind(node, meeting),
        place=place,
        message=message,
        backward=backward,
        digits=significant(place.error, place.x, metric.scale),
        lost=node.lost,
        events=", ".join(also),
    )


def _covering(here: Place, others: Iterable[Place], metric: Metric) -> Place:
    """Return a place with an error that covers the other places of the same node."""
    apart = [place for place in others if place is not here]
    if not apart:
        return here  # nearly always
    errors = [
        np.maximum(place.error, np.abs(metric.difference(place.x, here.x))) for place in apart
    ]
    return Place(here.x, np.max([here.error, *errors], axis=0))


def _next_to_ends(piece: Piece) -> tuple[Array, Array]:
    """Return the points of a piece next to its two ends: the middle, twice, for a straight one."""
    points = piece.points
    if len(points) == 2:
        middle: Array = 0.5 * (points[0] + points[1])
        return middle, middle
    return points[1], points[-2]


def _kind(node: Node, meeting: _Meeting) -> Kind | str:
    """Return the kind of a node; where one cell is left for another, alpha may turn or go on.

    Slopes at the node itself may be zero to rounding: a smooth fold may lie on the interface.
    """
    if node.kind not in CROSSED or not meeting.is_passed:
        return node.kind
    (first, before), (second, after) = meeting.before[0], meeting.after[0]
    if first.followed.along_interface or second.followed.along_interface:
        return node.kind  # a sign along an interface is that of several solutions close by
    signs = before.det_sign * after.det_sign
    turns = Kind.NONSMOOTH_FOLD if signs < 0 else Kind.TRANSITION
    return turns if signs else node.kind


def _messages(system: PiecewiseSystem, node: Node, meeting: _Meeting) -> tuple[str, str]:
    """Return what changes at a node, and what else is known, in the two orientations."""
    if not meeting.is_passed:
        return node.message, node.message
    before, after = meeting.before[0][1].character, meeting.after[0][1].character
    if before == after or (node.kind == Kind.END and isinstance(system, Ending)):
        return node.message, node.message
    note = f"; {node.message}" if node.message and node.kind not in CROSSED else ""
    forward, backward = (
        system.describe_transition(*cells) for cells in ((before, after), (after, before))
    )
    return forward + note, backward + note


def _inner_start(place: Place, piece: Piece, metric: Metric) -> SpecialPoint:
    """Return the point in the middle of a piece at which tracing began."""
    digits = significant(place.error, place.x, metric.scale)
    said = f"start in {piece.label}"
    return SpecialPoint(-1, Kind.START, place, said, said, piece.id, digits)
