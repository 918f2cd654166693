"""Smooth folds and smooth branch points, inside of a cell.

A fold may lie at an end of the interval. The place where the curve turns is known to the square
root of rounding only; the place where the slope of alpha vanishes is well known, and serves the
rays on both sides. From there the tangent leads along the end: it leans into the interval by as
much as its own rounding. A fold beyond the end cuts the curve at the end, unless alpha is equal to
rounding.

At a branch point two curves of the same selection cross, and both curves are followed. Near it
[J; t^T] is nearly singular: the point is the regular solution of an extended system
(:mod:`pwscont.curve.crossing`), and the curve is bisected only while the step is too long for that.
The sign of det[J; t^T] next to the point is rounding: a point just outside the step counts as well.
Where a step jumped to another curve that passes close by, the sign flips without a branch point:
such a step fails, and is shortened. Points where the sign does not flip go unseen: where an even
number of eigenvalues vanishes together, and where curves touch.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, dense, product
from pwscont.basics.character import Character
from pwscont.basics.outcome import TOUCH, Failure, FailureReason, Kind
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD, SAME_ALPHA
from pwscont.curve.corrector import polished
from pwscont.curve.crossing import (
    CLOSE_TO_CROSSING,
    ERROR_OF_DIFFERENCES,
    FULL_RANK,
    Crossing,
    crossing,
    loses_rank,
    may_lose_rank,
)
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import uncertainty_beside
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.linear.factorise import bordered
from pwscont.system.selection import Selection
from pwscont.transitions.corner import index_at, is_solid
from pwscont.transitions.detector import (
    BOTH_SIGNS,
    NARROW_BRACKET,
    UNKNOWN,
    Reading,
    SpecialPointFound,
    TransitionDetector,
    locate_sign_change,
)
from pwscont.transitions.rays import Corner, Ray, beside

#: Slopes below this part of the turn of a step are polished where a fold is located: the tangents
#: of other states are known well enough to tell the side of the fold.
NEARLY_LEVEL = 1e-3
#: A dip of the slope of alpha below zero by less than this part of the slope is left alone.
SHALLOW_TURN = 1e-4


@final
@dataclass(frozen=True, slots=True)
class SmoothFolds(TransitionDetector):
    """Watches the alpha component of the tangent, which is proportional to det(dH/dz)."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the component and the negative component; zero to rounding counts as zero."""
        return Reading(curve.slope(state) * BOTH_SIGNS, UNKNOWN)

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Say that alpha turns twice on the cubic of the segment, or has slope zero at its end.

        The slope of the cubic is a parabola; a parabola that barely reaches zero is left alone, and
        so is a segment on which alpha is constant to rounding, as around the zero of z^5. On
        the step after a fold, which begins with slope zero, alpha may turn once. A step that ends
        with slope zero must be shorter, except along a vertical piece, on which alpha is the same
        at both ends; if every shorter step ends with slope zero, the branch is flat.
        """
        first, last = float(start.values[0]), float(end.values[0])
        if not last:
            rise = abs(segment.end.alpha - segment.start.alpha)
            is_flat = first or rise > CONVERGED * segment.curve.metric.width
            return Failure(FailureReason.FLAT) if is_flat else None
        return Failure(FailureReason.HIDDEN_FOLDS) if _turns_twice(segment) else None

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find where the tangent has no alpha component."""
        assert isinstance(segment, CurvedSegment)  # straight segments have no smooth folds
        sign, curve = 1.0 if index == 0 else -1.0, segment.curve
        finer = cache(partial(polished, curve))  # states are polished once

        def slope(state: State) -> float:
            return sign * float(state.tangent[-1])

        turn = abs(float(segment.end.tangent[-1] - segment.start.tangent[-1]))

        def exact_slope(state: State) -> float:
            if abs(slope(state)) > NEARLY_LEVEL * turn:
                return slope(state)
            state, off = finer(state)
            return slope(state) if abs(slope(state)) > off * curve.metric.width else 0.0

        narrow = _place(segment, GUARD * EPS)
        found = locate_sign_change(segment, exact_slope, bracket, narrow)
        if isinstance(found, Failure):  # right at an end the change may be polished away
            narrow = max(narrow, NARROW_BRACKET)
            found = locate_sign_change(segment, slope, bracket, narrow)
        if isinstance(found, Failure):
            return found
        fold, off = finer(found)
        # an exactly vertical tangent: rounding would be found as a fold again
        narrow, level = max(narrow, _place(segment, off)), _with_slope(fold, 0.0, fold.error)
        along = max(narrow * segment.length, _uncertain(curve, fold.x)) * level.tangent
        # alpha is stationary at a fold: its error is of second order
        return replace(level, error=np.vstack([fold.error, uncertainty_beside(curve, fold), along]))

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve."""
        return fold_point(curve, state)


def _uncertain(curve: Curve, fold: Array) -> float:
    """Return how far along the curve a fold at the alpha of a branch point is uncertain.

    Next to a branch point tangents are rounding.
    """
    reach = 1.0 / CLOSE_TO_CROSSING
    found = _crossing_at(curve, fold, reach) if may_lose_rank(curve, fold) else None
    if found is None or abs(found.x[-1] - fold[-1]) > SAME_ALPHA * curve.metric.width:
        return 0.0
    return max(curve.metric.norm(found.x - fold), FULL_RANK)


def fold_point(curve: Curve, fold: State, where: str = "") -> SpecialPointFound:
    """Return a fold as a special point, from which the same curve goes on."""
    forth, message = Ray(curve, fold), f'fold within "{curve.selection.label}"{where}'
    return SpecialPointFound(Kind.FOLD, fold.x, message, (forth.reversed(), forth))


def _turns_twice(segment: CurvedSegment) -> bool:
    first, chord, last = segment.slopes_of_alpha()
    a, b = 3.0 * (first + last - 2.0 * chord), 6.0 * chord - 4.0 * first - 2.0 * last
    if first * last < 0.0 or not 0.0 < -b / (2.0 * a or np.inf) < 1.0:
        return False
    least, largest = first - 0.25 * b * b / a, max(abs(first), abs(last))
    steepest = max(largest, abs(chord))  # from fold to fold both ends are level
    if segment.length * steepest <= GUARD * EPS * segment.curve.metric.width:
        return False  # both folds would be at one alpha
    return bool(least * (first + last) < -SHALLOW_TURN * largest * abs(first + last))


def _place(segment: CurvedSegment, off: float) -> float:
    """Return the accuracy of the place of a fold, as a part of the segment, from the tangent's."""
    turn = abs(segment.curve.slope(segment.end) - segment.curve.slope(segment.start))
    return min(off / turn, 1.0) if turn else 1.0


