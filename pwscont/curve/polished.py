"""States of a curve whose tangents are as exact as can be, and how exact that is.

Failure modes and answers
-------------------------
- Newton is content with a point that is off the curve by a little more than rounding, where the
  tangent is another one: the point is corrected once more.
- A Jacobian of central differences has ten digits: its tangent is found again by differences of
  fourth order, with twelve.
- A function changes within the longer steps of fourth order: with errors d of second order, those
  of fourth order are RATIO d^2, and are taken only where that is less.
"""

from __future__ import annotations

from typing import NamedTuple

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.differences import FINE_STEP, STEP

#: What differences of second and of fourth order are off by at least, relative to derivatives.
CENTRAL, FINE = EPS / STEP, EPS / FINE_STEP
#: Errors of both are (STEP / w)^2 and (FINE_STEP / w)^4 for a function that changes over a width w.
RATIO = (FINE_STEP / STEP) ** 4


class Polished(NamedTuple):
    """A state, and what its tangent, of length one, may be off by."""

    state: State
    off: float


def polished(curve: Curve, state: State) -> Polished:
    """Return a state after one correction more, with a tangent to nearly all digits."""
    found = BorderedNewton().correct(curve, state.x, state.tangent)
    corrected = state if isinstance(found, Failure) else found.state
    if curve.selection.knows_jacobian:
        return Polished(corrected, GUARD * EPS)
    return _by_differences(curve, corrected)


def _by_differences(curve: Curve, state: State) -> Polished:
    """Return a state with the better one of two tangents."""
    tangent = _of_fourth_order(curve, state)
    if tangent is None:
        return Polished(state, CENTRAL)
    apart = curve.metric.norm(tangent - state.tangent)
    if RATIO * apart >= 1.0:
        return Polished(state, max(CENTRAL, apart))
    better = State(state.x, tangent, state.error, state.orientation)
    return Polished(better, max(FINE, RATIO * apart**2))


def _of_fourth_order(curve: Curve, state: State) -> Array | None:
    """Return the tangent by differences of fourth order, None where there is none."""
    differences, metric = curve.selection.system.differences(state.alpha), curve.metric
    jacobian = differences.to_fourth_order(curve.selection.residual, state.x)
    factor = bordered(jacobian, metric.covector(state.tangent), metric.binary)
    if factor.is_singular():
        return None
    tangent: Array = metric.normalised(factor.solve(last_unit(len(state.x))))
    return tangent
