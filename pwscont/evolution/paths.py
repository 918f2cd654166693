"""Single evolutions: the paths through the graph."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, final

from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import counted, named
from pwscont.evolution.states import EvolutionPiece, EvolutionState

if TYPE_CHECKING:
    from pwscont.evolution.structure import EvolutionStructure


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
            If the evolution has ended before.
        """
        nodes = self._graph.nodes
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
