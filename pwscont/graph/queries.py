"""Queries for the solutions at a value of alpha, and for their number."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from numbers import Real

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.graph.records import Piece, Solution, SpecialPoint, Stretch
from pwscont.graph.refinement import refine
from pwscont.graph.structure import Structure
from pwscont.system.hidden import completed


class Queries(Structure):
    """The queries of a branch graph; see :class:`pwscont.BranchGraph`."""

    def count(self, alpha: float) -> int | float:
        """Return the number of solutions at ``alpha``; infinite where they fill a segment or more.

        A solution at which two pieces meet counts once.
        """
        self._inside(alpha)
        if self._is_infinite(alpha):
            return math.inf
        return len(self._through(alpha)) + len(self._nodes_at(alpha))

    def solutions(self, alpha: float) -> list[Solution]:
        """Return all solutions at ``alpha`` that the graph holds, corrected to full accuracy.

        Of infinitely many, as on a vertical piece, these are the ends of segments that are pieces.

        Raises
        ------
        InvalidInputError
            If alpha lies outside the interval.
        SystemNeededError
            If a curved piece must be corrected and the graph was loaded without its system.
        """
        self._inside(alpha)
        at_nodes = [self.solution_at(node) for node in self._nodes_at(alpha)]
        between = [
            refine(self.system, piece, alpha, self.interval, self.quantities)
            for piece in self._through(alpha)
        ]
        return sorted(at_nodes + between, key=lambda solution: solution.piece)

    def solution_at(self, node: int) -> Solution:
        """Return a special point as one of the solutions at its alpha."""
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
        """Return a solution from which no piece leaves, in the cell of the point itself."""
        character, label = Character(()), "unknown"
        if self.system is not None:
            z = completed(self.system, point.z, point.alpha)
            character = self.system.character(z, point.alpha)
            label = self.system.label(character)
        known = (point.kind, point.error, point.digits, point.quantities)
        return Solution(point.z, point.alpha, character, label, 0, -1, *known)

    def multiplicity(self) -> list[Stretch]:
        """Return ``(lo, hi, count)`` for successive stretches with the same number of solutions.

        The number holds at every alpha of the stretch; each entry says whether it holds at its ends
        as well (``lo_closed``, ``hi_closed``). A single value of alpha with infinitely many
        solutions is an entry of its own; those with another number, such as folds, are found by
        :meth:`with_count` and :meth:`count`.
        """
        breaks = self.breaks()
        counts = [self.count(alpha) for alpha in breaks]
        return list(_merged([*self._between(breaks, counts)], counts))

    def _between(self, breaks: list[float], counts: list[int | float]) -> Iterator[Stretch]:
        """Yield the stretches between successive breaks, at which there are so many solutions."""
        for (lo, at_lo), (hi, at_hi) in pairwise(zip(breaks, counts, strict=True)):
            middle = 0.5 * (lo + hi)
            count = math.inf if self._is_infinite(middle) else len(self._over(middle))
            yield Stretch(lo, hi, count, at_lo == count, at_hi == count)

    def _is_infinite(self, alpha: float) -> bool:
        """Tell whether there are infinitely many solutions at ``alpha``."""
        if any(self.same(piece.interval[0], alpha) for piece in self.verticals):
            return True
        return any(self._has(stretch, alpha) for stretch in self.infinite)

    def is_beside_infinite(self, alpha: float) -> bool:
        """Tell whether there are infinitely many solutions at ``alpha`` or next to it."""
        ends = (end for stretch in self.infinite for end in stretch[:2])
        return self._is_infinite(alpha) or any(bool(self.same(end, alpha)) for end in ends)

    def _has(self, stretch: Stretch, alpha: float) -> bool:
        """Tell whether alpha lies in a stretch, whose ends are known to rounding."""
        lo, hi = stretch[:2]
        at_lo, at_hi = bool(self.same(lo, alpha)), bool(self.same(hi, alpha))
        if at_lo or at_hi:
            return (at_lo and stretch.lo_closed) or (at_hi and stretch.hi_closed)
        return lo < alpha < hi

    def with_count(self, count: int | float) -> list[Stretch]:
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

    def _index(self, node: int) -> int:
        """Return the index of the solution at a node: the sum of the signs of pieces to its right.

        At the right end of the interval the pieces to its left count; elsewhere both sums agree.
        """
        alpha, pieces = self.point(node).alpha, self.pieces_at(node)
        right = [p for p in pieces if not p.is_vertical and self.same(p.interval[0], alpha)]
        left = [p for p in pieces if not p.is_vertical and self.same(p.interval[1], alpha)]
        at_hi = bool(self.same(alpha, self.interval[1]))
        return sum(piece.det_sign for piece in (left if at_hi else right))

    def _inside(self, alpha: float) -> None:
        lo, hi = self.interval
        if np.ndim(alpha) or not isinstance(np.asarray(alpha).item(), Real):
            raise InvalidInputError(f"alpha must be a number, got {alpha!r}")
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

    def _nodes_at(self, alpha: float) -> list[int]:
        return [self._points[i].id for i in np.flatnonzero(self.same(self._alphas, alpha))]


def _merged(rows: list[Stretch], counts: list[int | float]) -> Iterator[Stretch]:
    """Yield stretches, joined where the number goes on, and breaks with infinitely many alone.

    ``counts`` has the numbers at the breaks: the beginnings of all stretches, and the last end.
    """
    whole = rows[0]
    if counts[0] == math.inf != whole[2]:
        yield _single(whole[0])
    for row, count in zip(rows[1:], counts[1:], strict=False):
        if whole[2] == row[2] == count:
            whole = Stretch(whole[0], row[1], count, whole.lo_closed, row.hi_closed)
            continue
        yield whole
        if count == math.inf and math.inf not in (whole[2], row[2]):
            yield _single(row[0])
        whole = row
    yield whole
    if counts[-1] == math.inf != whole[2]:
        yield _single(whole[1])


def _single(alpha: float) -> Stretch:
    return Stretch(alpha, alpha, math.inf, True, True)
