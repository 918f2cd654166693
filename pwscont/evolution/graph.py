"""The graph of evolutions, with all queries as methods."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import card, counted
from pwscont.basics.quantities import Quantities
from pwscont.evolution import exports
from pwscont.evolution.memory import SystemWithMemory
from pwscont.evolution.paths import Cycle, EvolutionPath, EvolutionPaths, cycle_of
from pwscont.evolution.rays import is_piece
from pwscont.evolution.states import SAME_TIME, EvolutionStructure

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.figure import Figure


@final
class EvolutionGraph(EvolutionStructure):
    """Everything that a system with memory can do in an interval of time.

    Made by :func:`pwscont.evolve`; not changed afterwards. Nodes are states at events, edges are
    smooth pieces. States that agree are one node, however many evolutions lead there.

    Attributes
    ----------
    interval : tuple of float
    guarantee : str
        What is known about completeness, in words. "all evolutions with finitely many events"
        where every way on of every event was found; an evolution that begins with infinitely many
        events in a finite time is not among these. Where evolutions branch, the words add "that
        branch at events only, not in between": an evolution may then leave a piece at any time, as
        when a node that slips comes to rest without a reason (docs/theory, F18).

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
    (5, 1)
    """

    @property
    def is_complete(self) -> bool:
        """Whether the ways on from every event were all found."""
        return self.guarantee.startswith("all ")

    def paths(self) -> EvolutionPaths:
        """Return all evolutions, each from a start to an end, a loss or an undecided state.

        Evolutions may be very many: each evolution is made when asked for.
        """
        return EvolutionPaths(self)

    def strange_times(self, *, labels: bool = True) -> Iterator[float]:
        """Yield when pieces begin that are none of the system, asked anew, or end elsewhere.

        A piece is straight, from node to node, in one cell of the law with the memory of the first
        node; the cell has the label of the piece, if ``labels`` are compared.
        """
        for piece in self.pieces:
            begin, end = self.node(piece.start), self.node(piece.end)
            states, label = [begin, *self.along(piece, 3), end], piece.label if labels else None
            goes_on = begin.t <= end.t and not piece.is_jump
            if not (goes_on and is_piece(self.system, states, self.interval, label)):
                yield begin.t

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
            If the period is no number from 0.0001 to half of the interval.
        """
        lo, hi = self.interval
        period = float(finite_array("period", period, ()))
        if not 1e-4 <= period / (hi - lo) <= 0.5 * (1.0 + SAME_TIME):
            raise InvalidInputError(
                f"period must be positive, from 0.0001 to half of the interval, got {period!r}"
            )
        return [cycle_of(path, hi, period) for path in self.paths()]

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

    def page_records(self, wanted: str) -> dict[str, Any]:
        """Return what the page of :class:`~pwscont.View` shows, ``wanted`` at first."""
        from pwscont.evolution.browser import page_records  # noqa: PLC0415  only where asked for

        return page_records(self, wanted)

    def to_dict(self) -> dict[str, Any]:
        """Return the graph as plain lists and numbers."""
        return exports.as_dict(self)

    def plot(self, y: str | int = 0, x: str | int = "t") -> Figure:
        """Return a picture of a quantity over time, or over another quantity.

        Each evolution has a colour and a line style of its own; a piece that several evolutions
        share has stripes of all their colours. Starts, branchings, losses and jumps are marked.

        Parameters
        ----------
        y, x : str or int
            The name of an unknown or of a recorded quantity, or the place of an unknown; "t" is
            the time.

        Raises
        ------
        UnknownNameError
            If there is no such quantity; the message lists similar names.
        """
        from pwscont.evolution.plotting import draw  # noqa: PLC0415  only where asked for

        return draw(self, [(y, x)])

    def animate(
        self,
        path: str | Path,
        y: str | int = 0,
        x: str | int = "t",
        *,
        frames: int = 60,
        fps: int = 12,
    ) -> Path:
        """Write the picture of :meth:`plot` with all states moving over time, as an animated GIF.

        Parameters
        ----------
        path : str or Path
            Ending in ``.gif``.
        y, x
            As for :meth:`plot`.
        frames : int
            At least 2, at equal steps in time.
        fps : int
            Frames per second.

        Raises
        ------
        InvalidInputError
            If the file cannot be written.
        UnknownNameError
            If there is no such quantity.
        """
        from pwscont.evolution.plotting import animate  # noqa: PLC0415  only where asked for

        return animate(self, Path(path), (y, x), frames, fps)

    def save(self, path: str | Path) -> None:
        """Write the graph to one portable file (a zip of arrays and JSON; no pickle).

        Raises
        ------
        GraphFileError
            If the file cannot be written.
        """
        exports.write(path, self)

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
        InvalidInputError
            If the system remembers more or fewer numbers than the states of the file.
        """
        parts = exports.read(path)
        checked_kind("system", system, SystemWithMemory)
        if system is not None and parts.nodes:
            own, size = len(system.initial_memory()), len(parts.nodes[0].memory)
            if own != size:
                kind = type(system).__name__
                raise InvalidInputError(f"{kind} remembers {own} numbers, the file {size}")
        quantities = Quantities(parts.reader.names)
        found = parts.nodes, parts.pieces, parts.interval, parts.reader
        return cls(*found, quantities, parts.guarantee, system)

    def __iter__(self) -> Iterator[EvolutionPath]:
        return iter(self.paths())

    def __repr__(self) -> str:
        lo, hi = self.interval
        events, pieces = counted(len(self.nodes), "node"), counted(len(self.pieces), "piece")
        return f"EvolutionGraph: t in [{lo:g}, {hi:g}], {events}, {pieces}; {self.guarantee}"

    def _repr_html_(self) -> str:
        rows = [("nodes", len(self.nodes)), ("pieces", len(self.pieces))]
        return card("EvolutionGraph", [*rows, ("guarantee", self.guarantee)])
