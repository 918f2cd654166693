"""States of a curve whose tangents are as exact as can be, and how exact that is.

Newton is content with a point that is off the curve by a little more than rounding, where the
tangent is another one: the point is corrected once more. A Jacobian of central differences has ten
digits: its tangent is found again with twelve, see :mod:`pwscont.curve.fourth_order`.
"""

from __future__ import annotations

from typing import NamedTuple

from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.fourth_order import CENTRAL, FINE, RATIO, finer


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
    found = finer(curve.selection, curve.metric, state.x, state.tangent)
    if found is None:
        return Polished(state, CENTRAL)
    apart = curve.metric.norm(found.tangent - state.tangent)
    if RATIO * apart >= 1.0:
        return Polished(state, max(CENTRAL, apart))
    better = State(state.x, found.tangent, state.error, state.orientation)
    return Polished(better, max(FINE, RATIO * apart**2))
