"""Where branches start and end: solutions, ends of the interval, bounds, and what the system says.

Near a fold the residual is as small as the square of the distance: where dH/dz is singular, Newton
at fixed alpha may stand still beside the fold, or beyond the fold, where there is no solution. With
another unknown held fixed, Newton leads to the curve, at the curve's own alpha.

A corner that ends the curve of one cell ends all curves that meet there, or the result would depend
on the cell of arrival. A point that all curves pass within a single cell ends no curve.

A piece may run along a bound, or touch a bound: Newton leaves the piece's points on either side. An
unknown leaves its bounds only where it is beyond a bound by more than the error of the point, which
is estimated anew if small by chance. A test may vanish where a bound is met, as the test of a
complementarity does: the rays of that transition that stay within the bounds are followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, Signs, are_finite
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, FailureReason, Kind, Remark
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD, HALF_DIGITS, SAME_ALPHA
from pwscont.curve import newton
from pwscont.curve.crossing import loses_rank
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import Found, magnitude
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.enumeration.continua import is_one_of_many
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.abilities import Ending, end_of
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions import smooth_folds
from pwscont.transitions.bounding import BoundingTests, at_corner, crossed
from pwscont.transitions.branch_points import at_branch_point
from pwscont.transitions.cone import tangent_cone
from pwscont.transitions.corner import Corner
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import Ray, check_continuity, inward_ray, same_piece, turns
from pwscont.transitions.zeros import NARROW_BRACKET, locate_sign_change, locate_zero


def settled(system: PiecewiseSystem, metric: Metric, found: Found) -> Found | None:
    """Return a solution that Newton found at fixed alpha, put on the curve if dH/dz is singular.

    None where the curve is outside the interval.
    """
    if isinstance(system, SlicewiseLinearSystem):
        return found
    x, _ = found
    curve = Curve(Selection(system, system.character(x[:-1], float(x[-1]))), metric)
    held = regular_border(curve, x)
    if held is None or held[1][-1]:
        return found
    row = held[1]
    root = newton.newton(curve, lambda y: (float(row.dot(y - x)), row), x, newton.MOST_NEWTON)
    if isinstance(root, Failure):
        return None
    same = 0.5 * SAME_ALPHA * max(abs(float(x[-1])), float(metric.scale[-1]))
    return found if abs(root.x[-1] - x[-1]) <= same else (root.x, root.error[np.newaxis])


def solves(system: PiecewiseSystem, metric: Metric, x: Array) -> bool:
    """Tell whether H at a point is as small as at a solution, in the cell of the point.

    Newton judges by one selection, with derivatives from before the last correction. Where H jumps
    or has an infinite slope, all corrections may vanish although H does not.
    """
    tests = system.test_functions(x[:-1], float(x[-1]))
    if not np.isfinite(tests).all():
        return False
    own = Selection(system, Character.of(tests))
    rest = own.residual(x)
    return are_finite(rest) and newton.is_solved(own, metric, x, own.jacobian(x), rest)


def regular_border(curve: Curve, x: Array) -> tuple[Matrix, Array, Factor] | None:
    """Return J, the unit row e_j that borders J to a regular matrix, and the factorisation.

    The row holds one unknown fixed: alpha, except at a fold, where alpha fails. At a branch point
    all fail.
    """
    jacobian, size = curve.selection.jacobian(x), len(x)
    for j in range(size - 1, -1, -1):
        row = (np.arange(size) == j).astype(float)
        factor = bordered(jacobian, row, curve.metric.binary)
        if not factor.is_singular():
            return jacobian, row, factor
    return None


def departures(corner: Corner) -> SpecialPointFound:
    """Return a start as a special point, with the point's kind and rays.

    A point inside a cell has two rays on the same curve and the kind START.
    """
    x, error, zero, metric = corner.x, corner.error, corner.zero, corner.metric
    here = Curve(Selection(corner.system, corner.character), metric)
    if not zero:
        return _inside(here, x, error)
    if len(zero) == 1:
        (test,) = zero
        other = Curve(Selection(corner.system, corner.character.flip(test)), metric)
        one, two = (inward_ray(side, x, error, test) for side in (here, other))
        check_continuity(here, other.selection, one and two, x, error)
        if one and two:
            return crossed(x, one, two)
    return at_corner(corner, here)


def _inside(curve: Curve, x: Array, error: Array) -> SpecialPointFound:
    held = regular_border(curve, x)
    if held is None:
        fill = is_one_of_many(curve.selection.system, curve.metric, x)
        why = Remark.FILL_CURVES if fill else FailureReason.SINGULAR.value
        stopped = SpecialPointFound(Kind.STOPPED, x, why, ())
        return stopped if fill else at_branch_point(curve, x) or stopped
    jacobian, row, factor = held
    tangent = curve.metric.normalised(factor.solve(last_unit(len(x))))
    is_upright = abs(tangent[-1]) <= smooth_folds.STEEPEST_AT_FOLD * curve.metric.width
    is_doubtful = is_upright or (x[-1] in curve.metric.interval and not curve.selection.is_straight)
    if is_doubtful and loses_rank(curve, x) and (point := at_branch_point(curve, x)):
        return point
    known = np.maximum.reduce(np.abs(error))
    error = newton.uncertainty(newton.Root(x, known, jacobian, row, factor, curve.metric.scale))
    # det [J; r] is proportional to r.t, and e_j.t is positive like t.t: the signs are equal
    state = State(x, tangent, error, factor.sign, magnitude(x, error))
    fold = smooth_folds.fold_at_end(curve, state)
    if fold and (there := Corner.at(curve.selection.system, curve.metric, fold.x, fold.error)).zero:
        return departures(there)  # the fold may be known less exactly than the start
    forth = Ray(curve, fold or state)
    rays = forth, forth.reversed()
    said = partial('start in "{0.label}"'.format, curve.selection)
    return SpecialPointFound(Kind.START, forth.state.x, said, rays)


def ended_by_system(arrival: SpecialPointFound) -> SpecialPointFound:
    """Return a special point of kind END, if the system ends any of the curves there.

    Systems that are not :class:`~pwscont.extending.Ending` end no curve.
    """
    if arrival.kind == Kind.START or not arrival.rays:
        return arrival
    curve = arrival.rays[0].curve
    system = curve.selection.system
    cells = dict.fromkeys(ray.curve.selection.character for ray in arrival.rays)
    if not isinstance(system, Ending) or len(cells) < 2:
        return arrival
    zero = Corner.at(system, curve.metric, arrival.x, arrival.rays[0].state.error).zero
    reasons = (end_of(system, cell, zero) for cell in cells) if zero else ()
    why = next(filter(None, reasons), None)
    return SpecialPointFound(Kind.END, arrival.x, why, arrival.rays) if why else arrival


@final
@dataclass(frozen=True, slots=True)
class IntervalEnds(TransitionDetector):
    """Watches alpha - lo and hi - alpha."""

    is_affine = True
    lo: float
    hi: float

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the distances to both ends; zero to rounding counts as zero."""
        alpha, slope, same = state.alpha, float(state.tangent[-1]), SAME_ALPHA * (self.hi - self.lo)
        down, up = alpha - self.lo, self.hi - alpha
        distances = (down if down > same else 0.0, up if up > same else 0.0)
        return Reading(np.array(distances), np.array((slope, -slope)))

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Solve {H_chi = 0, alpha = end}, or find the fold at which a step turns at the end."""
        end, side = (self.lo, 1.0) if index == 0 else (self.hi, -1.0)
        state = near = _reached(segment, bracket, -1, side, end)
        if not isinstance(segment, CurvedSegment):
            return state
        curve = segment.curve
        if isinstance(near, Failure):
            near = locate_sign_change(segment, curve.slope, (0.0, segment.length), NARROW_BRACKET)
        near = segment.end if isinstance(near, Failure) else near
        fold = smooth_folds.fold_at_end(curve, near)
        if fold and curve.metric.covector(segment.chord).dot(fold.tangent) < 0.0:
            fold = fold.reversed()  # beyond a fold the way out of the interval leads back
        return fold or state

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """End the component, or turn back where other pieces leave from the same point."""
        return at_end(curve, state)


def _reached(
    segment: Segment, bracket: tuple[float, float], which: int, side: float, limit: float
) -> State | Failure:
    """Return the state at which a component of x reaches a limit; from above where side is 1."""
    row = np.zeros(len(segment.start.x))
    row[which] = side
    state = locate_zero(segment, lambda x: (side * float(x[which] - limit), row), bracket)
    if isinstance(state, State):
        state.x[which] = limit  # equal up to the rounding of the solve
    return state


def at_end(curve: Curve, state: State) -> SpecialPointFound:
    """Return the special point at which a curve reaches an end of the interval."""
    back = Ray(curve, state).reversed()
    corner = Corner.at(curve.selection.system, curve.metric, state.x, state.error)
    if not corner.zero and (fold := smooth_folds.fold_at_end(curve, state)):
        return smooth_folds.fold_point(curve, fold, ", at the end of the interval")
    found = tangent_cone(corner, back) if corner.zero else None
    rays, dimension = (found.rays, found.dimension) if found else ((), 1)
    is_straight, inside = curve.selection.is_straight, list[Ray]()
    for ray in (ray for ray in rays if not same_piece(ray, back)):
        is_level = not (is_straight or ray.curve.slope(ray.state))  # at the end
        if turns(back, ray) or (is_level and not smooth_folds.leads_outside(ray)):
            inside.append(ray)
    wide = f"; {Remark.FILL} a cone of dimension {dimension}" if dimension > 1 else ""
    return SpecialPointFound(Kind.END, state.x, f"end of the interval{wide}", (back, *inside))


def points_inside(ray: Ray, lo: float, hi: float) -> bool:
    """Tell whether a ray from a point of the interval stays in it at first.

    At a fold at an end the rays' own alphas may be beside that end by rounding.
    """
    alpha, slope, same = ray.state.alpha, ray.curve.slope(ray.state), SAME_ALPHA * (hi - lo)
    is_out = (alpha - lo <= same and slope < 0.0) or (hi - alpha <= same and slope > 0.0)
    return not (is_out or smooth_folds.leads_outside(ray))


@final
class Bounds(TransitionDetector):
    """Watches z - lower and upper - z for all finite bounds of named unknowns."""

    is_affine = True

    def __init__(self, box: Box, names: Sequence[str]) -> None:
        below, above = (np.flatnonzero(np.isfinite(ends)) for ends in (box.lower, box.upper))
        self._which = np.concatenate([below, above])
        self._limit = np.concatenate([box.lower[below], box.upper[above]])
        self._side = np.repeat([1.0, -1.0], [len(below), len(above)])
        self._names = names

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the distances to the bounds; the distance to a bound at the state is positive."""
        values, slopes = self._inside(state.x), self._side * state.tangent[self._which]
        on = self._is_on(curve, state)
        values[on] = self._rounding(curve)[on]
        slopes[on & (np.abs(slopes) <= self._level(curve, state))] = 0.0
        return Reading(values, slopes)

    def _inside(self, x: Array) -> Array:
        """Return how far a point is inside of each bound."""
        return np.asarray(self._side * (x[self._which] - self._limit))

    def _is_on(self, curve: Curve, state: State) -> Signs:
        """Tell on which bounds the state lies, up to its error."""
        off, rounding = np.abs(self._inside(state.x)), self._rounding(curve)
        on: Signs = off <= CONFIDENCE * (state.size[self._which] + rounding)
        doubtful = ~on & (off <= self._level(curve, state))
        if doubtful.any():
            error = magnitude(state.x, newton.uncertainty_beside(curve, state))[self._which]
            on |= doubtful & (off <= CONFIDENCE * (error + rounding))
        return on

    def _rounding(self, curve: Curve) -> Array:
        """Return the rounding of distances to bounds."""
        return np.asarray(EPS * (curve.metric.scale[self._which] + np.abs(self._limit)))

    def _level(self, curve: Curve, state: State) -> Array:
        """Return slopes that are none, and distances that may be the error of a point."""
        level = GUARD * EPS if curve.selection.is_straight else HALF_DIGITS
        return np.asarray(level * (curve.metric.scale + np.abs(state.x))[self._which])

    def left_by(self, ray: Ray) -> str | None:
        """Return in words which bound a ray leaves at once, None if none."""
        curve, state = ray.curve, ray.state
        out = self._side * state.tangent[self._which] < -self._level(curve, state)
        found = np.flatnonzero(self._is_on(curve, state) & out if out.any() else out)
        return self._message(int(found[0])) if len(found) else None

    def shifts_within(self, x: Array, shift: Array) -> float:
        """Return how often a point may be shifted within the bounds, infinity without a bound."""
        falls = -self._side * shift[self._which]
        towards = falls > 0.0
        return float((self._inside(x)[towards] / falls[towards]).min(initial=np.inf))

    def _message(self, index: int) -> str:
        side = "lower" if self._side[index] > 0.0 else "upper"
        name = self._names[int(self._which[index])]
        return f"{name} reaches its {side} bound {self._limit[index]:.6g}"

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Solve {H_chi = 0, z_i = bound}."""
        which, side, limit = self._which[index], self._side[index], self._limit[index]
        return _reached(segment, bracket, int(which), float(side), float(limit))

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """End the branch, or cross the interface that is met together with the bound."""
        selection, back = curve.selection, Ray(curve, state).reversed()
        zero = Corner.at(selection.system, curve.metric, state.x, state.error).zero
        for place, test in enumerate(selection.bounding.tolist()):
            if test in zero:
                return BoundingTests().arrive(curve, state, place)
        return SpecialPointFound(Kind.END, state.x, self._message(index), (back,))
