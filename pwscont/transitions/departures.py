"""All rays that leave a given solution."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import FailureReason
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.root import Root
from pwscont.curve.uncertainty import uncertainty
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.bounding import corner, turns
from pwscont.transitions.branch_point import at_branch_point
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.fold_at_end import fold_at_end
from pwscont.transitions.rays import Ray, beyond, check_continuity, inward_ray, vanishing
from pwscont.transitions.standing import regular_border


def departures(
    system: PiecewiseSystem, metric: Metric, x: Array, error: Array
) -> SpecialPointFound:
    """Return a solution ``x`` as a special point, with its kind and its rays.

    A point inside a cell has two rays on one curve and the kind START.
    """
    tests = system.test_functions(x[:-1], float(x[-1]))
    if not np.isfinite(tests).all():
        raise InvalidSystemError(
            f"{type(system).__name__}.test_functions returned {tests} at a solution, alpha = "
            f"{x[-1]:.6g}: all must be finite"
        )
    curve = Curve(Selection(system, Character.of(tests)), metric)
    error = np.atleast_2d(error)  # searches may give one sample as a vector
    zero = vanishing(system, x, error, metric.scale)
    if not zero & _bounds_near(system, x, zero):
        return _inside(curve, x, error)
    return _on_interface(curve, x, error, zero)


def _bounds_near(system: PiecewiseSystem, x: Array, zero: frozenset[int]) -> set[int]:
    """Return the tests that bound a cell next to ``x``, among those that vanish there."""
    here = system.character(x[:-1], float(x[-1]))
    sides = [here, *(here.flip(test) for test in zero)]
    return {int(test) for side in sides for test in system.bounding_tests(side)}


def _inside(curve: Curve, x: Array, error: Array) -> SpecialPointFound:
    fixed = regular_border(curve, x)
    if fixed is None:
        stopped = SpecialPointFound(Kind.STOPPED, x, str(FailureReason.SINGULAR.value), ())
        return at_branch_point(curve, x) or stopped
    row, factor = fixed
    jacobian, tangent = curve.selection.jacobian(x), factor.solve(last_unit(len(x)))
    tangent = curve.metric.normalised(tangent)
    known = np.abs(error).max(axis=0)
    error = uncertainty(Root(x, known, jacobian, row, factor, curve.metric.scale, 0))
    oriented = bordered(jacobian, curve.metric.covector(tangent), curve.metric.binary)
    state = State(x, tangent, error, oriented.sign)
    forth = Ray(curve, fold_at_end(curve, state) or state)
    return SpecialPointFound(
        Kind.START, forth.state.x, f"start in {curve.selection.label}", (forth, forth.reversed())
    )


def _on_interface(curve: Curve, x: Array, error: Array, zero: frozenset[int]) -> SpecialPointFound:
    if len(zero) == 1:
        (test,) = zero
        system = curve.selection.system
        other = Curve(Selection(system, beyond(curve.selection, x, test)), curve.metric)
        rays = [inward_ray(side, x, error, test) for side in (curve, other)]
        check_continuity(curve, other.selection, None if None in rays else rays[1], x, error)
        found = [ray for ray in rays if ray is not None]
        if len(found) == 2:
            kind = Kind.NONSMOOTH_FOLD if turns(*found) else Kind.TRANSITION
            characters = curve.selection.character, other.selection.character
            return SpecialPointFound(kind, x, system.describe_transition(*characters), tuple(found))
    return corner(curve, x, error, zero)
