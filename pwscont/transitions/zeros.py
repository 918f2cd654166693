"""Where a function falls to zero: on a straight piece, and within a step along a curve.

- On a straight piece affine functions have a ratio test (:func:`ratio_test`).
- A function with a gradient: Newton within a bracket (:func:`locate_zero`).
- A function of the state without a gradient: Brent's method (:func:`locate_sign_change`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONVERGED, EPS, GUARD
from pwscont.curve.corrector import zero
from pwscont.curve.curve import State
from pwscont.curve.newton import Border
from pwscont.curve.pseudo_arclength import NOT_CONVERGED
from pwscont.curve.stepper import CurvedSegment, Segment

#: A function that falls to zero no nearer than this, in the metric, falls by rounding only.
FARTHEST_ZERO = 0.1 / EPS**0.75
#: The sign change of a slope is bracketed within this part of a segment. At a turning point alpha,
#: or a test, is flat: the error of alpha is the square of this number. Much closer, changes of the
#: tangent are rounding.
NARROW_BRACKET = EPS**0.6
#: The sign change of any other function: alpha errs by as much, however long the segment is.
NARROWEST_BRACKET = GUARD * EPS
#: A bracket in double precision cannot be halved more often.
MOST_BRACKET_HALVINGS = 60


def ratio_test(values: Array, slopes: Array) -> Array:
    """Return the distances at which affine functions fall to zero, infinite for other functions.

    A function that is negative already falls at distance zero.
    """
    falling = slopes < 0.0
    distances = np.where(falling, np.maximum(values, 0.0), np.inf)
    np.divide(distances, -slopes, out=distances, where=falling)
    distances[distances > FARTHEST_ZERO] = np.inf
    return distances


def locate_zero(
    segment: Segment, border: Border, bracket: tuple[float, float], guess: float | None = None
) -> State | Failure:
    """Return the state where ``border`` falls to zero, by Newton within a bracket.

    Newton may run off to another zero, or to another sheet: Newton's point counts only within the
    bracket and beside the cubic of the segment; otherwise the bracket is halved on the curve
    itself. A straight segment needs no bracket, because the prediction is exact.

    Parameters
    ----------
    segment : Segment
    border : callable
        x -> (value, gradient); positive at the lower end of the bracket, not at the upper.
    bracket : tuple of float
        Distances along the segment; equal where the zero is known in advance.
    guess : float, optional
        Where in the bracket to begin; default the middle.
    """
    lo, hi = bracket
    guess = 0.5 * (lo + hi) if guess is None else guess
    for number in range(MOST_BRACKET_HALVINGS):
        # Newton fails again and again where H is singular, and costs more than all halvings
        is_tried = number.bit_count() < 2
        corrected = zero(segment.curve, border, segment.near(guess)) if is_tried else NOT_CONVERGED
        found = corrected if isinstance(corrected, Failure) else corrected.state
        if not isinstance(segment, CurvedSegment):
            return found
        if isinstance(found, State):
            s, slack = segment.position(found.x), segment.curve.metric.slack(found.x, CONVERGED)
            if lo - slack <= s <= hi + slack and segment.is_beside(found, s):
                return found
        middle = segment.at(guess)
        if isinstance(middle, Failure):
            return middle
        lo, hi = (guess, hi) if border(middle.x)[0] > 0.0 else (lo, guess)
        guess = 0.5 * (lo + hi)
    return NOT_CONVERGED


class _OffCurveError(Exception):
    """The corrector failed within a bracket; carries the failure out of the root finder."""


def locate_point(segment: Segment, s: float) -> State | Failure:
    """Return the state of the curve at a distance along a straight segment."""
    point, row = segment.near(s), -segment.curve.metric.covector(segment.start.tangent)
    return locate_zero(segment, lambda x: (float(row.dot(x - point)), row), (s, s))


def locate_sign_change(
    segment: Segment,
    function: Callable[[State], float],
    bracket: tuple[float, float],
    narrow: float = NARROWEST_BRACKET,
) -> State | Failure:
    """Return the state where ``function`` of the state changes sign, by Brent's method.

    For functions without a gradient: a few corrected points more than Newton needs. ``narrow`` is
    the part of the segment within which the change is bracketed, by default close to rounding. A
    bracket of equal distances on a straight segment is a place that is known, from
    :meth:`~pwscont.TransitionDetector.falls`.
    """
    is_curved = isinstance(segment, CurvedSegment)
    if not is_curved and bracket[0] == bracket[1]:
        return locate_point(segment, bracket[0])
    from scipy.optimize import brentq  # noqa: PLC0415  it takes as long to import as all the rest

    at = cache(segment.at)

    @cache  # noise may give a second value another sign
    def along(s: float) -> float:
        if isinstance(found := at(s), Failure):
            raise _OffCurveError(found)
        return function(found)

    try:
        ends = sorted(map(along, bracket))
        if not ends[0] <= 0.0 <= ends[1]:  # a change that is rounding
            return NOT_CONVERGED
        xtol = narrow * (segment.length if isinstance(segment, CurvedSegment) else bracket[1])
        most = MOST_BRACKET_HALVINGS**2  # Brent's method takes many steps where a zero is flat
        s = brentq(along, *bracket, xtol=xtol, rtol=4.0 * EPS, maxiter=most)
        return at(s) if is_curved else locate_point(segment, s)
    except _OffCurveError as off:
        failure: Failure = off.args[0]
        return failure
