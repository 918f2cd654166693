"""Looks inside a step: places at which H tells whether the curve is where the cubic leads.

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
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, inf, sqrt

import numpy as np

from pwscont.basics.arrays import GOLDEN, Array, largest, smallest
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED, EPS, GUARD
from pwscont.curve.stepper import CurvedSegment, StepSize
from pwscont.linear.factor import Factor
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
