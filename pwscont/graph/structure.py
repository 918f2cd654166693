"""The data of a branch graph: special points, pieces, and how the pieces are connected."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import cached_property
from itertools import combinations
from numbers import Real
from typing import Any

import numpy as np

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, UnknownNameError
from pwscont.basics.outcome import Guarantee, Kind, SearchScope
from pwscont.basics.quantities import Function, Naming, Quantities, checked_record
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.graph.records import Piece, Solution, SpecialPoint, Stretch
from pwscont.system.abilities import shown_size
from pwscont.system.system import PiecewiseSystem

#: Two members that are connected.
Pair = tuple[int, int]


def connected(members: Iterable[int], pairs: Iterable[Pair]) -> list[set[int]]:
    """Return the sets of members that are connected, ordered by the least member of each set."""
    sets = {member: {member} for member in members}
    for pair in pairs:
        small, large = sorted((sets.setdefault(member, {member}) for member in pair), key=len)
        if small is not large:
            large |= small
            sets |= dict.fromkeys(small, large)
    return sorted({id(some): some for some in sets.values()}.values(), key=min)


#: A word as similar as this to the word of a kind is a misspelt word.
MISSPELT = 0.7
NOT_SEARCHED = SearchScope("the component through the start", Guarantee.NOTHING)


class ConnectedPieces:
    """Pieces, special points, and how pieces are connected; see :class:`pwscont.BranchGraph`."""

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
        infinite: Sequence[Stretch] = (),
    ) -> None:
        self.interval, self.system, self.parameter = interval, system, parameter
        self.searched = searched
        #: Stretches of alpha at which solutions fill a segment or more.
        self.infinite = tuple(infinite)
        #: All pieces by id.
        self.pieces = tuple(sorted(pieces, key=lambda piece: piece.id))
        self._points, within = sorted(points, key=lambda point: point.id), list(starts)
        known = [*self._points, *within]
        naming: Naming = names if names is not None or system is None else system.names
        if naming is None:  # without a system the names come from the points
            naming = next((p.quantities.naming for p in known if p.quantities.is_named), None)
        unknowns = Quantities(naming).names(len(known[0].z)) if record and known else ()
        kept = {name for point in known for name in point.quantities.record}
        #: The unknowns and recorded quantities of the states, by name.
        self.quantities = Quantities(naming, checked_record(record, unknowns), kept)
        self.starts = tuple(_asked(point, self.quantities) for point in within)
        self._by_id = {piece.id: piece for piece in self.pieces}

    @cached_property
    def nodes(self) -> tuple[SpecialPoint, ...]:
        """The special points by id, without the starts within pieces."""
        return tuple(_asked(point, self.quantities) for point in self._points)

    @cached_property
    def _nodes(self) -> dict[int, SpecialPoint]:
        return {point.id: point for point in self.nodes}

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
        if self.system is None and not self.nodes:
            return ()
        size = shown_size(self.system) if self.system else len(self.nodes[0].z)
        return self.quantities.names(size)

    def special_points(self, kind: str | None = None) -> list[SpecialPoint]:
        """Return all special points, or the special points of a given kind.

        ``kind``: a value of :class:`~pwscont.basics.outcome.Kind`, such as "nonsmooth fold", or a
        kind of a user's own detector, of which there may be no point. A misspelt word is refused.
        """
        everything = [*self.nodes, *self.starts]
        if kind is None:
            return everything
        kinds = list(dict.fromkeys([*map(str, Kind), *(str(point.kind) for point in everything)]))
        is_text = isinstance(kind, str)
        if not is_text or kind not in kinds:
            near = get_close_matches(kind, kinds, n=3, cutoff=MISSPELT) if is_text else []
            hint = f"; did you mean {' or '.join(near)}?" if near else ""
            if near or not is_text or not kind:  # an array has no truth value
                words = f"unknown kind {kind!r}{hint}; kinds are {', '.join(kinds)}"
                raise InvalidInputError(words)
        return [point for point in everything if point.kind == kind]

    def point(self, node: int) -> SpecialPoint:
        """Return the special point with this id."""
        if not isinstance(node, Real) or node not in self._nodes:
            words = f"there is no special point {node}; graph.special_points() has all"
            raise UnknownNameError(words)
        return self._nodes[node]

    def components(self) -> list[list[Piece]]:
        """Return the pieces of each connected component, in the order along the branches."""
        parts = connected(self._nodes, ((piece.start, piece.end) for piece in self.pieces))
        ids = [{piece.id for node in part for piece in self._touching[node]} for part in parts]
        return [[self._by_id[i] for i in sorted(some)] for some in ids]

    def itinerary(self, component: Sequence[Piece], orientation: int = 1) -> list[SpecialPoint]:
        """Return the special points of a component in the order of an orientation, +1 or -1.

        The component, one of :meth:`components`, has no branch point. The orientation is that of
        Janovsky and Ligursky (2012, Definition 1). Without pieces the list is empty.
        """
        for piece in component if isinstance(component, Iterable) else [component]:
            checked_kind("each of component", piece, Piece, is_needed=True)
        nodes = [*(piece.start for piece in component[:1]), *(piece.end for piece in component)]
        return [self.point(node) for node in nodes[::orientation]]

    def pieces_at(self, node: int) -> list[Piece]:
        """Return the pieces that begin or end at a special point."""
        return list(self._touching[self.point(node).id])

    def path(self, a: Solution, b: Solution) -> list[Piece]:
        """Return the pieces of a shortest way along the branches from a solution to another.

        Empty where no way connects the solutions, as where a solution lies on no piece.
        """
        for name, solution in (("a", a), ("b", b)):
            checked_kind(name, solution, Solution, is_needed=True)
        import networkx as nx  # noqa: PLC0415  it takes longer to import than most paths to follow

        beside = nx.Graph()
        beside.add_nodes_from(self._by_id)
        for pieces in self._touching.values():
            beside.add_edges_from(combinations([piece.id for piece in pieces], 2))
        if not {a.piece, b.piece} <= beside.nodes or not nx.has_path(beside, a.piece, b.piece):
            return []
        return [self._by_id[i] for i in nx.shortest_path(beside, a.piece, b.piece)]

    def same(self, a: Array | float, b: float) -> Any:
        """Tell whether values of alpha differ by rounding only."""
        lo, hi = self.interval
        return np.abs(np.asarray(a) - b) <= SAME_ALPHA * max(abs(b), hi - lo)

    def clean(self, alpha: float) -> float:
        """Return zero where alpha is nothing but rounding."""
        return 0.0 if bool(self.same(alpha, 0.0)) else alpha

    def breaks(self) -> list[float]:
        """Return the ends of the interval and of stretches, and the alphas of nodes, each once."""
        lo, hi = self.interval
        breaks = [lo]
        ends = [end for stretch in self.infinite for end in stretch[:2]]
        for alpha in sorted(map(self.clean, [*(p.alpha for p in self.nodes), *ends])):
            if not self.same(alpha, breaks[-1]) and not self.same(alpha, hi):
                breaks.append(alpha)
        return [*breaks, hi]

    @cached_property
    def extent(self) -> Array:
        """Smallest and largest alpha of each piece, shape (number of pieces, 2)."""
        return np.array([piece.interval for piece in self.pieces]).reshape(-1, 2)

    @cached_property
    def alphas(self) -> Array:
        """The alphas of the nodes."""
        return np.array([point.alpha for point in self.nodes])

    @cached_property
    def alpha_errors(self) -> Array:
        """The estimated errors of these alphas."""
        return np.array([point.error[-1] if len(point.error) else 0.0 for point in self.nodes])

    @cached_property
    def verticals(self) -> list[Piece]:
        """The pieces on which alpha is one value."""
        return [piece for piece in self.pieces if piece.is_vertical]


def _asked(point: SpecialPoint, quantities: Quantities) -> SpecialPoint:
    """Return a point with the quantities of the graph; values read from a file are kept."""
    if kept := point.quantities.record:
        quantities = Quantities(quantities.naming, {**kept, **quantities.record})
    return replace(point, quantities=quantities)
