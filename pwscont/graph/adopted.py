"""The system of a graph that was read from a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pwscont.basics.errors import InvalidInputError
from pwscont.graph.records import Piece, SpecialPoint
from pwscont.system.abilities import completed, shown_size
from pwscont.system.selection import unexplained
from pwscont.system.system import PiecewiseSystem

#: Components larger than this, or smaller than 1 / this, are not of the order of 1.
ORDER_OF_ONE = 8.0
#: At about this many pieces of a graph the equations are checked.
MOST_CHECKED = 4


def adopted(
    path: str | Path,
    pieces: Sequence[Piece],
    points: Sequence[SpecialPoint],
    interval: tuple[float, float],
    system: PiecewiseSystem,
) -> PiecewiseSystem:
    """Return the system of a graph, fitted to the interval and solutions of the graph.

    Raises
    ------
    InvalidInputError
        If the system has another number of unknowns or tests, or other solutions.
    """
    if pieces:
        _check_numbers(path, system, points[0], pieces[0])
    fitted = _fitted(system, interval, points)
    for piece in pieces[:: max(1, len(pieces) // MOST_CHECKED)]:
        _check_solution(path, fitted, piece, interval)
    return fitted


def _check_numbers(
    path: str | Path, system: PiecewiseSystem, point: SpecialPoint, piece: Piece
) -> None:
    """Refuse a system that has another number of unknowns or tests than the graph."""
    unknowns, name = len(point.z), type(system).__name__
    if unknowns != (size := shown_size(system)):
        raise InvalidInputError(
            f"{path} is of another system: it has {unknowns} unknowns, {name} has {size}"
        )
    tests = len(bytes(piece.character))
    z = completed(system, point.z, point.alpha)
    given = len(bytes(system.character(z, point.alpha)))
    if tests != given:
        raise InvalidInputError(
            f"{path} is of another system: it has {tests} tests, {name} has {given}"
        )


def _fitted(
    system: PiecewiseSystem, interval: tuple[float, float], points: Sequence[SpecialPoint]
) -> PiecewiseSystem:
    """Return a system fitted to an interval; a system without a scale, also to the solutions."""
    states = [completed(system, point.z, point.alpha) for point in points]
    sizes = np.max(np.abs(states), axis=0, initial=0.0)
    usual = (sizes == 0.0) | ((sizes > 1.0 / ORDER_OF_ONE) & (sizes < ORDER_OF_ONE))
    found = None if system.gives_scale or usual.all() else np.where(usual, 1.0, sizes)
    return system.within(*interval, found)


def _check_solution(
    path: str | Path, system: PiecewiseSystem, piece: Piece, interval: tuple[float, float]
) -> None:
    """Refuse a system whose equations do not hold where a piece begins."""
    alpha = piece.track.start.alpha
    z = completed(system, piece.track.start.x[:-1], alpha)
    scale = np.append(system.scale(*interval), np.ptp(interval))
    if unexplained(system, piece.character, np.append(z, alpha), scale):
        raise InvalidInputError(
            f"{path} is of another system: {type(system).__name__} does not have its solution at "
            f"alpha = {alpha:.10g}; give the system with the constants that the graph was made with"
        )
