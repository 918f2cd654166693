"""Solutions on the bounds of unknowns, where a branch may begin and end inside the interval.

Solutions at the ends of the interval do not lead to such a branch, and between the ends the branch
may be short. On a bound, the unknown is given and alpha is not.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, dense
from pwscont.basics.character import Character
from pwscont.curve.error_samples import Found
from pwscont.curve.metric import Metric
from pwscont.search.pursuit import ALMOST, FARTHEST_START, SAME_SOLUTION, Pursuit
from pwscont.search.search import KnownBranches
from pwscont.system.box import Box
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import PiecewiseSystem

#: How far from its bound an unknown is looked for at most, in typical magnitudes.
INWARDS = 4.0


@final
class Exchanged(PiecewiseSystem):
    """A system whose parameter is one of the unknowns, with alpha in the place of the unknown."""

    def __init__(self, system: PiecewiseSystem, place: int, metric: Metric) -> None:
        self.size, self._system, self._place = system.size, system, place
        self._box, self._interval = Box.of(system), metric.interval
        self.magnitudes = self.exchanged(metric.scale)  # of the unknowns and of the parameter

    def exchanged(self, x: Array) -> Array:
        """Return points, shape (..., n + 1), with the unknown and alpha exchanged."""
        y = np.array(x)
        y[..., self._place], y[..., -1] = x[..., -1], x[..., self._place]
        return y

    def _at(self, z: Array, alpha: float) -> tuple[Array, float]:
        """Return z and alpha of the system, with alpha moved into the interval if it is outside."""
        x = self.exchanged(np.append(z, alpha))
        return x[:-1], float(np.clip(x[-1], *self._interval))

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the tests of the system."""
        return np.asarray(self._system.test_functions(*self._at(z, alpha)), dtype=float)

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return H, nan outside of the interval."""
        own, at = self._at(z, alpha)
        rows = residual_at(self._system, own, at, character)
        return rows if at == z[self._place] else np.full_like(rows, np.nan)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the derivatives of H, with two columns exchanged."""
        return self.exchanged(dense(jacobian_at(self._system, *self._at(z, alpha), character)))

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the derivatives of the tests, with two columns exchanged."""
        return self.exchanged(dense(self._system.test_jacobian(*self._at(z, alpha))))

    def scale(self, lo: float, hi: float) -> Array:
        """Return the magnitudes, that of alpha in the place of the unknown."""
        return self.magnitudes[:-1]

    def bounds(self) -> tuple[Any, Any]:
        """Return the bounds, the interval in the place of the unknown."""
        ends = zip((self._box.lower, self._box.upper), self._interval, strict=True)
        lower, upper = (self.exchanged(np.append(bound, end))[:-1] for bound, end in ends)
        return lower, upper

    def periods(self) -> Array:
        """Return the periods; alpha has none."""
        return self.exchanged(np.append(self._box.period, np.inf))[:-1]

    def branches(self, known: KnownBranches) -> KnownBranches:
        """Return known branches of the system as branches of this system."""
        seen = KnownBranches()
        seen.followed = lambda: ((cell, self.exchanged(x)) for cell, x in known.followed())
        return seen


def on_bounds(pursuit: Pursuit, reach: Array, count: int, turn: int) -> Iterator[Found]:
    """Yield solutions on bounds of unknowns from ``count`` starts in all, others in each turn.

    Starts ``reach`` so far. If there are more bounds than starts, the first bounds have one start
    each.
    """
    system, metric, known = pursuit.system, pursuit.metric, pursuit.known
    box, scale = Box.of(system), metric.scale[:-1]
    ends = lower, upper = np.array([box.lower, box.upper])
    near = np.argwhere(np.abs(ends) <= FARTHEST_START * scale)[:count]
    each = count // max(len(near), 1)
    for side, place in near.tolist():
        bound, slack = float(ends[side, place]), SAME_SOLUTION * scale[place]
        if any((np.abs(x[:, place] - bound) <= slack).sum() > 1 for x in known.pieces()):
            continue  # a branch lies on the bound
        other, width = Exchanged(system, place, metric), INWARDS * scale[place]
        inside = max(lower[place], bound - width), min(upper[place], bound + width)
        own = other.exchanged(np.append(reach, metric.width))[:-1]
        there = Metric(other.magnitudes, inside, Box.of(other).period)
        across = Pursuit(other, there, other.branches(known), own)
        starts = map(across.guess, range(turn * each, (turn + 1) * each))
        for x, error in across.at(bound, starts):
            if _is_crossed(other, x):
                yield other.exchanged(x), other.exchanged(error)


def _is_crossed(other: Exchanged, y: Array) -> bool:
    """Tell whether a curve crosses a bound at a point; a curve outside may touch the bound."""
    z, bound = y[:-1], float(y[-1])
    rows = other.jacobian(z, bound, other.character(z, bound)) * other.magnitudes
    sizes = np.abs(rows).max(axis=1, keepdims=True)
    tangent = np.linalg.svd(rows / np.where(sizes > 0.0, sizes, 1.0))[2][-1]
    return bool(abs(tangent[-1]) > ALMOST)
