"""The nodes and pieces of all evolutions, and the states on them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.quantities import Quantities
from pwscont.evolution.states import (
    KINDS,
    EvolutionNode,
    EvolutionPiece,
    EvolutionState,
    same_time,
)
from pwscont.evolution.ways import StateReader

if TYPE_CHECKING:
    from pwscont.evolution.memory import SystemWithMemory


class EvolutionStructure:
    """Nodes and pieces, without what is made of them."""

    def __init__(
        self,
        nodes: Sequence[EvolutionNode],
        pieces: Sequence[EvolutionPiece],
        interval: tuple[float, float],
        reader: StateReader,
        quantities: Quantities,
        guarantee: str,
        system: SystemWithMemory | None = None,
    ) -> None:
        self.nodes, self.pieces, self.interval = tuple(nodes), tuple(pieces), interval
        self.guarantee, self.system = guarantee, system
        self._reader, self.quantities = reader, quantities

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the unknowns."""
        return tuple(self._reader.names())

    # -- states --------------------------------------------------------------------------

    def count(self, t: float) -> int:
        """Return how many different states there are at ``t``, on all evolutions together."""
        return len(self._places(t))

    def states(self, t: float) -> list[EvolutionState]:
        """Return all different states at ``t``.

        Raises
        ------
        InvalidInputError
            If t lies outside the interval.
        """
        return [
            self.node(place) if isinstance(place, int) else self._within(place, t)
            for place in self._places(t)
        ]

    def _places(self, t: float) -> list[int | EvolutionPiece]:
        """Return the nodes at a time, and the pieces with the time strictly inside."""
        lo, hi = self.interval
        same = same_time(self.interval)
        if not lo - same <= t <= hi + same:
            raise InvalidInputError(f"t = {t} lies outside the interval [{lo}, {hi}]")
        times = self._times
        at = np.flatnonzero(np.abs(times - t) <= same).tolist()
        begins, ends = self._spans
        inside = np.flatnonzero((begins < t - same) & (t + same < ends)).tolist()
        return [*at, *(self.pieces[i] for i in inside)]

    @cached_property
    def _times(self) -> Array:
        return np.array([node.t for node in self.nodes])

    @cached_property
    def _spans(self) -> tuple[Array, Array]:
        """The times at which pieces begin and end."""
        starts = np.array([piece.start for piece in self.pieces], dtype=int)
        ends = np.array([piece.end for piece in self.pieces], dtype=int)
        return self._times[starts], self._times[ends]

    def on(self, piece: EvolutionPiece, t: float) -> EvolutionState:
        """Return the state on a piece at a time."""
        return self._within(piece, t)

    def along(self, piece: EvolutionPiece, count: int) -> list[EvolutionState]:
        """Return states at equal steps in time on a piece, or the states at both ends of a jump."""
        if piece.is_jump:
            return [self.node(piece.start), self.node(piece.end)]
        begin, end = self.nodes[piece.start].t, self.nodes[piece.end].t
        return [self._within(piece, t) for t in np.linspace(begin, end, count).tolist()]

    def _within(self, piece: EvolutionPiece, t: float) -> EvolutionState:
        begin, end = self.nodes[piece.start], self.nodes[piece.end]
        z = piece.between((t - begin.t) / (end.t - begin.t) if end.t > begin.t else 1.0)
        return EvolutionState(
            float(t),
            self._reader.shown(z, t),
            self._reader.memory(z, t),
            piece.label,
            history=self._history(piece.start),
            quantities=self.quantities,
        )

    def node(self, number: int) -> EvolutionState:
        """Return a node as a state."""
        node = self.nodes[number]
        return EvolutionState(
            node.t,
            self._reader.shown(node.z, node.t),
            node.memory,
            self._label(number),
            node.kind,
            node.name,
            node.remark,
            number,
            self._history(number),
            self.quantities,
        )

    def _label(self, number: int) -> str:
        into = [piece.label for piece in self.into[number] if not piece.is_jump]
        return (into or [piece.label for piece in self.out_of[number]] or [""])[0]

    def _history(self, number: int) -> tuple[int, ...]:
        """Return the nodes of one evolution that leads to a node, from its start."""
        history = [number]
        while self.into[history[-1]]:
            history.append(self.into[history[-1]][0].start)
        return tuple(reversed(history))

    @cached_property
    def into(self) -> list[list[EvolutionPiece]]:
        """For every node the pieces that end there."""
        return self._by_node("end")

    @cached_property
    def out_of(self) -> list[list[EvolutionPiece]]:
        """For every node the pieces that begin there."""
        return self._by_node("start")

    def _by_node(self, side: str) -> list[list[EvolutionPiece]]:
        found: list[list[EvolutionPiece]] = [[] for _ in self.nodes]
        for piece in self.pieces:
            found[getattr(piece, side)].append(piece)
        return found

    def multiplicity(self) -> list[tuple[float, float, int]]:
        """Return stretches (lo, hi, number of states) of time with the same number of states."""
        times = sorted({*self.interval, *(node.t for node in self.nodes)})
        rows = [(lo, hi, self.count(0.5 * (lo + hi))) for lo, hi in pairwise(times)]
        runs = [list(run) for _, run in groupby(rows, lambda row: row[2])]
        return [(run[0][0], run[-1][1], run[0][2]) for run in runs]

    # -- events --------------------------------------------------------------------------

    def events(self, kind: str | None = None) -> list[EvolutionState]:
        """Return all nodes, or the nodes of a kind, in the order of time.

        Parameters
        ----------
        kind : str, optional
            "start", "event", "branching", "loss", "jump", "undecided" or "end".

        Raises
        ------
        InvalidInputError
            If there is no such kind.
        """
        if kind is not None and kind not in KINDS:
            raise InvalidInputError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}")
        found = [i for i, node in enumerate(self.nodes) if kind in (None, node.kind)]
        return [self.node(i) for i in found]

    def branchings(self) -> list[EvolutionState]:
        """Return the states with several ways on, those of kind "start" included."""
        several = (i for i, pieces in enumerate(self.out_of) if len(_smooth(pieces)) > 1)
        return [self.node(i) for i in several]

    def losses(self) -> list[EvolutionState]:
        """Return the states with no way on."""
        return self.events("loss")

    def shown(self, z: Array, t: float) -> Array:
        """Return a state as users see the state."""
        return self._reader.shown(z, t)

    def memory_at(self, z: Array, node: int) -> Array:
        """Return the memory of a state at the time of a node."""
        return self._reader.memory(z, self.nodes[node].t)

    def value(self, state: EvolutionState, quantity: str | int) -> float:
        """Return a quantity of a state by name or place; "t" is the time."""
        if quantity == "t":
            return state.t
        return float(state.z[quantity]) if isinstance(quantity, int) else state[quantity]

    def dissipation(self, before: EvolutionState, after: EvolutionState) -> float:
        """Return the energy dissipated between two states of one smooth piece."""
        known = None if self.system is None else self.system.dissipation(before, after)
        if known is None:
            raise SystemNeededError("only a system that knows its dissipation can tell this")
        return float(known)


def _smooth(pieces: Sequence[EvolutionPiece]) -> list[EvolutionPiece]:
    return [piece for piece in pieces if not piece.is_jump]
