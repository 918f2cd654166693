"""The branch graph: smooth pieces joined at special points, and what can be asked of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any, final

import networkx as nx
import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.basics.kind import Kind
from pwscont.basics.quantities import Function, Naming, Quantities, checked_record
from pwscont.basics.rounding import CONFIDENCE, SAME_ALPHA
from pwscont.graph import presentation, storage
from pwscont.graph.exports import data_frame, networkx_graph
from pwscont.graph.records import Piece, Solution, SpecialPoint, Stretch
from pwscont.graph.refinement import refine
from pwscont.graph.verdict import WORDS, is_on_purpose, loose_ends, verdict
from pwscont.system.system import PiecewiseSystem

#: Solutions that are larger or smaller by this factor are not of the order of one.
FAR = 1e3
NOT_SEARCHED = SearchScope("nothing but the component through the start", Guarantee.NOTHING)


@final
class BranchGraph:
    """All that was found of the solutions of a system in an interval of its parameter.

    Made by :func:`pwscont.trace` and :func:`pwscont.explore`; not changed afterwards.

    Parameters
    ----------
    points : iterable of SpecialPoint
    pieces : iterable of Piece
    interval : tuple of float
    starts : iterable of SpecialPoint
        Where tracing began within a piece.
    system : PiecewiseSystem, optional
        Needed to answer to full accuracy between the points of a curved piece.
    parameter : str
        Name of the parameter, for tables and axes.
    searched : SearchScope
        Where starts were searched, and what that promises.
    record : mapping of str to callable, optional
        Quantities to have at hand by name, such as ``solution["power"]``: functions of (z, alpha)
        that return a finite float. They are evaluated when asked for; one that fails raises then,
        and nothing else of the graph is lost.
    names : sequence of str, optional
        Names of the unknowns; default those of the system.

    Raises
    ------
    InvalidInputError
        If a recorded quantity has the name of an unknown or of something else, or is no function.
    """

    def __init__(
        self,
        points: Iterable[SpecialPoint],
        pieces: Iterable[Piece],
        interval: tuple[float, float],
        *,
        starts: Iterable[SpecialPoint] = (),
        system: PiecewiseSystem | None = None,
        parameter: str = "alpha",
        searched: SearchScope = NOT_SEARCHED,
        record: Mapping[str, Function] | None = None,
        names: Sequence[str] | None = None,
    ) -> None:
        self.interval = interval
        self.searched = searched
        self.system = system
        self.parameter = parameter
        given, within = list(points), list(starts)
        #: What its states can be asked for by name.
        self.quantities = _quantities([*given, *within], system, record, names)
        self.starts = tuple(_asked(point, self.quantities) for point in within)
        self._nodes = {point.id: _asked(point, self.quantities) for point in given}
        self._by_id = {piece.id: piece for piece in sorted(pieces, key=lambda piece: piece.id)}

    @cached_property
    def nx(self) -> nx.MultiGraph:
        """The same as a networkx graph of its own, with plain attributes.

        Its values are numbers and texts, so that :func:`networkx.write_graphml` and the like take
        them. Made when first asked for; changing it changes nothing else.

        Nodes are the ids of special points. They have ``kind``, ``alpha``, ``message``, ``name``,
        the recorded quantities, and ``z``, the state as a JSON list. (As an array it is
        ``graph.point(node).z``; one unknown is ``graph.point(node)["u_t"]``.)

        The key of an edge is the id of its piece. Edges have this ``piece``, ``label``,
        ``det_sign``, ``character`` (a text of + and -), ``alpha_lo``, ``alpha_hi``, and ``length``:
        the sum of the chords between stored points in (z, alpha), where alpha is measured by the
        interval and each unknown by its largest magnitude in the graph.
        """
        return networkx_graph(self)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """All pieces by id."""
        return tuple(self._by_id.values())

    @cached_property
    def _points(self) -> tuple[SpecialPoint, ...]:
        return tuple(self._nodes[i] for i in sorted(self._nodes))

    @cached_property
    def _touching(self) -> dict[int, list[Piece]]:
        """The pieces that begin or end at each node."""
        touching: dict[int, list[Piece]] = {node: [] for node in self._nodes}
        for piece in self.pieces:
            for node in {piece.start, piece.end}:
                touching[node].append(piece)
        return touching

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the unknowns; empty where a graph has neither a system nor points."""
        some = self.system.size if self.system else next((len(p.z) for p in self._points), None)
        return () if some is None else self.quantities.names(some)

    def special_points(self, kind: str | None = None) -> list[SpecialPoint]:
        """Return the special points, of one kind if given.

        Parameters
        ----------
        kind : str, optional
            A value of :class:`~pwscont.basics.kind.Kind`, such as "nonsmooth fold", or a kind
            of one's own detector that is in the graph.
        """
        everything = [*self._points, *self.starts]
        kinds = dict.fromkeys([*map(str, Kind), *(str(point.kind) for point in everything)])
        if kind is not None and kind not in kinds:
            raise InvalidInputError(f"unknown kind {kind!r}; kinds are {', '.join(kinds)}")
        return [point for point in everything if kind is None or point.kind == kind]

    def point(self, node: int) -> SpecialPoint:
        """Return the special point with this id."""
        return self._nodes[node]

    def components(self) -> list[list[Piece]]:
        """Return the pieces of each connected component, in the order in which they follow."""
        joined = nx.Graph()
        joined.add_nodes_from(self._nodes)
        joined.add_edges_from((piece.start, piece.end) for piece in self.pieces)
        return [self._at_any(nodes) for nodes in sorted(nx.connected_components(joined), key=min)]

    def _at_any(self, nodes: set[int]) -> list[Piece]:
        ids = {piece.id for node in nodes for piece in self._touching[node]}
        return [self._by_id[i] for i in sorted(ids)]

    def itinerary(self, component: Sequence[Piece], orientation: int = 1) -> list[SpecialPoint]:
        """Return the special points of a component in the order of its orientation.

        Parameters
        ----------
        component : sequence of Piece
            One of :meth:`components`, without branch points.
        orientation : int
            +1 or -1 (Janovsky and Ligursky 2012, Definition 1).
        """
        nodes = [component[0].start, *(piece.end for piece in component)]
        return [self.point(node) for node in nodes[::orientation]]

    # -- how many solutions, and which ---------------------------------------------------

    def same(self, a: Array | float, b: float) -> Any:
        """Tell whether values of alpha are one, but for rounding."""
        lo, hi = self.interval
        return np.abs(np.asarray(a) - b) <= SAME_ALPHA * max(abs(b), hi - lo)

    def _inside(self, alpha: float) -> None:
        lo, hi = self.interval
        if not lo <= alpha <= hi:
            raise InvalidInputError(f"alpha = {alpha} lies outside the interval [{lo}, {hi}]")

    @cached_property
    def _extent(self) -> Array:
        """Smallest and largest alpha of each piece, shape (number of pieces, 2)."""
        return np.array([piece.interval for piece in self.pieces]).reshape(-1, 2)

    def _over(self, alpha: float) -> list[Piece]:
        """Return the pieces that pass over an alpha at which there is no node."""
        lo, hi = self._extent.T
        return [self.pieces[i] for i in np.flatnonzero((lo < alpha) & (alpha < hi))]

    def _through(self, alpha: float) -> list[Piece]:
        """Return the pieces that have ``alpha`` strictly inside."""
        lo, hi = self._extent.T
        inside = (lo < alpha) & (alpha < hi) & ~self.same(lo, alpha) & ~self.same(hi, alpha)
        return [self.pieces[i] for i in np.flatnonzero(inside)]

    @cached_property
    def _alphas(self) -> Array:
        return np.array([point.alpha for point in self._points])

    @cached_property
    def _alpha_errors(self) -> Array:
        return np.array([point.error[-1] if len(point.error) else 0.0 for point in self._points])

    @cached_property
    def verticals(self) -> list[Piece]:
        """The pieces on which alpha is one value."""
        return [piece for piece in self.pieces if piece.is_vertical]

    def _nodes_at(self, alpha: float) -> list[int]:
        return [self._points[i].id for i in np.flatnonzero(self.same(self._alphas, alpha))]

    def pieces_at(self, node: int) -> list[Piece]:
        """Return the pieces that begin or end at a special point."""
        return list(self._touching[node])

    def count(self, alpha: float) -> int | float:
        """Return the number of solutions at ``alpha``; infinite on a vertical piece.

        A solution at which two pieces meet counts once.
        """
        self._inside(alpha)
        if any(self.same(piece.interval[0], alpha) for piece in self.verticals):
            return math.inf
        return len(self._through(alpha)) + len(self._nodes_at(alpha))

    def solutions(self, alpha: float) -> list[Solution]:
        """Return all solutions at ``alpha`` that the graph holds, corrected to full accuracy.

        On a vertical piece these are its two ends.

        Raises
        ------
        InvalidInputError
            If alpha lies outside the interval.
        SystemNeededError
            If a curved piece must be corrected and the graph was loaded without its system.
        """
        self._inside(alpha)
        at_nodes = [self._solution_at(node) for node in self._nodes_at(alpha)]
        between = [
            refine(self.system, piece, alpha, self.interval, self.quantities)
            for piece in self._through(alpha)
        ]
        return sorted(at_nodes + between, key=lambda solution: solution.piece)

    def _solution_at(self, node: int) -> Solution:
        point, pieces = self.point(node), self.pieces_at(node)
        if not pieces:
            return self._isolated(point)
        piece, index = pieces[0], self._index(node)
        return Solution(
            z=point.z,
            alpha=point.alpha,
            character=piece.character,
            label=piece.label,
            det_sign=index,
            piece=piece.id,
            kind=point.kind,
            error=point.error,
            digits=point.digits,
            quantities=point.quantities,
        )

    def _isolated(self, point: SpecialPoint) -> Solution:
        """Return a solution from which no piece leaves; its cell is that of the point itself."""
        character, label = Character(()), "unknown"
        if self.system is not None:
            character = self.system.character(point.z, point.alpha)
            label = self.system.label(character)
        known = (point.kind, point.error, point.digits, point.quantities)
        return Solution(point.z, point.alpha, character, label, 0, -1, *known)

    def _index(self, node: int) -> int:
        """Return the index of the solution at a node: the sum of the signs to its right.

        At the right end of the interval, of those to its left; both sums agree elsewhere.
        """
        alpha, pieces = self.point(node).alpha, self.pieces_at(node)
        right = [p for p in pieces if not p.is_vertical and self.same(p.interval[0], alpha)]
        left = [p for p in pieces if not p.is_vertical and self.same(p.interval[1], alpha)]
        at_hi = bool(self.same(alpha, self.interval[1]))
        return sum(piece.det_sign for piece in (left if at_hi else right))

    def multiplicity(self) -> list[Stretch]:
        """Return ``(lo, hi, count)`` for successive stretches with the same number of solutions.

        The number holds at every regular alpha of the stretch; each entry says whether it holds
        at its ends as well (``lo_closed``, ``hi_closed``). Single values of alpha with another
        number, such as folds, are found by :meth:`where` and :meth:`count`.
        """
        table: list[tuple[float, float, int]] = []
        for lo, hi in pairwise(self.breaks()):
            count = len(self._over(0.5 * (lo + hi)))
            if table and table[-1][2] == count:
                table[-1] = (table[-1][0], hi, count)
            else:
                table.append((lo, hi, count))
        return [self._stretch(*row) for row in table]

    def _stretch(self, lo: float, hi: float, count: int) -> Stretch:
        return Stretch(lo, hi, count, self.count(lo) == count, self.count(hi) == count)

    def where(self, count: int) -> list[Stretch]:
        """Return all stretches and single values of alpha with exactly ``count`` solutions."""
        stretches = [stretch for stretch in self.multiplicity() if stretch[2] == count]
        covered = [end for lo, hi, _ in stretches for end in (lo, hi)]
        single = [
            Stretch(alpha, alpha, count, True, True)
            for alpha in self.breaks()
            if self.count(alpha) == count
            and alpha not in covered
            and not any(lo < alpha < hi for lo, hi, _ in stretches)
        ]
        return sorted([*stretches, *single])

    def breaks(self) -> list[float]:
        """Return both ends of the interval and the alphas of all nodes, without repetition."""
        lo, hi = self.interval
        breaks = [lo]
        for alpha in sorted(self.clean(point.alpha) for point in self._points):
            if not self.same(alpha, breaks[-1]) and not self.same(alpha, hi):
                breaks.append(alpha)
        return [*breaks, hi]

    def clean(self, alpha: float) -> float:
        """Return zero where alpha is nothing but rounding."""
        return 0.0 if bool(self.same(alpha, 0.0)) else alpha

    def balance(self, alpha: float) -> int:
        """Return the sum of the signs of det(dH/dz) over all solutions at ``alpha``.

        Where solutions stay bounded it is the same at every regular alpha; if it is not, a
        branch is missing. The converse does not hold: a missed pair cancels.
        """
        self._inside(alpha)
        nodes = sum(self._index(node) for node in self._nodes_at(alpha))
        return nodes + sum(piece.det_sign for piece in self._through(alpha))

    def path(self, a: Solution, b: Solution) -> list[Piece]:
        """Return the pieces of a shortest way along the branches from one solution to another.

        Parameters
        ----------
        a, b : Solution
            Answers of :meth:`solutions`.

        Returns
        -------
        list of Piece
            From the piece of ``a`` to the piece of ``b``; empty where no way connects them.
        """
        joints = nx.Graph()
        joints.add_nodes_from(piece.id for piece in self.pieces)
        for node in self._nodes:
            joints.add_edges_from(combinations((p.id for p in self.pieces_at(node)), 2))
        try:
            return [self._by_id[i] for i in nx.shortest_path(joints, a.piece, b.piece)]
        except nx.NetworkXNoPath:
            return []

    def balances(self) -> list[int]:
        """Return the balance within each interval between successive special points."""
        middles = [0.5 * (a + b) for a, b in pairwise(self.breaks())]
        return [sum(piece.det_sign for piece in self._over(alpha)) for alpha in middles]

    def sums(self) -> list[int]:
        """Return the different values of the balance, ascending; one where nothing is missing.

        Only stretches of alpha count that can be judged: one that is no longer than the
        uncertainty of the special points around it may be there or not, and in either order.
        """
        return sorted({value for value, _ in self._judged()})

    def _judged(self) -> list[tuple[int, tuple[float, float]]]:
        """Return balance and ends of the stretches that are longer than their ends are uncertain.

        Where all of them are shorter there is nothing else to go by than all of them.
        """
        everything = list(zip(self.balances(), pairwise(self.breaks()), strict=True))
        return [row for row in everything if not self._is_blurred(*row[1])] or everything

    def _is_blurred(self, lo: float, hi: float) -> bool:
        """Tell whether the special points around a stretch may as well lie within it."""
        left = self._alphas < 0.5 * (lo + hi)
        blur = CONFIDENCE * self._alpha_errors
        first = (self._alphas + blur)[left].max(initial=lo)
        last = (self._alphas - blur)[~left].min(initial=hi)
        return bool(first >= last)

    def is_balanced(self) -> bool:
        """Tell whether the balance is the same at every regular alpha of the interval.

        Where the system knows its degree (+1 for Coulomb friction), the balance must equal it.
        Stretches too short to be judged do not count, see :meth:`sums`.
        """
        return not self.unbalanced()

    def unbalanced(self) -> list[tuple[float, float]]:
        """Return the stretches in which the balance is not what it must be.

        Without a known degree, those that differ from the most frequent value, when the branches
        that end on purpose are left out.
        """
        judged = self._judged()
        degree = self.system.degree if self.system else None
        if degree is None:
            ends = [(p, n) for p, n in loose_ends(self).items() if is_on_purpose(self, p)]
            judged = [(value - _ended(ends, gap), gap) for value, gap in judged]
            values = [value for value, _ in judged]
            degree = max(values, key=values.count)
        merged: list[tuple[float, float]] = []
        for lo, hi in (gap for value, gap in judged if value != degree):
            if merged and merged[-1][1] == lo:
                merged[-1] = (merged[-1][0], hi)
            else:
                merged.append((lo, hi))
        return merged

    @property
    def guarantee(self) -> str:
        """What is known about the completeness of the graph, in words.

        It begins with "complete", "complete but for closed loops", "balanced", or "not balanced",
        and goes on with what stands in the way, and where: a branch is missing, a solution stands
        twice, a piece was stopped, the model ends, a branch ends on purpose. No graph is called
        complete with a special point that is stopped, searched in part, left by a piece that could
        not be followed, or known to less than two digits. Where the run was interrupted or its
        limits ran out, it says that instead. Balance is necessary for completeness, not
        sufficient, and says nothing of stretches shorter than the uncertainty of their ends, see
        :meth:`sums`.
        """
        return verdict(self)

    @property
    def is_complete(self) -> bool:
        """Whether nothing can be missing, no closed loop either; else counts are least numbers."""
        words = self.guarantee.split(";")[0]
        return words in (WORDS[Guarantee.EVERYTHING], WORDS[Guarantee.UNIQUE])

    # -- outside -----------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the graph to one portable file (a zip of arrays and JSON; no pickle).

        Raises
        ------
        GraphFileError
            If it cannot be written.
        """
        storage.write(
            path,
            storage.Contents(
                self._points,
                self.pieces,
                self.starts,
                self.interval,
                self.parameter,
                self.searched,
                self._names_to_keep(),
            ),
        )

    def _names_to_keep(self) -> tuple[str, ...] | None:
        """Return the names for a file; one with numbers is better than none for a wrong name."""
        try:
            return self.names if self.quantities.is_named and self._points else None
        except InvalidSystemError:
            return None

    @classmethod
    def load(
        cls,
        path: str | Path,
        system: PiecewiseSystem | None = None,
        record: Mapping[str, Function] | None = None,
    ) -> BranchGraph:
        """Read a graph written by :meth:`save`.

        Parameters
        ----------
        path : str or Path
        system : PiecewiseSystem, optional
            The system that the graph belongs to; without it, solutions between the stored
            points of a curved piece cannot be corrected and are refused.
        record : mapping of str to callable, optional
            Quantities to have at hand by name. Without it the special points keep those that were
            recorded when the graph was saved; solutions between them need the functions.

        Raises
        ------
        GraphFileError
            If the file is missing, damaged, or no branch graph.
        InvalidInputError
            If the system has another number of unknowns or tests than the graph, or names and
            functions of ``record`` do not fit.
        """
        file = storage.read(path)
        if file.pieces and system is not None:
            _check_system(path, system, file.points[0], file.pieces[0])
        return cls(
            file.points,
            file.pieces,
            file.interval,
            starts=file.starts,
            system=system and _fitted(system, file.interval, file.points),
            parameter=file.parameter,
            searched=file.searched,
            record=record,
            names=None if system else file.names,
        )

    def to_dataframe(self, rows: str) -> Any:
        """Return a pandas data frame.

        Parameters
        ----------
        rows : {"pieces", "points", "special"}
            "pieces": one row for each piece, with id, component, start, end, label, character,
            det_sign, alpha_lo, alpha_hi, number of points and length (see :attr:`nx`).
            "points": one row for each stored point of every piece, with piece, component, label,
            alpha, all unknowns by name and the recorded quantities.
            "special": one row for each special point, with id (-1 for a start within a piece),
            kind, name, alpha, message, all unknowns by name, the recorded quantities, the
            estimated error of alpha and the number of digits known.

            An unknown whose name is that of another column is called ``z[i]``.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        InvalidInputError
            If ``rows`` is another word, or a recorded quantity fails.
        MissingPackageError
            If pandas is not installed.
        """
        return data_frame(self, rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the graph as plain lists and numbers."""
        return presentation.as_dict(self)

    def __repr__(self) -> str:
        return presentation.as_text(self)

    def _repr_html_(self) -> str:
        return presentation.as_html(self)


