"""A curve that touches an interface and stays on its side of it.

Where the slope of a test along the curve is -s, and k the curvature of the test, the curve leads
s^2 / (2 k) beyond the interface before it turns back. Where that is within the rounding of the
test, and the values of the test there do not follow that parabola, the curve has not crossed.

Failure modes and answers
-------------------------
- A double zero is located to the square root of rounding, so that slopes there are far from zero
  by their own rounding, and no matrix is singular: the depth is what counts.
- Terms of a test cancel of which its gradient knows nothing, or are known to more digits than is
  typical: values, not estimates, tell whether the test is negative between its zeros.
- The curvature from differences is that of another part of the curve: both places are a millionth
  of the interval apart, and a zero that is farther from the lowest point is a crossing.
- Another interface is met before the place where the piece would go on: that piece would begin
  outside of its cell, and never meet this interface.
- From the zero the test falls again: the piece goes on beyond the lowest point, as far as the zero
  is before it.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude_of_values
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray

#: A place that is known better than this is where a test falls clearly: touching it would have a
#: curvature of more than 1 / EPS^(1/2).
CLEAR = EPS**0.75
#: Distance over which the slope changes, in the metric.
NEARBY = 1e-6
#: Where between both zeros values of the test are compared with the parabola, as parts of the
#: distance to the lowest point, and how far they may be off, as a part of the depth.
BETWEEN, OFF = (0.5, 1.0, 1.5), 0.25


def touching(curve: Curve, state: State, test: int) -> SpecialPointFound | None:
    """Return the point where a curve touches an interface, None where it crosses, or may.

    Parameters
    ----------
    curve : Curve
    state : State
        Where a test that bounds its cell vanishes, and falls along the tangent.
    test : int
    """
    if curve.metric.norm(state.size) <= CLEAR:
        return None  # nearly always
    index = int(np.flatnonzero(curve.selection.bounding == test)[0])
    slope, further = -_slope(curve, state, index), _at(curve, state, NEARBY)
    if further is None or not slope > 0.0:
        return None
    turn = slope + _slope(curve, further, index)
    lowest = NEARBY * slope / turn if turn > 0.0 else np.inf
    if not (lowest <= NEARBY and 0.5 * slope * lowest <= _rounding(curve, state, index)):
        return None
    places = [_at(curve, state, part * lowest) for part in (*BETWEEN, 2.0)]
    *between, rising = (place for place in places if place is not None)
    if len(between) < len(BETWEEN) or _dips(curve, between, index, slope * lowest):
        return None
    if _leaves(curve, rising, index):
        return None
    return _touched(curve, state, rising, test)


def _dips(curve: Curve, between: list[State], index: int, twice: float) -> bool:
    """Tell whether a test follows the parabola that begins at zero and is half of twice deep."""
    values = np.array([curve.selection.test(state.x, index) for state in between])
    parts = np.array(BETWEEN)
    parabola = twice * (0.5 * parts**2 - parts)
    return bool((np.abs(values - parabola) <= 0.5 * OFF * twice).all())


def _leaves(curve: Curve, rising: State, index: int) -> bool:
    """Tell whether another interface lies between the zero and where the piece would go on."""
    return bool((np.delete(curve.selection.tests(rising.x), index) < 0.0).any())


def _slope(curve: Curve, state: State, index: int) -> float:
    return float(curve.selection.test_gradient(state.x, index).dot(state.tangent))


def _rounding(curve: Curve, state: State, index: int) -> float:
    """Return a bound on the rounding of a test, whose terms may be as large as typical ones."""
    row = curve.selection.test_gradient(state.x, index)[np.newaxis]
    size = magnitude_of_values(row, state.x, state.error) + EPS * (abs(row) @ curve.metric.scale)
    return CONFIDENCE * float(size[0])


def _touched(curve: Curve, state: State, rising: State, test: int) -> SpecialPointFound:
    """Return the special point, uncertain by as much as both ways on begin apart."""
    name = curve.selection.system.test_name(test)
    error = np.vstack([state.error, rising.x - state.x])
    onwards = State(rising.x, rising.tangent, error, state.orientation)
    message = f"touches the interface where {name} vanishes, and stays in {curve.selection.label}"
    rays = Ray(curve, state).reversed(), Ray(curve, onwards)
    return SpecialPointFound(Kind.CORNER, state.x, message, rays)


def _at(curve: Curve, state: State, s: float) -> State | None:
    """Return the state of the curve at a distance along the tangent, None where there is none."""
    found = BorderedNewton().correct(curve, state.x + s * state.tangent, state.tangent)
    return None if isinstance(found, Failure) else found.state
