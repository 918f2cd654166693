"""The pieces and transitions of a graph of linear pieces, each with a certificate.

In a cell with a regular matrix the solutions lie on one line, and every inequality is affine in
alpha along the line. Strict inequalities at both ends prove a piece, and one inequality that
changes sign proves the end of the piece. If the system has few cells, the other cells are proved to
be empty: then nothing is missing on the interval.

Failure modes and answers
-------------------------
- Several inequalities vanish at an end (a corner), a piece is vertical, doubles cannot tell: the
  piece or the transition stays undecided.
- A cell touches the branches in one point, or is singular: the cell is looked at in rational
  numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import islice, product
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.basics.looks import counted
from pwscont.exact.cells import (
    MOST_CELLS,
    TOGETHER,
    Choice,
    at,
    eliminated,
    exact,
    number_of_cells,
    rows_of,
    solved,
    upper,
    value_of,
    without,
)
from pwscont.graph.branch_graph import BranchGraph
from pwscont.graph.records import Piece
from pwscont.system.abilities import ExactMode, completed

#: Signs are looked at so far beside an end, as parts of the interval of alpha.
BESIDE = 2.0 ** -np.array([36.0, 28.0, 20.0])
#: An equation holds, to tell modes apart, within this part of the sizes of the terms.
HOLDS = 1e-7
#: An unknown that is always smaller than this part of the largest unknown is rounding.
DUST = 1e-6
#: How far two ranges of a cell must be apart to exclude the cell, as a part of the interval.
APART = 2.0**-30
ASSUMED = (
    "assumed: arithmetic of IEEE 754 to nearest; the data, loads affine in alpha included, count "
    "as the doubles that they are"
)
Rows = tuple[Array, Sequence[Sequence[ExactMode]]]


@final
class PiecesProof:
    """What is proved of the pieces and transitions of a graph; made by :func:`pwscont.prove`.

    Attributes
    ----------
    holds : bool
        Whether all pieces and transitions are proved.
    is_complete : bool
        Whether the interval is proved to have no other solutions.
    statements : tuple of str
        A sentence for what is proved, and a sentence for the data of the proof.
    open : list of str
        The pieces, special points and cells that are not decided.
    """

    def __init__(self, graph: BranchGraph, rows: Rows) -> None:
        self._graph, (self._common, self._parts) = graph, rows
        self._met: dict[int, list[int]] = {}
        for piece in graph.pieces:
            for node in (piece.start, piece.end):
                self._met.setdefault(node, []).append(piece.id)
        self._choices: dict[int, Choice] = {}
        self._vanishing: dict[tuple[int, int], Array] = {}
        self.open: list[str] = []
        for piece in graph.pieces:
            if not self._is_proved(piece):
                self.open.append(f"piece {piece.id}")
        inner = {node: ids for node, ids in self._met.items() if not self._is_at_end(node)}
        self.open += [
            f"special point {node}" for node, ids in inner.items() if not self._is_joined(node, ids)
        ]
        self.holds = not self.open
        cells = number_of_cells(self._parts)
        left = list(self._left_cells()) if self.holds and cells <= MOST_CELLS else None
        self.is_complete = left == []
        self.open += [f"cell {choice}" for choice in left or ()]
        self.statements = (self._words(len(inner), left), ASSUMED)

    def _words(self, transitions: int, left: list[Choice] | None) -> str:
        if not self.holds:
            some = ", ".join(self.open[:3])
            more = f" and {len(self.open) - 3} more" if len(self.open) > 3 else ""
            return f"not proved: {some}{more} undecided"
        number = f"{counted(len(self._graph.pieces), 'piece')} and "
        number += counted(transitions, "transition")
        if self.is_complete:
            return f"complete, proved: {number}"
        others = "too many cells" if left is None else f"{counted(len(left), 'cell')} undecided"
        return f"{number}, proved; of other solutions nothing is proved: {others}"

    def __repr__(self) -> str:
        return f"PiecesProof({self.statements[0]})"

    # -- pieces and transitions ----------------------------------------------------------------

    def _is_at_end(self, node: int) -> bool:
        """Tell whether one piece ends at an end of the interval."""
        return self._graph.point(node).alpha in self._graph.interval and len(self._met[node]) == 1

    def _is_proved(self, piece: Piece) -> bool:
        """Prove a piece, and note which inequality vanishes at either end."""
        choice, ends = self._choice(piece), np.array([piece.alpha[0], piece.alpha[-1]])
        equations = np.concatenate([self._common, *rows_of(self._parts, choice, "equations")])
        if len(equations) != equations.shape[1] - 2 or ends[0] == ends[1]:
            return False
        if choice in self._choices.values():  # a cell has one piece: this is the same piece again
            return False
        sides = np.concatenate(rows_of(self._parts, choice, "sides"))
        lo, hi = self._graph.interval
        nodes = (piece.start, piece.end)
        inward = np.sign(ends[::-1] - ends) * [not self._is_at_end(node) for node in nodes]
        step = np.multiply.outer(BESIDE, inward * (hi - lo))
        alphas = np.concatenate([ends + step, ends - step]).ravel()
        signs = _signs(equations[np.newaxis], sides[np.newaxis], alphas)[:, 0]
        inner, outer = signs.reshape(2, len(BESIDE), 2, len(sides))
        known = (inner > 0).all(axis=-1)
        if not known.any(axis=0).all():
            return False
        self._choices[piece.id] = choice
        ended = known & (outer != 0).all(axis=-1) & ((outer < 0).sum(axis=-1) == 1)
        for k, node in enumerate(nodes):
            for which in np.flatnonzero(ended[:, k])[:1]:
                self._vanishing[piece.id, node] = sides[outer[which, k] < 0][0]
        return True

    def _choice(self, piece: Piece) -> Choice:
        """Return the modes of a piece, as the middle of the piece shows them."""
        x = 0.5 * (piece.points[0] + piece.points[-1])
        sizes = np.abs(np.vstack([each.points for each in self._graph.pieces])).max(axis=0)
        if len(x) != self._common.shape[1] - 1:
            system: Any = self._graph.system
            x = np.append(completed(system, x[:-1], float(x[-1])), x[-1])
            sizes = np.append(np.full(len(x) - 1, sizes[:-1].max()), sizes[-1])
        sizes[:-1] = np.maximum(sizes[:-1], DUST * sizes[:-1].max())
        x, sizes = np.append(x, 1.0), np.append(sizes, 1.0)

        def fit(mode: ExactMode) -> tuple[bool, float]:
            off = np.abs(mode.equations @ x) <= HOLDS * (np.abs(mode.equations) @ sizes)
            room = (mode.sides @ x) / np.maximum(np.abs(mode.sides) @ sizes, LEAST)
            return bool(off.all()), float(room.min(initial=1.0))

        return tuple(
            max(range(len(modes)), key=lambda k, modes=modes: fit(modes[k]))  # type: ignore[misc]
            for modes in self._parts
        )

    def _is_joined(self, node: int, pieces: list[int]) -> bool:
        """Tell whether two proved pieces certainly end in one point.

        At the end of the first piece one more row vanishes. If the rows of the second piece and
        its vanishing row are sums of multiples of these rows, both pieces end there.
        """
        if len(pieces) != 2 or any((each, node) not in self._vanishing for each in pieces):
            return False
        one, other = (self._choices[each] for each in pieces)
        differ = [i for i, (a, b) in enumerate(zip(one, other, strict=True)) if a != b]
        rows = [
            [*(self._parts[i][choice[i]].equations for i in differ), self._vanishing[each, node]]
            for choice, each in zip((one, other), pieces, strict=True)
        ]
        return _spans(*map(np.vstack, rows))

    # -- all other cells -----------------------------------------------------------------------

    def _left_cells(self) -> Iterator[Choice]:
        """Yield the cells that may hold solutions that are on no piece."""
        proved = set(self._choices.values())
        cells = product(*(range(len(modes)) for modes in self._parts))
        choices = (choice for choice in cells if choice not in proved)
        size = self._common.shape[1] - 2
        while some := list(islice(choices, max(TOGETHER // (size + 2) ** 2, 1))):
            empty = self._are_certainly_empty(some)
            for choice in (
                each for each, is_empty in zip(some, empty, strict=True) if not is_empty
            ):
                if not self._is_on_pieces(choice):
                    yield choice

    def _are_certainly_empty(self, choices: list[Choice]) -> Signs:
        """Tell in floating point for which cells no alpha satisfies all inequalities."""
        empty = np.zeros(len(choices), dtype=bool)
        known = [
            [np.concatenate(rows_of(self._parts, each, name)) for name in ("equations", "sides")]
            for each in choices
        ]
        shapes = {(len(equations), len(sides)) for equations, sides in known}
        for shape in shapes:
            which = [i for i, (a, b) in enumerate(known) if (len(a), len(b)) == shape]
            if shape[0] + len(self._common) != self._common.shape[1] - 2:
                continue
            equations = np.array([np.concatenate([self._common, known[i][0]]) for i in which])
            sides = np.array([known[i][1] for i in which])
            lo, hi = _upper_bounds(equations, sides, np.array(self._graph.interval))
            first, last = _allowed(lo, hi)
            none = first.max(axis=-1, initial=0.0) > last.min(axis=-1, initial=1.0) + APART
            empty[which] = none & (np.isfinite(lo) & np.isfinite(hi)).all(axis=-1)
        return empty

    def _is_on_pieces(self, choice: Choice) -> bool:
        """Tell in rational numbers whether a cell is empty, or has solutions on pieces only."""
        ends = [self._exact_line(choice, alpha) for alpha in self._graph.interval]
        if any(not end for end in ends):
            return False
        sides = np.concatenate(rows_of(self._parts, choice, "sides"))
        values = [
            [at(row, x) for row in exact(sides, alpha)]
            for x, alpha in zip(ends, self._graph.interval, strict=True)
        ]
        first, last = Fraction(0), Fraction(1)
        for lo, hi in zip(*values, strict=True):
            if lo < 0 and hi < 0:
                return True
            if lo < 0:
                first = max(first, lo / (lo - hi))
            elif hi < 0:
                last = min(last, lo / (lo - hi))
        return first > last or self._holds_line(ends, first, last)

    def _exact_line(self, choice: Choice, alpha: float) -> Any:
        rows = np.concatenate([self._common, *rows_of(self._parts, choice, "equations")])
        return eliminated(exact(rows, alpha))

    def _holds_line(self, ends: list[Any], first: Fraction, last: Fraction) -> bool:
        """Tell whether one piece holds the solutions between two parts of the interval."""
        lo, hi = self._graph.interval
        alpha = lo + (hi - lo) * 0.5 * float(first + last)
        for piece in self._graph.pieces:
            least, largest = sorted((piece.alpha[0], piece.alpha[-1]))
            if not least - APART * (hi - lo) <= alpha <= largest + APART * (hi - lo):
                continue
            own = [self._exact_line(self._choices[piece.id], alpha) for alpha in (lo, hi)]
            is_same = all(_between(ends, part) == _between(own, part) for part in (first, last))
            if is_same and self._is_in_cell(piece, own, first, last):
                return True
        return False

    def _is_in_cell(self, piece: Piece, own: list[Any], first: Fraction, last: Fraction) -> bool:
        """Tell whether the line of a piece satisfies the inequalities of the piece."""
        sides = np.concatenate(rows_of(self._parts, self._choices[piece.id], "sides"))
        rows = [exact(sides, alpha) for alpha in self._graph.interval]
        values = [[at(row, x) for row in each] for each, x in zip(rows, own, strict=True)]
        return all(
            a + (b - a) * part >= 0 for a, b in zip(*values, strict=True) for part in (first, last)
        )


#: The least size of a term, to divide by.
LEAST = 1e-300


def _signs(equations: Array, sides: Array, alphas: Array) -> Array:
    """Return the signs of inequalities of B cells at k alphas, zero where not certain.

    The shape is (k, B, s).
    """
    value, error = _values(equations, sides, alphas)
    return np.where(value > error, 1, np.where(value < -error, -1, 0))


def _upper_bounds(equations: Array, sides: Array, alphas: Array) -> Array:
    value, error = _values(equations, sides, alphas)
    bounds: Array = upper(np.abs(value) + error, 2) - np.abs(value) + value
    return bounds


def _values(equations: Array, sides: Array, alphas: Array) -> tuple[Array, Array]:
    """Return the inequalities of B cells at k alphas, and bounds of the errors, shape (k, B, s)."""
    with np.errstate(all="ignore"):
        x, radius = solved(equations, alphas)
        value, error = value_of(sides, alphas[:, np.newaxis, np.newaxis], x)
        far = (np.abs(sides[..., :-2]) @ radius[..., np.newaxis])[..., 0]
        return value, np.where(np.isfinite(far), upper(error + far, x.shape[-1]), np.inf)


def _allowed(lo: Array, hi: Array) -> tuple[Array, Array]:
    """Return from and up to which part of the interval upper bounds are not negative."""
    with np.errstate(all="ignore"):
        root = lo / (lo - hi)
    first = np.where(lo >= 0.0, 0.0, np.where(hi >= 0.0, root, np.inf))
    last = np.where(hi >= 0.0, 1.0, np.where(lo >= 0.0, root, -np.inf))
    return first, last


def _spans(rows: Array, others: Array) -> bool:
    """Tell whether other rows are sums of multiples of rows, in rational numbers."""
    used = np.flatnonzero((rows != 0.0).any(axis=0) | (others != 0.0).any(axis=0))
    basis = [[Fraction(float(value)) for value in row[used]] for row in rows]
    left = [[Fraction(float(value)) for value in row[used]] for row in others]
    for column in range(len(used)):
        pivot = next((row for row in basis if row[column]), None)
        if pivot is None:
            continue
        unit = [value / pivot[column] for value in pivot]
        basis = [without(row, unit, column) for row in basis if row is not pivot]
        left = [without(row, unit, column) for row in left]
    return not any(any(row) for row in left)


def _between(ends: list[Any], part: Fraction) -> list[Fraction]:
    return [a + (b - a) * part for a, b in zip(*ends, strict=True)]
