"""Where the determinant vanishes within a step, although its sign is the same at both ends.

The sign of det[J; t^T] flips twice at two branch points, and not at all where an even number of
eigenvalues vanishes together, as at a branch point of a symmetric structure. The magnitude tells: a
parabola through the determinants at three places says where the determinant may be least. A look
there, and a parabola through nearer places, come as close to the least value as is needed.

Failure modes and answers
-------------------------
- The determinant of many unknowns changes by orders of magnitude within a step: logarithms are
  carried along, and a parabola that is wrong costs a few looks.
- Along a curve on which H vanishes twice the determinant is rounding: where the Jacobian loses
  rank, nothing is told unless the determinant is far smaller than at both ends.
- The parabola needs a state before the step: the first step of a piece is not looked into, unless
  the piece begins at a branch point, where the determinant is zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import EPS
from pwscont.curve.crossing import loses_rank
from pwscont.curve.curve import State
from pwscont.curve.stepper import CurvedSegment

#: A look is taken if the parabola comes down to this part of the least determinant that is known.
LOW = 0.5
#: Most looks into a step: each look halves the distance to the least determinant or better.
MOST_LOOKS = 12
#: Where the Jacobian loses rank, the determinant vanishes if it is below this part of the
#: determinants at both ends; on a curve of double roots the determinant is rounding everywhere.
VANISHES = 1e-6
#: Distance from a place at which the Jacobian is exactly singular, as a part of the step.
BESIDE_LOOK = EPS**0.5
#: Where looks are taken, as parts of the step, if the determinant is known at less than three places
#: because it vanishes at others: first near the end, where the sign must still be that of the start.
PARTS = (0.99, 0.5, 0.25)
#: Logarithm of the largest ratio of determinants: the power of a larger one overflows.
LARGEST_LOG = 700.0


class _Place(NamedTuple):
    """A place on a segment, and the magnitude of the determinant there, up to a constant."""

    at: float
    value: float


def hidden_in(segment: CurvedSegment) -> State | Failure | None:
    """Return a state within a segment at which the determinant vanishes and keeps its sign.

    A Failure if the sign flips twice within the segment: a shorter step is needed. None if the
    determinant does not vanish within the segment, and where the signs at both ends differ.
    """
    earlier, start, end = segment.earlier, segment.start, segment.end
    known = [state for state in (earlier, start, end) if state is not None]
    zeros = tuple(segment.position(state.x) for state in known if _is_zero(state))
    if not zeros and not (earlier and start.log_determinant < earlier.log_determinant):
        return None  # nearly always: the determinant grows
    if start.orientation != end.orientation or start.orientation != known[0].orientation:
        return None
    known = [state for state in known if not _is_zero(state)]
    for part in PARTS[: 3 - len(known)] if zeros else ():
        look = _look(segment, part * segment.length)
        known += [look] if look else []
    if any(state.orientation != end.orientation for state in known):
        return Failure(FailureReason.SINGULAR)
    return _least(segment, known, zeros) if len(known) == 3 else None


def _is_zero(state: State) -> bool:
    """Tell whether the determinant vanishes at a state, as at a branch point."""
    return state.log_determinant == -math.inf


def _least(
    segment: CurvedSegment, known: list[State], zeros: tuple[float, ...]
) -> State | Failure | None:
    """Return what looks at the least determinant tell, as :func:`hidden_in` does."""
    places = sorted(_placed(state, segment, zeros) for state in known)
    largest = max(place.value for place in places)
    for _ in range(MOST_LOOKS):
        at = _least_at(places)
        state = None if at is None else _look(segment, at)
        if state is None:
            return None  # nearly always
        here = _placed(state, segment, zeros)
        if loses_rank(segment.curve, state.x):
            vanishes = here.value <= VANISHES * largest
            return state if vanishes and not loses_rank(segment.curve, segment.end.x) else None
        if state.orientation != segment.end.orientation:
            return Failure(FailureReason.SINGULAR)
        places = _around_lowest([*places, here])
    return None


def _look(segment: CurvedSegment, at: float) -> State | None:
    """Return the state at a place, or right beside where Newton's method finds none."""
    if not 0.0 < at < segment.length:
        return None
    for place in (at, at + BESIDE_LOOK * segment.length):
        state = segment.at(place)
        if isinstance(state, State) and not math.isnan(state.log_determinant):
            return state
    return None


def _placed(state: State, segment: CurvedSegment, zeros: tuple[float, ...]) -> _Place:
    """Return the place of a state, and the determinant there, from which zeros are divided out."""
    logs = (segment.start.log_determinant, segment.end.log_determinant)
    at = segment.position(state.x)
    log = state.log_determinant - max(filter(math.isfinite, logs), default=0.0)
    log -= sum(math.log(abs(at - zero) / segment.length) for zero in zeros if at != zero)
    return _Place(at, math.exp(min(log, LARGEST_LOG)))


def _least_at(places: list[_Place]) -> float | None:
    """Return the place at which the parabola through three places is least, and low enough."""
    (a, first), (b, middle), (c, last) = places
    falls, rises = (middle - first) / (b - a), (last - middle) / (c - b)
    bend = (rises - falls) / (c - a)
    if not bend > 0.0:
        return None
    slope = falls + bend * (b - a)  # at the middle
    least = middle - 0.25 * slope * slope / bend
    return b - 0.5 * slope / bend if least <= LOW * min(first, middle, last) else None


def _around_lowest(places: list[_Place]) -> list[_Place]:
    """Return the lowest of four places and the two places beside it, in order."""
    places = sorted(places)
    lowest = min(range(4), key=lambda i: places[i].value)
    middle = min(max(lowest, 1), 2)
    return places[middle - 1 : middle + 2]
