"""The true pieces of a system that is affine in z at each alpha, by a solve per cell and alpha.

In each cell the state is a function of alpha, computed by a dense solve of numpy; a piece is a
stretch of alpha on which the state lies in the cell. The ends of a piece are roots along alpha of
the smallest test that bounds the cell. No tangent, no step and no Newton iteration takes part.

Failure modes and answers
-------------------------
- A piece is shorter than the steps of the grid of alphas: the answer is compared with
  ``enumerate_solutions`` at further values of alpha, see :mod:`pwscont.bench.cases`. Pieces shorter
  than the steps between all these values are missed.
- A cell is singular at every alpha, and may hold vertical pieces: refused.
- A state runs to infinity where the determinant vanishes: refused, if within the cell.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from pwscont import Character, SlicewiseLinearSystem
from pwscont.bench.truth.known_answer import TruePiece, UnknownAnswerError
from pwscont.extending import EPS, Array, Selection, dense

#: Number of values of alpha at which every cell is tried.
GRID = 401
#: Part of the product of the rows' lengths up to which the determinant of a matrix counts as zero.
SINGULAR = 1e-13


def cellwise_pieces(
    system: SlicewiseLinearSystem, interval: tuple[float, float]
) -> list[TruePiece]:
    """Return all pieces of all cells.

    Raises
    ------
    UnknownAnswerError
        If a cell may have pieces that this method cannot find.
    """
    return [
        piece
        for character in system.cells()
        for piece in _InCell(system, character).pieces(interval)
    ]


class _InCell:
    """The state of a cell as a function of alpha."""

    def __init__(self, system: SlicewiseLinearSystem, character: Character) -> None:
        self._selection = Selection(system, character)
        self._origin = np.zeros(system.size + 1)

    def _matrix(self, alpha: float) -> Array:
        self._origin[-1] = alpha
        return dense(self._selection.jacobian(self._origin))[:, :-1]

    def look(self, alpha: float) -> tuple[float, int, float]:
        """Return alpha, the sign of det(dH/dz), and the slack, which is NaN if the sign is 0."""
        sign = _sign(self._matrix(alpha))
        return alpha, sign, self.slack(alpha) if sign else np.nan

    def at(self, alpha: float) -> Array:
        """Return the solution (z, alpha) of the selection at ``alpha``."""
        z = np.linalg.solve(self._matrix(alpha), -self._selection.residual(self._origin))
        return np.append(z, alpha)

    def slack(self, alpha: float) -> float:
        """Return the smallest bounding test, not negative if the point lies in the cell."""
        return float(self._selection.tests(self.at(alpha)).min(initial=np.inf))

    def pieces(self, interval: tuple[float, float]) -> list[TruePiece]:
        """Return the pieces in the interval, in the order of alpha."""
        looks = [self.look(float(alpha)) for alpha in np.linspace(*interval, GRID)]
        table = [look for look in looks if look[1]]
        if len(table) < GRID // 2:
            raise UnknownAnswerError("a cell is singular at every alpha: vertical pieces")
        ends = [interval[0]] * (table[0][2] >= 0.0)
        ends += [self._end(a, b) for a, b in pairwise(table) if (a[2] >= 0.0) != (b[2] >= 0.0)]
        ends += [interval[1]] * (table[-1][2] >= 0.0)
        return [self._piece(lo, hi) for lo, hi in zip(ends[::2], ends[1::2], strict=True)]

    def _end(self, a: tuple[float, int, float], b: tuple[float, int, float]) -> float:
        if a[1] != b[1]:
            raise UnknownAnswerError("the determinant of a cell vanishes where a piece ends")
        return float(brentq(self.slack, a[0], b[0], xtol=EPS * (b[0] - a[0]), rtol=4.0 * EPS))

    def _piece(self, lo: float, hi: float) -> TruePiece:
        cell, sign = self._selection.cell, _sign(self._matrix(0.5 * (lo + hi)))
        return TruePiece(cell, sign, (lo, hi), self.at, lambda x: float(x[-1]))


def _sign(matrix: Array) -> int:
    """Return the sign of the determinant, 0 if the determinant vanishes within rounding."""
    det = np.linalg.det(matrix / np.linalg.norm(matrix, axis=1)[:, np.newaxis])
    return 0 if abs(det) < SINGULAR else int(np.sign(det))
