"""Where exactly a function vanishes on a segment.

Failure modes and answers
-------------------------
- Newton runs off to another zero: what it finds counts only within the bracket, which is
  otherwise halved on the curve itself.
- The curve is tangent to the zero set: the bordered matrix is singular and the answer is a
  :class:`~pwscont.foundation.outcome.Failure`, not a point.
- A straight segment needs no bracket: its prediction is exact and one correction removes the
  rounding that a long ray has gathered.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from pwscont.foundation.arrays import Array, Matrix
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.foundation.rounding import CONVERGED, EPS
from pwscont.numerics.curve import State
from pwscont.numerics.linalg import Factor, bordered, last_unit
from pwscont.stepping.stepper import CurvedSegment, Segment

#: A scalar function of x together with its gradient, shape (n + 1,) or a sparse row.
Function = Callable[[Array], tuple[float, Matrix]]

MOST_NEWTON = 8
#: A bracket in double precision cannot be halved more often.
MOST_HALVINGS = 60


def locate_zero(
    segment: Segment, function: Function, bracket: tuple[float, float]
) -> State | Failure:
    """Return the state where ``function`` falls to zero, by Newton within a bracket.

    Parameters
    ----------
    segment : Segment
    function : callable
        Positive at the lower end of the bracket, not positive at its upper end.
    bracket : tuple of float
        Distances along the segment; equal where the zero is known in advance.
    """
    lo, hi = bracket
    guess = 0.5 * (lo + hi)
    for _ in range(MOST_HALVINGS):
        found = _newton(segment, function, guess)
        if isinstance(found, State) and _within(segment, found, lo, hi):
            return found
        if not isinstance(segment, CurvedSegment):
            return found if isinstance(found, Failure) else Failure(Trouble.NOT_CONVERGED)
        middle = segment.at(0.5 * (lo + hi))
        if isinstance(middle, Failure):
            return middle
        lo, hi = (guess, hi) if function(middle.x)[0] > 0.0 else (lo, guess)
        guess = 0.5 * (lo + hi)
    return Failure(Trouble.NOT_CONVERGED)


def _within(segment: Segment, found: State, lo: float, hi: float) -> bool:
    """Tell whether a point lies in the bracket, but for the accuracy of its location."""
    slack = CONVERGED * (1.0 + segment.curve.metric.norm(found.x)) if lo < hi else np.inf
    return bool(lo - slack <= segment.position(found.x) <= hi + slack)


def _newton(segment: Segment, function: Function, guess: float) -> State | Failure:
    """Solve {H_chi = 0, function = 0} from the point of the segment at ``guess``."""
    curve, x = segment.curve, segment.near(guess)
    for _ in range(MOST_NEWTON):
        value, gradient = function(x)
        factor = bordered(curve.selection.jacobian(x), gradient)
        if factor.sign == 0:
            return Failure(Trouble.SINGULAR)
        dx = factor.solve(np.append(curve.selection.residual(x), value))
        x = x - dx
        size = curve.metric.norm(dx)
        if not np.isfinite(size):
            return Failure(Trouble.NOT_FINITE)
        if size <= CONVERGED * (1.0 + curve.metric.norm(x)):
            return _falling(factor, segment, x, dx)
    return Failure(Trouble.NOT_CONVERGED)


def _falling(factor: Factor, segment: Segment, x: Array, dx: Array) -> State | Failure:
    """Return the state at x with the tangent along which the function falls."""
    if factor.is_singular():
        return Failure(Trouble.SINGULAR)
    tangent = -factor.solve(last_unit(len(x)))
    return State(x, segment.curve.metric.normalised(tangent), np.abs(dx), -factor.sign)


class _OffCurveError(Exception):
    """The corrector failed within a bracket; carries the failure out of the root finder."""

    def __init__(self, failure: Failure) -> None:
        self.failure = failure


def locate_sign_change(
    segment: CurvedSegment, function: Callable[[State], float], bracket: tuple[float, float]
) -> State | Failure:
    """Return the state where ``function`` of the state changes sign, by Brent's method.

    For functions without a gradient: a few corrected points more than Newton needs.
    """

    def along(s: float) -> float:
        state = segment.at(s)
        if isinstance(state, Failure):
            raise _OffCurveError(state)
        return function(state)

    try:
        s = brentq(along, *bracket, xtol=4.0 * EPS * segment.length, rtol=4.0 * EPS)
    except _OffCurveError as off:
        return off.failure
    return segment.at(s)
