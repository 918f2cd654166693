"""States of a curve whose tangents are as exact as can be.

Failure modes and answers
-------------------------
- Newton is content with a point that is off the curve by a little more than rounding, where the
  tangent is another one: the point is corrected once more.
- A Jacobian of central differences has ten digits: its tangent is found again with twelve.
"""

from __future__ import annotations

from pwscont.basics.outcome import Failure
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.system import PiecewiseSystem


def polished(curve: Curve, state: State) -> State:
    """Return a state after one correction more, with a tangent to nearly all digits."""
    found = BorderedNewton().correct(curve, state.x, state.tangent)
    if isinstance(found, Failure):
        return state
    return _by_fourth_order(curve, found.state) if has_differences(curve) else found.state


def has_differences(curve: Curve) -> bool:
    """Tell whether the Jacobian is by central differences."""
    return type(curve.selection.system).jacobian is PiecewiseSystem.jacobian


def _by_fourth_order(curve: Curve, state: State) -> State:
    """Return a state with its tangent by differences of fourth order."""
    differences, metric = curve.selection.system.differences(state.alpha), curve.metric
    jacobian = differences.to_fourth_order(curve.selection.residual, state.x)
    factor = bordered(jacobian, metric.covector(state.tangent), metric.binary)
    if factor.failed:
        return state
    tangent = metric.normalised(factor.solve(last_unit(len(state.x))))
    return State(state.x, tangent, state.error, state.orientation)
