"""Semismooth Newton at fixed alpha, for a start that is only rough.

Qi and Sun (1993); damping by the merit function |H|^2 / 2 as in Facchinei and Pang (2003),
chapter 8.

Failure modes and answers
-------------------------
- A singular element of the Jacobian: the step is regularised (Levenberg and Marquardt).
- Cycling between cells: the merit function must fall, by Armijo's rule.
- At a kink, such as the body at rest, the step of one cell need not reduce the merit at all: a few
  steps are taken undamped, and the rule holds again from where they lead.
- A stationary point of the merit function that is no solution: the failure says so.
- Known solutions attract: they are deflated away (Farrell, Birkisson and Funke 2015).
- Equations in different units: each row is divided by its largest scaled coefficient.
- Divergence: so far out that rounding hides the residual, no step reduces it. A point whose error
  is as large as the point itself is no solution.
- Ill conditioning: a solution can be so uncertain that its correction never converges. A point is
  a solution where no step reduces the residual any more and the correction is nothing but rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, are_finite, dense, joined, product
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED, EPS
from pwscont.curve.curve import Held, LastHeld
from pwscont.curve.error_samples import has_digits
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Root, is_rounding, uncertainty
from pwscont.linear.factorise import Factor, bordered, last_unit
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem

MOST_ITERATIONS = 100
MOST_HALVINGS = 30
#: The same where solutions are deflated away: shorter steps creep to a minimum of the merit, which
#: is no solution. Random bodies: as many solutions found as with 30, in less than half the time.
MOST_HALVINGS_DEFLATED = 12
ARMIJO = 1e-4
#: Undamped steps from points where no step reduces the merit: a watchdog strategy.
MOST_LEAPS = 3


def semismooth_newton(
    system: PiecewiseSystem,
    metric: Metric,
    z: Array,
    alpha: float,
    known: Sequence[Array] = (),
    last: LastHeld | None = None,
) -> tuple[Array, Array] | Failure:
    """Solve H(z, alpha) = 0 for z from a rough start.

    Parameters
    ----------
    system : PiecewiseSystem
    metric : Metric
    z : ndarray, shape (n,)
    alpha : float
    known : sequence of ndarray, shape (n + 1,)
        Solutions (z, alpha) to keep away from: H is multiplied by 1 + 1 / distance^2 for each.
    last : LastHeld, optional
        Where the Jacobian at the solution is left, if it is that of a straight cell.

    Returns
    -------
    x, error : ndarray, shape (n + 1,)
        The solution (z, alpha) and the size of the last correction, or, shape (k, n + 1), samples
        of its error where that is all conditioning allows; or a Failure.
    """
    place, linear, leaps = _Place.first(system, joined(z, alpha), last), None, 0
    for iteration in range(1, MOST_ITERATIONS + 1):
        check_budget()
        if linear is None or not linear.holds_at(system, place):
            linear = _Linear.of(system, metric, place)
        if linear is None or not are_finite(place.residual):
            return Failure(FailureReason.NOT_FINITE)
        step, x = _direction(linear, place.residual, metric), place.x
        if not are_finite(step):
            return Failure(FailureReason.NOT_FINITE)
        step = step * _stretch(metric, known, x, step)
        if metric.relative(step, x) <= CONVERGED:
            flat = linear.is_flat(metric)
            if not _is_solved(place.residual / linear.rows, x / metric.scale, flat):
                return Failure(FailureReason.NO_DESCENT)
            if last and isinstance(system, PiecewiseLinearSystem):
                linear.leave(last, place.character)
            return x + step, np.abs(step)[np.newaxis]
        damped = _line_search(_Merit(system, metric, linear.rows, known), place, step)
        if damped is None:
            parts = linear.jacobian, last_unit(len(x)), linear.factor, metric.scale, iteration
            found = _as_good_as_it_gets(Root(x, np.abs(step), *parts), metric, known)
            leaps += 1
            if known or leaps > MOST_LEAPS or not isinstance(found, Failure):
                return found
            damped = _Place.at(system, x + step)
        place = damped
    return Failure(FailureReason.NO_DESCENT)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A point (z, alpha), the character of its cell, the residual and, if known, the Jacobian."""

    x: Array
    character: Character
    residual: Array
    jacobian: Matrix | None = None

    @classmethod
    def first(cls, system: PiecewiseSystem, x: Array, last: LastHeld | None) -> _Place:
        """Return the same of a start, of what the system returned when it was checked there."""
        known = last.begun(x) if last else None
        return (
            cls(x, known.character, known.residual, known.jacobian) if known else cls.at(system, x)
        )

    @classmethod
    def at(cls, system: PiecewiseSystem, x: Array) -> _Place:
        """Return what a system says at a point."""
        z, alpha = x[:-1], float(x[-1])
        character = system.character(z, alpha)
        return cls(x, character, residual_at(system, z, alpha, character))


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Linear:
    """The Jacobian at a point, and what is made of it.

    Attributes
    ----------
    character : Character
    jacobian : ndarray or sparse matrix, shape (n, n + 1)
    rows : ndarray, shape (n,)
        The largest scaled coefficient of z in each row.
    factor : Factor
        Of the Jacobian and a last row that holds alpha.
    is_singular : bool
    """

    character: Character
    jacobian: Matrix
    rows: Array
    factor: Factor
    is_singular: bool

    @classmethod
    def of(cls, system: PiecewiseSystem, metric: Metric, place: _Place) -> _Linear | None:
        """Return the Jacobian at a place, factorised; None where it is not finite."""
        x, character, jacobian = place.x, place.character, place.jacobian
        if jacobian is None:
            jacobian = jacobian_at(system, x[:-1], float(x[-1]), character)
        rows = _row_scale(jacobian, metric)
        if not are_finite(rows):
            return None
        factor = bordered(jacobian, last_unit(len(x)), metric.binary)
        return cls(character, jacobian, rows, factor, factor.is_singular())

    def is_flat(self, metric: Metric) -> Array:
        """Tell which rows do not see z: H hardly changes where a start has run away."""
        by_z = product(abs(self.jacobian), joined(metric.scale[:-1], 0.0))
        by_alpha = product(abs(self.jacobian), joined(np.zeros(len(self.rows)), metric.width))
        return np.asarray(by_z <= EPS * by_alpha)

    def leave(self, last: LastHeld, character: Character) -> None:
        """Leave the Jacobian, if it is regular, where the piece that begins here finds it."""
        if not self.is_singular:
            row = last_unit(len(self.rows) + 1)
            last.keep(character, Held(self.jacobian, row, self.factor))

    def holds_at(self, system: PiecewiseSystem, place: _Place) -> bool:
        """Tell whether the Jacobian is known to be the same at another place."""
        if not isinstance(system, PiecewiseLinearSystem):
            return False
        here, there = self.character, place.character
        return here == there or system.cell(here) == system.cell(there)


