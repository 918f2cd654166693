"""The true pieces of a problem and the joints of pieces, for the bench.

A true piece is a curve with its own parameter (alpha, an angle, the height of a solution), because
alpha is a poor parameter near a fold.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import final

import networkx as nx
import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import Array

#: Ends of true pieces closer than this, in the metric of the problem, are the same point.
SAME_PLACE = 1e-8
#: Number of true solutions of a piece with which the computed branch is compared.
SAMPLES = 101

#: The name of a selection, as :meth:`pwscont.PiecewiseSystem.cell` returns it.
Cell = Hashable


class UnknownAnswerError(InvalidInputError):
    """The bench does not know the right answer of a problem."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class TruePiece:
    """A smooth piece on which alpha is monotone.

    Attributes
    ----------
    cell : hashable
        As of :meth:`pwscont.PiecewiseSystem.cell`.
    det_sign : int
    span : tuple of float
        Values of the piece's own parameter at the ends.
    at : callable
        Own parameter -> the point (z, alpha), shape (n + 1,).
    parameter : callable
        A point near the piece -> own parameter of a point of the piece close to that point.
    """

    cell: Cell
    det_sign: int
    span: tuple[float, float]
    at: Callable[[float], Array]
    parameter: Callable[[Array], float]

    def next_to(self, x: Array) -> Array:
        """Return a point of the piece close to the point ``x``."""
        return self.at(min(max(self.parameter(x), self.span[0]), self.span[1]))

    def middle(self) -> Array:
        """Return a point well inside the piece."""
        return self.at(0.5 * sum(self.span))

    def ends(self) -> tuple[Array, Array]:
        """Return the points at the ends."""
        return self.at(self.span[0]), self.at(self.span[1])

    def extent(self) -> tuple[float, float]:
        """Return the smallest and the largest alpha."""
        a, b = (float(end[-1]) for end in self.ends())
        return min(a, b), max(a, b)

    def samples(self) -> Array:
        """Return points of the piece, dense towards the ends, shape (SAMPLES, n + 1)."""
        a, b = self.span
        share = 0.5 - 0.5 * np.cos(np.pi * np.arange(SAMPLES) / (SAMPLES - 1))
        return np.array([self.at(float(s)) for s in a + (b - a) * share])


@final
class Truth:
    """All true pieces of a problem, and the points where pieces meet.

    Parameters
    ----------
    pieces : sequence of TruePiece
    interval : tuple of float
    scale : ndarray, shape (n + 1,)
        Typical magnitudes, of the problem's metric.
    known_by : str
        The source of the answer, in words.
    """

    def __init__(
        self,
        pieces: Sequence[TruePiece],
        interval: tuple[float, float],
        scale: Array,
        known_by: str,
    ) -> None:
        self.pieces, self.interval = tuple(pieces), interval
        self.scale, self.known_by = scale, known_by
        self._meeting: list[tuple[Array, list[int]]] = []
        for i, piece in enumerate(pieces):
            for end in piece.ends():
                self._meet(end, i)

    def _meet(self, end: Array, piece: int) -> None:
        for place, pieces in self._meeting:
            if np.linalg.norm((end - place) / self.scale) < SAME_PLACE:
                pieces.append(piece)
                return
        self._meeting.append((end, [piece]))

    def _inner(self) -> Iterator[tuple[Array, list[TruePiece]]]:
        """Yield the points where pieces meet inside the interval."""
        for place, pieces in self._meeting:
            if len(pieces) > 1:
                yield place, [self.pieces[i] for i in pieces]

    @property
    def loose_ends(self) -> list[Array]:
        """Points where a single piece ends: at ends of the interval, if no piece is missing."""
        return [place for place, pieces in self._meeting if len(pieces) == 1]

    @cached_property
    def transitions(self) -> list[Array]:
        """Points where pieces of different cells meet: transitions, including non-smooth folds."""
        return [x for x, pieces in self._inner() if len({piece.cell for piece in pieces}) > 1]

    @cached_property
    def folds(self) -> list[Array]:
        """Points where alpha turns: folds and non-smooth folds."""
        return [x for x, pieces in self._inner() if sum(piece.det_sign for piece in pieces) == 0]

    @cached_property
    def starts(self) -> list[Array]:
        """A point inside a piece of every component."""
        joints = nx.Graph()
        joints.add_nodes_from(range(len(self.pieces)))
        for _, pieces in self._meeting:
            joints.add_edges_from(pairwise(pieces))
        return [self.pieces[min(found)].middle() for found in nx.connected_components(joints)]

    @cached_property
    def samples(self) -> list[Array]:
        """Points of each piece, for comparison with a computed branch."""
        return [piece.samples() for piece in self.pieces]

    @cached_property
    def _extents(self) -> list[tuple[float, float]]:
        return [piece.extent() for piece in self.pieces]

    def over(self, alpha: float) -> list[TruePiece]:
        """Return the pieces that pass over a regular alpha."""
        extents = zip(self.pieces, self._extents, strict=True)
        return [piece for piece, (lo, hi) in extents if lo < alpha < hi]

    def count(self, alpha: float) -> int:
        """Return the number of solutions at a regular alpha."""
        return len(self.over(alpha))

    def regular_alphas(self) -> list[float]:
        """Return an alpha between every two successive special alphas."""
        lo, hi = self.interval
        special = sorted({lo, hi, *(float(x[-1]) for x, _ in self._meeting)})
        gap = SAME_PLACE * (hi - lo)
        return [0.5 * (a + b) for a, b in pairwise(special) if b - a > gap]
