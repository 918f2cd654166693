"""Semismooth Newton at fixed alpha, for a start that is only rough.

Qi and Sun (1993); damping by the merit function |H|^2 / 2 as in Facchinei and Pang (2003),
chapter 8.

Failure modes and answers
-------------------------
- A singular element of the Jacobian: the step is regularised (Levenberg and Marquardt).
- Cycling between cells: the merit function must fall, by Armijo's rule.
- A stationary point of the merit function that is no solution: the failure says so.
- Equations in different units: each row is divided by its largest scaled coefficient.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pwscont.foundation.arrays import Array, Matrix
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.foundation.rounding import CONVERGED
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.linalg import factor
from pwscont.numerics.metric import Metric

MOST_ITERATIONS = 100
MOST_HALVINGS = 30
ARMIJO = 1e-4


def semismooth_newton(
    system: PiecewiseSystem, metric: Metric, z: Array, alpha: float
) -> tuple[Array, Array] | Failure:
    """Solve H(z, alpha) = 0 for z from a rough start.

    Returns
    -------
    x, error : ndarray, shape (n + 1,)
        The solution (z, alpha) and the size of the last correction; or a Failure.
    """
    x = np.append(z, alpha)
    for _ in range(MOST_ITERATIONS):
        character = system.character(x[:-1], alpha)
        residual = system.residual(x[:-1], alpha, character)
        jacobian = _state_part(system.jacobian(x[:-1], alpha, character))
        if not np.isfinite(residual).all():
            return Failure(Trouble.NOT_FINITE)
        rows = _row_scale(jacobian, metric)
        step = _direction(jacobian, residual, rows, metric)
        if metric.relative(step, x) <= CONVERGED:
            return x + step, np.abs(step)
        damped = _line_search(system, x, step, residual / rows, rows)
        if damped is None:
            return Failure(Trouble.NOT_CONVERGED)
        x = damped
    return Failure(Trouble.NOT_CONVERGED)


def _state_part(jacobian: Matrix) -> Matrix:
    """Return the columns that belong to z."""
    return jacobian.tocsc()[:, :-1] if sp.issparse(jacobian) else jacobian[:, :-1]


def _row_scale(jacobian: Matrix, metric: Metric) -> Array:
    """Return the largest scaled coefficient of each row."""
    scaled = abs(jacobian) @ metric.scale[:-1]
    return np.where(scaled > 0.0, scaled, 1.0)


def _direction(jacobian: Matrix, residual: Array, rows: Array, metric: Metric) -> Array:
    """Return the Newton step (with a zero for alpha), regularised where J is singular."""
    lu = factor(jacobian, metric.binary[:-1])
    if not lu.is_singular():
        return np.append(-lu.solve(residual), 0.0)
    dense = jacobian.toarray() if sp.issparse(jacobian) else jacobian
    scaled = dense * metric.scale[:-1] / rows[:, np.newaxis]
    damping = np.sqrt(np.linalg.norm(residual / rows)) * np.eye(len(rows))
    system = np.vstack([scaled, damping])
    step = np.linalg.lstsq(system, np.append(-residual / rows, np.zeros(len(rows))))[0]
    return np.append(step * metric.scale[:-1], 0.0)


def _line_search(
    system: PiecewiseSystem, x: Array, step: Array, before: Array, rows: Array
) -> Array | None:
    """Return the first of x + step, x + step / 2, ... that reduces the merit enough."""
    merit, length = float(before @ before), 1.0
    for _ in range(MOST_HALVINGS):
        trial = x + length * step
        z, alpha = trial[:-1], float(trial[-1])
        after = system.residual(z, alpha, system.character(z, alpha)) / rows
        if float(after @ after) <= (1.0 - 2.0 * ARMIJO * length) * merit:
            return trial
        length *= 0.5
    return None
