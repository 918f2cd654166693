"""All rays that leave a given solution.

Near a fold the residual is as small as the square of the distance: where dH/dz is singular, Newton
at fixed alpha may stand still beside the fold, or beyond the fold, where there is no solution. With
another unknown held fixed, Newton leads to the curve, at the curve's own alpha.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, are_finite
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.outcome import FILL_CURVES, Failure, FailureReason, Kind
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import Found, magnitude
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Root, newton, uncertainty
from pwscont.enumeration.continua import is_one_of_many
from pwscont.linear.factorise import Factor, bordered, last_unit
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions.bounding import corner, crossed
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray, check_continuity, inward_ray, is_zero
from pwscont.transitions.smooth import at_branch_point, fold_at_end

MOST_SETTLING = 8


def settled(system: PiecewiseSystem, metric: Metric, found: Found) -> Found | None:
    """Return a solution that Newton found at fixed alpha, put on the curve if dH/dz is singular.

    None where the curve is outside the interval.
    """
    if isinstance(system, SlicewiseLinearSystem):
        return found
    x, _ = found
    curve = Curve(Selection(system, system.character(x[:-1], float(x[-1]))), metric)
    held = regular_border(curve, x)
    if held is None or held[1][-1]:
        return found
    row = held[1]
    root = newton(curve, lambda y: (float(row.dot(y - x)), row), x, MOST_SETTLING)
    if isinstance(root, Failure):
        return None
    same = 0.5 * SAME_ALPHA * max(abs(float(x[-1])), float(metric.scale[-1]))
    return found if abs(root.x[-1] - x[-1]) <= same else (root.x, root.error[np.newaxis])


def regular_border(curve: Curve, x: Array) -> tuple[Matrix, Array, Factor] | None:
    """Return J, the unit row e_j that borders J to a regular matrix, and the factorisation.

    The row holds one unknown fixed: alpha, except at a fold, where alpha fails. At a branch point
    all fail.
    """
    jacobian, size = curve.selection.jacobian(x), len(x)
    for j in range(size - 1, -1, -1):
        row = np.zeros(size)
        row[j] = 1.0
        factor = bordered(jacobian, row, curve.metric.binary)
        if not factor.is_singular():
            return jacobian, row, factor
    return None


@final
@dataclass(frozen=True, slots=True)
class Standing:
    """Where a solution stands: inside a cell, on the interface of two, or in a corner."""

    x: Array  # shape (n + 1,)
    error: Array  # shape (k, n + 1)
    zero: frozenset[int]  # the tests that vanish there
    curve: Curve  # the curve of the cell whose signs the tests have, or seem to have
    #: The curve of the cell on the other side, if exactly one test that bounds a cell vanishes.
    other: Curve | None

    @classmethod
    def of(cls, system: PiecewiseSystem, metric: Metric, x: Array, error: Array) -> Standing:
        """Return where a solution stands; refuse tests that are not finite."""
        tests = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        if len(tests) and not are_finite(tests):
            raise InvalidSystemError(
                f"{type(system).__name__}.test_functions returned {tests} at a solution, alpha = "
                f"{x[-1]:.6g}: all must be finite"
            )
        curve = Curve(Selection(system, Character.of(tests)), metric)
        gradients = system.test_jacobian(x[:-1], float(x[-1]))
        zero = np.flatnonzero(is_zero(gradients, tests, x, error, metric.scale)).tolist()
        here = curve.selection
        beyond = [Selection(system, here.character.flip(test)) for test in zero]
        if all(set(zero).isdisjoint(side.bounding.tolist()) for side in (here, *beyond)):
            return cls(x, error, frozenset(), curve, None)
        other = Curve(beyond[0], metric) if len(zero) == 1 else None
        return cls(x, error, frozenset(zero), curve, other)

    def departures(self) -> SpecialPointFound:
        """Return the solution as a special point, with the point's kind and rays.

        A point inside a cell has two rays on the same curve and the kind START.
        """
        curve, other, x, error = self.curve, self.other, self.x, self.error
        if not self.zero:
            return _inside(curve, x, error)
        if other:
            (test,) = self.zero
            one, two = (inward_ray(side, x, error, test) for side in (curve, other))
            check_continuity(curve, other.selection, one and two, x, error)
            if one and two:
                return crossed(x, one, two)
        return corner(curve, x, error, self.zero)


def _inside(curve: Curve, x: Array, error: Array) -> SpecialPointFound:
    held = regular_border(curve, x)
    if held is None:
        if is_one_of_many(curve.selection.system, curve.metric, x):
            return SpecialPointFound(Kind.STOPPED, x, FILL_CURVES, ())
        stopped = SpecialPointFound(Kind.STOPPED, x, str(FailureReason.SINGULAR.value), ())
        return at_branch_point(curve, x) or stopped
    jacobian, row, factor = held
    tangent = curve.metric.normalised(factor.solve(last_unit(len(x))))
    known = np.maximum.reduce(np.abs(error))
    error = uncertainty(Root(x, known, jacobian, row, factor, curve.metric.scale, 0))
    # det [J; r] is proportional to r.t, and e_j.t is positive like t.t: the signs are equal
    state = State(x, tangent, error, factor.sign, magnitude(x, error))
    forth = Ray(curve, fold_at_end(curve, state) or state)
    rays = forth, forth.reversed()
    said = partial("start in {0.label}".format, curve.selection)
    return SpecialPointFound(Kind.START, forth.state.x, said, rays)