#: A curve steeper than this at an end has no fold there.
STEEPEST_AT_FOLD = 1e-2
#: Distance from the end, in the metric, at which the slope of alpha is compared first.
FIRST_SECANT = 1e-4
MOST_SECANTS = 8
#: The tangent of a fold at an end leans into the interval by this part of its length.
LEAN_INWARDS = EPS**0.5


def fold_at_end(curve: Curve, state: State) -> State | None:
    """Return the fold that ``state`` is, if alpha there is an end of the interval to rounding.

    None if the state is not at an end, or alpha goes on beyond the end.
    """
    side = _side(curve, state)
    if not side or abs(slope := curve.slope(state)) > STEEPEST_AT_FOLD:
        return None
    inwards = FIRST_SECANT if side * slope > 0.0 else -FIRST_SECANT
    here, there = beside(curve, state, 0.0), beside(curve, state, inwards)
    if isinstance(here, Failure) or isinstance(there, Failure) or _side(curve, there):
        return None
    steepness = before = curve.slope(there)
    r, s, slope, fold = inwards, 0.0, curve.slope(here), here
    for _ in range(MOST_SECANTS):  # to where the slope of alpha vanishes
        if slope in (0.0, before):
            break
        r, s, before = s, s - slope * (s - r) / (slope - before), slope
        found = abs(s) <= FIRST_SECANT and beside(curve, state, s)
        if not isinstance(found, State):
            return None
        fold, slope = found, curve.slope(found)
    if not _side(curve, fold):
        return None
    along = max(abs(s), GUARD * EPS * FIRST_SECANT / abs(steepness))
    return _with_slope(fold, 0.0, np.vstack([state.error, fold.error, along * fold.tangent]))


