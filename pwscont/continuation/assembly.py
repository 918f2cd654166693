"""From discovered nodes and pieces to the branch graph: direction, signs, numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.continuation.network import Edge, Network, Node
from pwscont.foundation.arrays import Array
from pwscont.foundation.character import Character
from pwscont.foundation.guarantee import Searched
from pwscont.foundation.kind import Kind
from pwscont.foundation.records import significant
from pwscont.foundation.rounding import SAME_ALPHA
from pwscont.graph import BranchGraph, Piece, SpecialPoint
from pwscont.model.reduction import Reduction
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.metric import Metric
from pwscont.numerics.uncertainty import magnitude


def assemble(
    network: Network,
    system: PiecewiseSystem,
    interval: tuple[float, float],
    parameter: str,
    searched: Searched,
    reduction: Reduction | None,
) -> BranchGraph:
    """Return the branch graph of a finished network.

    Pieces are directed and numbered along the positive orientation of their component. What
    was left out of the system is put back.
    """
    width = interval[1] - interval[0]
    lift = Lift(system, reduction, Metric.of(system, interval).scale)
    edges = [_Directed(edge, width, lift) for edge in network.edges]
    order = list(_in_order(edges))
    numbers = {node: number for number, node in enumerate(_nodes_in_order(order, network))}
    touching = _by_node(order)
    points = [
        _special_point(
            number,
            network.nodes[node],
            _messages(system, network.nodes[node], touching[node], node),
            _ends(touching[node], node),
            lift,
        )
        for node, number in numbers.items()
    ]
    pieces = [edge.piece(i, numbers) for i, edge in enumerate(order)]
    starts = [_inner_start(edge, i, lift) for i, edge in enumerate(order)]
    return BranchGraph(
        points,
        pieces,
        interval,
        starts=filter(None, starts),
        system=system,
        parameter=parameter,
        searched=searched,
    )


@final
@dataclass(frozen=True, slots=True)
class Lift:
    """The way from the system that was followed to the full one."""

    system: PiecewiseSystem
    reduction: Reduction | None
    scale: Array

    def points(self, points: Array) -> Array:
        """Return points, or one, with all unknowns."""
        return self.reduction.points(points, self.system.size) if self.reduction else points

    def character(self, character: Character) -> Character:
        """Return the character with all signs."""
        return self.reduction.character(character) if self.reduction else character


class _Directed:
    """An edge turned so that it follows the positive orientation."""

    def __init__(self, edge: Edge, width: float, lift: Lift) -> None:
        self.edge = edge
        forward = edge.ray.state.orientation > 0
        self.start, self.end = (edge.start, edge.end) if forward else (edge.end, edge.start)
        self.points: Array = lift.points(edge.points if forward else edge.points[::-1])
        self.character = lift.character(edge.ray.curve.selection.character)
        self.label = lift.system.label(self.character)
        ray = edge.ray
        self.det_sign = ray.index if ray.shared else self._direction(width)

    def _direction(self, width: float) -> int:
        """Return the direction of alpha: on the positive orientation, the sign of det(dH/dz)."""
        rise = float(self.points[-1, -1] - self.points[0, -1])
        if abs(rise) > SAME_ALPHA * width:
            return 1 if rise > 0.0 else -1
        ray = self.edge.ray
        return int(np.sign(ray.curve.slope(ray.state))) * ray.state.orientation

    def piece(self, number: int, numbers: dict[int, int]) -> Piece:
        return Piece(
            id=number,
            start=numbers[self.start],
            end=numbers[self.end],
            character=self.character,
            label=self.label,
            points=self.points,
            det_sign=self.det_sign,
        )


def _by_node(edges: list[_Directed]) -> dict[int, list[_Directed]]:
    touching: dict[int, list[_Directed]] = defaultdict(list)
    for edge in edges:
        for node in {edge.start, edge.end}:
            touching[node].append(edge)
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


def _nodes_in_order(order: list[_Directed], network: Network) -> Iterator[int]:
    """Yield each node once: first those of the pieces in their order, then isolated ones."""
    seen: set[int] = set()
    for node in [*(n for edge in order for n in (edge.start, edge.end)), *network.nodes]:
        if node not in seen:
            seen.add(node)
            yield node


def _special_point(
    number: int, node: Node, messages: tuple[str, str], ends: list[Array], lift: Lift
) -> SpecialPoint:
    x = lift.points(node.x)
    error = _error(x, lift.points(_own_error(node)), ends)
    return SpecialPoint(
        number,
        node.kind,
        x[:-1],
        float(x[-1]),
        *messages,
        error=error,
        digits=significant(error, x, lift.scale),
    )


def _own_error(node: Node) -> Array:
    """Return the error of the node's place as its least certain ray knows it."""
    samples = [ray.state.error for ray in node.rays] or [np.zeros((1, len(node.x)))]
    return np.asarray(np.max([magnitude(node.x, error) for error in samples], axis=0))


def _error(x: Array, own: Array, ends: list[Array]) -> Array:
    """Return an error of ``x`` that covers the ends of all pieces that were taken to meet there."""
    return np.asarray(np.max([own, *(np.abs(end - x) for end in ends)], axis=0))


def _ends(edges: list[_Directed], node: int) -> list[Array]:
    """Return the points with which edges begin or end at a node."""
    return [
        edge.points[at]
        for edge in edges
        for place, at in ((edge.start, 0), (edge.end, -1))
        if place == node
    ]


def _inner_start(directed: _Directed, piece: int, lift: Lift) -> SpecialPoint | None:
    """Return the point in the middle of a piece where tracing began, if it did."""
    edge = directed.edge
    if edge.begun_at is None:
        return None
    error = magnitude(edge.begun_at, edge.ray.state.error)
    x, error = lift.points(edge.begun_at), lift.points(error)
    message = f"start in {directed.label}"
    digits = significant(error, x, lift.scale)
    return SpecialPoint(
        -1, Kind.START, x[:-1], float(x[-1]), message, message, piece, error, digits
    )


def _messages(
    system: PiecewiseSystem, node: Node, edges: list[_Directed], number: int
) -> tuple[str, str]:
    """Return the messages at a node for both orientations: what changes, and what else is known."""
    before = [edge.character for edge in edges if edge.end == number]
    after = [edge.character for edge in edges if edge.start == number]
    if len(before) != 1 or len(after) != 1 or before == after:
        return node.message, node.message
    forward, backward = before + after, after + before
    changes = system.describe_transition(*forward), system.describe_transition(*backward)
    if node.kind in (Kind.TRANSITION, Kind.NONSMOOTH_FOLD):
        return changes
    return f"{changes[0]}; {node.message}", f"{changes[1]}; {node.message}"
