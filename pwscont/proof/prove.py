"""Proofs from exact data: counts at one alpha, pieces and transitions of graphs, unique rates.

The systems are of linear pieces. What doubles do not decide goes to rational numbers. The theorems
stand on the page "Proofs".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import inf
from typing import Any, cast, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, finite_array
from pwscont.basics.errors import InvalidInputError, InvalidSystemError, SystemNeededError
from pwscont.basics.printing import counted
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.enumeration.echelon import independent
from pwscont.graph.branch_graph import BranchGraph
from pwscont.graph.proved import are_matched, with_slack
from pwscont.graph.records import Piece, Solution
from pwscont.notation.straight import SwitchedLinearSystem
from pwscont.proof.cells import (
    MOST_CELLS,
    Choice,
    ExactCells,
    Point,
    as_doubles,
    exact_array,
    holds,
    segment_of,
)
from pwscont.proof.interval import Interval, is_positive_definite, together
from pwscont.search.enumeration import Solutions
from pwscont.system.abilities import (
    ExactData,
    ExactMode,
    ExactRates,
    completed_point,
    shown_points,
    shown_size,
)
from pwscont.system.contract import check_in_domain
from pwscont.system.selection import Selection, unexplained

#: An end of a cell is the end of a piece within the errors that the graph states, the widths of
#: enclosures (alpha of few unknowns without) and GUARD * EPS of magnitudes, and never beyond this.
#: Solutions at one alpha have the same limit.
NEAR = 2.0**-20
#: An unknown that is always smaller than this part of the largest unknown is rounding.
DUST = 1e-6
#: An equation holds, to tell modes apart, within this part of the sizes of the terms.
HOLDS = 1e-7
#: Most unknowns of a piece that is looked at in rational numbers.
MOST_RATIONAL = 80


@final
@dataclass(frozen=True, slots=True, repr=False)
class Certificate:
    """What :func:`pwscont.prove` has proved.

    ``open`` is what is not decided: at one alpha, cells (for every part of the system, the number
    of a mode); else words.
    """

    holds: bool  #: Whether all that was given is proved: solutions, pieces, transitions, evolution.
    statements: tuple[str, str]  #: What is proved, and of which data, a sentence each.
    open: Sequence[Any]
    count: int | None = None  #: The proved number of solutions at one alpha; None if undecided.
    is_complete: bool = False  #: Whether a graph is proved to have all solutions on its interval.

    def __repr__(self) -> str:
        return f"Certificate({self.statements[0]})"


def cells_of(system: Any, rows: Any) -> ExactCells:
    """Return the cells of the exact rows of a system, or refuse rows that make no sense."""
    try:
        cells = ExactCells(*rows)
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        raise InvalidSystemError(f"{type(system).__name__}: exact rows fail: {error}") from error
    if cells.size != system.size:
        size = f"{system.size} unknowns, but exact rows have {cells.size}"
        raise InvalidSystemError(f"{type(system).__name__} has {size}")
    return cells


def _assumed(system: Any, data: str) -> str:
    if isinstance(system, SwitchedLinearSystem):
        data = "the coefficients of the formula, as floating point adds them up,"
    return f"assumed: arithmetic of IEEE 754 to nearest; {data} count as the doubles that they are"


def certified_count(
    system: Any, alpha: float, known: Sequence[Solution], number: float
) -> Certificate:
    """Return what is proved of all solutions at alpha, and of the known ones, ``number`` in all."""
    check_in_domain(system, alpha)
    cells = cells_of(system, system.exact_rows(alpha))
    if cells.number > MOST_CELLS:
        raise InvalidInputError(
            f"{cells.number} cells are too many: at most {MOST_CELLS} are proved"
        )
    boxes, points, undecided = proved_solutions(cells, alpha)
    whole = [*(each.middle() for each in boxes.values()), *map(as_doubles, points)]
    centres = [shown_points(system, z) for z in whole]
    count = None if undecided else len(centres)
    found = [with_slack(x, np.abs(x.z).max(initial=0.0), GUARD * EPS, NEAR) for x in known]
    holds = count == number and are_matched([(x, x) for x in centres], found)
    words = f"exactly {counted(len(centres), 'solution')} at alpha = {alpha:.8g}, proved"
    if not holds:
        given = "infinitely many" if number == inf else number
        words += f"; the {given} given are not these"
    if undecided:
        words = f"not proved: {counted(len(undecided), 'cell')} undecided at alpha = {alpha:.8g}"
    return Certificate(holds, (words, _assumed(system, "the data")), undecided, count)


@np.errstate(all="ignore")
def proved_solutions(
    cells: ExactCells, alpha: float
) -> tuple[dict[Choice, Interval], set[Point], list[Choice]]:
    """Return enclosures of solutions by cells, all other solutions, and cells that are undecided.

    Rational numbers decide cells that are not certainly off their inequalities, and cells whose
    solution may be that of another cell.
    """
    at = Interval(np.array([alpha]))
    found = [
        (choice, cells.unknowns(line, at)[:, 0], is_decided)
        for choice, line, is_decided in cells.left((alpha, alpha))
    ]
    lo, hi = (np.array([getattr(box, end) for _, box, _ in found]) for end in ("lo", "hi"))
    boxes, points, undecided = dict[Choice, Interval](), set[Point](), list[Choice]()
    for choice, box, is_decided in found:
        if is_decided and ((lo > box.hi) | (hi < box.lo)).any(axis=1).sum() == len(found) - 1:
            boxes[choice] = box
            continue
        ends = segment_of(*cells.of(choice), (alpha, alpha))
        if ends and len(ends) == 2 and ends[0] == ends[1]:
            points.add(ends[0][:-1])
        elif ends is not None:
            undecided.append(choice)
    return boxes, points, undecided


def certified_pieces(
    graph: BranchGraph, rows: tuple[Array, Sequence[Sequence[ExactMode]]]
) -> Certificate:
    """Return what is proved of the pieces and transitions of a graph from the exact rows."""
    proof = _Pieces(graph, cells_of(graph.system, rows))
    undecided = [f"piece {graph.pieces[k].id}" for k in proof.left_pieces()]
    cells = None if undecided or proof.cells.number > MOST_CELLS else list(proof.left_cells())
    undecided += [f"special point {node}" for node in proof.inner if not proof.is_joined(node)]
    transitions = sum(len(pieces) > 1 for pieces in proof.inner.values())
    words = f"{counted(len(graph.pieces), 'piece')} and {counted(transitions, 'transition')}"
    if cells == []:
        undecided += proof.doubtful_infinities()
        words = f"complete, proved: {words}"
    else:
        others = "too many cells" if cells is None else f"{counted(len(cells), 'cell')} undecided"
        words += f", proved; of other solutions nothing is proved: {others}"
    if proof.rays:
        places = ", ".join(f"{float(x[-1]):.8g}" for x in sorted(proof.rays, key=lambda x: x[-1]))
        words += f"; solutions without end at alpha = {places}"
    if undecided:
        more = f" and {len(undecided) - 3} more" if len(undecided) > 3 else ""
        words = f"not proved: {', '.join(undecided[:3])}{more} undecided"
    return Certificate(
        not undecided,
        (words, _assumed(graph.system, "the data, loads affine in alpha included,")),
        [*undecided, *(f"cell {choice}" for choice in cells or ())],
        is_complete=cells == [] and not undecided,
    )


@final
class _Pieces:
    """The pieces of a graph beside the cells in which the pieces lie.

    ``inner`` are the pieces at special points, except a single piece at an end of the interval;
    ``rays`` are the places where rays without end begin.
    """

    def __init__(self, graph: BranchGraph, cells: ExactCells) -> None:
        self._graph, self.cells, pieces = graph, cells, graph.pieces
        self.inner = dict[int, list[int]]()
        for node in graph.nodes:
            met = [k for k, p in enumerate(pieces) for end in (p.start, p.end) if end == node.id]
            if len(met) != 1 or node.alpha not in graph.interval:
                self.inner[node.id] = met
        self.rays: set[Point] = set()
        self._rational_ends = cache(self._ends_of)
        self._system = cast("Any", graph.system)
        full = [[completed_point(self._system, p.points[k]) for k in (0, -1)] for p in pieces]
        #: Both ends (z, alpha) of each piece, shape (k, 2, n + 1), and magnitudes.
        self._points = np.array(full).reshape(-1, 2, cells.size + 1)
        self._sizes = np.abs(self._points).max(axis=(0, 1), initial=0.0)
        self._sizes[:-1] = np.maximum(self._sizes[:-1], DUST * self._sizes[:-1].max(initial=0.0))
        self._scale = np.append(self._sizes[:-1], np.ptp(graph.interval))
        self._choices = self._modes()
        #: The inequality that vanishes at the end of a piece, by piece and node.
        self._vanishing: dict[tuple[int, int], Array] = {}

    def _is_drawn(self, piece: Piece) -> bool:
        """Tell whether a piece is straight, from special point to special point, of its cell."""
        ends = np.array([self._graph.point(node).place.x for node in (piece.start, piece.end)])
        if len(piece.points) != 2 or not self._is_end(piece, ends):
            return False
        x = completed_point(self._system, piece.points.mean(axis=0))
        cell, near = Selection(self._system, piece.character), 0.0
        if ((tests := cell.tests(x)) < 0.0).any():
            near = HOLDS * (abs(cell.test_gradients(x)) @ (np.abs(x) + self._scale))
        is_inside = bool((tests >= -near).all())
        return is_inside and not unexplained(self._system, piece.character, x, self._scale)

    def _is_end(self, piece: Piece, ends: Array, width: Any = 0.0) -> bool:
        """Tell whether a piece has these ends (2, n + 1) within the errors of its special points.

        Only the unknowns that are shown are compared, for the others follow from these.
        """
        places = [self._graph.point(node).place for node in (piece.start, piece.end)]
        scale = shown_points(self._system, self._scale)
        errors = np.array([CONFIDENCE * place.error for place in places])
        near = np.minimum(GUARD * EPS * scale + errors + width, NEAR * scale)
        return bool((np.abs(ends - piece.points[[0, -1]]) <= near).all())

    def _modes(self) -> Indices:
        """Return the modes of each piece, as the middle of the piece shows them, shape (k, p)."""
        x, rows = self._points.mean(axis=1), self.cells.rows
        values = rows[:, :-1] @ x.T + rows[:, -1:]
        sizes = np.abs(rows[:, :-1]) @ self._sizes + np.abs(rows[:, -1])
        off = np.abs(values) <= HOLDS * sizes[:, np.newaxis]
        room = values / (sizes + (sizes == 0.0))[:, np.newaxis]
        return np.array(  # most room of those that hold
            [
                (2.0 * off[own].all(axis=1) + room[sides].min(axis=1, initial=1.0)).argmax(axis=0)
                for own, sides in zip(self.cells.equations, self.cells.sides, strict=True)
            ]
        ).T

    @np.errstate(all="ignore")
    def left_pieces(self) -> list[int]:
        """Return the pieces that are not proved, or repeat the cell of an earlier piece."""
        first = set(np.unique(self._choices, axis=0, return_index=True)[1].tolist())
        left = []
        for some in self.cells.portions(len(self._choices)):
            x, sides = self.cells.lines(self._choices[some])
            for i, k in enumerate(range(some.start, some.stop)):
                is_drawn = k in first and self._is_drawn(self._graph.pieces[k])
                if not (is_drawn and (self._is_range(k, x[i], sides[i]) or self._rational_ends(k))):
                    left.append(k)
        return left

    def _is_range(self, k: int, line: Interval, sides: Interval) -> bool:
        """Tell whether a piece is all of its cell, and note the inequalities that end the piece.

        At either end one inequality vanishes, also of alpha, and all others hold.
        """
        lo, hi = self._graph.interval
        rows = together(np.vstack, sides, Interval(np.array([[1.0, -lo], [-1.0, hi]])))
        roots = -rows[:, 1] / rows[:, 0]
        far = np.abs(roots.middle() - self._points[k][:, -1:])
        numbers = np.where(np.isnan(far), inf, far).argmin(axis=1)
        places = roots[numbers]
        values = rows @ together(np.vstack, places, Interval(np.ones(2)))
        values.lo[numbers, [0, 1]] = 1.0
        ends = together(np.vstack, self.cells.unknowns(line, places), places)
        found, width = (shown_points(self._system, x.T) for x in (ends.middle(), ends.width()))
        width[:, -1] *= self.cells.size > MOST_RATIONAL  # else rational numbers decide
        piece, count = self._graph.pieces[k], len(sides.lo)
        holds = (values.lo > 0.0).all() and numbers[0] != numbers[1]
        if not (holds and self._is_end(piece, found, width)):
            return False
        for number, node in zip(numbers, (piece.start, piece.end), strict=True):
            if node not in self.inner and number < count:
                return False
            if number < count:
                self._vanishing[k, node] = self.cells.of(self._choices[k])[1][number]
        return True

    def is_joined(self, node: int) -> bool:
        """Tell whether proved pieces certainly end in one point, or one piece where rays begin.

        At the end of the first of two pieces one more row vanishes. If the rows of the second piece
        and its vanishing row are sums of multiples of these rows, both pieces end there.
        """
        pieces = self.inner[node]
        if len(pieces) == 2 and all((k, node) in self._vanishing for k in pieces):
            pair = self._choices[pieces]
            differ, tables = np.flatnonzero(pair[0] != pair[1]), self.cells.equations
            rows = [
                [*(self.cells.rows[tables[i][choice[i]]] for i in differ), self._vanishing[k, node]]
                for choice, k in zip(pair, pieces, strict=True)
            ]
            one, other = map(np.vstack, rows)
            return not any(independent(np.vstack([one, other]))[len(one) :])
        ends = [self._rational_ends(k) for k in pieces]
        starts = [self._graph.pieces[k].start == node for k in pieces]
        places = {pair[not first] for pair, first in zip(ends, starts, strict=True) if pair}
        return (len(pieces) > 1 or places <= self.rays) and all(ends) and len(places) == 1

    def _ends_of(self, k: int) -> tuple[Point, ...]:
        """Return both ends of a piece in rational numbers; nothing if not decided, or elsewhere."""
        if self.cells.size > MOST_RATIONAL:
            return ()
        cell, piece = self.cells.of(self._choices[k]), self._graph.pieces[k]
        ends = segment_of(*cell, self._graph.interval) or ()
        for pair in (ends, ends[::-1]) if len(set(ends)) == 2 else ():
            found = shown_points(self._system, as_doubles(pair))
            nodes = zip((piece.start, piece.end), pair, strict=True)
            outer = [x[-1] in self._graph.interval for node, x in nodes if node not in self.inner]
            if self._is_end(piece, found) and all(outer):
                return pair
        return ()

    def left_cells(self) -> Iterator[Choice]:
        """Yield the cells that may hold solutions that are on no piece."""
        proved = set(map(tuple, self._choices.tolist()))
        for choice, *_ in self.cells.left(self._graph.interval):
            if choice not in proved and not self._is_on_pieces(choice):
                yield choice

    def _is_on_pieces(self, choice: Choice) -> bool:
        """Tell in rational numbers whether a cell is empty, or has solutions on one piece only.

        Or on a ray from a piece, at an alpha where the graph has infinitely many solutions.
        """
        ends = segment_of(*self.cells.of(choice), self._graph.interval)
        cells = map(self.cells.of, self._choices if ends else ())
        is_on = ends is None or any(all(holds(*each, x) for x in ends) for each in cells)
        if ends and len(ends) == 1 and is_on:
            is_on = self._graph.count(float(ends[0][-1])) == inf
            self.rays |= {ends[0]} if is_on else set()
        return is_on

    def doubtful_infinities(self) -> list[str]:
        """Return where the graph counts other than its vertical pieces and rays say."""
        graph, ranges = self._graph, (piece.interval for piece in self._graph.pieces)
        places = [lo for lo, hi in ranges if lo == hi]
        finite = [lo for lo in places if graph.count(lo) < inf]
        places += [float(x[-1]) for x in self.rays]
        return [f"a piece at alpha = {at:.8g}, where a number is counted" for at in finite] + [
            f"infinitely many solutions for alpha in ({lo:.8g}, {hi:.8g})"
            for lo, hi, _ in graph.infinite
            if not any(graph.same(lo, at) and graph.same(hi, at) for at in places)
        ]


#: Most nodes with friction, whose signs are all tried.
MOST_NODES = 10


def prove(given: Any, alpha: float | None = None) -> Certificate:
    """Prove how many solutions a system of linear pieces has at one alpha, or all of a graph.

    Of an evolution of ``QuasiStaticCoulomb``, prove that no other evolution exists. Bounds of all
    rounding decide, or else rational numbers; the data count as exact (docs/proofs).

    Parameters
    ----------
    given : BranchGraph, Solutions or EvolutionGraph
        A graph, or what :func:`pwscont.enumerate_solutions` returned. The system must be a
        :class:`~pwscont.extending.ExactData`: contact with Coulomb friction, and formulas with
        ``linear=True`` such as :func:`pwscont.LCP`.
    alpha : float, optional
        The value at which solutions of a graph are counted. Without alpha every piece and
        transition of the graph is proved; if cells are few, also that nothing is missing.

    Returns
    -------
    Certificate

    Raises
    ------
    InvalidInputError
        If ``given`` is something else, the system hands over no exact data or has too many cells,
        or a solution is listed at another alpha.
    SystemNeededError
        If the graph was read from a file without its system.

    Examples
    --------
    >>> from pwscont import LCP, enumerate_solutions, explore, prove
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[0, 0])
    >>> prove(enumerate_solutions(problem, 0.0)).statements[0]
    'exactly 3 solutions at alpha = 0, proved'
    >>> prove(explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))).statements[0]
    'complete, proved: 3 pieces and 2 transitions'
    """
    system: Any = getattr(given, "system", False)
    if system is None:
        raise SystemNeededError("the graph was read without its system; load it with system=...")
    if isinstance(system, ExactRates) and alpha is None:
        return certified_rates(given)
    is_graph = isinstance(given, BranchGraph)
    if not is_graph and (not isinstance(given, Solutions) or given.alpha is None):
        raise InvalidInputError(
            f"prove takes a graph or what enumerate_solutions returned, got {type(given).__name__}"
        )
    if not isinstance(system, ExactData):
        raise InvalidInputError(
            f"{type(system).__name__} hands over no exact data: prove takes contact problems and "
            "formulas with linear=True, and classes of straight pieces that derive from ExactData; "
            "counts of curved formulas are proved by explore, see graph.proof, and by Everywhere"
        )
    if not is_graph:
        size = shown_size(given.system)
        if any(not isinstance(x, Solution) or x.z.shape != (size,) for x in given):
            raise InvalidInputError(f"each solution must be a Solution with z of shape ({size},)")
        if strange := [each.alpha for each in given if each.alpha != given.alpha]:
            raise InvalidInputError(
                f"a solution at alpha = {strange[0]} is listed among those at alpha = {given.alpha}"
            )
        if alpha not in (None, given.alpha):
            raise InvalidInputError(f"alpha = {alpha}, but the solutions are at {given.alpha}")
        return certified_count(system, given.alpha, given, len(given))
    if alpha is not None:
        alpha = float(finite_array("alpha", alpha, ()))
        return certified_count(system, alpha, given.solutions(alpha), given.count(alpha))
    rows = system.exact_lines()
    if rows is None:
        raise InvalidInputError(
            f"the data of {type(system).__name__} are not affine in alpha: "
            "prove(graph, alpha) needs the alpha at which to count"
        )
    return certified_pieces(given, rows)


def certified_rates(evolution: Any) -> Certificate:
    """Return whether exactly one evolution with finitely many events is proved to exist."""
    doubt = _doubt(evolution)
    begin = "" if doubt or _begins_at_rest(evolution) else " from the given state"
    words = f"exactly one evolution with finitely many events{begin}, proved: rates are unique at "
    words = f"not proved: {doubt}" if doubt else words + "every state"
    if not doubt and (end := evolution.paths()[0].end) < evolution.interval[1]:
        words += f"; followed up to a stop at t = {end:.8g}"
    return Certificate(not doubt, (words, _assumed(None, "A, N, T and F")), [doubt] * bool(doubt))


def _begins_at_rest(evolution: Any) -> bool:
    """Tell whether the initial memory of the system admits the state with which one path begins."""
    start, system = evolution.node(evolution.paths()[0].first), evolution.system
    law, t = system.remembering(system.initial_memory()), start.t
    z = completed_point(law, np.append(start.z, t))[:-1]
    value, slopes = (of(z, t, law.character(z, t)) for of in (law.residual, law.jacobian))
    terms = abs(slopes[:, :-1]) @ (np.abs(z) + law.scale(*evolution.interval))
    return bool((np.abs(value) <= EPS**0.5 * terms).all())


def _doubt(evolution: Any) -> str:
    """Return why not exactly one evolution, the one that is given, is proved to exist."""
    paths, (lo, hi) = evolution.paths(), evolution.interval
    if len(paths) != 1 or evolution.losses() or not evolution.is_complete:
        return f"{counted(len(paths), 'evolution')} found: {evolution.guarantee}"
    if paths[0].start != lo or (paths[0].end < hi and not paths[0].events[-1].name):
        return f"the evolution is of [{paths[0].start:.8g}, {paths[0].end:.8g}] only"
    A, N, T, F = _exact_rates(evolution.system)
    for t in evolution.strange_times(labels=bool(F.all())):  # no friction: any slip is slip+
        return f"the piece from t = {t:.8g} on is none of the system"
    return _doubt_of_rates(A, N, T, F)


def _doubt_of_rates(A: Array, N: Array, T: Array, F: Array) -> str:
    """Return why rates are not proved to be unique at every state."""
    rubs = np.flatnonzero(F)
    rows = np.vstack([N, T[rubs]])
    is_unit = (np.abs(rows).sum(axis=1) == 1.0) & ((rows != 0.0).sum(axis=1) == 1)
    if not is_unit.all() or (np.abs(rows).sum(axis=0) > 1.0).any():
        return "the rows of N and T are no unit vectors of unknowns of their own"
    if len(rubs) > MOST_NODES:
        return f"{len(rubs)} nodes with friction are more than {MOST_NODES}"
    frictions = (np.array(signs) * F[rubs] for signs in product((-1.0, 1.0), repeat=len(rubs)))
    if all(is_unique(A, N[rubs], T[rubs], friction) for friction in frictions):
        return ""
    return "rates may not be unique at some state: a form is not positive definite"


def _exact_rates(system: Any) -> tuple[Array, ...]:
    """Return A, N, T and F of a system, or refuse data that make no sense."""
    given = system.exact_rates()
    A, N, T, F = (exact_array(name, each) for name, each in zip("ANTF", given, strict=True))
    shapes, n, p = [each.shape for each in (A, N, T, F)], len(A), len(N)
    if shapes != [(n, n), (p, n), (p, n), (p,)] or (F < 0.0).any():
        raise InvalidInputError(
            f"{type(system).__name__}.exact_rates must return A (n, n), N and T (p, n), and F (p,) "
            f"that is not negative, got shapes {shapes}"
        )
    return A, N, T, F


def is_unique(A: Array, N: Array, T: Array, friction: Array) -> bool:
    """Tell whether the form of some signs, with friction times signs, is positive definite."""
    work = Interval(friction[:, np.newaxis]) * (Interval(N) @ Interval(A))
    return is_positive_definite(Interval(A) - Interval(T.T) @ work)
