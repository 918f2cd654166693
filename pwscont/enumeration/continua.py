"""Sets of infinitely many solutions at one alpha, as two equal equations have.

For piecewise-linear systems such sets are found exactly. With alpha as a further unknown, the
solutions in a closed cell are a polyhedron: a segment where the cell is regular. A polyhedron of
two or more dimensions fills all values of alpha between two ends; a polyhedron at a single alpha
fills a single value. The face at an end is looked at alone, for a polyhedron may end in a point.

For curved systems, a solution belongs to such a set if dH/dz is singular there and at another
solution nearby: a branch point or a double root is singular, too, but from there Newton's method,
started aside in the null direction of dH/dz, does not converge, or comes back. The shortest Newton
step is taken, because dH/dz is singular at all solutions of a set. A singular value below the error
of Jacobians by differences counts as zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import final

import numpy as np
from scipy.linalg import lstsq, null_space, svd

from pwscont.basics.arrays import Array, are_finite, dense, generic
from pwscont.basics.budget import check_budget
from pwscont.basics.rounding import EPS
from pwscont.curve.metric import Metric
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.options import Problem, problem_with_alpha
from pwscont.enumeration.polyhedron import Polyhedron, inside_of
from pwscont.enumeration.slices import solve_slice
from pwscont.enumeration.tree import leaves
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
SINGULAR_VALUE = EPS ** (1.0 / 3.0)
#: Distance at which another solution is looked for, as a part of 1 plus the length of a solution.
DISTANCE_TO_OTHER = 0.01
#: Most shortest steps to another solution; beside a double root, steps shrink more slowly.
MOST_SHORTEST_STEPS = 6
#: Longest step to a solution that has arrived, as a part of 1 plus the length of the solution.
LONGEST_LAST_STEP = EPS**0.5
#: Where H vanishes along the way to a point, as a part of the way; H is tiny below this size.
NEAR_ZERO, TINY = 1e-3, 1e-200
#: Most cells of a system that is asked for such sets.
MOST_CELLS_FILLED = 4**10
#: Distance from an end of a stretch at which the stretch is asked for, as a part of the stretch.
NEAR_AN_END = 1e-3
#: Most unknowns for which a singular value decomposition costs little beside a search.
MOST_UNKNOWNS_OF_SVD = 200
#: Cells are cut off by linear programs before anything else is done (see :func:`leaves`).
CUT_OFF = 1, 1e-9
#: Largest component along alpha, in widths of the interval, of a unit direction at a single alpha.
LEVEL_DIRECTION = EPS**0.5


def is_one_of_many(system: PiecewiseSystem, metric: Metric, x: Array) -> bool:
    """Tell whether a solution of a curved system belongs to solutions that fill a curve or more.

    ``system``: not one that is affine in z at fixed alpha, which has exact answers.
    ``x``, shape (n + 1,): a solution and the value of alpha.
    """
    if isinstance(system, SlicewiseLinearSystem) or system.size > MOST_UNKNOWNS_OF_SVD:
        return False
    scale, alpha = metric.scale[:-1], float(x[-1])
    y = x[:-1] / scale
    null = _null_direction(system, scale, y, alpha)
    if null is None:
        return False
    way = DISTANCE_TO_OTHER * (1.0 + float(np.linalg.norm(y)))
    for start in (y + way * null, y - way * null):
        other = solution_near(system, scale, start, alpha)
        if other is None or np.linalg.norm(other - y) < 0.5 * way:
            continue
        if _null_direction(system, scale, other, alpha) is not None:
            return True
    return False


def underflows(system: PiecewiseSystem, metric: Metric, x: Array) -> bool:
    """Tell whether H is zero at a point, or next to zero, only because H is as small as it can be.

    On the way from a generic place H is tiny before H is zero, as exp(-z^2) is; max(z, 0) is not.
    """
    scale, alpha = metric.scale[:-1], float(x[-1])
    start = Box.of(system).centre(scale) + scale * generic(len(scale))

    def size(part: float) -> float:
        z = start + part * (x[:-1] - start)
        return float(np.abs(residual_at(system, z, alpha, system.character(z, alpha))).max())

    inside, beyond = 0.0, 1.0
    if size(beyond) > TINY or size(inside) <= TINY:
        return False
    while beyond - inside > NEAR_ZERO:
        middle = 0.5 * (inside + beyond)
        inside, beyond = (middle, beyond) if size(middle) > TINY else (inside, middle)
    return size(inside) < sqrt(TINY)


def solution_near(system: PiecewiseSystem, scale: Array, y: Array, alpha: float) -> Array | None:
    """Return the solution to which a few shortest Newton steps lead at fixed alpha, else None.

    States are in typical magnitudes ``scale``.
    """
    for _ in range(MOST_SHORTEST_STEPS):
        linear = equations_in_magnitudes(system, y * scale, alpha, scale)
        if linear is None:
            return None
        residual, jacobian, _ = linear
        step = lstsq(jacobian, -residual, cond=SINGULAR_VALUE)[0]
        y = y + step
        longest = LONGEST_LAST_STEP * (1.0 + np.linalg.norm(y))
        if np.linalg.norm(step) <= longest:  # a cut off direction may have hidden the residual
            arrived = equations_in_magnitudes(system, y * scale, alpha, scale)
            return y if arrived and np.linalg.norm(arrived[0]) <= longest else None
    return None


@final
@dataclass(frozen=True, slots=True)
class Continuum:
    """An interval of alpha with infinitely many solutions."""

    lo: float
    hi: float
    lo_closed: bool  # whether the end belongs to the interval
    hi_closed: bool
    blur: float  # largest distance by which rounding may have moved the ends


def find_continua(
    system: PiecewiseSystem, metric: Metric, alphas: list[float], one_of_many: list[Array]
) -> Iterator[Continuum]:
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
    elif has_too_many_tests(system) or number_of_cells(system.blocks()) > MOST_CELLS_FILLED:
        return
    elif isinstance(system, PiecewiseLinearSystem):
        yield from _in_linear_pieces(system, metric)
    else:
        yield from _asked(system, metric, sorted(set(alphas)))


def _asked(
    system: SlicewiseLinearSystem, metric: Metric, alphas: list[float]
) -> Iterator[Continuum]:
    """Yield the values of alpha with infinitely many solutions, and stretches between values."""
    for alpha in alphas:
        if solve_slice(system, metric, alpha).faces:
            yield Continuum(alpha, alpha, True, True, 0.0)
    for lo, hi in pairwise(alphas):
        if solve_slice(system, metric, 0.5 * (lo + hi)).faces:
            yield Continuum(lo, hi, False, False, 0.0)


def _beside(
    system: PiecewiseSystem, metric: Metric, alphas: list[float], points: list[Array]
) -> Iterator[Continuum]:
    """Yield the values of alpha of such solutions, and the stretches filled beside them."""
    known, scale = {float(x[-1]): x for x in points}, metric.scale[:-1]

    def is_filled(starts: list[Array], alpha: float) -> bool:
        """Tell whether any of some solutions leads to one of infinitely many at another alpha."""
        found = (solution_near(system, scale, x[:-1] / scale, alpha) for x in starts)
        places = (np.append(y * scale, alpha) for y in found if y is not None)
        return any(is_one_of_many(system, metric, place) for place in places)

    for alpha in known:
        yield Continuum(alpha, alpha, True, True, 0.0)
    for lo, hi in pairwise(sorted({*alphas, *known})):
        starts = [known[end] for end in (lo, hi) if end in known]
        places = [0.5 * (lo + hi)]
        places += [] if hi in known else [hi - NEAR_AN_END * (hi - lo)]
        places += [] if lo in known else [lo + NEAR_AN_END * (hi - lo)]
        if starts and all(is_filled(starts, alpha) for alpha in places):
            yield Continuum(lo, hi, lo in known, hi in known, 0.0)


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
    return directions[-1] if sizes[-1] <= SINGULAR_VALUE * sizes[0] else None


def _in_linear_pieces(system: PiecewiseLinearSystem, metric: Metric) -> Iterator[Continuum]:
    """Yield where infinitely many solutions fill a segment or more of a cell."""
    problem, (lo, hi) = problem_with_alpha(system, metric), metric.interval
    if problem is None:
        return
    for choices in leaves(problem, *CUT_OFF):
        may_fill = np.ones(len(choices), dtype=bool)
        if choices.directions.shape[-1] == 1:  # then only a line at a single alpha
            rise = choices.directions[..., 0] @ problem.basis[-1] / (hi - lo)
            may_fill = np.abs(rise) <= LEVEL_DIRECTION
        for k in np.flatnonzero(may_fill).tolist():
            check_budget()
            yield from _in_cell(problem, choices[k : k + 1], metric.interval)


def _in_cell(problem: Problem, one: Choices, interval: tuple[float, float]) -> Iterator[Continuum]:
    """Yield the interval that the solutions of a cell fill, if any."""
    cell = inside_of(problem, one)
    if cell is None or not cell[2].shape[1]:
        return
    around, point, basis, rounding = cell
    width = interval[1] - interval[0]
    origin, row = float(problem.origin[-1]) / width, problem.basis[-1] / width
    here = origin + float(row @ (one.starts[0] + one.directions[0] @ point))
    ramp, blur = row @ one.directions[0] @ basis, rounding * width
    if (np.abs(ramp) <= LEVEL_DIRECTION).all():
        alpha = interval[0] + width * here
        yield Continuum(alpha, alpha, True, True, blur)
    elif len(ramp) > 1:
        flat = Polyhedron.of(around.matrix @ basis, around.moved(point).vector, rounding)
        assert flat is not None, "the inequalities hold around a point inside"
        (lo, lo_closed), (hi, hi_closed) = (
            _end(flat, sign * ramp, ramp, rounding) or ((sign + 1) / 2 - here, False)
            for sign in (-1, 1)
        )
        lo, hi = (interval[0] + width * (here + end) for end in (lo, hi))
        yield Continuum(lo, hi, lo_closed, hi_closed, blur)


def _end(flat: Polyhedron, way: Array, ramp: Array, rounding: float) -> tuple[float, bool] | None:
    """Return the rise to an end, and whether the end is more than a point; None if hidden."""
    w = flat.farthest(way)
    if w is None:
        return None
    level = null_space(ramp[np.newaxis])
    at_end = Polyhedron.of(flat.matrix @ level, flat.moved(w).vector, rounding)
    inside = at_end and at_end.inside(rounding)
    return float(ramp @ w), bool(inside and inside[1].shape[1])
