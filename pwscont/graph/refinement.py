"""A solution at a given alpha from the points stored around it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import SystemNeededError
from pwscont.basics.outcome import Failure
from pwscont.basics.quantities import NAMELESS, Quantities
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Border, newton
from pwscont.curve.zero import MOST_NEWTON
from pwscont.graph.accuracy import significant
from pwscont.graph.records import Piece, Solution
from pwscont.linear.factorise import bordered, last_unit
from pwscont.stepping.acceptance import SLOWEST
from pwscont.stepping.stepper import CurvedSegment
from pwscont.system.hidden import completed_point, shown_points
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
