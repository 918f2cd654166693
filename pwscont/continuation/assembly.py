"""From discovered nodes and pieces to the records of the branch graph.

Events are marked after everything has been found, and change no step: the graph is the graph
without events, plus the events.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations, count, islice, pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.budget import check_budget
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.outcome import CROSSED, Kind
from pwscont.basics.rounding import CONVERGED, SAME_ALPHA
from pwscont.continuation.discovery import Discovery
from pwscont.continuation.known import Edge, Node
from pwscont.continuation.plan import Plan
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import Segment, StraightSegment
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.graph.queries import cubics_between
from pwscont.graph.records import NO_NODE, Place, are_one, significant
from pwscont.system.abilities import Ending, shown_points, shown_size
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import kinds_at

if TYPE_CHECKING:
    from pwscont.events.along import EventMark
    from pwscont.events.events import Events

#: Puts the unknowns that a user sees into points (..., z, alpha) of the reduced system, or errors.
Show: TypeAlias = Callable[..., Array]
#: An edge in the direction of positive orientation, and the piece made of the edge.
Directed: TypeAlias = tuple[Edge, Piece]


def mark(discovery: Discovery, plan: Plan) -> None:
    """Mark what users' detectors see at special points."""
    for edge in discovery.edges if plan.foreign else ():
        curve, points = edge.curve(plan.reduced_system, plan.metric), edge.points
        ends = (edge.start, edge.first, points[1]), (edge.end, edge.last, points[-2])
        for number, place, inner in ends:
            node = discovery.nodes[number]
            for detector in plan.foreign:
                words = kinds_at(detector, curve, place.x, place.error, inner)
                node.also += [word for word in words if word not in (str(node.kind), *node.also)]


def divide(discovery: Discovery, plan: Plan, events: Events) -> int:
    """Divide the pieces at events; return how many are not, because the budget is spent."""
    parts, rest = list[Edge](), deque(discovery.edges)
    plan.budget.extend()
    try:
        while rest:
            parts += _divided(rest[0], discovery.nodes, plan, events)
            rest.popleft()
    except KeyboardInterrupt as why:
        plan.budget.end(why)
    discovery.edges = [*parts, *rest]
    return len(rest)


def _divided(edge: Edge, known: dict[int, Node], plan: Plan, events: Events) -> list[Edge]:
    """Return the parts of a piece between its events, which are added to the known nodes."""
    curve, points = edge.curve(plan.reduced_system, plan.metric), edge.points
    start, end, segments = edge.first, edge.last, list(_segments(curve, edge))
    along = events.along(curve, start.x, start.error)
    for after, (segment, (a, b)) in enumerate(zip(segments, pairwise(points), strict=True), 1):
        check_budget()
        along.look(segment, plan.metric.norm(b - a), after)
    marks = along.before(end.x, end.error)
    if not marks:
        return [edge]
    nodes = [Node(Kind.EVENT, Place(m.state.x, m.state.size), m.names) for m in marks]
    numbers = [*islice(count(1 + next(reversed(known))), len(nodes))]  # numbers grow
    known.update(zip(numbers, nodes, strict=True))
    ends = pairwise([start, *(node.place for node in nodes), end])
    joints = pairwise([edge.start, *numbers, edge.end])
    cuts = pairwise([1, *(mark.after for mark in marks), len(points) - 1])
    begun, parts = _part_begun(edge, curve, segments, marks), []
    for i, ((a, b), (first, last), (lo, hi)) in enumerate(zip(ends, joints, cuts, strict=True)):
        inner, begun_at = points[lo:hi], edge.begun_at if i == begun else None
        if len(inner) == 0 < len(edge.inner):  # a curved part has at least one inner point
            segment = cubics_between(curve, a.x, b.x)[0]
            middle = segment.point(0.5 * segment.length, None)
            inner = inner if middle is None else middle[np.newaxis]
        part = edge._replace(start=first, end=last, first=a, inner=inner, last=b)
        parts.append(part._replace(begun_at=begun_at))
    return parts


def _part_begun(
    edge: Edge, curve: Curve, segments: Sequence[Segment], marks: Sequence[EventMark]
) -> int | None:
    """Return the part in which tracing began, None where tracing began at an event."""
    begun, metric = edge.begun_at, curve.metric
    if begun is None or any(
        metric.norm(begun.x - mark.state.x) <= metric.slack(begun.x, CONVERGED) for mark in marks
    ):
        return None
    apart = [metric.norm(begun.x - x) for x in edge.points]
    after = int(np.argmin(apart)) if len(edge.inner) else 0
    here = after + 1, segments[min(after, len(segments) - 1)].position(begun.x)
    return sum((mark.after, mark.position) < here for mark in marks)


