"""What users see of an evolution: states, nodes, smooth pieces, and the states on all of these."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Signs, finite_array
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.printing import card, short
from pwscont.basics.printing import state as in_words
from pwscont.basics.quantities import NAMELESS, Quantities
from pwscont.basics.rounding import EPS, GUARD

#: The kinds of nodes of an evolution.
KINDS = ("start", "event", "branching", "loss", "jump", "undecided", "end")
#: Times closer than this part of the interval are one time.
SAME_TIME = 2.0**10 * GUARD * EPS


def same_time(interval: tuple[float, float]) -> float:
    """Return the largest difference of two times that are one time."""
    lo, hi = interval
    return SAME_TIME * (hi - lo) + GUARD * EPS * max(abs(lo), abs(hi))


@final
@dataclass(frozen=True, slots=True, eq=False)
class EvolutionState:
    """One state of an evolution.

    ``state["u_t"]`` is an unknown by name, or a recorded quantity.

    Attributes
    ----------
    t : float
    z : ndarray, shape (n,)
    memory : ndarray, shape (k,)
        What the state leaves behind.
    label : str
        The modes of the parts, on the piece that leads to the state.
    kind : str or None
        The kind of the node; None between nodes.
    name : str
        The names of the user's events that are zero here.
    remark : str
        What is uncertain of the ways on, in words; empty where nothing is.
    node : int or None
        The number of the node; None between nodes.
    history : tuple of int
        The nodes of one evolution that leads to the state, from its start.
    """

    t: float
    z: Array
    memory: Array
    label: str
    kind: str | None = None
    name: str = ""
    remark: str = ""
    node: int | None = None
    history: tuple[int, ...] = ()
    quantities: Quantities = NAMELESS

    def __getitem__(self, name: str) -> float:
        return self.quantities.value(name, self.z, self.t)

    def _in_words(self) -> str:
        return in_words(self.quantities.names(len(self.z)), self.z)

    def __repr__(self) -> str:
        kind = f"{self.kind}, " if self.kind else ""
        label = f"{short(self.label)}, " if self.label else ""
        return f"EvolutionState({kind}{label}t={self.t:.10g}, {self._in_words()})"

    def _repr_html_(self) -> str:
        rows = [("mode", short(self.label)), ("state", self._in_words())]
        return card(f"{self.kind or 'state'} at t = {self.t:.10g}", rows)


@final
@dataclass(slots=True, eq=False)
class EvolutionNode:
    """A state at an event, as the graph keeps the state.

    Attributes
    ----------
    t : float
    z : ndarray, shape (m,)
        In the unknowns of the evolver.
    memory : ndarray, shape (k,)
    kind, name, remark : str
        As for :class:`EvolutionState`.
    """

    t: float
    z: Array
    memory: Array
    kind: str = "undecided"
    name: str = ""
    remark: str = ""


@final
@dataclass(slots=True, eq=False)
class EvolutionPiece:
    """A smooth piece between two nodes, straight in (z, t); or a jump, at one t.

    Attributes
    ----------
    start, end : int
        The nodes.
    label : str
    first, last : ndarray, shape (m,)
        The states at both ends, in the unknowns of the evolver.
    """

    start: int
    end: int
    label: str
    first: Array
    last: Array
    is_jump: bool = field(default=False)

    def between(self, part: float) -> Array:
        """Return the state after a part of the time of the piece."""
        state: Array = (1.0 - part) * self.first + part * self.last
        return np.asarray(state)


class StateReader(ABC):
    """What the unknowns of a run mean: the state that users see, and the memory."""

    @abstractmethod
    def memory(self, z: Array, t: float) -> Array:
        """Return what a state leaves behind, shape (k,)."""

    def shown(self, z: Array, t: float) -> Array:
        """Return the state as users see the state; default the same unknowns."""
        return z

    @abstractmethod
    def names(self) -> Sequence[str]:
        """Return a name for each unknown that users see."""


class EvolutionStructure:
    """Nodes and pieces, without what is made of them; the system knows the dissipation, if any."""

    def __init__(
        self,
        nodes: Sequence[EvolutionNode],
        pieces: Sequence[EvolutionPiece],
        interval: tuple[float, float],
        reader: StateReader,
        quantities: Quantities,
        guarantee: str,
        system: Any = None,
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
            If t is no number within the interval.
        """
        return [
            self.node(place) if isinstance(place, int) else self.on(place, t)
            for place in self._places(t)
        ]

    def _places(self, t: float) -> list[int | EvolutionPiece]:
        """Return the nodes at a time, and the pieces with the time strictly inside."""
        t = float(finite_array("t", t, ()))
        lo, hi = self.interval
        same = same_time(self.interval)
        if not lo - same <= t <= hi + same:
            raise InvalidInputError(f"t = {t} lies outside the interval [{lo}, {hi}]")
        is_near = np.abs(self._times - t) <= same
        at = [i for i in np.flatnonzero(is_near).tolist() if not self._goes_on(i, is_near)]
        begins, ends = self._spans
        inside = np.flatnonzero((begins < t - same) & (t + same < ends)).tolist()
        return [*at, *(self.pieces[i] for i in inside)]

    def _goes_on(self, number: int, is_near: Signs) -> bool:
        """Tell whether a node is the state of a node just before: rounding alone set them apart."""
        return any(is_near[p.start] and not p.is_jump for p in self.into[number])

    @cached_property
    def _times(self) -> Array:
        return np.array([node.t for node in self.nodes])

    @cached_property
    def _spans(self) -> tuple[Array, Array]:
        """The times at which pieces begin and end."""
        starts = np.array([piece.start for piece in self.pieces], dtype=int)
        ends = np.array([piece.end for piece in self.pieces], dtype=int)
        return self._times[starts], self._times[ends]

    def along(self, piece: EvolutionPiece, count: int) -> list[EvolutionState]:
        """Return states at equal steps in time on a piece, or the states at both ends of a jump."""
        if piece.is_jump:
            return [self.node(piece.start), self.node(piece.end)]
        begin, end = self.nodes[piece.start].t, self.nodes[piece.end].t
        return [self.on(piece, t) for t in np.linspace(begin, end, count).tolist()]

    def on(self, piece: EvolutionPiece, t: float) -> EvolutionState:
        """Return the state on a piece at a time."""
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