def leads_outside(ray: Ray) -> bool:
    """Tell whether a ray along an end of the interval bends out of the interval."""
    curve, state = ray.curve, ray.state
    if not _side(curve, state) or abs(curve.slope(state)) > STEEPEST_AT_FOLD:
        return False
    found = beside(curve, state, FIRST_SECANT)
    return isinstance(found, Failure) and found.trouble is FailureReason.OUTSIDE


def _with_slope(state: State, slope: float, error: Array) -> State:
    """Return a state with another component of the tangent along alpha, and another error."""
    tangent = state.tangent.copy()
    tangent[-1] = slope
    return State(state.x, tangent, error, state.orientation)


def leaning(ray: Ray) -> Ray:
    """Return a ray along an end of the interval, leant so that the ray leads into the interval."""
    curve, state = ray.curve, ray.state
    side = _side(curve, state)
    if not side or curve.slope(state):
        return ray
    slope = side * LEAN_INWARDS * float(curve.metric.scale[-1])
    return replace(ray, state=_with_slope(state, slope, state.error))


def _side(curve: Curve, state: State) -> int:
    """Return the sign with which alpha enters the interval at an end of a curved piece, else 0."""
    if curve.selection.is_straight:
        return 0
    (lo, hi), alpha = curve.metric.interval, state.alpha
    same = SAME_ALPHA * max(hi - lo, abs(alpha))
    return (abs(alpha - lo) <= same) - (abs(alpha - hi) <= same)


#: A branch point outside a step, within this part of the step's length, belongs to the step.
OUTSIDE_STEP = 0.1
MOST_BISECTIONS = 10
#: Largest distance, in the metric, of a branch point from where it was located before.
LOCATED_AGAIN = EPS**0.5
#: The functions of a reading that belong to the cell that is followed: the sign and its negative.
OWN_SIGNS = 2
#: Most tests that vanish along a path of which all adjacent cells are tried.
MOST_TESTS_ON_PATH = 4
#: Distance at which the sign of det[J; t^T] is evaluated if no piece carries the sign along.
DISTANCE_TO_SIGN = EPS**0.25


