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
eigenvalues vanishes together, as at a branch point of a symmetric structure. The magnitude tells: a
parabola through the determinants at the ends of the step and at the state before says where the
determinant may be least. The curve is looked at there, the next parabola leads through nearer
places, and so on.

- The determinant of many unknowns changes by orders of magnitude within a step: logarithms are
  carried along. A parabola that is wrong costs a few looks; of more than 8 unknowns a determinant
  that falls evenly is left alone.
- A branch point that is known, at the beginning of a piece or where a step ends, is a zero, next to
  which a parabola sees no other zeros: known zeros are divided out.
- An odd number of branch points lies before the branch point that was located in a step: the sign
  next to that branch point tells.
- Along a curve on which H vanishes twice the determinant is rounding: where the Jacobian loses
  rank, nothing is told unless the determinant is far smaller than at both ends.
- The first step of a piece that begins elsewhere has no state before, and is not looked into. Three
  or more branch points within a hundredth of a step may look like one place to a parabola.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, exp, inf, isfinite, isnan, log, nan, sqrt
from operator import itemgetter
from typing import TypeAlias

import numpy as np

from pwscont.basics.arrays import Array, largest, smallest
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED, EPS
from pwscont.curve.crossing import loses_rank
from pwscont.curve.curve import State
from pwscont.curve.step_size import StepSize
from pwscont.curve.stepper import INSIDE, CurvedSegment
from pwscont.linear.factor import Factor
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

#: The second place at which the cubic is looked at, as a part of the step: there the cubic has
#: crossed sqrt(3) - 1 of the distance between sheets.
SECOND = 0.6602
#: The largest number of places in a step.
MOST_PLACES = 256
#: Most unknowns for which a look costs little beside a step.
CHEAP_UNKNOWNS = 8
#: Variation of the distances between places, as a part of the distance.
UNEVEN = 0.3
#: The golden section, whose multiples place the distances unevenly.
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
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


def gap_of(step_size: StepSize | None, system: PiecewiseSystem) -> float:
    """Return the distance within which two folds of a system may be passed over, or zero."""
    if step_size is None or isinstance(system, SlicewiseLinearSystem):
        return 0.0  # equations that are linear at fixed alpha have no fold in a cell
    return step_size.gap * sqrt(max(system.size / CHEAP_UNKNOWNS, 1.0))


