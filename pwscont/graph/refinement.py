"""A solution at a given alpha from the points stored around it."""

from __future__ import annotations

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.character import Character
from pwscont.foundation.errors import PwscontError, SystemNeededError
from pwscont.foundation.outcome import Failure
from pwscont.foundation.records import Piece, Solution, significant
from pwscont.model.selection import Selection
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.linalg import last_unit
from pwscont.numerics.metric import Metric
from pwscont.numerics.uncertainty import magnitude
from pwscont.stepping.stepper import CurvedSegment
from pwscont.transitions.location import locate_zero


def refine(
    system: PiecewiseSystem | None, piece: Piece, alpha: float, interval: tuple[float, float]
) -> Solution:
    """Return the solution of a piece at an alpha strictly inside it, to full accuracy.

    Parameters
    ----------
    system : PiecewiseSystem or None
    piece : Piece
    alpha : float
    interval : tuple of float
        The interval of the graph, for the metric.

    Raises
    ------
    SystemNeededError
        If the piece is curved and there is no system to correct with.
    """
    if system is None:
        x, error, digits = _on_chord(piece, alpha), np.zeros(0), 16.0
    else:
        x, error = solve_between(system, piece.character, piece.points, alpha, interval)
        digits = significant(error, x, Metric.of(system, interval).scale)
    return Solution(
        x[:-1], alpha, piece.character, piece.label, piece.det_sign, piece.id, None, error, digits
    )


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
        The solution and an estimate of its error.

    Raises
    ------
    PwscontError
        If Newton fails between the two stored points.
    """
    a, b = _around(points, alpha)
    curve = Curve(Selection(system, character), Metric.of(system, interval))
    start, end = (State(x, b - a, np.zeros_like(x), 0) for x in (a, b))
    segment = CurvedSegment.between(curve, start, end, suggestion=0.0)
    row = -last_unit(len(a))
    found = locate_zero(segment, lambda x: (alpha - float(x[-1]), row), (0.0, segment.length))
    if isinstance(found, Failure):
        label = system.label(character)
        raise PwscontError(f"no solution found in {label} at alpha = {alpha}: {found}")
    found.x[-1] = alpha
    return found.x, magnitude(found.x, found.error)


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
