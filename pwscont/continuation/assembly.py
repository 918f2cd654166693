"""From discovered nodes and pieces to the branch graph: direction, signs, numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.character import Character
from pwscont.basics.guarantee import SearchScope
from pwscont.basics.kind import Kind
from pwscont.basics.quantities import Function
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.discovery import Discovery
from pwscont.continuation.event_names import named_by_events
from pwscont.continuation.joints import Edge, Node
from pwscont.curve.metric import Metric
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.graph.accuracy import Accuracy
from pwscont.graph.packing import Lifted, WithoutHidden
from pwscont.graph.passages import Begun, Change, Passage, Said
from pwscont.graph.place import Place, Stored
from pwscont.graph.records import Stretch
from pwscont.graph.track import Track
from pwscont.system.box import Box
from pwscont.system.ending import Ending
from pwscont.system.hidden import HidesUnknowns, shown_points
from pwscont.system.reduction import Reduction
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.events import Events

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
