"""What lies inside a step: places at which H tells whether the curve is where the cubic leads.

Two folds of a bump that is far narrower than the step leave no trace at the ends of the step. H is
evaluated at places about :attr:`~pwscont.StepSize.gap` apart, at uneven distances, since H may be
periodic; all places are solved for at once with the factorisation of the end. A narrower bump may
be passed over.

Beside a bump the curve is off the cubic by less than is allowed. Along a smooth curve the distances
are u^2 (1 - u)^2 times a polynomial; if the distances vary otherwise, places around the odd place
and next to the ends are looked at, ever closer, as long as the distances bend more and more, as
beside a pole. The shorter steps after a refused step are looked into more closely. Where alpha
hardly changes the cubic may be close and alpha turn back all the same: the points of the curve next
to the places must be in order.

Branch points within a step
---------------------------
The sign of det[J; t^T] flips twice at two branch points, and not at all where an even number of
eigenvalues vanishes together, as at a branch point of a symmetric structure. The quadratic through
the Jacobians at the start, in the middle and at the end of a step is a matrix polynomial; real
zeros within the step say where the determinant vanishes, and how often.

- Three Jacobians cost a tenth of a step. They are computed unless the quadratic through the
  Jacobians of the last corrections, which are known, has no zero near the step.
- Zeros apart: if the sign between two of them is another one, a shorter step is asked for, until
  each step has one zero at most.
- Zeros together, and zeros without a change of sign, which may be multiple ones (Arnoldi's method
  shows these once): the step around them is looked at again, ever closer, until the zeros are
  apart, or vanish, or are one place to rounding.
- A branch point that is known, at the beginning of a piece or where a step ends, is no other zero.
- Many unknowns: Arnoldi's method computes the dominant zeros, of the line through two Jacobians
  first; one or two vectors show nearly always that no zero is near.
- Along a curve on which H vanishes twice the determinant is rounding: where the Jacobians lose
  rank, nothing is told.

Two zeros closer than a thousandth of a step to a known branch point may be missed, and an
eigenvalue that vanishes twice within a part of the step in which three Jacobians do not show that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import ceil, inf, isfinite, sqrt

import numpy as np

from pwscont.basics.arrays import (
    GOLDEN,
    Array,
    Matrix,
    dense,
    generic,
    joined,
    largest,
    product,
    smallest,
)
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED, EPS, GUARD
from pwscont.curve.crossing import FULL_RANK, loses_rank
from pwscont.curve.curve import State
from pwscont.curve.stepper import SHORTEST_CHORD, CurvedSegment, StepSize
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

#: The places inside a step that are always looked at, as parts u of the step. A cubic that leads to
#: another sheet has crossed the part 3 u^2 - 2 u^3 of the distance there: the golden section and
#: sqrt(3) - 1, whose multiples stay far from whole numbers, so that no sheet between passes for the
#: curve. For jumps over many sheets the first multiple may be nearly whole: after a large
#: correction the second place is looked at as well.
INSIDE, SECOND = 0.4209, 0.6602
#: The largest number of places in a step.
MOST_PLACES = 256
#: Most unknowns for which a look costs little beside a step.
CHEAP_UNKNOWNS = 8
#: Variation of the distances between places, as a part of the distance.
UNEVEN = 0.3
#: Largest part of the distances from the cubic that is not smooth, as a part of the largest
#: distance: beyond, a place is odd.
ROUGH_PART = 0.05
#: Distances from the cubic, in the metric, below which nothing is read from how these vary.
INVISIBLE = 10.0 * CONVERGED
#: Places around an odd place, rounds of looking there, and the factor by which the room shrinks.
CLOSER_PLACES, CLOSER_ROUNDS, ZOOM = 8, 3, 0.25
#: Towards a pole the distances bend more by this factor after CLOSER_ROUNDS rounds; most rounds.
GROWS_TO, MOST_CLOSER_ROUNDS = 4.0, 24
#: Degree of the polynomial that counts as smooth; at most a third of the number of places.
SMOOTH_DEGREE = 3

LEAVES_INTERVAL = Failure(FailureReason.JUMP)
HIDES_FOLDS = Failure(FailureReason.HIDDEN_FOLDS)


def gap_of(step_size: StepSize | None, system: PiecewiseSystem) -> float:
    """Return the distance within which two folds of a system may be passed over, or zero."""
    if step_size is None or isinstance(system, SlicewiseLinearSystem):
        return 0.0  # equations that are linear at fixed alpha have no fold in a cell
    return step_size.gap * sqrt(max(system.size / CHEAP_UNKNOWNS, 1.0))


def farthest_off(
    segment: CurvedSegment, factor: Factor, allowed: float, is_sure: bool
) -> float | Failure:
    """Return how far the curve is from the cubic of a step at most; nan where H is undefined.

    A Failure if the step hides folds, or the cubic leaves the interval.

    ``factor``: a factorisation [J; border] from the end of the segment. ``allowed``: the largest
    distance of the curve from the cubic; beyond, no closer look is taken. ``is_sure``: whether a
    single place is enough in a step no longer than the gap.
    """
    if not 0.0 < segment.gap < segment.length:
        return _off_at(segment, factor, (INSIDE,) if is_sure else (INSIDE, SECOND))
    count = min(max(ceil(segment.length / segment.gap) - 1, 2), MOST_PLACES)
    u, weights, rough = _uneven_places(count)
    off, alphas = _looked_at(segment, factor, weights)
    if len(off) < count and not segment.curve.metric.admits(segment.near(INSIDE * segment.length)):
        return LEAVES_INTERVAL
    worst = sqrt(largest(np.einsum("ij,ij->i", off, off)))
    if not worst <= allowed:
        return worst  # may be nan
    if worst > INVISIBLE and len(off) == count:
        roughness = np.abs(rough.dot(off))
        rounding = INVISIBLE + segment.curve.metric.slack(segment.end.x, 0.0)
        if largest(roughness) > ROUGH_PART * largest(np.abs(off)) + rounding:
            odd = float(u[int(roughness.argmax()) // off.shape[1]])
            for place in (odd, 0.0, 1.0):
                closer = _close_in(segment, factor, (place, 1.0 / count), allowed)
                if isinstance(closer, Failure):
                    return closer
                worst = max(worst, closer)
    return HIDES_FOLDS if _turns(segment, factor, u, alphas) else worst


@lru_cache(maxsize=MOST_PLACES)
def _uneven_places(count: int) -> tuple[Array, Array, Array]:
    """Return ``count`` places at uneven distances inside a step, as parts of the step.

    With the places come the weights of the cubic there, and the projection of distances from the
    cubic on the part that is not smooth.
    """
    j = np.arange(1.0, count + 1.0)
    u: Array = (j + UNEVEN * ((j * GOLDEN) % 1.0 - 0.5)) / (count + 1.0)
    for part in (INSIDE, SECOND):  # in place of the nearest
        u[np.abs(u - part).argmin()] = part
    smooth = (u * (1.0 - u))[:, np.newaxis] ** 2 * np.vander(u, min(SMOOTH_DEGREE, count // 3) + 1)
    q = np.linalg.qr(smooth)[0]
    return u, _weights(u), np.eye(count) - q @ q.T


def _weights(u: Array) -> Array:
    """Return the weights of chord and tangents in points of a cubic at u, shape (k, 3)."""
    v = 1.0 - u
    first, last = u * v * v, v * u * u
    return np.stack([u - first + last, first, -last], axis=1)


def _off_at(segment: CurvedSegment, factor: Factor, parts: Sequence[float]) -> float | Failure:
    """Return how far the curve is from the cubic at some parts of the step at most."""
    curve, worst = segment.curve, 0.0
    for part in parts:
        x = segment.near(part * segment.length)
        if not curve.metric.admits(x):
            return LEAVES_INTERVAL
        off = curve.metric.norm(factor.solve(curve.selection.residual_and(x, 0.0)))
        if not off < inf:
            return off
        worst = max(off, worst)
    return worst


def _looked_at(segment: CurvedSegment, factor: Factor, weights: Array) -> tuple[Array, Array]:
    """Return how far the curve is off the cubic at some places, and the alphas of the curve there.

    The distances are in typical magnitudes, shape (k, n + 1). Places outside the interval are left
    out.
    """
    metric, (lo, hi) = segment.curve.metric, segment.curve.metric.interval
    (leaving, by), (arriving, to), length = segment.leaving, segment.arriving, segment.length
    ways = np.array([length * segment.chord, length * by * leaving, length * to * arriving])
    points: Array = weights.dot(ways)
    points += segment.start.x
    alphas = points[:, -1]
    if not lo <= smallest(alphas) <= largest(alphas) <= hi:
        points = points[[metric.admits(x) for x in points]]
        if not len(points):
            return points, np.empty(0)
    off = factor.solve_all(segment.curve.selection.residuals(points))
    return off / metric.scale, points[:, -1] - off[:, -1]


def _close_in(
    segment: CurvedSegment, factor: Factor, around: tuple[float, float], allowed: float
) -> float | Failure:
    """Return how far off the curve is within a distance of a place, looked at ever closer."""
    (odd, apart), worst, bend, bends = around, 0.0, 0.0, [0.0] * CLOSER_ROUNDS
    while bend >= GROWS_TO * bends[-CLOSER_ROUNDS] and len(bends) < MOST_CLOSER_ROUNDS:
        bends.append(bend)
        u = odd + apart * np.linspace(-1.0, 1.0, CLOSER_PLACES + 2)[1:-1]
        u = u[(u > 0.0) & (u < 1.0)]
        off, alphas = _looked_at(segment, factor, _weights(u))
        if len(off) < max(len(u), 3):
            break
        worst = max(worst, largest(np.abs(off)))
        if not worst <= allowed or _turns(segment, factor, u, alphas):
            return HIDES_FOLDS
        # the smooth part of the distances is nearly straight
        each = np.abs(off[:-2] - 2.0 * off[1:-1] + off[2:]).max(axis=1)
        bend, odd, apart = largest(each), float(u[1 + each.argmax()]), ZOOM * apart
    return worst


def _turns(segment: CurvedSegment, factor: Factor, u: Array, alphas: Array) -> bool:
    """Tell whether alpha turns more often than the slopes at the ends of a step say.

    ``alphas``: nearly of the curve at the parts ``u``; if these turn, points of the curve decide.
    """
    if not _alphas_turn(segment, alphas):
        return False  # nearly always
    points = [segment.point(part * segment.length, factor) for part in u]
    return _alphas_turn(segment, np.array([x[-1] for x in points if x is not None]))


def _alphas_turn(segment: CurvedSegment, alphas: Array) -> bool:
    """Tell whether values of alpha along a step turn more often than the slopes say."""
    start, end = segment.start, segment.end
    steps = np.empty(len(alphas) + 1)
    steps[:-1], steps[-1] = alphas, end.alpha
    steps[1:] -= alphas
    steps[0] -= start.alpha
    leaving, arriving = float(start.tangent[-1]), float(end.tangent[-1])
    least = CONVERGED * segment.curve.metric.width + GUARD * EPS * abs(end.alpha)
    if leaving * arriving > 0.0:  # nearly always
        return (largest(steps) if leaving < 0.0 else -smallest(steps)) > least
    signs = np.sign(steps[np.abs(steps) > least])
    signs = np.concatenate([[leaving], signs, [arriving]])
    signs = signs[signs != 0.0]
    return int((signs[1:] * signs[:-1] < 0.0).sum()) > 1


# -- branch points within a step -------------------------------------------------------------------

#: Zeros are together if they are closer than this part of the half step, or if they are a complex
#: pair with a smaller imaginary part.
TOGETHER = 1e-2
#: Distance from a known branch point, as a part of the half step, below which a zero is that point.
KNOWN = 1e-3
#: How near zeros of a rough quadratic must be if they are computed, as a part of the step.
MARGIN = 0.2
#: How far before and behind a place a step is looked at again, as parts of the step: unlike, so
#: that the Jacobian in the middle is regular.
CLOSER = -0.05, 0.03
#: Most unknowns for which all zeros of the quadratic are computed: the eigenvalues cost less than
#: the step.
MOST_WITH_ALL_ZEROS = 24
#: For more unknowns, the number of vectors of Arnoldi's method; the size of the matrix of the first
#: two vectors below which no eigenvalue is 1; and the size of the first image, times the root of
#: the number of unknowns, below which a tenth of the usual part of such an eigenvector would show.
VECTORS, NO_EIGENVALUE, NO_PART = 10, 0.5, 0.1


def hidden_in(segment: CurvedSegment, *, is_part: bool = False) -> State | Failure | None:
    """Return a state within a segment at which the determinant vanishes and keeps its sign.

    A Failure if the sign differs at places between: a shorter step is needed. None if the
    determinant does not vanish, and where the signs at both ends differ. ``is_part``: whether the
    segment is a part of a segment in which the Jacobian has full rank.
    """
    selection, start, end = segment.curve.selection, segment.start, segment.end
    if selection.is_straight or start.orientation != end.orientation:
        return None
    if start.jacobian is None:  # at the beginning of a piece
        start.jacobian = selection.jacobian(start.x)
    few = selection.system.size <= MOST_WITH_ALL_ZEROS
    is_regular, zeros_in = (_is_regular, _all_zeros) if few else (_line_is_regular, _dominant_zeros)
    if is_regular(segment):
        return None  # nearly always
    known = _jacobians(segment)
    zeros = zeros_in(segment, known)
    if not len(zeros) or not (is_part or _has_full_rank(segment, known)):
        return None
    if (len(zeros) == 1 or np.ptp(zeros) > TOGETHER) and (apart := _apart(segment, zeros)):
        return apart
    # a shorter step is not refused, and zeros together in that step are one place
    closer = _singular_at if segment.length <= SHORTEST_CHORD else _closer
    least = 2 if few else 1  # Arnoldi's method shows a zero of any multiplicity once
    for group in np.split(zeros, np.flatnonzero(np.diff(zeros) > TOGETHER) + 1):
        middle = 0.5 * segment.length * (1.0 + float(group.mean()))
        if len(group) >= least and (found := closer(segment, middle)):
            return found
    return None


def _apart(segment: CurvedSegment, zeros: Array) -> Failure | None:
    """Return a Failure if the sign between zeros, or behind the last, is not that of the start."""
    places = 0.25 * segment.length * (2.0 + zeros + np.append(zeros[1:], 1.0))
    for state in map(segment.at, places if segment.length > SHORTEST_CHORD else ()):
        if isinstance(state, Failure) or state.orientation != segment.start.orientation:
            return Failure(FailureReason.SINGULAR)
    return None


def _is_regular(segment: CurvedSegment) -> bool:
    """Tell whether the quadratic through the last three Jacobians has no zero near the segment.

    The quadratic is B + s D + s^2 E, with s = 0 at the end and s = -1 at the start.
    """
    start = segment.start
    states = [state for state in (segment.behind, start, segment.end) if state]
    known = [dense(state.jacobian) for state in states if state.jacobian is not None]
    factor = segment.factor_at_end or segment.end.located_by
    if len(known) < len(states) or factor is None:
        return False
    metric, first = segment.curve.metric, known[-2] - known[-1]
    bend = np.zeros_like(first)
    if len(known) > 2:
        behind = metric.norm(start.x - states[0].x) / segment.length
        bend = ((known[0] - known[-1]) / (1.0 + behind) - first) / behind
    forth, bend = _solved(factor, metric.binary, bend - first, bend)
    return not len(_real_zeros(forth, bend, -1.0 - MARGIN, MARGIN, MARGIN))


def _solved(factor: Factor, scale: Array, *changes: Array) -> list[Array]:
    """Return M^-1 [C; 0] for a factorised M and changes C, in the units of the metric."""
    k = len(scale)
    both = np.zeros((len(changes) * k, k))
    both[:, :-1] = np.hstack(changes).T
    parts = factor.solve_all(both).reshape(len(changes), k, k)
    return [part.T * scale / scale[:, np.newaxis] for part in parts]


def _real_zeros(forth: Array, bend: Array, first: float, last: float, imaginary: float) -> Array:
    """Return the zeros s of I + s D + s^2 E from first to last, whose imaginary part is small."""
    norms = largest(np.abs(forth).sum(axis=0)), largest(np.abs(bend).sum(axis=0))
    farthest = max(-first, last)
    if farthest * (norms[0] + farthest * norms[1]) < 1.0 or not isfinite(sum(norms)):
        return np.zeros(0)  # nearly always
    k = len(forth)
    values = np.linalg.eigvals(np.block([[-forth, -bend], [np.eye(k), np.zeros((k, k))]]))
    return _from_to(1.0 / values[np.abs(values) > 0.5 / farthest], first, last, imaginary)


def _from_to(zeros: Array, first: float, last: float, imaginary: float) -> Array:
    """Return the real parts of zeros with a small imaginary part, from first to last, in order."""
    real = zeros.real[np.abs(zeros.imag) < imaginary]
    return np.sort(real[(first < real) & (real < last)])


def _jacobians(segment: CurvedSegment) -> list[Matrix]:
    """Return the Jacobians at the start, nearly in the middle and at the end of a segment."""
    places = segment.start.x, segment.near(0.5 * segment.length), segment.end.x
    return [segment.curve.selection.jacobian(x) for x in places]


def _has_full_rank(segment: CurvedSegment, known: list[Matrix]) -> bool:
    """Tell whether the Jacobian is somewhere farther from a lower rank than at a double root."""
    scale = segment.curve.metric.binary
    for jacobian in known:
        rows = abs(jacobian) @ scale
        solution = _factor(segment, jacobian).solve(joined(rows * generic(len(rows)), 0.0)) / scale
        if largest(np.abs(solution)) < 1.0 / FULL_RANK:
            return True
    return False


def _factor(segment: CurvedSegment, jacobian: Matrix) -> Factor:
    """Return a factorisation of a Jacobian that is bordered by the chord of a segment."""
    metric = segment.curve.metric
    return bordered(jacobian, metric.covector(segment.chord), metric.binary)


def _range(segment: CurvedSegment) -> tuple[float, float]:
    """Return between which places zeros count: -1 and 1, without known branch points there."""
    first, last = (1.0 - KNOWN * state.is_singular for state in (segment.start, segment.end))
    return -first, last


def _all_zeros(segment: CurvedSegment, known: list[Matrix]) -> Array:
    """Return where the quadratic through three Jacobians is singular, between -1 and 1.

    The quadratic is M + s D + s^2 E, with s = -1 at the start and s = 1 at the end of the segment.
    """
    before, here, after = parts = [dense(each) for each in known]
    if not np.isfinite(here).all():  # H may be undefined beside the curve
        here = parts[1] = 0.5 * (before + after)
    if not np.isfinite(parts).all():
        return np.zeros(0)
    changes = 0.5 * (after - before), 0.5 * (after + before) - here
    forth, bend = _solved(_factor(segment, here), segment.curve.metric.binary, *changes)
    return _real_zeros(forth, bend, *_range(segment), TOGETHER)


def _line_is_regular(segment: CurvedSegment) -> bool:
    """Tell whether the line through the Jacobians at both ends has no zero near the segment.

    The line is M + (s - place) / 2 (after - before), with M at the end if a factorisation is known
    there, else in the middle.
    """
    curve, start, end = segment.curve, segment.start, segment.end
    factor, after, place = segment.factor_at_end or end.located_by, end.jacobian, 1.0  # of M
    if factor is None or after is None:
        factor = _factor(segment, curve.selection.jacobian(segment.near(0.5 * segment.length)))
        after, place = curve.selection.jacobian(end.x), 0.0
    before, scale = start.jacobian, curve.metric.binary

    def change(x: Array) -> Array:
        image = product(before, scale * x) - product(after, scale * x)
        return factor.solve(joined(image, 0.0)) / scale

    values = _dominant(change, len(scale), NO_PART / sqrt(len(scale)), NO_EIGENVALUE)
    near = 1.0 + 2.0 * MARGIN
    return not len(_from_to(place + 2.0 / values[np.abs(values) > 0.5], -near, near, 2.0 * MARGIN))


def _dominant_zeros(segment: CurvedSegment, known: list[Matrix]) -> Array:
    """Return zeros as :func:`_all_zeros`, those with the least distance from the middle."""
    before, here, after = known
    factor, scale = _factor(segment, here), segment.curve.metric.binary

    def companion(both: Array) -> Array:
        x, y = np.split(both, 2)
        forth = product(after, scale * (y + x)) + product(before, scale * (y - x))
        image = product(here, scale * y) - 0.5 * forth
        return np.concatenate([factor.solve(joined(image, 0.0)) / scale, x])

    values = _dominant(companion, 2 * len(scale))
    return _from_to(1.0 / values[np.abs(values) > 0.5], *_range(segment), TOGETHER)


def _dominant(apply: Callable[[Array], Array], size: int, *small: float) -> Array:
    """Return the largest eigenvalues of a matrix of some size, by Arnoldi's method.

    ``apply``: returns the matrix times a vector. ``small``: norms of the matrix in the space of
    the first vectors, one after the other, below which all eigenvalues count as small.
    """
    basis, matrix = np.zeros((VECTORS + 1, size)), np.zeros((VECTORS + 1, VECTORS))
    basis[0] = _unit(size)
    for j in range(VECTORS):
        image = apply(basis[j])
        parts = basis[: j + 1].dot(image)
        image -= parts.dot(basis[: j + 1])
        matrix[: j + 1, j], matrix[j + 1, j] = parts, np.linalg.norm(image)
        least = small[j] if j < len(small) else 0.0
        if not least <= np.linalg.norm(matrix) < inf:
            return np.zeros(0)  # nearly always
        if not matrix[j + 1, j] > 0.0:
            break
        basis[j + 1] = image / matrix[j + 1, j]
    return np.asarray(np.linalg.eigvals(matrix[: j + 1, : j + 1]))


@lru_cache(maxsize=4)
def _unit(size: int) -> Array:
    """Return a unit vector with parts of all frequencies: a single wave has no part of others."""
    vector = np.random.default_rng(0).standard_normal(size)
    return np.asarray(vector / np.linalg.norm(vector))


def _closer(segment: CurvedSegment, middle: float) -> State | Failure | None:
    """Return what the part of a segment around a place shows."""
    places = [min(max(middle + p * segment.length, 0.0), segment.length) for p in CLOSER]
    start, end = map(segment.at, places)
    if isinstance(start, Failure) or isinstance(end, Failure):
        return Failure(FailureReason.SINGULAR)
    if start.orientation != segment.start.orientation or end.orientation != start.orientation:
        return Failure(FailureReason.SINGULAR)
    part = CurvedSegment.between(segment.curve, start, end, segment.suggestion)
    found = hidden_in(part, is_part=True)
    return found or _singular_at(segment, middle, CLOSER[1] - CLOSER[0])


def _singular_at(segment: CurvedSegment, at: float, part: float = SHORTEST_CHORD) -> State | None:
    """Return the state at a place of a segment if the Jacobian loses rank there.

    ``part``: of the segment, the error of the place.
    """
    x = segment.near(at)
    if not loses_rank(segment.curve, x):
        return None
    error = part * (segment.end.x - segment.start.x)[np.newaxis]
    return State(x, segment.chord, error, segment.start.orientation, is_singular=True)
