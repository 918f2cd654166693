"""The graph of evolutions, with all queries as methods."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.looks import card, counted
from pwscont.basics.quantities import Quantities
from pwscont.evolution import exports, file
from pwscont.evolution.cycle import Cycle, cycle_of
from pwscont.evolution.paths import EvolutionPath, EvolutionPaths
from pwscont.evolution.states import (
    KINDS,
    SAME_TIME,
    EvolutionNode,
    EvolutionPiece,
    EvolutionState,
)
from pwscont.evolution.ways import Evolver

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.figure import Figure

    from pwscont.evolution.memory import SystemWithMemory


@final
class EvolutionGraph:
    """Everything that a system with memory can do in an interval of time.

    Made by :func:`pwscont.evolve`; not changed afterwards. Nodes are states at events, edges are
    smooth pieces. States that agree are one node, however many evolutions lead there.

    Attributes
    ----------
    interval : tuple of float
    guarantee : str
        What is known about completeness, in words. "all evolutions with finitely many events"
        where every way on of every event was found; an evolution that begins with infinitely many
        events in a finite time is not among these.

    Examples
    --------
    >>> from pwscont import evolve
    >>> from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> load = LoadHistory([[1, 0], [1, 3], [1, -3]])
    >>> evolution = evolve(QuasiStaticCoulomb(body, load, 0.5), (0.0, 2.0))
    >>> evolution.count(1.5), [state.label for state in evolution.states(1.1)]
    (1, ['stick'])
    >>> evolution.branchings(), evolution.losses()
    ([], [])
    >>> evolution.nx.number_of_edges(), len(evolution.paths())
    (4, 1)
    """

    def __init__(
        self,
        nodes: Sequence[EvolutionNode],
        pieces: Sequence[EvolutionPiece],
        interval: tuple[float, float],
        evolver: Evolver,
        quantities: Quantities,
        guarantee: str,
        system: SystemWithMemory | None = None,
    ) -> None:
        self.nodes, self.pieces, self.interval = tuple(nodes), tuple(pieces), interval
        self.guarantee, self.system = guarantee, system
        self._evolver, self._quantities = evolver, quantities

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the unknowns."""
        return tuple(self._evolver.names())

    @property
    def is_complete(self) -> bool:
        """Whether the ways on from every event were all found."""
        return self.guarantee.startswith("all ")

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
        same = SAME_TIME * (hi - lo + max(abs(lo), abs(hi)))
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

    def _within(self, piece: EvolutionPiece, t: float) -> EvolutionState:
        begin, end = self.nodes[piece.start], self.nodes[piece.end]
        z = piece.between((t - begin.t) / (end.t - begin.t) if end.t > begin.t else 1.0)
        return EvolutionState(
            float(t),
            self._evolver.shown(z, t),
            self._evolver.memory(z, t),
            piece.label,
            history=self._history(piece.start),
            quantities=self._quantities,
        )

    def node(self, number: int) -> EvolutionState:
        """Return a node as a state."""
        node = self.nodes[number]
        return EvolutionState(
            node.t,
            self._evolver.shown(node.z, node.t),
            node.memory,
            self._label(number),
            node.kind,
            node.name,
            node.remark,
            number,
            self._history(number),
            self._quantities,
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
        several = (i for i, pieces in enumerate(self.out_of) if _smooth(pieces) > 1)
        return [self.node(i) for i in several]

    def losses(self) -> list[EvolutionState]:
        """Return the states with no way on."""
        return self.events("loss")

    def paths(self) -> EvolutionPaths:
        """Return all evolutions, each from a start to an end, a loss or an undecided state.

        The evolutions may be very many; they are made one by one as they are asked for.
        """
        return EvolutionPaths(self)

    # -- what engineers read off -----------------------------------------------------------

    def dissipated(self, t0: float, t1: float) -> list[float]:
        """Return the energy dissipated between two times, for every evolution of :meth:`paths`.

        Raises
        ------
        SystemNeededError
            If the system does not know its dissipation, or the graph was loaded without a system.
        """
        return [path.dissipated(t0, t1) for path in self.paths()]

    def cycle(self, period: float) -> list[Cycle]:
        """Return what a periodic load leads to, for every evolution of :meth:`paths`.

        Parameters
        ----------
        period : float
            The period of the load. The last periods of the interval are compared.

        Returns
        -------
        list of Cycle
            With ``kind`` "shakedown", "cyclic slip", "ratchetting" or "not yet".

        Raises
        ------
        InvalidInputError
            If the period is not positive, or longer than half of the interval.
        """
        lo, hi = self.interval
        if not 0.0 < period <= 0.5 * (hi - lo) * (1.0 + SAME_TIME):
            raise InvalidInputError(
                f"period must be positive and at most half of the interval, got {period!r}"
            )
        return [cycle_of(path, hi, period) for path in self.paths()]

    def dissipation(self, before: EvolutionState, after: EvolutionState) -> float:
        """Return the energy dissipated between two states of one smooth piece."""
        known = None if self.system is None else self.system.dissipation(before, after)
        if known is None:
            raise SystemNeededError("only a system that knows its dissipation can tell this")
        return float(known)

    # -- other programs ------------------------------------------------------------------

    @cached_property
    def nx(self) -> nx.DiGraph:
        """The graph as a new networkx graph with plain attributes.

        Nodes have ``t``, ``kind``, ``name``, ``remark``, and ``z`` and ``memory`` as JSON lists.
        Edges have ``label``, ``t0``, ``t1`` and ``jump``.
        """
        return exports.networkx_graph(self)

    def to_dataframe(self, rows: str) -> Any:
        """Return a pandas data frame.

        Parameters
        ----------
        rows : {"events", "pieces"}
            "events": a row for each node, with id, kind, name, t and all unknowns by name.
            "pieces": a row for each piece, with start, end, label, t0, t1 and jump.

        Raises
        ------
        InvalidInputError
            If ``rows`` is another word.
        MissingPackageError
            If pandas is not installed.
        """
        return exports.data_frame(self, rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the graph as plain lists and numbers."""
        return exports.as_dict(self)

    def plot(self, y: str | int = 0, x: str | int = "t") -> Figure:
        """Return a picture of a quantity over time, or over another quantity.

        Parameters
        ----------
        y, x : str or int
            The name of an unknown or of a recorded quantity, or the place of an unknown; "t" is
            the time.
        """
        from pwscont.evolution.plotting import draw  # noqa: PLC0415  only where asked for

        return draw(self, y, x)

    def shown(self, z: Array, t: float) -> Array:
        """Return a state as users see the state."""
        return self._evolver.shown(z, t)

    def memory_at(self, z: Array, node: int) -> Array:
        """Return the memory of a state at the time of a node."""
        return self._evolver.memory(z, self.nodes[node].t)

    def value(self, state: EvolutionState, quantity: str | int) -> float:
        """Return a quantity of a state by name or place; "t" is the time."""
        if quantity == "t":
            return state.t
        return float(state.z[quantity]) if isinstance(quantity, int) else state[quantity]

    def save(self, path: str | Path) -> None:
        """Write the graph to one portable file (a zip of arrays and JSON; no pickle).

        Raises
        ------
        GraphFileError
            If the file cannot be written.
        """
        file.write(path, self)

    @classmethod
    def load(cls, path: str | Path, system: SystemWithMemory | None = None) -> EvolutionGraph:
        """Read a graph written by :meth:`save`.

        Parameters
        ----------
        path : str or Path
        system : SystemWithMemory, optional
            Needed for :meth:`dissipated` alone.

        Raises
        ------
        GraphFileError
            If the file is missing, damaged, or no evolution.
        """
        parts = file.read(path)
        quantities = Quantities(parts.evolver.names)
        return cls(
            parts.nodes,
            parts.pieces,
            parts.interval,
            parts.evolver,
            quantities,
            parts.guarantee,
            system,
        )

    def __iter__(self) -> Iterator[EvolutionPath]:
        return iter(self.paths())

    def __repr__(self) -> str:
        lo, hi = self.interval
        events, pieces = counted(len(self.nodes), "node"), counted(len(self.pieces), "piece")
        return f"EvolutionGraph: t in [{lo:g}, {hi:g}], {events}, {pieces}; {self.guarantee}"

    def _repr_html_(self) -> str:
        rows = [("nodes", len(self.nodes)), ("pieces", len(self.pieces))]
        return card("EvolutionGraph", [*rows, ("guarantee", self.guarantee)])


def _smooth(pieces: Sequence[EvolutionPiece]) -> int:
    return sum(not piece.is_jump for piece in pieces)
