"""Transitions: the bounding tests of a cell, and the way across each.

A curve may touch an interface without crossing. Where the slope of a test along the curve is -s,
and k the curvature of the test, the curve leads s^2 / (2 k) beyond the interface before the curve
turns back. Where this depth is within the rounding of the test, and the values of the test there do
not follow the parabola of s and k, the curve has not crossed. A double zero is located to the
square root of rounding only, so that slopes there differ from zero by more than their own rounding,
and no matrix is singular: the depth is what counts. As terms of a test may cancel, values, not
estimates, tell whether the test is negative between its zeros.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, Signs, are_finite, is_anywhere, smallest
from pwscont.basics.outcome import Failure, FailureReason, Kind, Remark
from pwscont.basics.rounding import EPS, GUARD, HALF_DIGITS
from pwscont.curve.crossing import may_cross
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import zero_up_to
from pwscont.curve.looks import INSIDE
from pwscont.curve.newton import Border
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.system.abilities import end_of
from pwscont.system.selection import Selection
from pwscont.transitions.branch_points import path_from, path_through
from pwscont.transitions.cone import TangentCone, tangent_cone
from pwscont.transitions.corner import Corner
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import (
    SLANT,
    Ray,
    beside,
    beyond,
    check_continuity,
    inward_ray,
    opposite,
    same_piece,
    turns,
)
from pwscont.transitions.zeros import locate_zero

#: A place with an error below this bound belongs to a test that falls clearly: touching would need
#: a curvature of more than 1 / EPS^(1/2).
CLEAR_CROSSING = EPS**0.75
#: Distance over which the slope changes, in the metric.
DISTANCE_TO_CURVATURE = 1e-6
#: Places between both zeros where values of the test are compared with the parabola, as parts of
#: the distance to the lowest point, and the second zero, beyond which the piece goes on; and the
#: largest difference allowed, as a part of the depth.
PARABOLA_PLACES, PARABOLA_DEFECT = (0.5, 1.0, 1.5, 2.0), 0.25


def touching(curve: Curve, state: State, test: int) -> SpecialPointFound | None:
    """Return the point where a curve touches an interface; None if the curve crosses, or may cross.

    ``state``: a point where a test that bounds the cell vanishes, and falls along the tangent.
    """
    if curve.metric.norm(state.size) <= CLEAR_CROSSING:
        return None  # nearly always
    selection, index = curve.selection, int(np.flatnonzero(curve.selection.bounding == test)[0])
    row = selection.test_gradient(state.x, index)
    further = beside(curve, state, DISTANCE_TO_CURVATURE)
    slope = -float(row.dot(state.tangent))
    if isinstance(further, Failure) or not slope > 0.0:
        return None
    turn = slope + float(selection.test_gradient(further.x, index).dot(further.tangent))
    lowest = DISTANCE_TO_CURVATURE * slope / turn if turn > 0.0 else np.inf
    rounding = zero_up_to(row[np.newaxis], np.abs(state.x) + curve.metric.scale, state.error)[0]
    if not (lowest <= DISTANCE_TO_CURVATURE and 0.5 * slope * lowest <= rounding):
        return None  # a zero farther from the lowest point than that is a crossing
    found = [beside(curve, state, part * lowest) for part in PARABOLA_PLACES]
    places = [place for place in found if not isinstance(place, Failure)]
    if len(places) < len(found):
        return None
    parts, rising = np.array(PARABOLA_PLACES[:-1]), places[-1]
    values = np.array([selection.test(place.x, index) for place in places[:-1]])
    parabola = slope * lowest * (0.5 * parts**2 - parts)
    dips = (np.abs(values - parabola) <= 0.5 * PARABOLA_DEFECT * slope * lowest).all()
    # another interface may lie before the place where the piece would go on
    if dips or (np.delete(selection.tests(rising.x), index) < 0.0).any():
        return None
    error = np.vstack([state.error, rising.x - state.x])  # covers the beginnings of both rays
    onwards = State(rising.x, rising.tangent, error, state.orientation)
    name = selection.system.test_name(test)
    message = f"touches the interface where {name} vanishes, and stays in {selection.label}"
    rays = Ray(curve, state).reversed(), Ray(curve, onwards)
    return SpecialPointFound(Kind.CORNER, state.x, message, rays)


#: Tests smaller than this part of their own terms are looked at more closely.
NEXT_TO_ZERO = 1e-9
#: Within a step longer than this, in the metric, the tests are looked at in two points.
LONG_STEP = 0.05
NO_WAY_ON = (
    "no way on where {} vanish at the end of {}: do the selections agree on the interface? run "
    "check_system"
)
#: Where perturbation leads nowhere, as where solutions fill a face.
NO_WAY_FOUND = "{} test functions vanish, too many cells to try all; perturbation found no way on"
THIRDS = (1.0 / 3.0, 2.0 / 3.0)


@final
@dataclass(frozen=True, slots=True)
class BoundingTests(TransitionDetector):
    """Watches the test functions that bound the current cell."""

    is_affine = True

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the bounding tests, positive inside, and their slopes.

        A piece may run along an interface: a test that is zero, and stays so, is no event.
        """
        selection = curve.selection
        if not len(selection.bounding):  # a smooth system
            return Reading(np.zeros(0), np.zeros(0))
        rows = selection.unsigned_gradients(state.x)
        values, slopes = selection.tests(state.x), selection.side * rows.dot(state.tangent)
        if not are_finite(slopes):  # as of a root of zero: the values alone tell
            slopes[~np.isfinite(slopes)] = 0.0
        scale = curve.metric.scale
        below = np.abs(values) <= zero_up_to(rows, np.abs(state.x) + scale, part=NEXT_TO_ZERO)
        if is_anywhere(below):  # seldom
            near = np.flatnonzero(below)
            stays = _stay_zero(curve, state, rows[near], values[near], slopes[near])
            values[near[stays]], slopes[near[stays]] = 1.0, 0.0
        return Reading(values, slopes)

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Say that a test is positive at both ends and negative inside, or negative all along.

        A dip that is rounding of the test is none; affine tests have none.
        """
        selection, scale = segment.curve.selection, segment.curve.metric.scale
        if selection.is_straight or not len(start.values):
            return None
        if smallest(start.values) < 0.0:  # seldom
            x, rows = segment.start.x, selection.unsigned_gradients(segment.start.x)
            least = zero_up_to(rows, np.abs(x) + scale, segment.start.error, NEXT_TO_ZERO)
            if ((start.values < -least) & (end.values < start.values)).any():
                return Failure(FailureReason.OUTSIDE_OF_CELL)
        parts = THIRDS if segment.length > LONG_STEP else (INSIDE,)
        places = (segment.near(part * segment.length) for part in parts)
        for x in filter(segment.curve.metric.admits, places):
            values = selection.tests(x)
            if smallest(values) < 0.0:  # seldom
                rows = selection.unsigned_gradients(x)
                sizes = NEXT_TO_ZERO * np.maximum(np.abs(start.values), np.abs(end.values))
                positive = (end.values > 0.0) & ((start.values > 0.0) | (start.slopes > 0.0))
                stays_zero = (start.slopes == 0.0) & (end.slopes == 0.0)
                rounding = zero_up_to(rows, np.abs(x) + scale, part=NEXT_TO_ZERO)
                deep = values < -np.maximum(rounding, sizes)
                if (deep & positive & ~stays_zero).any():
                    return Failure(FailureReason.THIN_CELL)
        return None

    def border(self, curve: Curve, index: int) -> Border:
        """Return kappa_i and its gradient."""
        selection = curve.selection
        return lambda x: (selection.test(x, index), selection.test_gradient(x, index))

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Solve {H_chi = 0, kappa_i = 0}."""
        return locate_zero(segment, self.border(segment.curve, index), bracket)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Cross the interface unless the curve only touches it; at a corner, take every way on."""
        system, x = curve.selection.system, state.x
        test = int(curve.selection.bounding[index])
        corner = Corner.at(system, curve.metric, x, state.error)
        zero = corner.zero | {test}
        back = Ray(curve, state).reversed()
        if end := end_of(system, curve.selection.character, zero):
            return SpecialPointFound(Kind.END, x, end, (back,))
        if may_cross(curve, state, index) and (point := path_through(curve, corner)):
            return point
        if len(zero) == 1:
            if touched := touching(curve, state, test):
                return touched
            if forth := across(curve, state, test):
                return crossed(x, back, forth)
        met = at_corner(replace(corner, zero=zero), curve, back)
        # without a ray back the piece lies between interfaces, and meets one after another
        is_apart = met.kind == Kind.STOPPED and len(zero) > 1
        forth = across(curve, state, test) if is_apart else None
        return crossed(x, back, forth) if forth else met


def crossed(x: Array, back: Ray, forth: Ray) -> SpecialPointFound:
    """Return the special point at which a curve leaves one cell for another."""
    before, after = back.curve.selection, forth.curve.selection
    message = partial(before.system.describe_transition, before.character, after.character)
    kind = Kind.NONSMOOTH_FOLD if turns(back, forth) else Kind.TRANSITION
    return SpecialPointFound(kind, x, message, (back, forth))


def _stay_zero(
    curve: Curve, state: State, gradients: Matrix, values: Array, slopes: Array
) -> Signs:
    """Tell which tests next to zero stay zero along a piece, to the rounding of the tests' terms.

    A slope is zero if the slope would not lift the test out of its rounding within the length of
    the interval, which is 1 in the metric. Where nothing moves, values and slopes are rounding of
    typical values. Along a path that is known to run on interfaces slopes alone tell: gradients by
    differences err, and next to a branch point the error of the tangent is magnified.
    """
    selection, scale = curve.selection, curve.metric.scale
    rounding = zero_up_to(gradients, np.abs(state.x) + scale, state.error)
    flat = np.maximum(rounding, zero_up_to(gradients, np.abs(state.tangent), part=GUARD * EPS))
    stay: Signs = (np.abs(values) <= rounding) & (np.abs(slopes) <= flat)
    if selection.adjacent_cells:
        is_exact = selection.system.knows_derivatives
        level = HALF_DIGITS if is_exact else HALF_DIGITS**0.5  # in the metric
        stay |= np.abs(slopes) <= zero_up_to(gradients, scale, part=level)
    return stay


def across(curve: Curve, state: State, test: int) -> Ray | None:
    """Return the ray on the other side of the only test that vanishes (F1, F2).

    None where the curve is tangent to the interface, or the orientations do not agree because
    the selections do not.
    """
    new = Selection(curve.selection.system, beyond(curve.selection, state.x, test))
    there = Curve(new, curve.metric)
    ray = inward_ray(there, state.x, state.error, test)
    check_continuity(curve, new, ray, state.x, state.error)
    return ray if ray and ray.state.orientation == state.orientation else None


def at_corner(corner: Corner, curve: Curve, back: Ray | None = None) -> SpecialPointFound:
    """Return the special point at which several interfaces meet, or the curve is tangent to one."""
    here, system, x = curve.selection, corner.system, corner.x
    around = replace(corner, zero=corner.zero | _named_as_well(corner, here))
    if not np.isfinite(abs(around.gradients) @ np.ones(len(x))).all():  # as of a root of zero
        why = str(Failure(FailureReason.NOT_FINITE))
        return SpecialPointFound(Kind.STOPPED, x, why, () if back is None else (back,))
    found = tangent_cone(around, back)
    for ray in found.rays:
        check_continuity(curve, ray.curve.selection, ray, x, corner.error)
    others = tuple(ray for ray in found.rays if back is None or not same_piece(ray, back))
    rays = others if back is None else (back, *others)
    if not rays and found.exact:
        return SpecialPointFound(Kind.ISOLATED, x, "no piece leaves from this solution", ())
    is_back_found = back is None or len(others) < len(found.rays)
    goes_on = is_back_found and (len(rays) > 1 or found.along_interface)
    is_plain = goes_on and found.dimension == 1 and not found.along_interface
    may_lie_on_path = not (is_plain or here.is_straight)
    if may_lie_on_path and (point := path_through(curve, corner) if back else path_from(corner)):
        return point
    tests, count = ", ".join(map(system.test_name, sorted(around.zero))), len(around.zero)
    if not goes_on:
        why = NO_WAY_ON.format(tests, here.label) if found.exact else NO_WAY_FOUND.format(count)
        return SpecialPointFound(Kind.STOPPED, x, why, rays[:1])
    if back is not None:
        rays = (_as_uncertain_as(back, around), *others)
    elif rays[0].interface_cells and len(rays) == 2 and found.dimension == 1 and opposite(*rays):
        message = f"start on the boundary of {rays[0].curve.selection.label}"
        return SpecialPointFound(Kind.START, x, message, rays)
    return SpecialPointFound(found.kind, x, _message(found, tests, count), rays)


def _named_as_well(corner: Corner, here: Selection) -> frozenset[int]:
    """Return the tests that bound the cell beyond an interface, if rounding names a wrong cell.

    The only test that vanishes bounds the cell beyond, except next to a corner.
    """
    if len(corner.zero) != 1:
        return frozenset()
    (test,) = corner.zero
    new = Selection(corner.system, beyond(here, corner.x, test))
    return frozenset() if test in new.bounding else frozenset(new.bounding.tolist())


def _as_uncertain_as(back: Ray, corner: Corner) -> Ray:
    """Return the ray with an error that covers where along the ray each test vanishes."""
    state, gradients = back.state, corner.gradients
    slopes, values = np.abs(gradients @ state.tangent), np.abs(corner.tests[corner.which])
    steep = slopes > zero_up_to(gradients, np.abs(state.tangent), part=SLANT)
    if not steep.any():
        return back
    apart = float((values[steep] / slopes[steep]).max())
    error = np.vstack([state.error, apart * state.tangent])
    return replace(back, state=replace(state, error=error))


def _message(found: TangentCone, tests: str, count: int) -> str:
    """Return what happens at a corner where several tests, named ``tests``, vanish."""
    if not found.exact:
        others = len(found.rays) - 1
        ways = "one way on, possibly of several"
        ways = ways if others == 1 else f"{others} ways on, possibly of more"
        ways += "" if found.is_balanced else " (more there are: their signs do not cancel)"
        few = f"{count} test functions vanish: too many cells to try all"
        return f"{few}; {ways}, found by perturbation"
    rays = len(found.rays)
    if found.dimension > 1:
        cone = f"{Remark.FILL} a cone of dimension {found.dimension}"
        return f"{tests} vanish; {cone}, of which the {rays} extreme rays are followed"
    along = ", at least one along an interface" if found.along_interface else ""
    return f"{tests} vanish; {rays} pieces meet{along}"
