"""Pieces divided at the events on them, after everything was followed.

So no event changes a step, a piece or what is found: the graph is the one without events, and has
the events besides.

Failure modes and answers
-------------------------
- Two points of a piece mean a straight one: a part of a curved piece has a third point.
- At an end of a piece, as at a corner, the tangent may not be known: the chord stands for it.
- An event where tracing began: the point is the event.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, pairwise
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONVERGED
from pwscont.continuation.detector_words import keep_words
from pwscont.continuation.discovery import Discovery
from pwscont.continuation.joints import Edge, Node
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.graph.packing import place as place_of
from pwscont.graph.place import Place
from pwscont.graph.track import Track
from pwscont.stepping.stepper import CurvedSegment, Segment, StraightSegment
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import TransitionDetector
from pwscont.transitions.events import Events
from pwscont.transitions.events_along import EventMark


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