def _segments(curve: Curve, edge: Edge) -> Iterator[Segment]:
    """Yield the stretches between the points of a piece."""
    points, none = edge.points, np.zeros_like(edge.first.x)
    if len(points) == 2:
        way = curve.metric.normalised(points[1] - points[0])
        yield StraightSegment(curve, State(points[0], way, edge.first.error[np.newaxis], 1))
        return
    errors = [edge.first.error, *[none for _ in edge.inner], edge.last.error]
    for (a, b), known in zip(pairwise(points), pairwise(errors), strict=True):
        yield cubics_between(curve, a, b, known)[0]


def assemble(
    discovery: Discovery, plan: Plan
) -> tuple[list[SpecialPoint], list[Piece], list[SpecialPoint]]:
    """Return special points, pieces, and starts inside pieces, in the unknowns that a user sees.

    Pieces are directed and numbered along the positive orientation of the component. What a
    reduction left out is put back, and unknowns that the system hides are left out.
    """
    system, metric, reduction = plan.system, plan.full_metric, plan.reduction

    def show(points: Array, errors: bool = False) -> Array:
        """Return points (..., z, alpha) of the reduced system with the user's unknowns."""
        whole = reduction.points(points, system.size, are_errors=errors) if reduction else points
        return shown_points(system, whole)

    edges, places, shown = discovery.edges, dict[Place, Place](), shown_size(system)
    if discovery.nodes and (reduction or shown < system.size):
        places = _shown_places(discovery, show)
        edges = [
            edge._replace(
                first=places[edge.first],
                inner=show(edge.inner),
                last=places[edge.last],
                begun_at=edge.begun_at and places[edge.begun_at],
            )
            for edge in edges
        ]
    edges = list(_in_order([e if e.orientation > 0 else e.reversed() for e in edges]))
    ends = [node for edge in edges for node in (edge.start, edge.end)]
    #: A number for each node: first the nodes of the edges in order, then isolated nodes.
    numbers = {node: i for i, node in enumerate(dict.fromkeys([*ends, *discovery.nodes]))}
    pieces = [_piece(edge, i, numbers, plan) for i, edge in enumerate(edges)]
    if shown < system.size:
        period = Box.of(system).period[:shown]
        metric = Metric(shown_points(system, metric.scale), metric.interval, period)
    before: dict[int, list[Directed]] = defaultdict(list)
    after: dict[int, list[Directed]] = defaultdict(list)
    starts = []
    for edge, piece in zip(edges, pieces, strict=True):
        after[edge.start].append((edge, piece))
        before[edge.end].append((edge, piece))
        if (place := edge.begun_at) is not None:
            digits, said = (
                significant(place.error, place.x, metric.scale),
                f"start in {piece.label}",
            )
            starts.append(SpecialPoint(NO_NODE, Kind.START, place, said, said, piece.id, digits))
    points = [
        _special_point(i, discovery.nodes[n], before[n], after[n], places, metric, plan)
        for n, i in numbers.items()
    ]
    return points, pieces, starts


def _shown_places(discovery: Discovery, show: Show) -> dict[Place, Place]:
    """Return each place of a discovery with the user's unknowns, by the place itself."""
    nodes, edges = discovery.nodes.values(), discovery.edges
    known = [place for edge in edges for place in (edge.first, edge.last, edge.begun_at)]
    known += [place for node in nodes for place in (node.place, *(ray.place for ray in node.rays))]
    places = list(dict.fromkeys(place for place in known if place is not None))
    points = show(np.array([place.x for place in places]))
    errors = show(np.array([place.error for place in places]), errors=True)
    return dict(zip(places, map(Place, points, errors), strict=True))


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