@final
@dataclass(frozen=True, slots=True)
class SmoothBranchPoints(TransitionDetector):
    """Watches the sign of det[J; t^T], in all cells next to a path along an interface.

    The sign flips at simple branch points and nowhere else.
    """

    def read(self, curve: Curve, state: State) -> Reading:
        """Return each sign and its negative."""
        others = _in_other_cells(curve)
        if not others:
            return Reading(state.orientation * BOTH_SIGNS, UNKNOWN)  # nearly always
        signs = [state.orientation, *(_sign_around(own, state) for own in others)]
        return Reading(np.outer(signs, BOTH_SIGNS).ravel(), np.zeros(2 * len(signs)))

    def locate(
        self, segment: Segment, index: int, bracket: tuple[float, float]
    ) -> State | Failure | None:
        """Solve the extended system from within the bracket.

        None where the sign of a cell that is not followed flips, and no curve leads into that cell.
        """
        assert isinstance(segment, CurvedSegment)  # straight curves cannot cross
        before, orientation = -1 if index % 2 else 1, segment.start.orientation
        if index >= OWN_SIGNS:
            own = _in_other_cells(segment.curve)[index // 2 - 1]
            segment = CurvedSegment.between(own, segment.start, segment.end, segment.suggestion)
        found = _locate(segment, bracket, before)
        if isinstance(found, Crossing):
            state = State(found.x, _own(segment, found), found.error, orientation)
            is_seen = index < OWN_SIGNS or _crossing_rays(segment.curve, state)
            return state if is_seen else None
        return found if index < OWN_SIGNS or isinstance(found, State) else None

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Go on along the same curve, and in both directions along the crossing curve."""
        if curve.selection.adjacent_cells:
            point = branch_point_on_interface(curve, state)
        else:
            here = Corner.at(curve.selection.system, curve.metric, state.x, state.error)
            point = path_through(curve, here)
        if point:
            return point
        if found := _crossing_at(curve, state.x):
            return branch_point(curve, found, state)
        after = state.orientation if index >= OWN_SIGNS else -state.orientation
        onward = Ray(curve, State(state.x, state.tangent, state.error, after))
        rays = Ray(curve, state).reversed(), onward
        return SpecialPointFound(Kind.DEGENERATE, state.x, TOUCH, rays)


def branch_point(curve: Curve, found: Crossing, state: State) -> SpecialPointFound:
    """Return a branch point with its four rays.

    The signs of det[J; t^T] on the rays, each ray seen leaving the point, alternate around the
    point: a piece that arrives on one curve with a positive sign goes on with a negative sign, and
    both halves of the other curve leave with a positive sign.

    ``state``: the point as an arrival on either curve, with the sign before the point.
    """
    other, sign = _least_along(found, curve.metric.covector(state.tangent)), state.orientation
    ways = (-state.tangent, -sign), (state.tangent, -sign), (other, sign), (-other, sign)
    rays = tuple(Ray(curve, State(state.x, way, state.error, side)) for way, side in ways)
    message = f"two curves cross on {curve.selection.label}"
    return SpecialPointFound(Kind.BRANCH_POINT, state.x, message, rays)


def branch_point_on_interface(curve: Curve, state: State) -> SpecialPointFound | None:
    """Return the point where curves cross a path along an interface, as of z (|z| - alpha) at 0.

    Each cell next to the path has a crossing curve of its own, of which the half inside the cell is
    followed. None where no cell has one.

    ``state``: the point as an arrival on the path.
    """
    every = _in_cells(curve, curve.selection.adjacent_cells)
    rays = [ray for own in every for ray in _crossing_rays(own, state)]
    if not rays:
        return None
    after = _sign_beside(curve, state.x, state.tangent, 1.0)
    onward = State(state.x, state.tangent, state.error, after or -state.orientation)
    path = [_along(curve, Ray(curve, state).reversed()), _along(curve, Ray(curve, onward))]
    message = f"curves cross on the boundary of {curve.selection.label}"
    return SpecialPointFound(Kind.BRANCH_POINT, state.x, message, (*path, *rays))


def path_through(curve: Curve, corner: Corner) -> SpecialPointFound | None:
    """Return the point of a path along interfaces at which a curve in a cell arrives, or None.

    The first ray leads back on the curve: the tangent with which the curve arrived is rounding.
    """
    here, scale = curve.selection, corner.metric.scale
    if here.is_straight or not 0 < len(corner.zero) <= MOST_TESTS_ON_PATH:
        return None
    found = _crossing_at(curve, corner.x, 1.0 / CLOSE_TO_CROSSING)
    if found is None:
        return None
    x = found.x  # more digits: where the curve meets the interface, the Jacobian loses rank
    rows = dense(replace(corner, x=x).vanishing(here)[1])
    if not len(rows):
        return None
    tangent = _least_along(found, rows)
    if (np.abs(rows @ tangent) > DISTANCE_TO_SIGN * (np.abs(rows) @ scale)).any():
        return None
    cells = tuple(cell for cell in corner.all_cells() if is_solid(corner, cell))
    path = Curve(Selection(corner.system, here.character, cells), corner.metric)
    sign = _sign_before(curve, x, tangent)
    point = branch_point_on_interface(path, State(x, tangent, found.error, sign))
    own = [ray for ray in point.rays if ray.cells == (here.cell,)] if point else []
    rest = (ray for ray in point.rays if ray is not own[0]) if point else ()
    return point.leading((own[0], *rest)) if point and own else None


def path_from(corner: Corner) -> SpecialPointFound | None:
    """Return a start that is a branch point of a path along interfaces, None if there is none."""
    if not len(corner.zero) <= MOST_TESTS_ON_PATH:
        return None
    cells = (Curve(Selection(corner.system, cell), corner.metric) for cell in corner.all_cells())
    return next(filter(None, (path_through(curve, corner) for curve in cells)), None)


def _in_cells(curve: Curve, cells: Iterable[Character]) -> list[Curve]:
    """Return a path along an interface as a curve of each of these cells."""
    return [Curve(Selection(curve.selection.system, cell), curve.metric) for cell in cells]


def _in_other_cells(curve: Curve) -> list[Curve]:
    """Return a curved path along an interface as a curve of each other cell, none of very many."""
    here = curve.selection
    if here.is_straight or not 0 < len(here.adjacent_cells) <= 2**MOST_TESTS_ON_PATH:
        return []  # nearly always
    pairs = zip(here.adjacent_cells, here.adjacent_names, strict=True)
    followed = here.system.cell(here.character)
    return _in_cells(curve, (cell for cell, name in pairs if name != followed))


def _sign_around(own: Curve, state: State) -> int:
    """Return the sign of det[J; t^T] in a cell, zero where the sign differs on both sides."""
    signs = {_sign_beside(own, state.x, state.tangent, side) for side in (-1.0, 1.0)} - {None}
    return signs.pop() or 0 if len(signs) == 1 else 0


def _crossing_rays(own: Curve, state: State) -> list[Ray]:
    """Return the rays into a cell of the curve that crosses a path along the cell's boundary."""
    metric, x = own.metric, state.x
    if not (found := _crossing_at(own, x)):
        return []
    other = _least_along(found, metric.covector(state.tangent))
    sign = _sign_before(own, x, state.tangent)
    gradients = own.selection.test_gradients(x)
    vanish = np.abs(own.selection.tests(x)) <= LOCATED_AGAIN * (abs(gradients) @ metric.scale)
    ways = [way for way in (other, -other) if (product(gradients, way)[vanish] > 0.0).all()]
    return [Ray(own, State(x, way, state.error, sign)) for way in ways]


def _crossing_at(curve: Curve, x: Array, near: float = LOCATED_AGAIN) -> Crossing | None:
    """Return the branch point within a distance of a point, None if there is none."""
    found = crossing(curve, x)
    if isinstance(found, Failure) or curve.metric.norm(found.x - x) > near:
        return None
    return found


def _least_along(found: Crossing, rows: Matrix) -> Array:
    """Return the direction at a branch point whose products with rows are least."""
    return min(found.directions, key=lambda way: float(np.linalg.norm(product(rows, way))))


def _sign_before(curve: Curve, x: Array, tangent: Array) -> int:
    """Return the sign of det[J; t^T] just before a branch point, where the sign flips."""
    before = _sign_beside(curve, x, tangent, -1.0)
    return -(_sign_beside(curve, x, tangent, 1.0) or 0) if before is None else before


def _sign_beside(curve: Curve, x: Array, tangent: Array, side: float) -> int | None:
    """Return the sign of det[J; t^T] before or after a point, for a side of -1 or +1.

    Zero where J has lower rank, None outside the interval.
    """
    near, metric = x + side * DISTANCE_TO_SIGN * tangent, curve.metric
    if not metric.interval[0] <= near[-1] <= metric.interval[1]:
        return None
    factor = bordered(curve.selection.jacobian(near), metric.covector(tangent), metric.binary)
    return 0 if factor.is_singular() else factor.sign


def _along(curve: Curve, ray: Ray) -> Ray:
    """Return a ray along an interface with the index that the ray has beside its beginning."""
    beyond = beside(curve, ray.state, DISTANCE_TO_SIGN)
    if isinstance(beyond, Failure):
        beyond = ray.state
    corner = Corner.at(curve.selection.system, curve.metric, beyond.x, beyond.error)
    index = index_at(Ray(curve, beyond), corner)
    return Ray(curve, ray.state, curve.selection.adjacent_cells, index)


def at_branch_point(curve: Curve, x: Array) -> SpecialPointFound | None:
    """Return the branch point that a start is, at the start's alpha up to errors, None if none."""
    found = _crossing_at(curve, x, curve.metric.slack(x, FULL_RANK))
    if found is None or not found.meets:
        return None
    tangent, at = found.directions[0], found.x.copy()
    if abs(at[-1] - x[-1]) <= CONFIDENCE * ERROR_OF_DIFFERENCES * curve.metric.width:
        at[-1] = x[-1]
    sign = _sign_before(curve, at, tangent)
    error = np.vstack([found.error, at - found.x])
    return branch_point(curve, found, State(at, tangent, error, sign))


def crossing_on_end(curve: Curve, x: Array) -> SpecialPointFound | None:
    """Return the branch point on an end of the interval next to ``x``, None if there is none."""
    ends = np.array(curve.metric.interval)
    on_end = np.append(x[:-1], ends[np.abs(ends - x[-1]).argmin()])
    if curve.selection.is_straight or curve.metric.norm(x - on_end) > DISTANCE_TO_SIGN:
        return None
    point = at_branch_point(curve, on_end)
    return point if point and point.x[-1] == on_end[-1] else None


def _locate(
    segment: CurvedSegment, bracket: tuple[float, float], before: int
) -> Crossing | State | Failure | None:
    """Return the branch point on a segment, bisecting until Newton finds the point.

    Where Newton finds no point although the Jacobian loses rank where the sign flips, curves touch:
    the last state tried is returned. A sign that is rounding all along the segment, as on a
    curve of double roots, tells of no point: None.
    """
    (lo, hi), last = bracket, segment.end
    for _ in range(MOST_BISECTIONS):
        middle = 0.5 * (lo + hi)
        found = crossing(segment.curve, segment.near(middle))
        point = found if isinstance(found, Crossing) and _belongs(segment, found.x) else None
        if point is None and last is segment.end and _is_double(segment):
            return None
        if point is not None:
            if not point.meets:
                return Failure(FailureReason.SINGULAR)
            middle = 0.5 * (lo + segment.position(point.x))
            if middle <= lo:
                return point
        state = segment.at(middle)
        if point is not None and (isinstance(state, Failure) or state.orientation == before):
            return point  # the sign has not flipped on the way to the point
        if isinstance(state, Failure):
            return state
        lo, hi = (middle, hi) if state.orientation == before else (lo, middle)
        last = state
    return _touching(segment, last, hi - lo, before)


def _is_double(segment: CurvedSegment) -> bool:
    """Tell whether the Jacobian loses rank along a segment that no branch point explains."""
    is_long = segment.length > 1.0 / CLOSE_TO_CROSSING
    return is_long and all(loses_rank(segment.curve, end.x) for end in (segment.start, segment.end))


def _touching(segment: CurvedSegment, last: State, apart: float, before: int) -> State | Failure:
    """Return the point, known up to a distance, at which the sign flips and curves touch."""
    if all(loses_rank(segment.curve, end.x) for end in (segment.start, segment.end)):
        return Failure(FailureReason.TWICE)
    if not loses_rank(segment.curve, last.x):
        return Failure(FailureReason.SINGULAR)
    error = np.vstack([last.error, apart * last.tangent])
    return State(last.x, last.tangent, error, before)


def _belongs(segment: CurvedSegment, x: Array) -> bool:
    """Tell whether a branch point lies on the segment, or too close to its ends to decide."""
    s, slack = segment.position(x), OUTSIDE_STEP * segment.length
    aside = segment.curve.metric.norm(x - segment.near(s))
    return bool(-slack <= s <= segment.length + slack and aside <= segment.length)


def _own(segment: CurvedSegment, found: Crossing) -> Array:
    """Return the direction, pointing forward, that is closest to the cubic through the ends."""
    r = segment.position(found.x) / segment.length
    slope = (1.0 - r) * (1.0 - 3.0 * r) * segment.start.tangent
    slope += r * (3.0 * r - 2.0) * segment.end.tangent + 6.0 * r * (1.0 - r) * segment.chord
    covector = segment.curve.metric.covector(slope)
    cosines = [float(covector.dot(direction)) for direction in found.directions]
    best = int(np.argmax(np.abs(cosines)))
    return np.asarray(np.sign(cosines[best]) * found.directions[best])
