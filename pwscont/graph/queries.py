"""Functions of a graph: solutions and counts at any alpha, refined between stored points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from numbers import Real
from operator import itemgetter
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, InvalidSystemError, SystemNeededError
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric, Range
from pwscont.curve.newton import MOST_NEWTON, STALLED, Border, newton
from pwscont.curve.stepper import CurvedSegment
from pwscont.enumeration.continua import Continuum
from pwscont.graph.records import Piece, Solution, Stretch, are_one, significant
from pwscont.graph.structure import ConnectedPieces
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.abilities import completed, completed_point, shown_points
from pwscont.system.selection import Selection, unexplained
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.zeros import locate_zero

#: A step is halved at most this often where the cubic is too far from the curve to tell the sheet.
MOST_HALVINGS_OF_STEP = 8
#: A solution farther from its place than this part of a step belongs to a changed system.
MOVED = 1e-3


def _refined(graph: ConnectedPieces, piece: Piece, alpha: float) -> Solution:
    """Return the solution of a piece at an alpha strictly inside it, to full accuracy."""
    system, interval = graph.system, graph.interval
    a, b = _around(piece.points, alpha)
    if system is None:
        if len(piece.points) > 2:
            words = f"piece {piece.id} is curved, and this graph was loaded without its system"
            raise SystemNeededError(f"{words}; use BranchGraph.load(path, system=...)")
        x, error, digits = a + (alpha - a[-1]) / (b[-1] - a[-1]) * (b - a), np.zeros(0), 16.0
    else:
        points = np.array([completed_point(system, a), completed_point(system, b)])
        scale = Metric.of(system, interval).scale
        moved = MOVED * np.abs(points[1] - points[0])
        if (stray := stray_alpha(system, piece, alpha, scale, moved)) is not None:
            raise InvalidSystemError(
                f"{type(system).__name__} has changed since the graph was made: it does not have "
                f"the solution of piece {piece.id} at alpha = {stray:.10g} any more; explore "
                "again, or change a copy of it"
            )
        x, error = solve_between(system, piece.character, points, alpha, interval)
        digits = significant(error, x, scale)
        x, error = shown_points(system, x), shown_points(system, error)
    found = Solution(x[:-1], alpha, piece.character, piece.label, piece.det_sign, piece.id)
    return replace(found, error=error, digits=digits, quantities=graph.quantities)


def stray_alpha(
    system: PiecewiseSystem, piece: Piece, near: float, scale: Array, moved: Array | None = None
) -> float | None:
    """Return the alpha of a point of a piece if a system does not have this solution, else None.

    The point is next to ``near``, and inside: at the ends a change of H may not be seen.
    """
    inside = piece.points[1:-1] if len(piece.points) > 2 else piece.points.mean(axis=0)[np.newaxis]
    x = completed_point(system, inside[np.abs(inside[:, -1] - near).argmin()])
    return float(x[-1]) if unexplained(system, piece.character, x, scale, moved) else None


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # Newton may try any point
def solve_between(
    system: PiecewiseSystem, character: Character, points: Array, alpha: float, interval: Range
) -> tuple[Array, Array]:
    """Return the point with this alpha between points of a piece, shape (k, n + 1), and its error.

    Where Newton fails: a point of the cubic, and an error as large as the chord.
    """
    a, b = _around(points, alpha)
    curve = Curve(Selection(system, character), Metric.of(system, interval))
    row = -last_unit(len(a))

    def border(x: Array) -> tuple[float, Array]:
        return alpha - float(x[-1]), row

    for _ in range(MOST_HALVINGS_OF_STEP):
        for segment in cubics_between(curve, a, b):
            s = _where(segment, alpha)
            found = locate_zero(segment, border, (0.0, segment.length), s)
            if isinstance(found, State):
                break
        if isinstance(found, State) and _is_sure(segment, border, s):
            break
        x = segment.near(0.5 * segment.length)
        middle = BorderedNewton().correct(curve, x, segment.chord)
        if isinstance(middle, Failure) or middle.contraction > STALLED:
            found = Failure(FailureReason.NOT_CONVERGED)
            break
        a, b = _around(np.array([a, middle.state.x, b]), alpha)
    if isinstance(found, State):
        x, error = found.x, found.size
    else:
        x, error = segment.near(s), np.abs(segment.end.x - segment.start.x)
    x[-1] = alpha
    return x, error


def _is_sure(segment: CurvedSegment, border: Border, s: float) -> bool:
    """Tell whether Newton contracts at once: else the cubic may be nearer to another sheet."""
    if segment.curve.selection.is_straight:
        return True
    root = newton(segment.curve, border, segment.near(s), MOST_NEWTON)
    return not isinstance(root, Failure) and root.contraction <= STALLED


def fine_points(system: PiecewiseSystem, piece: Piece, interval: Range, parts: int) -> Array:
    """Return points along a piece, shape (k, n + 1), with each step cut into ``parts``.

    A step was taken only where the cubic solves the selection to a tolerance (docs/theory, F14).

    Examples
    --------
    >>> from pwscont import Switched, trace
    >>> from pwscont.extending import fine_points
    >>> graph = trace(Switched(1, lambda z, t, sw: z**3 - t), ([0.5], 0.1), (0.1, 0.9))
    >>> (piece,) = graph.pieces
    >>> len(fine_points(graph.system, piece, (0.1, 0.9), 4)) == 4 * (len(piece.points) - 1) + 1
    True
    """
    points = [completed_point(system, x) for x in piece.points]
    curve, found = (
        Curve(Selection(system, piece.character), Metric.of(system, interval)),
        points[:1],
    )
    for a, b in pairwise(points):
        segment = cubics_between(curve, a, b)[0]
        inner = np.linspace(0.0, segment.length, parts + 1)[1:-1]
        found += [*(segment.near(s) for s in inner), b]
    return shown_points(system, np.array(found))


def cubics_between(
    curve: Curve, a: Array, b: Array, errors: Sequence[Array] | None = None
) -> list[CurvedSegment]:
    """Return cubics between two points of a curve, first the cubic closest to the curve.

    Where two curves cross, the Jacobian gives no direction: guesses are the parabola with the known
    direction at the other point, and the chord. ``errors``: of the two points, default zero.
    """
    chord = curve.metric.normalised(b - a)
    ways = [(chord, chord)]
    if not curve.selection.is_straight:
        start, end = _tangent(curve, a, chord), _tangent(curve, b, chord)
        ways = [(start, end), (start, 2.0 * chord - start), (2.0 * chord - end, end), *ways]
    known = errors or (np.zeros_like(a), np.zeros_like(b))

    def cubic(*tangents: Array) -> CurvedSegment:
        rows = zip((a, b), tangents, known, strict=True)
        first, last = (State(x, way, error[np.newaxis], 1) for x, way, error in rows)
        return CurvedSegment.between(curve, first, last, suggestion=0.0)

    def off(segment: CurvedSegment) -> float:
        """Return the largest residual in the middle of a segment."""
        middle = segment.near(0.5 * segment.length)
        size = float(np.abs(curve.selection.residual(middle)).max())  # no squares
        return size if math.isfinite(size) else math.inf

    return sorted((cubic(*way) for way in ways), key=off)


def _tangent(curve: Curve, x: Array, chord: Array) -> Array:
    metric = curve.metric
    factor = bordered(curve.selection.jacobian(x), metric.covector(chord), metric.binary)
    return chord if factor.is_singular() else metric.normalised(factor.solve(last_unit(len(x))))


def _where(segment: CurvedSegment, alpha: float) -> float:
    """Return the distance at which the cubic of a segment has this alpha."""
    ends = [float(segment.near(s)[-1]) - alpha for s in (0.0, segment.length)]
    if ends[0] * ends[1] >= 0.0:
        return 0.0 if abs(ends[0]) <= abs(ends[1]) else segment.length
    from scipy.optimize import brentq  # noqa: PLC0415  it takes as long to import as all the rest

    return float(brentq(lambda s: segment.near(s)[-1] - alpha, 0.0, segment.length))


def _around(points: Array, alpha: float) -> tuple[Array, Array]:
    """Return the two neighbouring points around an alpha."""
    ordered = points if points[-1, -1] > points[0, -1] else points[::-1]
    i = min(max(int(np.searchsorted(ordered[:, -1], alpha)), 1), len(points) - 1)
    return ordered[i - 1], ordered[i]


def joined(parts: Iterable[Continuum], known: Sequence[float]) -> tuple[Stretch, ...]:
    """Return the stretches that parts cover together; ends at known values of alpha are these."""
    ends = [*known, 0.0]
    rows, found = list[Stretch](), list[Stretch]()
    for part in parts:
        lo, hi = (_known_end(end, part.blur, ends) for end in (part.lo, part.hi))
        rows.append(Stretch(lo, hi, math.inf, part.lo_closed, part.hi_closed))
    for new in sorted(rows, key=lambda stretch: (stretch[0], not stretch.lo_closed)):
        last = found[-1] if found else None
        if last and (new[0] < last[1] or (new[0] == last[1] and (last.hi_closed or new.lo_closed))):
            hi = max(last[1], new[1])
            hi_closed = any(one.hi_closed and one[1] == hi for one in (last, new))
            found[-1] = Stretch(last[0], hi, math.inf, last.lo_closed, hi_closed)
        else:
            found.append(new)
    return tuple(found)


def _known_end(alpha: float, blur: float, ends: list[float]) -> float:
    """Return the known end that alpha is within rounding, or alpha, which is known from now on."""
    nearest = min(ends, key=lambda end: abs(end - alpha), default=math.inf)
    if abs(nearest - alpha) <= blur:
        return nearest
    ends.append(alpha)
    return alpha


def count_at(graph: ConnectedPieces, alpha: float) -> int | float:
    """Return the number of solutions at ``alpha``; infinite where they fill a segment or more.

    A solution at which two pieces meet counts once.
    """
    check_inside(graph, alpha)
    if is_infinite(graph, alpha):
        return math.inf
    return len(pieces_through(graph, alpha)) + len(apart_at(graph, alpha))


def solutions_at(graph: ConnectedPieces, alpha: float) -> list[Solution]:
    """Return all solutions at ``alpha`` that the graph holds, corrected to full accuracy.

    Where solutions are infinitely many, as on a vertical piece, the ends of the segments are
    returned.

    Raises
    ------
    InvalidInputError
        If alpha lies outside the interval.
    SystemNeededError
        If a curved piece must be corrected and the graph was loaded without a system.
    """
    check_inside(graph, alpha)
    at_nodes = [solution_at(graph, node) for node in apart_at(graph, alpha)]
    between = [_refined(graph, piece, alpha) for piece in pieces_through(graph, alpha)]
    return sorted(at_nodes + between, key=lambda solution: solution.piece)


def solution_at(graph: ConnectedPieces, node: int) -> Solution:
    """Return a special point as a solution at the alpha of the point."""
    point, pieces, system = graph.point(node), graph.pieces_at(node), graph.system
    where = Character(()), "unknown", 0, -1
    if pieces:
        piece = pieces[0]
        where = piece.character, piece.label, index_at(graph, node), piece.id
    elif system:  # no piece leaves from the solution: its cell is that of the point itself
        character = system.character(completed(system, point.z, point.alpha), point.alpha)
        where = character, system.label(character), 0, -1
    known = point.kind, point.error, point.digits, point.quantities
    return Solution(point.z, point.alpha, *where, *known)


def multiplicity(graph: ConnectedPieces) -> list[Stretch]:
    """Return ``(lo, hi, count)`` for successive stretches with the same number of solutions.

    ``lo_closed`` and ``hi_closed`` say whether the number holds at the ends as well. A single
    value of alpha is an entry of its own where solutions are infinitely many, and where the
    numbers on both sides agree and another number holds between, as at a branch point. A fold
    lies in no stretch: :meth:`with_count` and :meth:`count` tell the number there.
    """
    found = runs(graph)
    around = [None, *found, None]
    return [
        run
        for before, run, after in zip(around, found, around[2:], strict=False)
        if run[0] < run[1] or run[2] == math.inf or (before and after and before[2] == after[2])
    ]


def runs(graph: ConnectedPieces) -> list[Stretch]:
    """Return the stretches and single values of alpha with one number of solutions, in order."""
    first, *breaks = graph.breaks()
    parts = [Stretch(first, first, count_at(graph, first), True, True)]
    for lo, hi in pairwise([first, *breaks]):
        middle = 0.5 * (lo + hi)
        count = math.inf if is_infinite(graph, middle) else len(pieces_over(graph, middle))
        parts.append(Stretch(lo, hi, count, False, False))
        parts.append(Stretch(hi, hi, count_at(graph, hi), True, True))
    groups = (list(group) for _, group in groupby(parts, key=itemgetter(2)))
    return [
        Stretch(group[0][0], group[-1][1], group[0][2], group[0].lo_closed, group[-1].hi_closed)
        for group in groups
    ]


def is_infinite(graph: ConnectedPieces, alpha: float) -> bool:
    """Tell whether there are infinitely many solutions at ``alpha``."""
    is_vertical = any(graph.same(piece.interval[0], alpha) for piece in graph.verticals)
    return is_vertical or any(_has(graph, stretch, alpha) for stretch in graph.infinite)


def is_beside_infinite(graph: ConnectedPieces, alpha: float, blur: float = 0.0) -> bool:
    """Tell whether there are infinitely many solutions at ``alpha``, or no farther than ``blur``.

    A stretch that ends at ``alpha`` to rounding is next to ``alpha``.
    """
    ends = np.array([end for stretch in graph.infinite for end in stretch[:2]])
    is_near = graph.same(ends, alpha) | (np.abs(ends - alpha) <= blur)
    return bool(is_near.any()) or is_infinite(graph, alpha)


def _has(graph: ConnectedPieces, stretch: Stretch, alpha: float) -> bool:
    """Tell whether alpha lies in a stretch, whose ends are known to rounding."""
    at_lo, at_hi = bool(graph.same(stretch.lo, alpha)), bool(graph.same(stretch.hi, alpha))
    if at_lo or at_hi:
        return (at_lo and stretch.lo_closed) or (at_hi and stretch.hi_closed)
    return stretch.lo < alpha < stretch.hi


def with_count(graph: ConnectedPieces, count: int | float) -> list[Stretch]:
    """Return all stretches and single values of alpha with exactly ``count`` solutions."""
    _check_number("count", count)
    return [run for run in runs(graph) if run[2] == count]


def index_at(graph: ConnectedPieces, node: int) -> int:
    """Return the sum of the signs of the pieces to the right of a node; at the last alpha, left."""
    alpha = graph.point(node).alpha
    side = 1 if graph.same(alpha, graph.interval[1]) else 0
    beside = (p for p in graph.pieces_at(node) if graph.same(p.interval[side], alpha))
    return sum(piece.det_sign for piece in beside if not piece.is_vertical)


def check_inside(graph: ConnectedPieces, alpha: float) -> None:
    """Refuse an alpha that is no number or lies outside the interval of the graph."""
    lo, hi = graph.interval
    _check_number("alpha", alpha)
    if not lo <= alpha <= hi:
        raise InvalidInputError(f"alpha = {alpha} lies outside the interval [{lo}, {hi}]")


def _check_number(name: str, value: Any) -> None:
    if np.ndim(value) or not isinstance(np.asarray(value).item(), Real):
        raise InvalidInputError(f"{name} must be a number, got {value!r}")


def pieces_over(graph: ConnectedPieces, alpha: float) -> list[Piece]:
    """Return the pieces that pass over an alpha at which there is no node."""
    lo, hi = graph.extent.T
    return [graph.pieces[i] for i in np.flatnonzero((lo < alpha) & (alpha < hi))]


def pieces_through(graph: ConnectedPieces, alpha: float) -> list[Piece]:
    """Return the pieces that have ``alpha`` strictly inside, and no node there."""
    lo, hi = graph.extent.T
    inside = (lo < alpha) & (alpha < hi) & ~graph.same(lo, alpha) & ~graph.same(hi, alpha)
    ends = {piece.id for node in nodes_at(graph, alpha) for piece in graph.pieces_at(node)}
    return [graph.pieces[i] for i in np.flatnonzero(inside) if graph.pieces[i].id not in ends]


def nodes_at(graph: ConnectedPieces, alpha: float) -> list[int]:
    """Return the ids of the special points at an alpha."""
    return [graph.nodes[i].id for i in np.flatnonzero(graph.same(graph.alphas, alpha))]


def apart_at(graph: ConnectedPieces, alpha: float) -> list[int]:
    """Return the ids of the special points at an alpha, one id for points that errors explain."""
    apart: list[int] = []
    for node in nodes_at(graph, alpha):
        if not any(are_one(graph.point(node), graph.point(other)) for other in apart):
            apart.append(node)
    return apart