def _piece(edge: Edge, number: int, numbers: Mapping[int, int], plan: Plan) -> Piece:
    """Return the piece of a directed edge, with the signs that a reduction left out."""
    points, character = edge.points, edge.cells[0]
    rise = float(points[-1, -1] - points[0, -1])
    is_level = abs(rise) <= SAME_ALPHA * (plan.interval[1] - plan.interval[0])
    det_sign = 1 if rise > 0.0 else -1  # as of det(dH/dz), on the positive orientation
    if is_level or edge.along_interface:
        det_sign = edge.det_sign
    if is_level and not det_sign:  # a vertical piece, with ends that differ by rounding only
        points[:, -1] = points[0, -1]
    else:  # the same numbers are in memory once
        edge.first.x, edge.last.x = points[0], points[-1]
    character = plan.reduction.character(character) if plan.reduction else character
    ends = numbers[edge.start], numbers[edge.end]
    return Piece(number, *ends, character, plan.system.label, points, det_sign)


def _special_point(
    number: int,
    node: Node,
    before: Sequence[Directed],
    after: Sequence[Directed],
    places: Mapping[Place, Place],
    metric: Metric,
    plan: Plan,
) -> SpecialPoint:
    """Return the special point of a node at which some edges end and others begin."""
    ends = [edge.last for edge, _ in before] + [edge.first for edge, _ in after]
    here, *others = (places.get(at, at) for at in [node.place, *(ray.place for ray in node.rays)])
    place = _covering(here, [*ends, *others], metric)
    also = list(node.also)
    if plan.events and node.kind != Kind.EVENT:
        inside = [_next_to_end(piece, -2) for _, piece in before]
        inside += [_next_to_end(piece, 1) for _, piece in after]
        also += filter(None, [plan.events.names_at(metric, place.x, place.error, inside)])
    passed = (before[0], after[0]) if len(before) == len(after) == 1 else None
    kind = _turning(node, *passed) if passed and node.kind in CROSSED else node.kind
    words, said = _messages(plan.system, node, passed), ", ".join(also)
    digits = significant(place.error, place.x, metric.scale)
    return SpecialPoint(number, kind, place, *words, digits=digits, lost=node.lost, events=said)


def _covering(here: Place, others: Iterable[Place], metric: Metric) -> Place:
    """Return a place with an error that covers the other places of the same node."""
    errors = [
        np.maximum(place.error, np.abs(metric.difference(place.x, here.x)))
        for place in others
        if place is not here
    ]
    return Place(here.x, np.max([here.error, *errors], axis=0)) if errors else here


def _next_to_end(piece: Piece, place: int) -> Array:
    """Return the point of a piece at a place next to an end; the middle of a straight piece."""
    points = piece.points
    return np.asarray(points[place] if len(points) > 2 else 0.5 * (points[0] + points[1]))


def _turning(node: Node, arriving: Directed, leaving: Directed) -> Kind | str:
    """Return the kind of a node where one cell is left for another: alpha may turn or go on.

    Slopes at the node itself may be zero to rounding: a smooth fold may lie on the interface.
    """
    (first, before), (second, after) = arriving, leaving
    if first.along_interface or second.along_interface:
        return node.kind  # a sign along an interface is that of several solutions close by
    signs = before.det_sign * after.det_sign
    turns = Kind.NONSMOOTH_FOLD if signs < 0 else Kind.TRANSITION
    return turns if signs else node.kind


def _messages(
    system: PiecewiseSystem, node: Node, passed: tuple[Directed, Directed] | None
) -> tuple[str, str]:
    """Return what changes at a node, and what else is known, in the two orientations."""
    if not passed or (node.kind == Kind.END and isinstance(system, Ending)):
        return node.message, node.message
    before, after = (piece.character for _, piece in passed)
    if before == after:
        return node.message, node.message
    note = f"; {node.message}" if node.kind not in CROSSED and node.message else ""
    describe = system.describe_transition
    return describe(before, after) + note, describe(after, before) + note


def check_unique(graph: BranchGraph) -> None:
    """Refuse a graph with two solutions at one alpha that are apart by more than their errors."""
    breaks = graph.breaks()
    for alpha in [*breaks, *(0.5 * (lo + hi) for lo, hi in pairwise(breaks))]:
        solutions = graph.solutions(alpha) if graph.count(alpha) > 1 else ()
        for first, second in combinations(solutions, 2):
            if not are_one(first, second):
                promise = f"{type(graph.system).__name__}.unique promises one solution at one"
                found = f"two at {graph.parameter} = {alpha:.10g}: {first!r} and {second!r}"
                words = f"{promise} {graph.parameter}, but there are {found}"
                raise InvalidSystemError(f"{words}; set unique = False")
