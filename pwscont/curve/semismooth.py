"""Semismooth Newton at fixed alpha, for a start that is only rough.

Qi and Sun (1993); damping by the merit function |H|^2 / 2 as in Facchinei and Pang (2003),
chapter 8; rows of H are divided by the largest scaled coefficients. The step of a singular Jacobian
is regularised (Levenberg and Marquardt). The merit must fall, by Armijo's rule, except for a few
undamped steps at kinks, where the step of a single cell need not reduce the merit. If a short last
step crosses an interface, Newton goes on in the cell beyond, since the solution of the cell that
was left is no solution. Known solutions are deflated away (Farrell, Birkisson and Funke 2015).

A point where no step reduces the residual is a solution if the correction is only rounding, and the
error is less than the point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from pwscont.basics.arrays import Array, Matrix, are_finite, dense, joined, product
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED, EPS, GUARD, HALF_DIGITS
from pwscont.curve.error_samples import has_digits
from pwscont.curve.metric import Metric, deflation, stretch
from pwscont.curve.newton import NEXT_IS_ROUNDING, SOLVED, Root, is_rounding, is_solved, uncertainty
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import balanced_columns, bordered, last_unit
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem

#: Most Newton iterations from a start, and most halvings of a step that hardly reduces the merit.
MOST_ITERATIONS = 100
MOST_HALVINGS = 30
#: Most halvings of a step if solutions are deflated away: shorter steps creep to a minimum of
#: the merit, which is no solution. Random bodies: as many solutions found as with 30, in less than
#: half the time.
MOST_HALVINGS_DEFLATED = 12
#: Least fall of the merit, as a part of the fall that the slope promises (Armijo's rule).
ARMIJO = 1e-4
#: Most undamped steps from points where no step reduces the merit: a watchdog strategy.
MOST_LEAPS = 3
#: Most steps no longer than rounding along which H does not fall.
MOST_SHORT = 10
#: H falls if each row falls by this factor, and stays if a row does not even fall by the second.
FALLS, STAYS = 0.125, 0.5


#: A point (z, alpha), the character of the cell there, and the residual.
_Evaluated: TypeAlias = tuple[Array, Character, Array]


class _Linearised(NamedTuple):
    """The Jacobian J at a point."""

    character: Character
    jacobian: Matrix  # shape (n, n + 1)
    rows: Array  # largest coefficient of each row, for z in typical magnitudes, shape (n,)
    factor: Factor  # of [J; e_alpha], whose last row holds alpha
    is_singular: bool


def semismooth_newton(
    system: PiecewiseSystem, metric: Metric, z: Array, alpha: float, known: Sequence[Array] = ()
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

    Returns
    -------
    x, error : ndarray, shape (n + 1,)
        The solution (z, alpha) and the size of the last correction, or, shape (k, n + 1), samples
        of the error where conditioning allows no smaller correction; or a Failure.
    """
    point, linear = _evaluated(system, joined(z, alpha)), None
    leaps, short, is_straight = 0, 0, isinstance(system, PiecewiseLinearSystem)
    for iteration in range(1, MOST_ITERATIONS + 1):
        check_budget()
        x, character, residual = point
        if not (linear and is_straight and _is_same_cell(system, linear.character, character)):
            linear = _linearised(system, metric, x, character)
        if linear is None or not are_finite(residual):
            return Failure(FailureReason.NOT_FINITE)
        step = _direction(linear, residual, metric)
        if not are_finite(step):
            return Failure(FailureReason.NOT_FINITE)
        step = step * stretch(metric, known, x, step)
        if metric.relative(step, x) <= CONVERGED:
            after, falls, is_root = _after_rounding(system, metric, linear, point, step)
            if after and (falls or short < MOST_SHORT):
                point, linear, short = after, None, short + (not falls)
                continue
            root = x + step, np.abs(step)[np.newaxis]
            return root if is_root else Failure(FailureReason.NO_DESCENT)
        reduced = _line_search(system, metric, linear.rows, known, point, step)
        if reduced is None:
            parts = linear.jacobian, last_unit(len(x)), linear.factor, metric.scale, iteration
            found = _as_good_as_it_gets(Root(x, np.abs(step), *parts), metric, known)
            leaps += 1
            if known or leaps > MOST_LEAPS or not isinstance(found, Failure):
                return found
            reduced = _evaluated(system, x + step)
        point = reduced
    return Failure(FailureReason.NO_DESCENT)


def _evaluated(system: PiecewiseSystem, x: Array) -> _Evaluated:
    """Return a point with the character and the residual that a system has there."""
    z, alpha = x[:-1], float(x[-1])
    character = system.character(z, alpha)
    return x, character, residual_at(system, z, alpha, character)


def _is_same_cell(system: PiecewiseSystem, one: Character, other: Character) -> bool:
    return one == other or system.cell(one) == system.cell(other)


def _linearised(
    system: PiecewiseSystem, metric: Metric, x: Array, character: Character
) -> _Linearised | None:
    """Return the Jacobian at a point, factorised; None where the Jacobian is not finite."""
    jacobian = jacobian_at(system, x[:-1], float(x[-1]), character)
    with np.errstate(invalid="ignore"):  # an infinite entry times zero, for alpha
        rows: Array = product(abs(jacobian), joined(metric.scale[:-1], 0.0))
    rows[rows == 0.0] = 1.0
    if not are_finite(rows):
        return None
    factor = bordered(jacobian, last_unit(len(x)), metric.binary)
    return _Linearised(character, jacobian, rows, factor, factor.is_singular())


