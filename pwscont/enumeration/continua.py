"""Sets of infinitely many solutions at one alpha, as two equal equations have.

For piecewise-linear systems such sets are found exactly: with alpha as a further unknown, the
solutions in a closed cell are a polyhedron. For curved systems, a solution belongs to such a set if
dH/dz is singular there and at another solution nearby, found from aside in the null direction of
dH/dz: from a branch point or a double root Newton's method does not converge there, or comes back.
The shortest Newton step is taken, because dH/dz is singular at all solutions of a set.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from math import sqrt
from typing import final

import numpy as np
from numpy.linalg import norm
from scipy.linalg import lstsq, null_space, svd

from pwscont.basics.arrays import Array, dense, generic
from pwscont.basics.budget import check_budget
from pwscont.basics.rounding import EPS, HALF_DIGITS
from pwscont.curve.crossing import FULL_RANK
from pwscont.curve.metric import Metric
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.options import Problem, problem_with_alpha
from pwscont.enumeration.polyhedron import Polyhedron, inside_of
from pwscont.enumeration.slices import solve_slice
from pwscont.enumeration.tree import leaves
from pwscont.system.box import Box
from pwscont.system.contract import equations_in_magnitudes, residual_at
from pwscont.system.system import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    has_too_many_tests,
    number_of_cells,
)

#: Distances at which another solution is looked for, as parts of 1 plus the length of a solution.
#: The smaller one is for places beside known solutions of the kind: a multiple root looks alike.
DISTANCES_TO_OTHER = 0.01, 0.001
#: H at another solution is at most this many times as large as H here, plus what rounding leaves.
MORE_RESIDUAL, LEFT_OVER = 4.0, 1e-13
#: Most shortest steps to another solution; beside a double root, steps shrink more slowly.
MOST_SHORTEST_STEPS = 6
#: Where H vanishes along the way to a point, as a part of the way; H is tiny below this size.
NEAR_ZERO, UNDERFLOWN = 1e-3, 1e-200
#: Most cells of a system that is asked for such sets.
MOST_CELLS_FILLED = 4**10
#: Distances from an end of a stretch, as parts of the stretch. That one of these places is filled
#: is enough, for the solutions may shrink to a point at the end.
NEAR_AN_END = 1e-1, 1e-2, 1e-3
#: A place in a stretch that is special by no symmetry, as a part of the stretch.
OFF_CENTRE = 0.5 * (3.0 - 5.0**0.5)
#: Most tests near a place of which all cells are looked at.
MOST_TESTS_NEAR = 6
#: Number of known places on each side of a gap from which a place in the gap is looked for.
STARTS = 2
#: Most unknowns for which a singular value decomposition costs little beside a search.
MOST_UNKNOWNS_OF_SVD = 200
#: Cells are cut off by linear programs before anything else is done (see :func:`leaves`).
CUT_OFF = 1, 1e-9


def is_one_of_many(system: PiecewiseSystem, metric: Metric, x: Array) -> bool:
    """Tell whether a solution of a curved system belongs to solutions that fill a curve or more."""
    if isinstance(system, SlicewiseLinearSystem) or system.size > MOST_UNKNOWNS_OF_SVD:
        return False
    scale, alpha = metric.scale[:-1], float(x[-1])
    y = x[:-1] / scale
    return _is_singular(system, scale, y, alpha) and _has_others(system, scale, y, alpha)


def _has_others(
    system: PiecewiseSystem,
    scale: Array,
    y: Array,
    alpha: float,
    parts: tuple[float, ...] = DISTANCES_TO_OTHER[:1],
) -> bool:
    """Tell whether solutions beside a place fill a curve or more, in any of the cells there."""
    here, size = equations_in_magnitudes(system, y * scale, alpha, scale), 1.0 + float(norm(y))
    most = MORE_RESIDUAL * float(norm(here[0])) / size + LEFT_OVER if here else 0.0
    for way in (part * size for part in parts):
        for direction in _level_directions(system, scale, y, alpha, way):
            other = solution_near(system, scale, y + way * direction, alpha, most)
            if other is None or not 0.5 * way <= norm(other - y) <= 2.0 * way:
                continue
            if _is_singular(system, scale, other, alpha):
                return True
    return False


def _level_directions(
    system: PiecewiseSystem, scale: Array, y: Array, alpha: float, way: float
) -> Iterator[Array]:
    """Yield unit directions of lines in which dH/dz of a cell vanishes and that enter the cell.

    Among the cells are all that meet within the distance ``way``, unless these are too many.
    """
    z, here = y * scale, system.character(y * scale, alpha)
    gradients = dense(system.test_jacobian(z, alpha))[:, :-1] * scale
    reached = way * np.linalg.norm(gradients, axis=1)
    near = np.flatnonzero(np.abs(system.test_functions(z, alpha)) <= reached)
    near = near if len(near) <= MOST_TESTS_NEAR else near[:0]
    for signs in product((1.0, -1.0), repeat=len(near)):
        cell = here.with_signs(near.tolist(), [sign > 0.0 for sign in signs])
        linear = equations_in_magnitudes(system, z, alpha, scale, cell)
        if linear is None or not (null := _null_space(linear[1])).shape[1]:
            continue
        sides = np.array(signs)[:, np.newaxis] * gradients[near] @ null
        box = np.vstack([np.eye(null.shape[1]), -np.eye(null.shape[1])])
        values = np.append(np.zeros(len(sides)), np.ones(len(box)))
        cone = Polyhedron.of(np.vstack([sides, box]), values, FULL_RANK)
        inside, along = (cone and cone.inside(FULL_RANK)) or (np.zeros(0), np.zeros((0, 0)))
        for end in (inside + w for v in along.T for w in (v, -v)):
            yield null @ end / norm(end)


def underflows(system: PiecewiseSystem, metric: Metric, x: Array) -> bool:
    """Tell whether H is zero at a point, or next to zero, only because H is as small as it can be.

    On the way from a generic place H is tiny before H is zero, as exp(-z^2) is; max(z, 0) is not.
    Beside a pole derivatives may be so large that rounding of z hides all else in a row.
    """
    scale, alpha = metric.scale[:-1], float(x[-1])
    start = Box.of(system).centre(scale) + scale * generic(len(scale))
    far, near = (equations_in_magnitudes(system, z, alpha, scale) for z in (x[:-1], start))
    if far and near and (EPS * far[2] > near[2]).any():
        return True

    def size(part: float) -> float:
        z = start + part * (x[:-1] - start)
        return float(np.abs(residual_at(system, z, alpha, system.character(z, alpha))).max())

    inside, beyond = 0.0, 1.0
    if size(beyond) > UNDERFLOWN or size(inside) <= UNDERFLOWN:
        return False
    while beyond - inside > NEAR_ZERO:
        middle = 0.5 * (inside + beyond)
        inside, beyond = (middle, beyond) if size(middle) > UNDERFLOWN else (inside, middle)
    return size(inside) < sqrt(UNDERFLOWN)


def solution_near(
    system: PiecewiseSystem, scale: Array, y: Array, alpha: float, most: float = HALF_DIGITS
) -> Array | None:
    """Return the solution to which a few shortest Newton steps lead at fixed alpha, else None.

    States are in typical magnitudes ``scale``; ``most`` is the largest H of a solution.
    """
    for _ in range(MOST_SHORTEST_STEPS):
        linear = equations_in_magnitudes(system, y * scale, alpha, scale)
        if linear is None:
            return None
        residual, jacobian, _ = linear
        step = lstsq(jacobian, -residual, cond=FULL_RANK)[0]
        y = y + step
        size = 1.0 + norm(y)
        if norm(step) <= HALF_DIGITS * size:
            arrived = equations_in_magnitudes(system, y * scale, alpha, scale)
            # a cut off direction may have hidden the residual
            return y if arrived and norm(arrived[0]) <= most * size else None
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
    system: PiecewiseSystem,
    metric: Metric,
    alphas: list[float],
    one_of_many: list[Array],
    doubtful: list[Array],
) -> Iterator[Continuum]:
    """Yield the parts of the interval with infinitely many solutions.

    ``alphas``: the values of alpha of special points, and both ends of the interval.
    ``one_of_many``: known solutions of a curved system that belong to infinitely many.
    ``doubtful``: special points at which not all ways on are curves.
    """
    if not isinstance(system, SlicewiseLinearSystem):
        if system.size <= MOST_UNKNOWNS_OF_SVD:
            yield from _beside(system, metric, alphas, one_of_many, doubtful)
    elif has_too_many_tests(system) or number_of_cells(system.blocks()) > MOST_CELLS_FILLED:
        return
    elif isinstance(system, PiecewiseLinearSystem):
        yield from _in_linear_pieces(system, metric)
    else:  # single values of alpha, and stretches between values
        known = sorted(set(alphas))
        for lo, hi in [*zip(known, known, strict=True), *pairwise(known)]:
            middle, beside = 0.5 * (lo + hi), lo + OFF_CENTRE * (hi - lo)
            if solve_slice(system, metric, middle).faces:  # by symmetry, perhaps there alone
                is_wide = lo < hi and bool(solve_slice(system, metric, beside).faces)
                ends = (lo, hi) if is_wide else (middle, middle)
                yield Continuum(*ends, not is_wide, not is_wide, 0.0)


def _beside(
    system: PiecewiseSystem,
    metric: Metric,
    alphas: list[float],
    points: list[Array],
    doubtful: list[Array],
) -> Iterator[Continuum]:
    """Yield the values of alpha of such solutions, and the stretches filled beside them."""
    known, scale = {float(x[-1]): x for x in points}, metric.scale[:-1]
    for x in doubtful:
        if x[-1] not in known and _has_others(system, scale, x[:-1] / scale, float(x[-1])):
            known[float(x[-1])] = x
    found, every = sorted(known), sorted({*alphas, *known})

    def is_filled(lo: float, hi: float, alpha: float) -> bool:
        """Tell whether solutions at the values next to a gap lead to one of many at alpha."""
        below, above = found[: bisect_right(found, lo)], found[bisect_left(found, hi) :]
        for end in below[-STARTS:] + above[:STARTS]:
            y = solution_near(system, scale, known[end][:-1] / scale, alpha)
            if y is not None and _has_others(system, scale, y, alpha, DISTANCES_TO_OTHER):
                known[alpha] = np.append(y * scale, alpha)
                insort(found, alpha)
                return True
        return False

    filled = {alpha for alpha in every if alpha in known or is_filled(alpha, alpha, alpha)}
    gaps = list(pairwise(every))
    for lo, hi in (*gaps, *reversed(gaps)):  # from filled gaps to the next, in both directions
        middle, ends = 0.5 * (lo + hi), ((lo, hi), (hi, lo))
        if filled.isdisjoint((lo, hi)) or not is_filled(lo, hi, middle):
            continue
        places = ([a + part * (b - a) for part in NEAR_AN_END] for a, b in ends if a not in filled)
        if all(
            any(is_filled(min(middle, at), max(middle, at), at) for at in row) for row in places
        ):
            filled |= {end for end in (lo, hi) if end in filled or is_filled(end, end, end)}
            yield Continuum(lo, hi, False, False, 0.0)
    for alpha in filled:
        yield Continuum(alpha, alpha, True, True, 0.0)


def _is_singular(system: PiecewiseSystem, scale: Array, y: Array, alpha: float) -> bool:
    """Tell whether dH/dz is singular at a place."""
    linear = equations_in_magnitudes(system, y * scale, alpha, scale)
    return linear is not None and bool(_null_space(linear[1]).shape[1])


def _null_space(matrix: Array) -> Array:
    """Return unit columns that span what the matrix sends to zero, shape (n, d)."""
    _, sizes, directions = svd(matrix)
    return directions[sizes <= FULL_RANK * sizes[0]].T


def _in_linear_pieces(system: PiecewiseLinearSystem, metric: Metric) -> Iterator[Continuum]:
    """Yield where infinitely many solutions fill a segment or more of a cell."""
    problem, (lo, hi) = problem_with_alpha(system, metric), metric.interval
    if problem is None:
        return
    for choices in leaves(problem, *CUT_OFF):
        may_fill = np.ones(len(choices), dtype=bool)
        if choices.directions.shape[-1] == 1:  # then only a line at a single alpha
            rise = choices.directions[..., 0] @ problem.basis[-1] / (hi - lo)
            may_fill = np.abs(rise) <= HALF_DIGITS
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
    if (np.abs(ramp) <= HALF_DIGITS).all():
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
