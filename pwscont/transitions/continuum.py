"""Sets of infinitely many solutions at one alpha, as two equal equations have.

For piecewise-linear systems such sets are found exactly. For curved systems, a solution belongs to
such a set if dH/dz is singular there and at another solution nearby.

Failure modes and answers
-------------------------
- A branch point or a double root is singular, too. From there no other solution lies in the null
  direction of dH/dz: Newton's method from a point aside does not converge, or comes back.
- Where dH/dz is singular at all solutions, Newton's step is not unique: the shortest step is taken.
- Jacobians may be made by differences: a singular value below the error of these counts as zero.
- Between two values of alpha with such sets there may be none: the middle is asked for as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.linalg import lstsq, svd

from pwscont.basics.arrays import Array, are_finite, dense
from pwscont.basics.rounding import EPS
from pwscont.curve.metric import Metric
from pwscont.enumeration import Filled, filled, solve_slice
from pwscont.system.box import Box
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    has_too_many_tests,
    number_of_cells,
)

#: Largest singular value that counts as zero, as a part of the largest: the error of differences.
SINGULAR = EPS ** (1.0 / 3.0)
#: Distance at which another solution is looked for, as a part of 1 plus the length of a solution.
BESIDE = 0.01
#: Most shortest steps to another solution; beside a double root, steps shrink more slowly.
MOST_STEPS = 6
#: Longest step to a solution that has arrived, as a part of 1 plus the length of the solution.
ARRIVED = EPS**0.5
#: Most cells of a system that is asked for such sets.
MANY_CELLS = 4**10
#: Distance from an end of a stretch at which the stretch is asked for, as a part of the stretch.
NEAR_AN_END = 1e-3
#: Most unknowns for which a singular value decomposition costs little beside a search.
MOST_UNKNOWNS = 200


def is_one_of_many(system: PiecewiseSystem, metric: Metric, x: Array) -> bool:
    """Tell whether a solution of a curved system belongs to solutions that fill a curve or more.

    ``system``: systems that are affine in z at fixed alpha have exact answers: see
    :func:`~pwscont.enumeration.filled.filled`.
    ``x``, shape (n + 1,): a solution and the value of alpha.
    """
    if isinstance(system, SlicewiseLinearSystem) or system.size > MOST_UNKNOWNS:
        return False
    scale, alpha = metric.scale[:-1], float(x[-1])
    y = x[:-1] / scale
    null = _null_direction(system, scale, y, alpha)
    if null is None:
        return False
    way = BESIDE * (1.0 + float(np.linalg.norm(y)))
    for start in (y + way * null, y - way * null):
        other = solution_near(system, scale, start, alpha)
        if other is None or np.linalg.norm(other - y) < 0.5 * way:
            continue
        if _null_direction(system, scale, other, alpha) is not None:
            return True
    return False


def solution_near(system: PiecewiseSystem, scale: Array, y: Array, alpha: float) -> Array | None:
    """Return the solution to which a few shortest Newton steps lead at fixed alpha, else None.

    States are in typical magnitudes ``scale``.
    """
    for _ in range(MOST_STEPS):
        linear = equations_in_magnitudes(system, y * scale, alpha, scale)
        if linear is None:
            return None
        residual, jacobian, _ = linear
        step = lstsq(jacobian, -residual, cond=SINGULAR)[0]
        y = y + step
        if np.linalg.norm(step) <= ARRIVED * (1.0 + np.linalg.norm(y)):
            return y
    return None


def filled_parts(
    system: PiecewiseSystem, metric: Metric, alphas: list[float], one_of_many: list[Array]
) -> Iterator[Filled]:
    """Yield the parts of the interval with infinitely many solutions.

    Exact for piecewise-linear systems. Otherwise the special points and the middles between special
    points are asked for.

    ``system``: nothing is asked of systems that are affine in z at fixed alpha and have many cells.
    ``alphas``: the values of alpha of special points, and both ends of the interval.
    ``one_of_many``, shape (n + 1,): known solutions of a curved system that belong to infinitely
    many, see :func:`is_one_of_many`.
    """
    if not isinstance(system, SlicewiseLinearSystem):
        yield from _beside(system, metric, alphas, one_of_many)
    elif has_too_many_tests(system) or number_of_cells(system.blocks()) > MANY_CELLS:
        return
    elif isinstance(system, PiecewiseLinearSystem):
        box = Box.of(system)
        yield from filled(system, metric.scale[:-1], metric.interval, (box.lower, box.upper))
    else:
        yield from _asked(system, metric, sorted(set(alphas)))


def _asked(system: SlicewiseLinearSystem, metric: Metric, alphas: list[float]) -> Iterator[Filled]:
    """Yield the values of alpha with infinitely many solutions, and stretches between values."""
    for alpha in alphas:
        if solve_slice(system, metric, alpha).faces:
            yield Filled(alpha, alpha, True, True, 0.0)
    for lo, hi in pairwise(alphas):
        if solve_slice(system, metric, 0.5 * (lo + hi)).faces:
            yield Filled(lo, hi, False, False, 0.0)


def _beside(
    system: PiecewiseSystem, metric: Metric, alphas: list[float], points: list[Array]
) -> Iterator[Filled]:
    """Yield the values of alpha of such solutions, and the stretches filled beside them."""
    known, scale = {float(x[-1]): x for x in points}, metric.scale[:-1]

    def is_filled(starts: list[Array], alpha: float) -> bool:
        """Tell whether any of some solutions leads to one of infinitely many at another alpha."""
        found = (solution_near(system, scale, x[:-1] / scale, alpha) for x in starts)
        places = (np.append(y * scale, alpha) for y in found if y is not None)
        return any(is_one_of_many(system, metric, place) for place in places)

    for alpha in known:
        yield Filled(alpha, alpha, True, True, 0.0)
    for lo, hi in pairwise(sorted({*alphas, *known})):
        starts = [known[end] for end in (lo, hi) if end in known]
        places = [0.5 * (lo + hi)]
        places += [] if hi in known else [hi - NEAR_AN_END * (hi - lo)]
        places += [] if lo in known else [lo + NEAR_AN_END * (hi - lo)]
        if starts and all(is_filled(starts, alpha) for alpha in places):
            yield Filled(lo, hi, lo in known, hi in known, 0.0)


def equations_in_magnitudes(
    system: PiecewiseSystem, z: Array, alpha: float, scale: Array
) -> tuple[Array, Array, Array] | None:
    """Return scaled H and dH/dz, or dH/d(z, alpha), and the divisors of rows; None if infinite."""
    character = system.character(z, alpha)
    residual = residual_at(system, z, alpha, character)
    jacobian = dense(jacobian_at(system, z, alpha, character))[:, : len(scale)] * scale
    rows = np.abs(jacobian).max(axis=1)
    rows[rows == 0.0] = 1.0
    if not np.isfinite(rows).all():
        return None
    residual, jacobian = residual / rows, jacobian / rows[:, np.newaxis]
    return (residual, jacobian, rows) if are_finite(residual) else None


def _null_direction(system: PiecewiseSystem, scale: Array, y: Array, alpha: float) -> Array | None:
    """Return the unit direction in which dH/dz vanishes, None where dH/dz is regular."""
    linear = equations_in_magnitudes(system, y * scale, alpha, scale)
    if linear is None:
        return None
    _, sizes, directions = svd(linear[1])
    return directions[-1] if sizes[-1] <= SINGULAR * sizes[0] else None