def _after_rounding(
    system: PiecewiseSystem, metric: Metric, linear: _Linearised, point: _Evaluated, step: Array
) -> tuple[_Evaluated | None, bool, bool]:
    """Return where Newton goes on after a step of rounding, whether H falls, whether x is a root.

    Newton goes on beyond an interface, where H falls clearly, and where H is not zero or may be a
    double zero: where H is nearly constant or J singular, a step may vanish although H does not.
    """
    x, character, residual = point
    is_solution = is_solved(Selection(system, character), metric, x, linear.jacobian, residual)
    is_root = is_solution and _is_regular_zero(linear, metric, x, residual)
    is_root = is_root and not _misses(linear, metric, x, residual)
    there, crosses = x + step, False
    if metric.relative(step, x) > GUARD * EPS:
        beyond = system.character(there[:-1], float(there[-1]))
        crosses = not _is_same_cell(system, character, beyond)
    if is_solution and not crosses and _is_last(linear, x, residual):
        return None, False, is_root
    after = _evaluated(system, there)
    if crosses:
        return after, False, is_root
    falls, stays = _trend(linear, metric, x, residual, after[2])
    goes_on = falls or not is_solution or (linear.is_singular and not stays)
    return after if goes_on else None, falls, is_root and not (stays and linear.is_singular)


def _is_last(linear: _Linearised, x: Array, residual: Array) -> bool:
    """Tell whether no further step is needed: J is regular, and H small beside the terms at x.

    Where an unknown of 1e-25 stands in an exponential of 1e41, a step that is rounding of typical
    magnitudes changes H by far more than all that tells the rows apart.
    """
    terms = product(abs(linear.jacobian), np.abs(x))
    return not linear.is_singular and bool((np.abs(residual) <= HALF_DIGITS * terms).all())


def _trend(
    linear: _Linearised, metric: Metric, x: Array, before: Array, after: Array
) -> tuple[bool, bool]:
    """Tell whether all rows of H that are not small fall, and whether some row does not.

    Small beside the terms of a row: those of the unknowns at x, and what alpha changes over the
    interval. At a double zero H falls from step to step.
    """
    sizes = joined(HALF_DIGITS * np.abs(x[:-1]), SOLVED * metric.width)
    before, after = np.abs(before), np.abs(after)
    is_small, falls = after <= product(abs(linear.jacobian), sizes), after < FALLS * before
    stays = ~is_small & (after > STAYS * before)
    return bool(falls.any() and (falls | is_small).all()), bool(stays.any())


def _is_regular_zero(linear: _Linearised, metric: Metric, x: Array, residual: Array) -> bool:
    """Tell whether a residual, divided by coefficients, fits a correction that is rounding.

    The regularised step of a singular J may vanish although the residual does not. A row is
    flat where the coefficients of z are rounding of the coefficient of alpha, as far outside where
    a start has run away: rounding of the point is no part of the residual of a flat row.
    """
    by_z = product(abs(linear.jacobian), joined(metric.scale[:-1], 0.0))
    by_alpha = product(abs(linear.jacobian), joined(np.zeros(len(residual)), metric.width))
    rounding = CONVERGED * float(np.add.reduce(np.abs(x / metric.scale)))
    allowed = NEXT_IS_ROUNDING + np.where(by_z <= EPS * by_alpha, 0.0, rounding)
    return bool((np.abs(residual / linear.rows) <= allowed).all())


def _misses(linear: _Linearised, metric: Metric, x: Array, residual: Array) -> bool:
    """Tell whether a regularised step is tiny where the Newton step is not.

    A Jacobian that is singular in the units of the metric may be regular in balanced units, as
    where an exponential in every row hides what tells the rows apart.
    """
    if not linear.is_singular:
        return False
    with np.errstate(all="ignore"):
        factor = bordered(linear.jacobian, last_unit(len(x)), balanced_columns(linear.jacobian))
        if factor.is_singular():
            return False
        step = factor.solve(joined(residual, 0.0))
    return not metric.relative(step, x) <= NEXT_IS_ROUNDING


def _as_good_as_it_gets(
    root: Root, metric: Metric, known: Sequence[Array]
) -> tuple[Array, Array] | Failure:
    """Return a point whose residual no step reduces, if the point is a solution within rounding.

    A point within rounding of a known solution is the known solution again, and refused.
    """
    again = (replace(root, error=np.abs(metric.difference(root.x, other))) for other in known)
    if root.factor.is_singular() or not is_rounding(root) or any(map(is_rounding, again)):
        return Failure(FailureReason.NO_DESCENT)
    error = uncertainty(root)
    certain = has_digits(root.x, error, root.scale)
    return (root.x, error) if certain else Failure(FailureReason.NO_DIGITS)


def _direction(linear: _Linearised, residual: Array, metric: Metric) -> Array:
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


def _line_search(
    system: PiecewiseSystem,
    metric: Metric,
    rows: Array,
    known: Sequence[Array],
    start: _Evaluated,
    step: Array,
) -> _Evaluated | None:
    """Return the first of x + step, x + step / 2, ... that reduces the merit enough.

    The merit is the square of the deflated residual, with every row divided by the entry of
    ``rows``.
    """

    def merit(point: _Evaluated) -> float:
        scaled, factor = point[2] / rows, deflation(metric, known, point[0])
        return float(scaled.dot(scaled)) * factor * factor  # a power would raise an error

    length = 1.0
    with np.errstate(over="ignore"):  # the merit is infinite far away, where H is an exponential
        before = merit(start)
        for _ in range(MOST_HALVINGS_DEFLATED if known else MOST_HALVINGS):
            trial = _evaluated(system, start[0] + length * step)
            if merit(trial) <= (1.0 - 2.0 * ARMIJO * length) * before:
                return trial
            length *= 0.5
    return None