def _is_solved(scaled: Array, size: Array, flat: Array) -> bool:
    """Tell whether a residual, divided by its coefficients, fits a correction that is rounding.

    Where the Jacobian is singular the regularised step may vanish where the residual does not. What
    rounding of the point makes of a row is none of it where the row does not see the point.
    """
    rounding = CONVERGED * float(np.add.reduce(np.abs(size)))
    return bool((np.abs(scaled) <= math.sqrt(CONVERGED) + np.where(flat, 0.0, rounding)).all())


def _as_good_as_it_gets(
    root: Root, metric: Metric, known: Sequence[Array]
) -> tuple[Array, Array] | Failure:
    """Return a point whose residual no step reduces, if it is a solution within rounding.

    Within rounding of a known solution it is the known one again, and refused.
    """
    again = (replace(root, error=np.abs(metric.difference(root.x, other))) for other in known)
    if root.factor.is_singular() or not is_rounding(root) or any(map(is_rounding, again)):
        return Failure(FailureReason.NO_DESCENT)
    error = uncertainty(root)
    certain = has_digits(root.x, error, root.scale)
    return (root.x, error) if certain else Failure(FailureReason.NO_DIGITS)


def _row_scale(jacobian: Matrix, metric: Metric) -> Array:
    """Return the largest scaled coefficient of z in each row."""
    scaled: Array = product(abs(jacobian), joined(metric.scale[:-1], 0.0))
    scaled[scaled == 0.0] = 1.0  # what is not finite stays so
    return scaled


def _direction(linear: _Linear, residual: Array, metric: Metric) -> Array:
    """Return the Newton step (with a zero for alpha), regularised where J is singular."""
    if not linear.is_singular:
        return -linear.factor.solve(joined(residual, 0.0))
    rows = linear.rows
    with np.errstate(over="ignore", invalid="ignore"):  # where H is flat rows are next to nothing
        scaled = dense(linear.jacobian)[:, :-1] * metric.scale[:-1] / rows[:, np.newaxis]
        rest = residual / rows
        damping = np.sqrt(np.linalg.norm(rest)) * np.eye(len(rows))
    system = np.vstack([scaled, damping])
    if not np.isfinite(system).all():
        return np.full(len(rows) + 1, np.inf)
    step = np.linalg.lstsq(system, np.append(-rest, np.zeros(len(rows))))[0]
    return np.append(step * metric.scale[:-1], 0.0)


@final
@dataclass(frozen=True, slots=True)
class _Merit:
    """The squared residual, deflated, with rows scaled alike."""

    system: PiecewiseSystem
    metric: Metric
    rows: Array
    known: Sequence[Array]

    def of(self, place: _Place) -> float:
        """Return the merit of a place."""
        scaled = place.residual / self.rows
        deflation = _deflation(self.metric, self.known, place.x)
        return float(scaled.dot(scaled)) * deflation * deflation  # a power would raise an error


def _line_search(merit: _Merit, place: _Place, step: Array) -> _Place | None:
    """Return the first of x + step, x + step / 2, ... that reduces the merit enough."""
    length = 1.0
    with np.errstate(over="ignore"):  # the merit is infinite far away, where H is an exponential
        before = merit.of(place)
        for _ in range(MOST_HALVINGS_DEFLATED if merit.known else MOST_HALVINGS):
            trial = _Place.at(merit.system, place.x + length * step)
            if merit.of(trial) <= (1.0 - 2.0 * ARMIJO * length) * before:
                return trial
            length *= 0.5
    return None


def _deflation(metric: Metric, known: Sequence[Array], x: Array) -> float:
    """Return the product of 1 + 1 / distance^2 over the known solutions."""
    factor = 1.0
    for other in known:
        factor *= 1.0 + 1.0 / max(metric.norm(metric.difference(x, other)) ** 2, EPS**2)
    return factor


def _stretch(metric: Metric, known: Sequence[Array], x: Array, step: Array) -> float:
    """Return the factor by which deflation lengthens, shortens or turns the Newton step.

    With M the deflating factor and d the step, the step of M H is d / (1 - (grad M . d) / M)
    by the formula of Sherman and Morrison (Farrell, Birkisson and Funke 2015).
    """
    slope = 0.0
    for other in known:
        distance = max(metric.norm(metric.difference(x, other)) ** 2, EPS**2)
        inner = float(metric.covector(metric.difference(x, other)).dot(step))
        slope += -2.0 * inner / distance**2 / (1.0 + 1.0 / distance)
    return 1.0 / (1.0 - slope) if slope != 1.0 else 1.0
