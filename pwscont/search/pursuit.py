"""Newton's method without error estimates, for the many rough starts of a search.

Points are in typical magnitudes, y = (z, alpha) / scale. The points found are rough as well: the
caller corrects each point with all care. Known solutions are deflated away (Farrell, Birkisson and
Funke 2015).

A deflated iteration without a solution at this alpha creeps to a minimum of the merit, and is given
up. The minimum often lies beside a fold of the branch looked for: the pursuit goes on from there
with alpha free, by steps of least length (Gauss and Newton). Functions that saturate make endless
steps where H is nearly flat: each step is limited to a few times the distance from zero, and a
pursuit that goes too far is given up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, are_finite
from pwscont.basics.budget import check_budget
from pwscont.basics.rounding import EPS
from pwscont.curve.curve import LEAN
from pwscont.curve.metric import Metric, deflation, stretch
from pwscont.enumeration.continua import equations_in_magnitudes
from pwscont.system.contract import residual_at
from pwscont.system.system import PiecewiseSystem

#: Most iterations at fixed alpha, and again with alpha free.
MOST_PURSUIT_STEPS = 20
#: Most halvings of a step that does not reduce the merit.
MOST_STEP_HALVINGS = 5
#: Least fall of the merit, as a part of the fall that a Newton step promises.
DESCENT = 0.05
#: Longest step of a pursuit that has arrived, as a part of 1 plus the length of the point.
LAST_STEP = 1e-6
#: Longest step, as a multiple of 1 plus the distance of the point from zero.
LONGEST_STEP = 4.0
#: Length of a point, in typical magnitudes, from which on a pursuit has run away.
RUN_AWAY = 1e5
#: Regularisation of a shortest step, as a part of the merit: steps stay finite where the Jacobian
#: is singular.
DAMPED = 1e-2
#: Most Newton iterations in a plane across a curve.
MOST_IN_PLANE = 5
#: Distance by which a point found with alpha free is moved along the curve, as a part of 1 plus the
#: length of the point, because a pursuit may have ended right beside a kink.
MOVED_ALONG = 0.01
#: Distance, in typical magnitudes, beyond which a point is far away, and the slope of alpha below
#: which alpha hardly changes there.
AWAY, ALMOST = 3.0, 1e-3
#: Distance by which a point is moved aside before alpha is set free, as a part of 1 plus the length
#: of the point, because a minimum of the merit may lie where H is flat by symmetry.
MOVED_ASIDE = 1e-3


@final
class Pursuit:
    """Pursuits of solutions of a system."""

    def __init__(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> None:
        self._system, self._metric, self._scale = system, metric, metric.scale
        self._ends = interval[0] / metric.width, interval[1] / metric.width

    def at_alpha(self, y: Array, known: Sequence[Array]) -> tuple[Array, bool]:
        """Return where Newton's method at fixed alpha leads, and whether a solution is there.

        ``known``: solutions (z, alpha) that are deflated away.
        """

        def step_at(y: Array, residual: Array, jacobian: Array) -> Array:
            step = np.append(_newton_step(jacobian[:, :-1], residual), 0.0)
            step *= stretch(self._metric, known, y * self._scale, step * self._scale)
            return _limited(step, y)

        return self._pursued(y, step_at, known)

    def free(self, y: Array, direction: Array) -> Array | None:
        """Return the point of a curve to which steps of least length lead, within the interval.

        The steps begin aside of a point, in a direction.
        """

        def step_at(y: Array, residual: Array, jacobian: Array) -> Array:
            step = _limited(_shortest_step(jacobian, residual), y)
            if self._ends[0] <= y[-1] + step[-1] <= self._ends[1]:
                return step
            rise = self._ends[0 if step[-1] < 0.0 else 1] - y[-1]  # to the end that is left
            rest = residual + jacobian[:, -1] * rise
            return _limited(np.append(_newton_step(jacobian[:, :-1], rest), rise), y)

        aside = y + MOVED_ASIDE * (1.0 + _length(y)) * direction
        found, arrived = self._pursued(aside, step_at, ())
        return found if arrived else None

    def _pursued(
        self, y: Array, step_at: Callable[[Array, Array, Array], Array], known: Sequence[Array]
    ) -> tuple[Array, bool]:
        """Return where steps lead, and whether a solution is there."""
        for _ in range(MOST_PURSUIT_STEPS):
            here = self._linear(y)
            step = None if here is None else step_at(y, *here)
            if here is None or step is None or not are_finite(step):
                return y, False
            if _length(step) <= LAST_STEP * (1.0 + _length(y)):
                return y + step, True
            moved = self._moved(y, here[0], step, known)
            if moved is None or _length(moved) > RUN_AWAY:
                return y, False
            y = moved
        return y, False

    def leads_to(self, start: Array, y: Array) -> bool:
        """Tell whether Newton's method leads from a point beside a curve to a point of the curve.

        Each Newton step is normal to the curve at the point ``y``.
        """
        direction = self.direction(y)
        found = None if direction is None else self.across(start, y, direction)
        if found is None:
            return False
        return _length(self._apart(found, y)) <= 10.0 * LAST_STEP * (1.0 + _length(y))

    def across(self, start: Array, y: Array, direction: Array) -> Array | None:
        """Return the point of a curve to which Newton leads in the plane normal to a direction.

        The plane passes through ``y``.
        """
        for _ in range(MOST_IN_PLANE):
            here = self._linear(start)
            if here is None:
                return None
            matrix, off = np.vstack([here[1], direction]), direction.dot(self._apart(start, y))
            step = _newton_step(matrix, np.append(here[0], off))
            if not are_finite(step):
                return None
            start = start + step
            if _length(step) <= LAST_STEP * (1.0 + _length(y)):
                return start
        return None

    def along(self, y: Array) -> Array:
        """Return another point of the curve through a point, which may be a special point."""
        direction = self.direction(y)
        if direction is None:
            return y
        for way in (direction, -direction):
            beside = y + MOVED_ALONG * (1.0 + _length(y)) * way
            if not self._ends[0] <= beside[-1] <= self._ends[1]:
                continue
            found = self.across(beside, beside, direction)
            if found is not None and self._ends[0] <= found[-1] <= self._ends[1]:
                return found
        return y

    def direction(self, y: Array) -> Array | None:
        """Return the direction of the curve at a point, None where H is not finite."""
        here = self._linear(y)
        return None if here is None else np.asarray(np.linalg.svd(here[1])[2][-1])

    def is_flat(self, y: Array, direction: Array) -> bool:
        """Tell whether alpha hardly changes along the curve, at a point and farther out.

        Far away, alpha hardly changes if a pursuit has run to infinity.
        """
        outwards = direction if direction.dot(y) > 0.0 else -direction
        far = _length(y) > AWAY
        least, way = (ALMOST, 0.5 * _length(y)) if far else (LEAN, MOVED_ASIDE)
        if abs(direction[-1]) > least:
            return False
        beside = self.direction(y + way * outwards)
        return beside is None or abs(beside[-1]) <= least

    def _linear(self, y: Array) -> tuple[Array, Array] | None:
        """Return scaled residual and Jacobian; None if H is not finite, or outside the interval."""
        check_budget()
        place = self._place(y)
        found = place and equations_in_magnitudes(self._system, *place, self._scale)
        if found is None:
            return None
        residual, jacobian, self._rows = found
        return residual, jacobian

    def _place(self, y: Array) -> tuple[Array, float] | None:
        """Return z and alpha of a point; None outside the interval by more than rounding."""
        x = y * self._scale
        return (x[:-1], float(x[-1])) if self._metric.admits(x) else None

    def _moved(
        self, y: Array, residual: Array, step: Array, known: Sequence[Array]
    ) -> Array | None:
        """Return the first of y + step, y + step / 2, ... that reduces the merit enough."""

        def merit(y: Array, residual: Array) -> float:
            return _length(residual) * deflation(self._metric, known, y * self._scale)

        before, length = merit(y, residual), 1.0
        for _ in range(MOST_STEP_HALVINGS):
            trial = y + length * step
            if place := self._place(trial):
                off = residual_at(self._system, *place, self._system.character(*place)) / self._rows
                if merit(trial, off) <= (1.0 - DESCENT * length) * before:
                    return trial
            length *= 0.5
        return None

    def _apart(self, y: Array, other: Array) -> Array:
        apart: Array = self._metric.difference(y * self._scale, other * self._scale)
        return apart / self._scale


def _newton_step(jacobian: Array, residual: Array) -> Array:
    """Return Newton's step, for a singular Jacobian the step of Levenberg and Marquardt."""
    try:
        step: Array = np.asarray(np.linalg.solve(jacobian, -residual), dtype=float)
        if are_finite(step):
            return step
    except np.linalg.LinAlgError:
        pass
    return _shortest_step(jacobian, residual)


def _shortest_step(jacobian: Array, residual: Array) -> Array:
    """Return the shortest step that solves the linear equations, regularised a little."""
    square = jacobian.dot(jacobian.T)
    square.flat[:: len(square) + 1] += DAMPED**2 * min(1.0, float(residual.dot(residual))) + EPS
    try:
        step: Array = -jacobian.T.dot(np.linalg.solve(square, residual))
    except np.linalg.LinAlgError:
        return np.full(jacobian.shape[1], np.inf)
    return step


def _limited(step: Array, y: Array) -> Array:
    """Return a step, shortened if much longer than the way from zero to the point."""
    most = LONGEST_STEP * (1.0 + _length(y[:-1]))
    length = _length(step)
    return step * (most / length) if length > most else step


def _length(y: Array) -> float:
    return math.sqrt(float(y.dot(y)))
