"""Branch points: two curves of one selection cross, or curves of cells cross a path along a kink.

All curves are followed. Near a branch point [J; t^T] is nearly singular: the point is the regular
solution of an extended system (:mod:`pwscont.curve.crossing`), and the curve is bisected only while
the step is too long for that. The sign of det[J; t^T] next to the point is rounding: a point just
outside the step counts as well. Where a step jumped to another curve that passes close by, the sign
flips without a branch point: such a step fails, and is shortened. Points where the sign does not
flip go unseen: where an even number of eigenvalues vanishes together, and where curves touch.

Where a curve of a cell meets a path along the cell's boundary, Newton's method for the place where
the test vanishes also converges beside that place, on the path. So the branch point is located, and
not the kink.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, generic, product
from pwscont.basics.outcome import Failure, FailureReason, Kind, Remark
from pwscont.basics.rounding import CONFIDENCE, EPS, HALF_DIGITS
from pwscont.curve import crossing
from pwscont.curve.crossing import Crossing, hidden_in
from pwscont.curve.curve import ERROR_OF_DIFFERENCES, Curve, State
from pwscont.curve.error_samples import zero_up_to
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.linear.factorise import bordered
from pwscont.system.selection import Selection
from pwscont.transitions import detector
from pwscont.transitions.cone import index_at, is_solid
from pwscont.transitions.corner import Corner
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import NEARBY, Ray, are_parallel, beside

#: A branch point outside a step, within this part of the step's length, belongs to the step.
OUTSIDE_STEP = 0.1
#: Distance from the beginning of a step, as a part of the step, at which a branch point is the one
#: at the beginning.
BEGINNING = 1e-6
MOST_BISECTIONS = 10
#: Distance across a curve, in the metric, over which the sign flips if H vanishes twice on the
#: curve: far more than the HALF_DIGITS to which the place of such a curve is known.
ACROSS = EPS**0.375
#: The functions of a reading that belong to the cell that is followed: the sign and its negative.
OWN_SIGNS = 2
#: Most tests that vanish along a path of which all adjacent cells are tried.
MOST_TESTS_ON_PATH = 4


@final
@dataclass(frozen=True, slots=True)
class SmoothBranchPoints(TransitionDetector):
    """Watches the sign of det[J; t^T], in all cells next to a path along an interface.

    The sign flips at simple branch points and nowhere else.
    """

    def read(self, curve: Curve, state: State) -> Reading:
        """Return each sign and its negative."""
        others = _in_other_cells(curve)
        if not others:  # nearly always
            return Reading(state.orientation * detector.BOTH_SIGNS, detector.UNKNOWN)
        signs = [state.orientation]
        for own in others:  # zero where the sign differs on both sides
            around = {_sign_beside(own, state.x, state.tangent, side) for side in (-1.0, 1.0)}
            known = around - {None}
            signs.append(known.pop() or 0 if len(known) == 1 else 0)
        return Reading(np.outer(signs, detector.BOTH_SIGNS).ravel(), np.zeros(2 * len(signs)))

    def look_inside(self, segment: CurvedSegment) -> State | Failure | None:
        """Look where the determinant vanishes although the sign is the same at both ends."""
        return hidden_in(segment)

    def locate(
        self, segment: Segment, index: int, bracket: tuple[float, float]
    ) -> State | Failure | None:
        """Solve the extended system from within the bracket.

        None where the sign of a cell that is not followed flips, and no curve leads into that cell,
        and where the sign is rounding, as on a curve of double roots.
        """
        assert isinstance(segment, CurvedSegment)  # straight curves cannot cross
        before, orientation = -1 if index % 2 else 1, segment.start.orientation
        if index >= OWN_SIGNS:
            own = _in_other_cells(segment.curve)[index // 2 - 1]
            segment = CurvedSegment.between(own, segment.start, segment.end, segment.suggestion)
        found = _locate(segment, bracket, before)
        if isinstance(found, Crossing):
            way = _own(segment, found)
            state = State(found.x, way, found.error, orientation, is_singular=True)
            is_seen = index < OWN_SIGNS or _ways_across(segment.curve, state)
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
        if found := crossing.crossing_near(curve, state.x):
            return branch_point(curve, found, state)
        after = -state.orientation if 0 <= index < OWN_SIGNS else state.orientation
        onward = Ray(curve, State(state.x, state.tangent, state.error, after, is_singular=True))
        rays = Ray(curve, state).reversed(), onward
        return SpecialPointFound(Kind.DEGENERATE, state.x, Remark.TOUCH, rays)


def branch_point(curve: Curve, found: Crossing, state: State) -> SpecialPointFound:
    """Return a branch point with its four rays.

    The signs of det[J; t^T] on the rays, each ray seen leaving the point, alternate around the
    point: a piece that arrives on one curve with a positive sign goes on with a negative sign, and
    both halves of the other curve leave with a positive sign.

    ``state``: the point as an arrival on either curve, with the sign before the point.
    """
    other, sign = _least_along(found, curve.metric.covector(state.tangent)), state.orientation
    ways = (-state.tangent, -sign), (state.tangent, -sign), (other, sign), (-other, sign)
    rays = tuple(
        Ray(curve, State(state.x, way, state.error, side, is_singular=True)) for way, side in ways
    )
    message = f"two curves cross on {curve.selection.label}"
    return SpecialPointFound(Kind.BRANCH_POINT, state.x, message, rays)


def branch_point_on_interface(curve: Curve, state: State) -> SpecialPointFound | None:
    """Return the point where curves cross a path along an interface, as of z (|z| - alpha) at 0.

    Each cell next to the path has a crossing curve of its own. The half inside the cell is
    followed. If the equations of the cell that is followed have such a curve outside of the cell
    only, the path just goes on. None where nothing crosses, or two paths along the interface cross.

    ``state``: the point as an arrival on the path.
    """
    cells = curve.selection.adjacent_cells
    own = (Curve(Selection(curve.selection.system, cell), curve.metric) for cell in cells)
    rays = _crossing_rays(curve, own, state)
    if not (rays or _across(curve, state)):
        return None
    after = _sign_beside(curve, state.x, state.tangent, 1.0) or -state.orientation
    onward = State(state.x, state.tangent, state.error, after, is_singular=True)
    path = [_along(curve, Ray(curve, state).reversed()), _along(curve, Ray(curve, onward))]
    kind, does = (Kind.BRANCH_POINT, "") if rays else (Kind.TRANSITION, ", outside of all cells")
    message = f"curves cross on the boundary of {curve.selection.label}{does}"
    return SpecialPointFound(kind, state.x, message, (*path, *rays))


def path_through(curve: Curve, corner: Corner) -> SpecialPointFound | None:
    """Return the point of a path along interfaces at which a curve in a cell arrives, or None.

    The first ray leads back on the curve: the tangent with which the curve arrived is rounding.
    """
    here, scale = curve.selection, corner.metric.scale
    if here.is_straight or not 0 < len(corner.zero) <= MOST_TESTS_ON_PATH:
        return None
    if not (found := crossing.crossing_near(curve, corner.x, 1.0 / crossing.CLOSE_TO_CROSSING)):
        return None
    x = found.x  # more digits: where the curve meets the interface, the Jacobian loses rank
    tests, rows = replace(corner, x=x).vanishing(here)
    values = corner.system.some_tests(x[:-1], float(x[-1]), tests)
    if not len(tests) or (np.abs(values) > zero_up_to(rows, scale, part=HALF_DIGITS)).any():
        return None
    tangent = _least_along(found, rows)
    if (np.abs(product(rows, tangent)) > zero_up_to(rows, scale, part=NEARBY)).any():
        return None
    cells = tuple(cell for cell in corner.all_cells() if is_solid(corner, cell))
    path = Curve(Selection(corner.system, here.character, cells), corner.metric)
    sign = _sign_before(curve, x, tangent)
    point = branch_point_on_interface(path, State(x, tangent, found.error, sign))
    own = next((ray for ray in point.rays if ray.cells == (here.cell,)), None) if point else None
    if point is None or own is None:
        return None
    return point.leading((own, *(ray for ray in point.rays if ray is not own)))


def path_from(corner: Corner) -> SpecialPointFound | None:
    """Return a start that is a branch point of a path along interfaces, None if there is none."""
    if len(corner.zero) > MOST_TESTS_ON_PATH:
        return None
    cells = (Curve(Selection(corner.system, cell), corner.metric) for cell in corner.all_cells())
    return next(filter(None, (path_through(curve, corner) for curve in cells)), None)


def _in_other_cells(curve: Curve) -> list[Curve]:
    """Return a curved path along an interface as a curve of each other cell, none of very many."""
    here = curve.selection
    if here.is_straight or not 0 < len(here.adjacent_cells) <= 2**MOST_TESTS_ON_PATH:
        return []  # nearly always
    pairs = zip(here.adjacent_cells, here.adjacent_names, strict=True)
    followed = here.system.cell(here.character)
    others = (Selection(here.system, cell) for cell, name in pairs if name != followed)
    return [Curve(other, curve.metric) for other in others]


def _crossing_rays(path: Curve, cells: Iterable[Curve], state: State) -> list[Ray]:
    """Return the rays of curves of cells that cross a path along the boundary of the cells.

    A curve may lie on further interfaces itself, as where equations are decoupled: the cells beside
    have that curve in common.
    """
    ways, rays = list[tuple[Array, list[Curve]]](), list[Ray]()
    for own in cells:
        for way in _ways_across(own, state):
            for known, owners in ways:
                if are_parallel(path.metric, way, known, HALF_DIGITS):
                    owners.append(own)
                    break
            else:
                ways.append((way, [own]))
    for way, owners in ways:
        first, around = owners[0], tuple(own.selection.character for own in owners)
        sign = _sign_before(first, state.x, state.tangent)
        onward = State(state.x, way, state.error, sign, is_singular=True)
        both = Curve(Selection(first.selection.system, around[0], around), first.metric)
        rays.append(_along(both, Ray(both, onward)) if len(owners) > 1 else Ray(first, onward))
    return rays


def _ways_across(own: Curve, state: State) -> list[Array]:
    """Return the directions, not out of a cell, of the curve that crosses a path on its boundary.

    On further interfaces the curve lies where the tests change by rounding only.
    """
    if not (across := _across(own, state)):
        return []
    other, rates = across
    return [side * other for side in (1.0, -1.0) if (side * rates > -NEARBY).all()]


def _across(own: Curve, state: State) -> tuple[Array, Array] | None:
    """Return the direction in which equations of a cell cross a path on the boundary of the cell.

    With the direction come the rates of the tests that vanish, relative to their gradients. None
    where nothing crosses, or a curve within the interface does.
    """
    metric, x = own.metric, state.x
    if not (found := crossing.crossing_near(own, x)):
        return None
    other = _least_along(found, metric.covector(state.tangent))
    gradients = own.selection.test_gradients(x)
    sizes = abs(gradients) @ metric.scale
    vanish = np.abs(own.selection.tests(x)) <= zero_up_to(gradients, metric.scale, part=HALF_DIGITS)
    rates = (product(gradients, other) / np.where(sizes > 0.0, sizes, 1.0))[vanish]
    return (other, rates) if (np.abs(rates) > NEARBY).any() else None


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
    near, (lo, hi) = x + side * NEARBY * tangent, curve.metric.interval
    return _sign_at(curve, near, tangent) if lo <= near[-1] <= hi else None


def _sign_at(curve: Curve, x: Array, tangent: Array) -> int:
    """Return the sign of det[J; t^T] at a point, zero where J has lower rank."""
    metric = curve.metric
    factor = bordered(curve.selection.jacobian(x), metric.covector(tangent), metric.binary)
    return 0 if factor.is_singular() else factor.sign


def _along(curve: Curve, ray: Ray) -> Ray:
    """Return a ray along an interface with the index that the ray has beside its beginning."""
    found = beside(curve, ray.state, NEARBY)
    beyond = ray.state if isinstance(found, Failure) else found
    corner = Corner.at(curve.selection.system, curve.metric, beyond.x, beyond.error)
    index = index_at(Ray(curve, beyond), corner)
    return Ray(curve, ray.state, curve.selection.adjacent_cells, index)


def at_branch_point(curve: Curve, x: Array) -> SpecialPointFound | None:
    """Return the branch point that a start is, at the start's alpha up to errors, None if none."""
    found = crossing.crossing_near(curve, x, curve.metric.slack(x, crossing.FULL_RANK))
    if not (found and found.meets):
        return None
    tangent, at = found.directions[0], found.x.copy()
    if abs(at[-1] - x[-1]) <= CONFIDENCE * ERROR_OF_DIFFERENCES * curve.metric.width:
        at[-1] = x[-1]
    sign = _sign_before(curve, at, tangent)
    error = np.vstack([found.error, at - found.x])
    return branch_point(curve, found, State(at, tangent, error, sign))


