"""The exact point of a segment at which a function vanishes.

Failure modes and answers
-------------------------
- Newton runs off to another zero, or to another sheet: Newton's point counts only within the
  bracket and beside the cubic of the segment. Otherwise the bracket is halved on the curve itself.
- A straight segment needs no bracket: the prediction is exact, and a single correction removes the
  rounding that a long ray has gathered.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED, EPS, GUARD
from pwscont.curve.corrector import falling, zero
from pwscont.curve.curve import State
from pwscont.curve.newton import Border, corrected
from pwscont.curve.stepper import CurvedSegment, Segment

#: The sign change of a slope is bracketed within this part of a segment. At a turning point alpha,
#: or a test, is flat: the error of alpha is the square of this number. Much closer, changes of the
#: tangent are rounding.
NARROW_BRACKET = EPS**0.6
#: The sign change of any other function: alpha errs by as much, however long the segment is.
NARROWEST_BRACKET = GUARD * EPS
#: A bracket in double precision cannot be halved more often.
MOST_BRACKET_HALVINGS = 60
#: Brent's method takes no more steps than the square of these halvings; many where a zero is flat.
MOST_BRENT = MOST_BRACKET_HALVINGS**2


def locate_zero(
    segment: Segment, border: Border, bracket: tuple[float, float], guess: float | None = None
) -> State | Failure:
    """Return the state where ``border`` falls to zero, by Newton within a bracket.

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
    for _ in range(MOST_BRACKET_HALVINGS):
        found = _newton(segment, border, guess)
        if isinstance(found, State) and _within(segment, found, lo, hi):
            return found
        if not isinstance(segment, CurvedSegment):
            return found if isinstance(found, Failure) else Failure(FailureReason.NOT_CONVERGED)
        middle = segment.at(guess)
        if isinstance(middle, Failure):
            return middle
        lo, hi = (guess, hi) if border(middle.x)[0] > 0.0 else (lo, guess)
        guess = 0.5 * (lo + hi)
    return Failure(FailureReason.NOT_CONVERGED)


def _within(segment: Segment, found: State, lo: float, hi: float) -> bool:
    """Tell whether a point lies in the bracket, up to the accuracy of the location."""
    if lo == hi:
        return True
    s, slack = segment.position(found.x), segment.curve.metric.slack(found.x, CONVERGED)
    return lo - slack <= s <= hi + slack and segment.is_beside(found, s)


def _newton(segment: Segment, border: Border, guess: float) -> State | Failure:
    """Return the zero that Newton finds from a place; the tangent points to where it falls."""
    curve, x = segment.curve, segment.near(guess)
    is_exact = curve.selection.is_straight and not isinstance(segment, CurvedSegment)
    if is_exact and (known := corrected(curve, x, *border(x))):
        if known[0].factor.is_singular():
            return Failure(FailureReason.SINGULAR)
        found = falling(curve, *known)
    else:
        found = zero(curve, border, x)
    return found if isinstance(found, Failure) else found.state


class _OffCurveError(Exception):
    """The corrector failed within a bracket; carries the failure out of the root finder."""

    def __init__(self, failure: Failure) -> None:
        self.failure = failure


def locate_point(segment: Segment, s: float) -> State | Failure:
    """Return the state of the curve at a distance along a straight segment."""
    point, row = segment.near(s), -segment.curve.metric.covector(segment.start.tangent)
    return locate_zero(segment, lambda x: (float(row.dot(x - point)), row), (s, s), s)


def locate_sign_change(
    segment: Segment,
    function: Callable[[State], float],
    bracket: tuple[float, float],
    narrow: float = NARROWEST_BRACKET,
) -> State | Failure:
    """Return the state where ``function`` of the state changes sign, by Brent's method.

    For functions without a gradient: a few corrected points more than Newton needs. ``narrow`` is
    the part of the segment within which the change is bracketed, by default close to rounding. On a
    straight segment the place is known, from :meth:`~pwscont.TransitionDetector.falls`.
    """
    if not isinstance(segment, CurvedSegment):
        return locate_point(segment, bracket[0])
    from scipy.optimize import brentq  # noqa: PLC0415  it takes as long to import as all the rest

    known: dict[float, State] = {0.0: segment.start, segment.length: segment.end}

    @cache  # noise may give a second value another sign
    def along(s: float) -> float:
        if s not in known:
            state = segment.at(s)
            if isinstance(state, Failure):
                raise _OffCurveError(state)
            known[s] = state
        return function(known[s])

    try:
        ends = sorted(map(along, bracket))
        if not ends[0] <= 0.0 <= ends[1]:  # a change that is rounding
            return Failure(FailureReason.NOT_CONVERGED)
        xtol = narrow * segment.length
        s = brentq(along, *bracket, xtol=xtol, rtol=4.0 * EPS, maxiter=MOST_BRENT)
    except _OffCurveError as off:
        return off.failure
    return known[s] if s in known else segment.at(s)
