"""Queries: solutions and counts at any alpha, refined between stored points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from numbers import Real

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.outcome import Failure
from pwscont.basics.quantities import NAMELESS, Quantities
from pwscont.curve.corrector import MOST_NEWTON, BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Border, newton
from pwscont.curve.pseudo_arclength import SLOWEST
from pwscont.curve.stepper import CurvedSegment
from pwscont.enumeration.filled import Filled
from pwscont.graph.exports import DamagedError, Fields
from pwscont.graph.records import Piece, Solution, SpecialPoint, Stretch, significant
from pwscont.graph.structure import Structure
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.abilities import completed, completed_point, shown_points
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.location import locate_zero

#: Steps are halved so often where the cubic is too far from the curve to say which sheet it is on.
MOST_HALVINGS = 8


def refine(
    system: PiecewiseSystem | None,
    piece: Piece,
    alpha: float,
    interval: tuple[float, float],
    quantities: Quantities = NAMELESS,
) -> Solution:
    """Return the solution of a piece at an alpha strictly inside it, to full accuracy.

    Parameters
    ----------
    system : PiecewiseSystem or None
    piece : Piece
    alpha : float
    interval : tuple of float
        The interval of the graph, for the metric.
    quantities : Quantities
        The unknowns and recorded quantities by name.

    Raises
    ------
    SystemNeededError
        If the piece is curved and there is no system to correct with.
    """
    if system is None:
        x, error, digits = _on_chord(piece, alpha), np.zeros(0), 16.0
    else:
        points = np.array([completed_point(system, x) for x in _around(piece.points, alpha)])
        x, error = solve_between(system, piece.character, points, alpha, interval)
        digits = significant(error, x, Metric.of(system, interval).scale)
        x, error = shown_points(system, x), shown_points(system, error)
    where, how = (x[:-1], alpha, piece.character, piece.label), (piece.det_sign, piece.id)
    return Solution(*where, *how, None, error, digits, quantities)


def solve_between(
    system: PiecewiseSystem,
    character: Character,
    points: Array,
    alpha: float,
    interval: tuple[float, float],
) -> tuple[Array, Array]:
    """Solve {H_chi = 0, alpha fixed} between two points of a piece, shape (k, n + 1).

    Returns
    -------
    x, error : ndarray, shape (n + 1,)
        The solution and an estimate of its error; where Newton fails, or another sheet is so
        close that it may lead there, a point of the cubic, and an error as large as the chord.
    """
    a, b = _around(points, alpha)
    curve = Curve(Selection(system, character), Metric.of(system, interval))
    for _ in range(MOST_HALVINGS):
        segment, s, found = _located(curve, a, b, alpha)
        if found is not None and _is_sure(segment, s, alpha):
            return found
        middle = _middle(segment)
        if middle is None:
            return _unrefined(segment, s, alpha)
        a, b = _around(np.array([a, middle, b]), alpha)
    return found or _unrefined(segment, s, alpha)


def _located(
    curve: Curve, a: Array, b: Array, alpha: float
) -> tuple[CurvedSegment, float, tuple[Array, Array] | None]:
    """Return the cubic between two points, where it has an alpha, and the solution beside it."""
    for start, end in _tangents(curve, a, b):
        first, last = (State(x, t, np.zeros_like(x), 0) for x, t in ((a, start), (b, end)))
        segment = CurvedSegment.between(curve, first, last, suggestion=0.0)
        s = _where(segment, alpha)
        found = locate_zero(segment, _at(alpha, len(a)), (0.0, segment.length), s)
        if isinstance(found, State):
            found.x[-1] = alpha
            return segment, s, (found.x, found.size)
    return segment, s, None


def _at(alpha: float, size: int) -> Border:
    """Return the border that falls to zero where a point has an alpha."""
    row = -last_unit(size)
    return lambda x: (alpha - float(x[-1]), row)


def _is_sure(segment: CurvedSegment, s: float, alpha: float) -> bool:
    """Tell whether Newton contracts at once: else the cubic may be nearer to another sheet."""
    if segment.curve.selection.is_straight:
        return True
    x = segment.near(s)
    root = newton(segment.curve, _at(alpha, len(x)), x, MOST_NEWTON)
    return not isinstance(root, Failure) and root.contraction <= SLOWEST


def _middle(segment: CurvedSegment) -> Array | None:
    """Return the point of the curve in the middle of a segment, None where it is not sure."""
    x = segment.near(0.5 * segment.length)
    found = BorderedNewton().correct(segment.curve, x, segment.chord)
    if isinstance(found, Failure) or found.contraction > SLOWEST:
        return None
    return found.state.x


def fine_points(
    system: PiecewiseSystem, piece: Piece, interval: tuple[float, float], parts: int
) -> Array:
    """Return points along a piece, from start to end: those of the cubics between stored points.

    A step was taken only where its cubic solves the selection to a tolerance (docs/theory, F14).

    Parameters
    ----------
    system : PiecewiseSystem
    piece : Piece
    interval : tuple of float
        The interval of the graph, for the metric.
    parts : int
        In how many parts each step is cut.

    Returns
    -------
    ndarray, shape (k, n + 1)
    """
    points = [completed_point(system, x) for x in piece.points]
    curve = Curve(Selection(system, piece.character), Metric.of(system, interval))
    found = [points[0]]
    for a, b in pairwise(points):
        start, end = next(_tangents(curve, a, b))
        first, last = (State(x, t, np.zeros_like(x), 0) for x, t in ((a, start), (b, end)))
        segment = CurvedSegment.between(curve, first, last, suggestion=0.0)
        inner = np.linspace(0.0, segment.length, parts + 1)[1:-1]
        found += [*(segment.near(s) for s in inner), b]
    return shown_points(system, np.array(found))


def _tangents(curve: Curve, a: Array, b: Array) -> Iterator[tuple[Array, Array]]:
    """Yield pairs of directions of the curve at two points, the second and later ones as guesses.

    At a point where two curves cross the Jacobian gives no direction. The guesses for it are that
    of the parabola through both points with the other point's direction, and that of the chord.
    """
    chord = curve.metric.normalised(b - a)
    if curve.selection.is_straight:
        yield chord, chord
        return
    start, end = _tangent(curve, a, chord), _tangent(curve, b, chord)
    yield start, end
    yield start, 2.0 * chord - start
    yield 2.0 * chord - end, end
    yield chord, chord


def _tangent(curve: Curve, x: Array, chord: Array) -> Array:
    metric = curve.metric
    factor = bordered(curve.selection.jacobian(x), metric.covector(chord), metric.binary)
    return chord if factor.is_singular() else metric.normalised(factor.solve(last_unit(len(x))))


def _unrefined(segment: CurvedSegment, s: float, alpha: float) -> tuple[Array, Array]:
    """Return the point of the cubic at this alpha, with an error as large as the chord."""
    x = segment.near(s)
    x[-1] = alpha
    return x, np.abs(segment.end.x - segment.start.x)


def _where(segment: CurvedSegment, alpha: float) -> float:
    """Return the distance at which the cubic of a segment has this alpha."""
    ends = segment.start.alpha - alpha, segment.end.alpha - alpha
    if ends[0] * ends[1] >= 0.0:
        return 0.0 if abs(ends[0]) <= abs(ends[1]) else segment.length
    from scipy.optimize import brentq  # noqa: PLC0415  it takes as long to import as all the rest

    return float(brentq(lambda s: segment.near(s)[-1] - alpha, 0.0, segment.length))


def _around(points: Array, alpha: float) -> tuple[Array, Array]:
    """Return the two neighbouring points with alpha between them."""
    rising = points[-1, -1] > points[0, -1]
    ordered = points if rising else points[::-1]
    i = int(np.searchsorted(ordered[:, -1], alpha))
    i = min(max(i, 1), len(points) - 1)
    return ordered[i - 1], ordered[i]


def _on_chord(piece: Piece, alpha: float) -> Array:
    if len(piece.points) > 2:
        raise SystemNeededError(
            f"piece {piece.id} is curved, and this graph was loaded without its system; "
            "use BranchGraph.load(path, system=...)"
        )
    a, b = _around(piece.points, alpha)
    x: Array = a + (alpha - a[-1]) / (b[-1] - a[-1]) * (b - a)
    x[-1] = alpha
    return x


#: Which entries of a row in a file tell whether an end is closed.
IS_CLOSED = [False, False, True, True]


def joined(parts: Iterable[Filled], known: Sequence[float]) -> tuple[Stretch, ...]:
    """Return the stretches that some parts cover together, in order.

    Parameters
    ----------
    parts : iterable of Filled
    known : sequence of float
        Values of alpha, of which an end takes one that rounding does not tell from it; or zero.
    """
    ends = [*known, 0.0]
    rows = sorted(
        (
            Stretch(
                _settled(part.lo, part.blur, ends),
                _settled(part.hi, part.blur, ends),
                math.inf,
                part.lo_closed,
                part.hi_closed,
            )
            for part in parts
        ),
        key=lambda stretch: (stretch[0], not stretch.lo_closed),
    )
    found: list[Stretch] = []
    for new in rows:
        if found and _touch(found[-1], new):
            found[-1] = _both(found[-1], new)
        else:
            found.append(new)
    return tuple(found)


def _settled(alpha: float, blur: float, ends: list[float]) -> float:
    """Return the known end that alpha is within rounding, or alpha, which is known from now on."""
    nearest = min(ends, key=lambda end: abs(end - alpha), default=math.inf)
    if abs(nearest - alpha) <= blur:
        return nearest
    ends.append(alpha)
    return alpha


def _touch(a: Stretch, b: Stretch) -> bool:
    return b[0] < a[1] or (b[0] == a[1] and (a.hi_closed or b.lo_closed))


def _both(a: Stretch, b: Stretch) -> Stretch:
    """Return two stretches that touch, the first of which begins first, as one."""
    hi = max(a[1], b[1])
    hi_closed = (a.hi_closed and a[1] == hi) or (b.hi_closed and b[1] == hi)
    return Stretch(a[0], hi, math.inf, a.lo_closed, hi_closed)


def rows_of(stretches: Iterable[Stretch]) -> list[list[float | bool]]:
    """Return stretches as a file holds them: both ends, and whether they are closed."""
    return [[*row[:2], row.lo_closed, row.hi_closed] for row in stretches]


def read_stretches(header: Fields, interval: tuple[float, float]) -> tuple[Stretch, ...]:
    """Return the stretches of a file, which old files lack."""
    return tuple(_read(header, interval))


def _read(header: Fields, interval: tuple[float, float]) -> Iterator[Stretch]:
    for row in header.items("infinite") if header.has("infinite") else ():
        if not isinstance(row, list) or [type(one) is bool for one in row] != IS_CLOSED:
            raise DamagedError("infinite must be rows of two ends, and whether they are closed")
        ends = Fields("infinite", {"lo": row[0], "hi": row[1]})
        lo, hi = ends.finite("lo"), ends.finite("hi")
        if not interval[0] <= lo <= hi <= interval[1]:
            raise DamagedError(f"infinitely many solutions outside the interval: {lo} to {hi}")
        yield Stretch(lo, hi, math.inf, *row[2:])


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
