"""Sets of solutions that fill a segment or an area.

With alpha as a further unknown, the solutions in a closed cell of a piecewise-linear system are a
polyhedron: a segment where the cell is regular. A polyhedron of two or more dimensions fills all
values of alpha between two ends; a polyhedron at a single alpha fills a single value.

Failure modes and answers
-------------------------
- Many cells: linear programs cut off the cells that no solution of the interval reaches, as in the
  search for all solutions at a fixed alpha.
- A polyhedron ends in a point, or in a segment: the face at the end is looked at alone.
- A polyhedron is flat, because inequalities hold with equality only: the dimension of the flat
  polyhedron counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.linalg import null_space

from pwscont.basics.arrays import Array, own_dense
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.enumeration.choices import SLACK, Choices
from pwscont.enumeration.options import Problem, aside, in_modes, most_modes, problem_of
from pwscont.enumeration.polyhedron import Polyhedron, polyhedron_of, satisfies
from pwscont.enumeration.tree import Prices, leaves
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.promises import refuse_bent
from pwscont.system.system import PiecewiseLinearSystem

#: Cells are cut off by linear programs before anything else is done.
CUT_OFF = Prices(1, 1e-9)
#: Largest component along alpha, in widths of the interval, of a unit direction at a single alpha.
LEVEL = EPS**0.5


@final
@dataclass(frozen=True, slots=True)
class Filled:
    """An interval of alpha with infinitely many solutions."""

    lo: float
    hi: float
    lo_closed: bool  # whether the end belongs to the interval
    hi_closed: bool
    blur: float  # largest distance by which rounding may have moved the ends


def filled(
    system: PiecewiseLinearSystem,
    scale: Array,
    interval: tuple[float, float],
    bounds: tuple[Array, Array],
) -> list[Filled]:
    """Return where in an interval infinitely many solutions fill a segment or more of a cell.

    ``system``: a system whose blocks have been checked.
    ``scale``, shape (n,): typical magnitudes of z.
    ``bounds``, shape (n,): least and largest values of z; infinite for unknowns without bounds.
    """
    problem = _with_alpha(system, scale, interval, bounds)
    found: list[Filled] = []
    if problem is None:
        return found
    for choices in leaves(problem, CUT_OFF):
        for k in np.flatnonzero(_may_fill(problem, choices, interval)).tolist():
            check_budget()
            found += _filled_by(problem, choices[k : k + 1], interval)
    return found


def _with_alpha(
    system: PiecewiseLinearSystem,
    scale: Array,
    interval: tuple[float, float],
    bounds: tuple[Array, Array],
) -> Problem | None:
    """Return the problem for the unknowns (z, alpha - lo), None for a problem without solution."""
    lo, hi = interval
    n, blocks = system.size, system.blocks()
    x, dx = np.append(np.zeros(n), lo), aside(scale)
    dx[-1] = hi - lo
    tests = np.array(system.test_functions(x[:-1], lo), dtype=float)
    slices = []
    for k in range(most_modes(blocks)):
        character: Character = in_modes(blocks, k, len(tests))
        jacobian = own_dense(jacobian_at(system, x[:-1], lo, character))
        residual = residual_at(system, x[:-1], lo, character)
        refuse_bent(system, character, x, dx, residual, jacobian)
        slices.append((jacobian, residual))
    K = own_dense(system.test_jacobian(x[:-1], lo))
    least, most = np.append(bounds[0], 0.0), np.append(bounds[1], hi - lo)
    unit, below, above = np.eye(n + 1), np.isfinite(least), np.isfinite(most)
    within = np.vstack([unit[below], -unit[above]]), np.append(-least[below], most[above])
    return problem_of(system, slices, (K, tests), within, np.append(scale, hi - lo))


def _may_fill(problem: Problem, choices: Choices, interval: tuple[float, float]) -> Array:
    """Tell which choices leave more than a line, or a line at a single alpha."""
    if choices.directions.shape[-1] != 1:
        return np.ones(len(choices), dtype=bool)
    rise = choices.directions[..., 0] @ problem.basis[-1] / (interval[1] - interval[0])
    return np.asarray(np.abs(rise) <= LEVEL)


def _filled_by(problem: Problem, one: Choices, interval: tuple[float, float]) -> Iterator[Filled]:
    """Yield the interval that the solutions of a cell fill, if any."""
    rounding = min(GUARD * float(one.rounding[0]), SLACK)
    if not satisfies(problem.chosen(one.picks[:, 0]), one.starts[0]):
        return
    around = polyhedron_of(problem, one, rounding)
    inside = around and around.inside(rounding)
    if around is None or inside is None or not inside[1].shape[1]:
        return
    point, basis = inside
    width = interval[1] - interval[0]
    origin, row = float(problem.origin[-1]) / width, problem.basis[-1] / width
    here = origin + float(row @ (one.starts[0] + one.directions[0] @ point))
    ramp, blur = row @ one.directions[0] @ basis, rounding * width
    if (np.abs(ramp) <= LEVEL).all():
        alpha = interval[0] + width * here
        yield Filled(alpha, alpha, True, True, blur)
    elif len(ramp) > 1:
        flat = Polyhedron.of(around.matrix @ basis, around.moved(point).vector, rounding)
        assert flat is not None, "the inequalities hold around a point inside"
        (lo, lo_closed), (hi, hi_closed) = (
            _end(flat, sign * ramp, ramp, rounding) or ((sign + 1) / 2 - here, False)
            for sign in (-1, 1)
        )
        lo, hi = (interval[0] + width * (here + end) for end in (lo, hi))
        yield Filled(lo, hi, lo_closed, hi_closed, blur)


def _end(flat: Polyhedron, way: Array, ramp: Array, rounding: float) -> tuple[float, bool] | None:
    """Return the rise to the end of a polyhedron, and whether the end is more than a point.

    None if rounding hides the end.
    """
    w = flat.farthest(way)
    if w is None:
        return None
    level = null_space(ramp[np.newaxis])
    at_end = Polyhedron.of(flat.matrix @ level, flat.moved(w).vector, rounding)
    inside = at_end and at_end.inside(rounding)
    return float(ramp @ w), bool(inside and inside[1].shape[1])