def crossing_on_end(curve: Curve, x: Array) -> SpecialPointFound | None:
    """Return the branch point on an end of the interval next to ``x``, None if there is none."""
    on_end = np.append(x[:-1], min(curve.metric.interval, key=lambda end: abs(end - x[-1])))
    if curve.selection.is_straight or curve.metric.norm(x - on_end) > NEARBY:
        return None
    point = at_branch_point(curve, on_end)
    return point if point and point.x[-1] == on_end[-1] else None


def _locate(
    segment: CurvedSegment, bracket: tuple[float, float], before: int
) -> Crossing | State | Failure | None:
    """Return the first branch point on a segment, bisecting until Newton finds the point.

    Where Newton finds no point although the Jacobian loses rank where the sign flips, curves touch:
    the last state tried is returned. A sign that is rounding all along the segment, as on a
    curve of double roots, tells of no point: None.
    """
    (lo, hi), last = bracket, segment.end
    for number in range(MOST_BISECTIONS):
        place = 0.5 * (lo + hi)
        found = crossing.crossing(segment.curve, segment.near(place))
        point = found if isinstance(found, Crossing) and _belongs(segment, found.x) else None
        if point:
            place = 0.5 * (lo + segment.position(point.x))
        elif not number and _is_double(segment):
            return None
        state = segment.at(place) if place > lo else None
        flips = isinstance(state, State) and state.orientation != before
        if point and not flips:  # on the way to the point
            return point if point.meets else Failure(FailureReason.SINGULAR)
        if not isinstance(state, State):
            return state
        lo, hi, last = (lo, place, state) if flips else (place, hi, state)
    loses = partial(crossing.loses_rank, segment.curve)
    if loses(segment.start.x) and loses(segment.end.x):
        return Failure(FailureReason.TWICE)
    error = np.vstack([last.error, (hi - lo) * last.tangent])
    touching = State(last.x, last.tangent, error, before)
    return touching if loses(last.x) else Failure(FailureReason.SINGULAR)


def _is_double(segment: CurvedSegment) -> bool:
    """Tell whether H vanishes twice along a segment: J loses rank, and the sign flips across."""
    curve = segment.curve

    def flips(state: State) -> bool:
        aside = ACROSS * curve.metric.scale * np.append(generic(len(state.x) - 1), 0.0)
        around = state.x + aside, state.x - aside
        return {_sign_at(curve, x, state.tangent) for x in around} >= {-1, 1}

    ends = segment.start, segment.end
    return all(crossing.loses_rank(curve, end.x) and flips(end) for end in ends)


def _belongs(segment: CurvedSegment, x: Array) -> bool:
    """Tell whether a branch point lies on the segment, or too close to its ends to decide.

    A branch point at which the segment begins does not count.
    """
    norm = segment.curve.metric.norm
    if segment.start.is_singular and norm(x - segment.start.x) <= BEGINNING * segment.length:
        return False
    s, slack = segment.position(x), OUTSIDE_STEP * segment.length
    aside = norm(x - segment.near(s))
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