def farthest_off(segment: CurvedSegment, factor: Factor, allowed: float, is_sure: bool) -> float:
    """Return how far the curve is from the cubic of a step at most, infinite where alpha turns.

    Not a number where H is undefined, or the cubic is outside the interval.

    ``factor``: a factorisation [J; border] from the end of the segment. ``allowed``: the largest
    distance of the curve from the cubic; beyond, no closer look is taken. ``is_sure``: whether a
    single place is enough in a step no longer than the gap.
    """
    if not 0.0 < segment.gap < segment.length:
        return _off_at(segment, factor, (INSIDE,) if is_sure else (INSIDE, SECOND))
    count = min(max(ceil(segment.length / segment.gap) - 1, 2), MOST_PLACES)
    u, weights, rough = _places(count)
    off, alphas = _looked_at(segment, factor, weights)
    if len(off) < count and not segment.curve.metric.admits(segment.near(INSIDE * segment.length)):
        return nan
    worst = sqrt(largest(np.einsum("ij,ij->i", off, off)))
    if not worst <= allowed:
        return worst  # may be nan
    if worst > INVISIBLE and len(off) == count:
        roughness = np.abs(rough.dot(off))
        if largest(roughness) > ROUGH_PART * largest(np.abs(off)) + INVISIBLE:
            odd = float(u[int(roughness.argmax()) // off.shape[1]])
            around = ((place, 1.0 / count) for place in (odd, 0.0, 1.0))
            worst = max(worst, *(_close_in(segment, factor, room, allowed) for room in around))
    return inf if _turns(segment, factor, u, alphas) else worst


@lru_cache(maxsize=MOST_PLACES)
def _places(count: int) -> tuple[Array, Array, Array]:
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


def _off_at(segment: CurvedSegment, factor: Factor, parts: Sequence[float]) -> float:
    """Return how far the curve is from the cubic at some parts of the step at most."""
    curve, worst = segment.curve, 0.0
    for part in parts:
        x = segment.near(part * segment.length)
        if not curve.metric.admits(x):
            return nan
        off = curve.metric.norm(factor.solve(curve.selection.residual_and(x, 0.0)))
        if not off < inf:
            return nan
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
) -> float:
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
            return inf
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
    least = CONVERGED * segment.curve.metric.width
    if leaving * arriving > 0.0:  # nearly always
        return (largest(steps) if leaving < 0.0 else -smallest(steps)) > least
    signs = np.sign(steps[np.abs(steps) > least])
    signs = np.concatenate([[leaving], signs, [arriving]])
    signs = signs[signs != 0.0]
    return int((signs[1:] * signs[:-1] < 0.0).sum()) > 1


# -- branch points within a step -------------------------------------------------------------------

#: A look is taken if the parabola comes down to this part of the least determinant that is known.
LOW = 0.9
#: Where the determinant at an end of a step is this part of the determinants beside, zeros may lie
#: next to that end, and a look is taken at this part of the step from the other end.
DEEP, NEXT_TO_END = 0.03, 0.9
#: The determinant of many unknowns may fall evenly, and no look is taken: by more than this factor
#: within a step, if the rates of the logarithm in two steps agree up to this part. Zeros bend the
#: rates.
DECAY, EVENLY = 0.1, 0.2
#: Further looks are taken while the determinant beside the least is this many times larger: the
#: determinant may be flat and have several zeros between.
FAR_HIGHER = 10.0
#: Most looks into a step, and the shortest step that is refused where that many tell nothing.
MOST_LOOKS, SHORTEST = 24, 1e-4
#: Where the Jacobian loses rank, the determinant vanishes if it is below this part of the largest
#: determinant that is known. On a curve of double roots every determinant is rounding.
VANISHES = 1e-6
#: Distance from a place at which the Jacobian is exactly singular, as a part of the step.
BESIDE_LOOK = EPS**0.5
#: Where looks are taken, as parts of the step, if a known branch point leaves fewer than three
#: determinants. The first look is for a step that ends at a branch point: next to the end the sign
#: must still be that of the start.
PARTS = (0.99, 0.5, 0.25)
#: Distance of places, as a part of the room between three, below which a look tells nothing new.
SAME_PLACE = 1e-6
#: Logarithm of the largest ratio of determinants: the power of a larger one overflows.
LARGEST_LOG = 700.0

#: A place on a segment, and the magnitude of the determinant there, up to a constant.
Place: TypeAlias = tuple[float, float]
_value = itemgetter(1)


def hidden_in(segment: CurvedSegment) -> State | Failure | None:
    """Return a state within a segment at which the determinant vanishes and keeps its sign.

    A Failure if the sign flips twice within the segment: a shorter step is needed. None if the
    determinant does not vanish within the segment, and where the signs at both ends differ.
    """
    states = [*segment.behind, segment.start, segment.end]
    known = [state for state in states if not state.is_singular]
    if len(known) == len(states) and not _may_vanish(segment, known):
        return None  # nearly always
    known, sign = known[-3:], segment.start.orientation
    if any(state.orientation != sign for state in (*known, segment.end)):
        return None
    parts = PARTS if segment.end.is_singular else PARTS[1:]
    for part in parts[: max(3 - len(known), len(parts) - 2)]:
        look = _look(segment, part * segment.length)
        if look is None:
            return None
        if look.orientation != sign:
            return Failure(FailureReason.SINGULAR)
        known.append(look)
    zeros = tuple(segment.position(state.x) for state in states if state.is_singular)
    return _least(segment, known[-3:], zeros)


def _may_vanish(segment: CurvedSegment, known: list[State]) -> bool:
    """Tell whether the parabola through the last three determinants is low within a segment."""
    if len(known) < 3 or not known[-2].log_determinant < known[-3].log_determinant:
        return False  # the determinant grows
    earlier, here, end = known[-3:]
    first, last = (
        exp(min(each.log_determinant - here.log_determinant, LARGEST_LOG))
        for each in (earlier, end)
    )
    before = segment.curve.metric.norm(here.x - earlier.x)
    return _first_look([(-before, first), (0.0, 1.0), (segment.length, last)], segment) is not None


def _least(
    segment: CurvedSegment, known: list[State], zeros: tuple[float, ...]
) -> State | Failure | None:
    """Return what looks at the least determinant tell, as :func:`hidden_in` does."""
    places = sorted(_placed(state, segment, zeros) for state in known)
    at, largest = _first_look(places, segment), max(map(_value, places))
    for _ in range(MOST_LOOKS):
        if at is None or not 0.0 < at < segment.length:
            return None  # nearly always
        state = _look(segment, at)
        if state is None:
            break
        here = _placed(state, segment, zeros)
        if loses_rank(segment.curve, state.x):
            vanishes = here[1] <= VANISHES * largest
            return state if vanishes and not loses_rank(segment.curve, segment.end.x) else None
        if state.orientation != segment.end.orientation:
            return Failure(FailureReason.SINGULAR)
        places = _around_lowest([*places, here])
        at = _least_at(places) or _nearer(places)  # no place of a look is zero
    return Failure(FailureReason.SINGULAR) if segment.length > SHORTEST else None


def _look(segment: CurvedSegment, at: float) -> State | None:
    """Return the state at a place, or right beside where Newton's method finds none."""
    for place in (at, at + BESIDE_LOOK * segment.length):
        state = segment.at(place)
        if isinstance(state, State) and not isnan(state.log_determinant):
            return state
    return None


def _placed(state: State, segment: CurvedSegment, zeros: tuple[float, ...]) -> Place:
    """Return the place of a state, and the determinant there, from which zeros are divided out."""
    logs = (segment.start.log_determinant, segment.end.log_determinant)
    at = segment.position(state.x)
    above = state.log_determinant - max(filter(isfinite, logs), default=0.0)
    above -= sum(log(abs(at - zero) / segment.length) for zero in zeros if at != zero)
    return at, exp(min(above, LARGEST_LOG))


def _first_look(places: list[Place], segment: CurvedSegment) -> float | None:
    """Return where to look first: where the parabola is low, or next to an end that is low."""
    if segment.curve.selection.system.size > CHEAP_UNKNOWNS and _follow_trend(places):
        return None
    at = _least_at(places)
    if at is not None and 0.0 < at < segment.length:
        return at
    values = [value for _, value in places]
    if values[-1] < DEEP * values[-2]:
        return NEXT_TO_END * segment.length
    is_low = places[-2][0] == 0.0 and values[-2] < DEEP * min(values[0], values[-1])
    return (1.0 - NEXT_TO_END) * segment.length if is_low else None


def _follow_trend(places: list[Place]) -> bool:
    """Tell whether three determinants fall like the terms of a geometric sequence, and fast."""
    (a, first), (b, middle), (c, last) = places
    if not 0.0 < middle < DECAY * first or not last > 0.0:
        return False
    before, after = log(middle / first) / (b - a), log(last / middle) / (c - b)
    return abs(after - before) < EVENLY * abs(before)


def _least_at(places: list[Place]) -> float | None:
    """Return where the parabola through three places is least, None if that is not low enough."""
    (a, first), (b, middle), (c, last) = places
    falls, rises = (middle - first) / (b - a), (last - middle) / (c - b)
    bend = (rises - falls) / (c - a)
    if not bend > 0.0:
        return None
    slope = falls + bend * (b - a)  # at the middle
    at, least = b - 0.5 * slope / bend, middle - 0.25 * slope * slope / bend
    is_new = min(abs(at - a), abs(at - b), abs(at - c)) > SAME_PLACE * (c - a)
    return at if is_new and least <= LOW * min(first, middle, last) else None


def _nearer(places: list[Place]) -> float | None:
    """Return a place between the lowest of three and a place beside that is far higher, if any."""
    first, (at, least), last = places
    if min(first[1], last[1]) < least:
        return None  # the determinant falls towards an end
    far, value = max(first, last, key=_value)
    return 0.5 * (at + far) if value > FAR_HIGHER * least else None


def _around_lowest(places: list[Place]) -> list[Place]:
    """Return the lowest of four places and the two places beside it, in order."""
    places = sorted(places)
    middle = min(max(places.index(min(places, key=_value)), 1), 2)
    return places[middle - 1 : middle + 2]
