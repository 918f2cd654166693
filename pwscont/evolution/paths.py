"""Single evolutions: the paths through the graph, and what a periodic load leads each to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.printing import counted, named
from pwscont.basics.rounding import SAME_STATE
from pwscont.evolution.states import EvolutionPiece, EvolutionState, EvolutionStructure

#: The number of errors of single states that add up over a period.
ADDED = 16.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """The end of an evolution under a periodic load.

    Attributes
    ----------
    kind : str
        "shakedown": nothing is left behind any more, the last period is free of slip or yield.
        "cyclic slip": the state repeats itself after ``periods`` periods of the load.
        "ratchetting": the memory grows by the same ``drift`` in each of the last periods.
        "not yet": none of these within the interval, or the evolution ends before.
    periods : int
        Number of periods of the load after which the state repeats itself; 0 if the state does not.
    drift : ndarray, shape (k,)
        Change of the memory in the last period.
    """

    kind: str
    periods: int
    drift: Array


def cycle_of(path: EvolutionPath, end: float, period: float) -> Cycle:
    """Return what one evolution comes to in the last periods before a time."""
    begin = end - period * np.floor((end - path.start) / period * (1.0 + SAME_STATE))
    times = np.arange(end, begin - 0.5 * period, -period)
    try:
        states = [path.state(max(float(t), path.start)) for t in times]
    except InvalidInputError:
        return Cycle("not yet", 0, np.zeros(0))
    size = max(float(np.abs(state.memory).max(initial=0.0)) for state in states)
    drift = states[0].memory - states[1].memory
    again = [k for k in range(1, len(states)) if _have_same_z(states[0], states[k])]
    same = [k for k in again if _have_same_memory(states[0], states[k], size)]
    # what is left behind may be rounding, in which no digit repeats itself
    if again[:1] == [1] and _is_at_rest(path, end - period, end, size):
        return Cycle("shakedown", 1, drift)
    if same:
        return Cycle("cyclic slip", same[0], drift)
    return Cycle("ratchetting" if _drifts(states, drift, size) else "not yet", 0, drift)


def _have_same_memory(a: EvolutionState, b: EvolutionState, size: float) -> bool:
    return bool((np.abs(a.memory - b.memory) <= ADDED * SAME_STATE * size).all())


def _have_same_z(a: EvolutionState, b: EvolutionState) -> bool:
    largest = np.maximum(np.abs(a.z), np.abs(b.z)).max(initial=0.0)
    return bool((np.abs(a.z - b.z) <= ADDED * SAME_STATE * largest).all())


def _is_at_rest(path: EvolutionPath, t0: float, t1: float, size: float) -> bool:
    """Tell whether nothing is dissipated between two times; by the memory where that is unknown."""
    try:
        lost, total = path.dissipated(t0, t1), path.dissipated(path.start, t1)
        return lost <= ADDED * SAME_STATE * total
    except SystemNeededError:
        slack, stretches = ADDED * SAME_STATE * size, path.stretches(t0, t1)
        return all((np.abs(b.memory - a.memory) <= slack).all() for a, b in stretches)


def _drifts(states: list[EvolutionState], drift: Array, size: float) -> bool:
    """Tell whether the memory changed, and by the same amount in the period before."""
    if len(states) < 3:
        return False
    before, slack = states[1].memory - states[2].memory, ADDED * SAME_STATE * size
    return bool((np.abs(drift) > slack).any() and (np.abs(drift - before) <= slack).all())


@final
class EvolutionPath:
    """One evolution, from a start to an end, a loss or an undecided state.

    Parameters
    ----------
    graph : EvolutionStructure
    first : int
        The node of the start.
    pieces : tuple of EvolutionPiece
        In the order of time; jumps are pieces, too.
    """

    def __init__(
        self, graph: EvolutionStructure, first: int, pieces: tuple[EvolutionPiece, ...]
    ) -> None:
        self._graph, self.first, self.pieces = graph, first, pieces

    @property
    def nodes(self) -> list[int]:
        """The numbers of the nodes."""
        return [self.first, *(piece.end for piece in self.pieces)]

    @property
    def labels(self) -> list[str]:
        """The modes on each piece, in words."""
        return [piece.label for piece in self.pieces]

    @property
    def events(self) -> list[EvolutionState]:
        """The states at the nodes."""
        return [self._graph.node(number) for number in self.nodes]

    @property
    def start(self) -> float:
        """The time at which the evolution starts."""
        return self._graph.nodes[self.first].t

    @property
    def end(self) -> float:
        """The time at which the evolution ends."""
        return self._graph.nodes[self.nodes[-1]].t

    def state(self, t: float) -> EvolutionState:
        """Return the state at a time; where the evolution jumps, the state before the jump.

        Raises
        ------
        InvalidInputError
            If t is no number, or the evolution has ended before.
        """
        nodes, t = self._graph.nodes, float(finite_array("t", t, ()))
        for piece in self.pieces:
            if nodes[piece.start].t <= t <= nodes[piece.end].t and not piece.is_jump:
                return self._graph.on(piece, t)
        if not self.pieces and t == nodes[self.first].t:
            return self._graph.node(self.first)
        raise InvalidInputError(f"the evolution has no state at t = {t}; it ends at {self.end}")

    def dissipated(self, t0: float, t1: float) -> float:
        """Return the energy dissipated between two times, as far as the evolution goes.

        Raises
        ------
        InvalidInputError
            If the times do not grow, or lie outside the interval.
        """
        lo, hi = self._graph.interval
        t0, t1 = finite_array("times", [t0, t1]).tolist()
        if not lo <= t0 <= t1 <= hi:
            raise InvalidInputError(
                f"dissipated needs {lo:g} <= t0 <= t1 <= {hi:g}, got t0 = {t0}, t1 = {t1}"
            )
        return sum(self._graph.dissipation(*pair) for pair in self.stretches(t0, t1))

    def stretches(self, t0: float, t1: float) -> Iterator[tuple[EvolutionState, EvolutionState]]:
        """Yield the states at both ends of each part of a smooth piece between two times."""
        for piece in self.pieces:
            begin, end = self._graph.nodes[piece.start].t, self._graph.nodes[piece.end].t
            a, b = max(begin, t0), min(end, t1)
            if a < b and not piece.is_jump:
                yield self._graph.on(piece, a), self._graph.on(piece, b)

    def __repr__(self) -> str:
        return named(self, f"{counted(len(self.pieces), 'piece')} up to t = {self.end:.6g}")


@final
class EvolutionPaths:
    """All evolutions of a graph, made one by one: their number may be very large.

    Parameters
    ----------
    graph : EvolutionStructure
    """

    def __init__(self, graph: EvolutionStructure) -> None:
        self._graph = graph

    @cached_property
    def _ahead(self) -> list[int]:
        """For every node, how many evolutions go on from there."""
        ahead = [0] * len(self._graph.nodes)
        for number in self._backwards():
            ends = [piece.end for piece in self._graph.out_of[number]]
            ahead[number] = sum(ahead[end] for end in ends) if ends else 1
        return ahead

    def _backwards(self) -> list[int]:
        """Return the nodes so that every node comes after the nodes that follow it."""
        order: list[int] = []
        left = [len(pieces) for pieces in self._graph.out_of]
        ready = [i for i, count in enumerate(left) if not count]
        while ready:
            number = ready.pop()
            order.append(number)
            for piece in self._graph.into[number]:
                left[piece.start] -= 1
                if not left[piece.start]:
                    ready.append(piece.start)
        return order

    @property
    def _starts(self) -> list[int]:
        return [i for i, pieces in enumerate(self._graph.into) if not pieces]

    @property
    def number(self) -> int:
        """How many evolutions there are, however many."""
        return sum(self._ahead[i] for i in self._starts)

    def __len__(self) -> int:
        return self.number

    def __getitem__(self, index: int) -> EvolutionPath:
        place = index + self.number if index < 0 else index
        for start in self._starts:
            if 0 <= place < self._ahead[start]:
                return EvolutionPath(self._graph, start, tuple(self._pieces(start, place)))
            place -= self._ahead[start]
        raise IndexError(index)

    def _pieces(self, node: int, place: int) -> Iterator[EvolutionPiece]:
        """Yield the pieces of one of the evolutions that go on from a node."""
        while self._graph.out_of[node]:
            for piece in self._graph.out_of[node]:
                if place < self._ahead[piece.end]:
                    break
                place -= self._ahead[piece.end]
            yield piece
            node = piece.end

    def __iter__(self) -> Iterator[EvolutionPath]:
        return (self[i] for i in range(self.number))

    def __repr__(self) -> str:
        return named(self, counted(self.number, "evolution"))
