"""Branch points within a step that the signs of det[J; t^T] at both ends do not tell.

The sign flips twice at two branch points, and not at all where an even number of eigenvalues
vanishes together, as at a branch point of a symmetric structure. The quadratic through the
Jacobians at the start, in the middle and at the end of a step is a matrix polynomial; real zeros
within the step say where the determinant vanishes, and how often.

- The zeros cost a tenth of a step. They are computed unless a norm shows that the quadratic through
  the Jacobians of the last corrections, which are known, has none.
- Several zeros apart: a shorter step is asked for, until each step has one zero at most. The places
  of zeros of a short step are exact to the third order of the length of the step.
- Several zeros together: the step around them is looked at again, ever closer, until the zeros are
  apart, or vanish, or are one place to rounding.
- A branch point that is known, at the beginning of a piece or where a step ends, is no other zero.
- Along a curve on which H vanishes twice the determinant is rounding: where the Jacobian loses rank
  at both ends, nothing is told.

Two zeros closer than a thousandth of a step to a known branch point may be missed, and an
eigenvalue that vanishes twice within a part of the step in which three Jacobians do not show that.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, dense, largest
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.crossing import loses_rank
from pwscont.curve.curve import State
from pwscont.curve.stepper import CurvedSegment
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered

#: Zeros of a step closer than this part of the half step are together; so are the two zeros of a
#: complex pair with a smaller imaginary part.
TOGETHER = 1e-2
#: Distance from a known branch point, as a part of the half step, below which a zero is that point.
KNOWN = 1e-3
#: How far before and behind a place a step is looked at again, as parts of the step: unlike, so
#: that the Jacobian in the middle is regular.
CLOSER = -0.05, 0.03
#: The shortest step that is refused, and the longest in which zeros together are one place.
SHORTEST = 1e-6
#: Most unknowns of which the zeros are computed: of more, that would cost as much as the step.
MOST_UNKNOWNS = 24


def hidden_in(segment: CurvedSegment) -> State | Failure | None:
    """Return a state within a segment at which the determinant vanishes and keeps its sign.

    A Failure if the determinant vanishes at several places: a shorter step is needed. None if the
    determinant does not vanish, where the signs at both ends differ, and for many unknowns.
    """
    curve, start, end = segment.curve, segment.start, segment.end
    if curve.selection.is_straight or curve.selection.system.size > MOST_UNKNOWNS:
        return None
    if start.orientation != end.orientation or _is_regular(segment):
        return None  # nearly always
    zeros, is_known = _zeros(segment), end.is_singular
    if not len(zeros) or all(loses_rank(curve, s.x) for s in (start, end)):
        return None
    middle = 0.5 * segment.length * (1.0 + float(zeros.mean()))
    if segment.length <= SHORTEST:
        return None if is_known or len(zeros) == 1 else _singular_at(segment, middle)
    if is_known or len(zeros) == 1 or np.ptp(zeros) > TOGETHER:
        return Failure(FailureReason.SINGULAR)
    return _closer(segment, middle)


def _is_regular(segment: CurvedSegment) -> bool:
    """Tell whether the quadratic through the last three Jacobians is regular, by its norm.

    The quadratic is B + s D + s^2 E, with s = 0 at the end and s = -1 at the start.
    """
    states = [state for state in (segment.behind, segment.start, segment.end) if state]
    known = [state.jacobian for state in states if state.jacobian is not None]
    if len(known) < 3 or segment.factor is None:
        return False
    metric = segment.curve.metric
    behind = metric.norm(segment.start.x - states[0].x) / segment.length
    earlier, first = dense(known[0] - known[2]), dense(known[1] - known[2])
    bend = (earlier / (1.0 + behind) - first) / behind
    return _norm(segment.factor, metric.binary, bend - first, bend) < 1.0


def _norm(factor: Factor, scale: Array, *changes: Array) -> float:
    """Return the sum of the norms of B^-1 [C; 0], for changes C, in the units of the metric."""
    return sum(largest(np.abs(each).sum(axis=0)) for each in _solved(factor, scale, *changes))


def _solved(factor: Factor, scale: Array, *changes: Array) -> list[Array]:
    k = len(scale)
    both = np.zeros((len(changes) * k, k))
    both[:, :-1] = np.hstack(changes).T
    parts = factor.solve_all(both).reshape(len(changes), k, k)
    return [part.T * scale / scale[:, np.newaxis] for part in parts]


def _zeros(segment: CurvedSegment) -> Array:
    """Return where the quadratic through three Jacobians is singular, between -1 and 1.

    The quadratic is M + s D + s^2 E, with s = -1 at the start and s = 1 at the end of the segment.
    """
    curve, length = segment.curve, segment.length
    places = segment.start.x, segment.near(0.5 * length), segment.end.x
    before, here, after = (dense(curve.selection.jacobian(x)) for x in places)
    factor = bordered(here, curve.metric.covector(segment.chord), curve.metric.binary)
    changes = 0.5 * (after - before), 0.5 * (after + before) - here
    forth, bend = _solved(factor, curve.metric.binary, *changes)
    if not (np.isfinite(forth).all() and np.isfinite(bend).all()):
        return np.zeros(0)
    k = len(forth)
    values = np.linalg.eigvals(np.block([[-forth, -bend], [np.eye(k), np.zeros((k, k))]]))
    zeros = 1.0 / values[np.abs(values) > 1.0]
    zeros = zeros.real[np.abs(zeros.imag) < TOGETHER]
    first, last = (1.0 - KNOWN * state.is_singular for state in (segment.start, segment.end))
    return np.sort(zeros[(-first < zeros) & (zeros < last)])


def _closer(segment: CurvedSegment, middle: float) -> State | Failure | None:
    """Return what the part of a segment around a place shows."""
    places = [min(max(middle + p * segment.length, 0.0), segment.length) for p in CLOSER]
    start, end = map(segment.at, places)
    if isinstance(start, Failure) or isinstance(end, Failure):
        return Failure(FailureReason.SINGULAR)
    if start.orientation != segment.start.orientation or end.orientation != start.orientation:
        return Failure(FailureReason.SINGULAR)
    return hidden_in(CurvedSegment.between(segment.curve, start, end, segment.suggestion))


def _singular_at(segment: CurvedSegment, at: float) -> State | None:
    """Return the state at a place of a short segment if the Jacobian loses rank there."""
    x = segment.near(at)
    if not loses_rank(segment.curve, x):
        return None
    error = SHORTEST * (segment.end.x - segment.start.x)[np.newaxis]
    return State(x, segment.chord, error, segment.start.orientation, is_singular=True)