def _quantities(
    points: Sequence[SpecialPoint],
    system: PiecewiseSystem | None,
    record: Mapping[str, Function] | None,
    names: Sequence[str] | None,
) -> Quantities:
    """Return what a graph can be asked for by name; names come from its points if need be."""
    naming: Naming = names if names is not None or system is None else system.names
    if naming is None:
        naming = next((p.quantities.naming for p in points if p.quantities.is_named), None)
    known = Quantities(naming)
    unknowns = known.names(len(points[0].z)) if record and points else ()
    return Quantities(naming, checked_record(record, unknowns))


def _asked(point: SpecialPoint, quantities: Quantities) -> SpecialPoint:
    """Return a point that can be asked by name; what it knows already, it keeps."""
    kept = point.quantities.record
    if kept:
        quantities = Quantities(quantities.naming, {**kept, **quantities.record})
    return replace(point, quantities=quantities)


def _check_system(
    path: str | Path, system: PiecewiseSystem, point: SpecialPoint, piece: Piece
) -> None:
    """Refuse a system with other numbers of unknowns or tests than those of a file."""
    unknowns, name = len(point.z), type(system).__name__
    if unknowns != system.size:
        raise InvalidInputError(
            f"{path} is of another system: it has {unknowns} unknowns, {name} has {system.size}"
        )
    tests = len(bytes(piece.character))
    given = len(bytes(system.character(point.z, point.alpha)))
    if tests != given:
        raise InvalidInputError(
            f"{path} is of another system: it has {tests} tests, {name} has {given}"
        )


def _ended(ends: list[tuple[SpecialPoint, int]], gap: tuple[float, float]) -> int:
    """Return by how much some ends change the balance between lo and a stretch."""
    return sum(jump for point, jump in ends if point.alpha < 0.5 * sum(gap))


def _fitted(
    system: PiecewiseSystem, interval: tuple[float, float], points: Sequence[SpecialPoint]
) -> PiecewiseSystem:
    """Return a system fitted to an interval, and to its solutions where it gives no scale."""
    sizes = np.max([np.abs(point.z) for point in points], axis=0, initial=0.0)
    usual = (sizes == 0.0) | ((sizes > 1.0 / FAR) & (sizes < FAR))
    found = None if system.gives_scale or usual.all() else np.where(usual, 1.0, sizes)
    return system.within(*interval, found)
