"""Paths that do not end: special points that accumulate, and paths that repeat themselves.

Failure modes and answers
-------------------------
- Special points come closer and closer for a while, and then no more: no path is stopped for that.
  Only the message of a path that was stopped for another reason says that points accumulate.
- Special points come closer so slowly that they reach any alpha (roots of the whole numbers): the
  differences must shrink fast enough for their sum to be finite, by Raabe's test.
- Several kinds of special points take turns: the sequences of every second, third and fourth point
  are tested, too.
- A path with many equal teeth, each in cells of its own, ends: a path repeats itself only in the
  same cells, shifted by the same vector again and again, at the same alphas.
- A path that repeats itself for a while may end all the same: a user who sets limits decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import ACCUMULATE
from pwscont.graph.place import Place

#: What a user reads at an end of a path that repeats itself.
REPEATS = "the path repeats itself without end: set limits=Limits(pieces=...) to follow it further"
#: Pieces after which a path is looked at again; odd, so that the ends of a path take turns.
EVERY = 13
#: Differences that must fit a convergent sequence, and most kinds of points that may take turns.
TERMS, MOST_TURNS = 6, 4
#: How far 1 / (1 - q) may stray from a straight line, q the ratio of successive differences.
STRAY = 0.25
#: Largest slope of that line: 0 for geometric sequences, 1/2 for 1 / k, 1 where the sum diverges.
STEEPEST = 0.8
#: Periods after which a path is taken to repeat itself, and their longest length in pieces.
PERIODS, LONGEST = 8, 8
#: Two shifts are one up to this part of their length.
SAME_SHIFT = 1e-5


@final
class Past:
    """The way by which each special point of a run was first reached."""

    def __init__(self) -> None:
        self._steps: dict[int, tuple[int, Place, object]] = {}

    def add(self, start: int, end: int, place: Place, cells: object) -> None:
        """Remember that a piece in some cells led from a node to another one, and its place."""
        self._steps.setdefault(end, (start, place, cells))

    def _leading_to(self, node: int, most: int) -> list[tuple[Place, object]]:
        """Return the last places on the way to a node, each with the cells before it."""
        found: list[tuple[Place, object]] = []
        while len(found) < most and node in self._steps:
            node, place, cells = self._steps[node]
            found.append((place, cells))
        return found[::-1]

    def repeats(self, node: int, scale: Array) -> bool:
        """Tell whether the path to a node repeats itself; the scale is that of (z, alpha)."""
        way = self._leading_to(node, PERIODS * LONGEST + 1)
        periods = _periods([cells for _, cells in way[1:]])
        if not periods:  # nearly always, and places are not looked at
            return False
        points = np.array([place.x / scale for place, _ in way])
        return any(_is_shifted(points, period) for period in periods)

    def accumulation(self, node: int, is_special: bool) -> str:
        """Return at which alpha the special points up to a node accumulate, in words."""
        way = self._leading_to(node, TERMS * MOST_TURNS + 2)
        alphas = [place.alpha for place, _ in way]
        limit = accumulation(alphas if is_special else alphas[:-1])
        return "" if limit is None else f"; {ACCUMULATE} {limit:.6g}"


def accumulation(alphas: Sequence[float]) -> float | None:
    """Return the alpha at which special points accumulate, None where nothing looks like it.

    Parameters
    ----------
    alphas : sequence of float
        The alphas of successive special points of a path.
    """
    for turns in range(1, MOST_TURNS + 1):
        terms = np.array(alphas[::-1][::turns][: TERMS + 1][::-1])
        if len(terms) > TERMS and (limit := _limit(terms)) is not None:
            return limit
    return None


def _limit(terms: Array) -> float | None:
    """Return the limit of a sequence, by the tail of its differences."""
    steps = np.diff(terms)
    if (steps == 0.0).any():
        return None
    ratios = steps[1:] / steps[:-1]
    if ratios.min() <= 0.0 or ratios.max() >= 1.0:
        return None
    rests = 1.0 / (1.0 - ratios)
    slope = float(np.median(np.diff(rests)))
    if slope >= STEEPEST or np.abs(np.diff(rests) - slope).max() > STRAY:
        return None
    return float(terms[-1] + steps[-1] * (rests[-1] - 1.0) / (1.0 - slope))


def _periods(cells: Sequence[object]) -> list[int]:
    """Return after how many pieces a path is in the same cells again and again."""
    return [
        period
        for period in range(1, min(LONGEST, len(cells) // PERIODS) + 1)
        if cells[-PERIODS * period : -period] == cells[-(PERIODS - 1) * period :]
    ]


def _is_shifted(points: Array, period: int) -> bool:
    """Tell whether each period shifts a path by as much, without coming nearer to an end.

    Parameters
    ----------
    points : ndarray, shape (k, n + 1)
        Successive special points (z, alpha), each unknown divided by its typical magnitude.
    period : int
        A number of pieces after which the path is in the same cells again.
    """
    shifts = np.diff(points[-1 - PERIODS * period :: period], axis=0)
    length = float(np.linalg.norm(shifts[-1]))
    spread = np.linalg.norm(shifts - shifts[-1], axis=1).max()
    return bool(length > 0.0 and spread <= SAME_SHIFT * length) and _stays(shifts, length)


def _stays(shifts: Array, length: float) -> bool:
    """Tell whether a period leads back to the alpha where it began."""
    return bool(np.abs(shifts[:, -1]).max() <= SAME_SHIFT * length)
