"""From discovered nodes and pieces to the branch graph: direction, signs, numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import final

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
from pwscont.graph.passages import Change, Passage, Said
from pwscont.graph.place import Place, Stored
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
    numbers = {node: number for number, node in enumerate(_nodes_in_order(order, discovery))}
    touching = _by_node(order)
    points = [
        _special_point(
            number,
            discovery.nodes[node],
            _passage(system, discovery.nodes[node], touching[node], node),
            _ends(touching[node], node),
            lift,
        )
        for node, number in numbers.items()
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
        self.track = lift.track(edge.track if forward else edge.track.reversed())
        self.character = lift.character(followed.character)
        self.naming = lift.system.label
        rise = self.track.end.alpha - self.track.start.alpha
        is_level = abs(rise) <= SAME_ALPHA * width
        rises = 0 if is_level else int(np.sign(rise))
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


def _by_node(edges: list[_Directed]) -> dict[int, list[_Directed]]:
    touching: dict[int, list[_Directed]] = defaultdict(list)
    for edge in edges:
        touching[edge.start].append(edge)
        if edge.end != edge.start:
            touching[edge.end].append(edge)
    return touching


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


def _nodes_in_order(order: list[_Directed], discovery: Discovery) -> Iterator[int]:
    """Yield each node once: first those of the pieces in their order, then isolated ones."""
    seen: set[int] = set()
    for node in [*(n for edge in order for n in (edge.start, edge.end)), *discovery.nodes]:
        if node not in seen:
            seen.add(node)
            yield node


def _special_point(
    number: int, node: Node, passage: Passage, ends: list[Place], lift: Lift
) -> SpecialPoint:
    place = lift.place(_covering(node, ends, lift))
    return SpecialPoint(number, node.kind, place, passage, accuracy=lift.accuracy, lost=node.lost)


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


def _ends(edges: list[_Directed], node: int) -> list[Place]:
    """Return the places where edges begin or end at a node, in the followed system."""
    found = [edge.edge for edge in edges]
    ends = [edge.track.start for edge in found if edge.start == node]
    return ends + [edge.track.end for edge in found if edge.end == node]


def _inner_start(directed: _Directed, piece: int, lift: Lift) -> SpecialPoint | None:
    """Return the point in the middle of a piece where tracing began, if it did."""
    edge = directed.edge
    if edge.begun_at is None:
        return None
    place = lift.place(edge.begun_at)
    said = Said(f"start in {directed.naming(directed.character)}")
    return SpecialPoint(-1, Kind.START, place, said, piece, lift.accuracy)


def _passage(system: PiecewiseSystem, node: Node, edges: list[_Directed], number: int) -> Passage:
    """Return what is said at a node: what changes, and what else is known."""
    before = [edge.character for edge in edges if edge.end == number]
    after = [edge.character for edge in edges if edge.start == number]
    passes = len(before) == len(after) == 1 and before != after
    if not passes or (node.kind == Kind.END and isinstance(system, Ending)):
        return Said(node.message)
    note = "" if node.kind in CROSSED else node.message
    return Change(system, before[0], after[0], note)
