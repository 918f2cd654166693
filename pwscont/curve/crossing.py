"""The point where two smooth curves of a selection cross, and the directions of the curves.

At a simple branch point the Jacobian J, (n, n + 1), has rank n - 1. With borders b and C for
which M = [[J, b], [C, 0]] is regular, the functions g of M (V; g) = (0; I) vanish exactly where
J loses rank, and {H + mu b = 0, g = 0} is a square system for (x, mu), regular at the branch
point although J is not: the minimally extended system of Moore (1980) and of Allgower and Georg
(1990, section 8.2), with g by bordering (Govaerts 2000, chapter 3). The directions d = V delta of
the curves solve the algebraic branching equation w^T H''[d, d] = 0, whose two by two matrix also
serves in Newton's method. No point of the curve is computed, so all matrices stay regular; each
iteration renews the borders from the null vectors.

If two curves pass each other without meeting, mu says how far H misses zero. If the curves touch,
or more than two curves meet, the two by two matrix has no two real directions: a failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, generic, generic_angles, largest, power_of_two
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD, HALF_DIGITS
from pwscont.curve.curve import ERROR_OF_DIFFERENCES, Curve, State
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import augmented, columns_scaled, largest_in_scaled_rows, rows_divided

#: Most Newton iterations to a branch point.
MOST_ITERATIONS_TO_CROSSING = 12
#: From this iteration on Newton is fast if the branch point is simple: a correction of more than
#: this part of the correction before tells of a point at which more than two curves meet.
FAR_OFF, LINEAR = 4, 0.25
#: Rounds of renewing generic borders before the first iteration.
FIRST_BORDERS = 2
#: Largest H at a crossing, as a part of the terms of H; with a larger H the curves pass by.
MEETS = EPS**0.75
#: Least measure of rank at a regular point; at a double root, whose z has half of the digits, the
#: measure is about a hundred times HALF_DIGITS.
FULL_RANK = EPS ** (1.0 / 3.0)
#: Inverses of scaled derivatives that are larger than this may belong to a branch point near by.
CLOSE_TO_CROSSING = FULL_RANK**-0.5
#: Distance from which Newton's method does not come back to a branch point that lies next to the
#: first iterate, in the metric, whose unit is the length of the interval.
LOST = 1.0
#: Displacement of z, in typical magnitudes, that shows how large the equations are.
ASIDE = 0.05
#: Component of a direction, as a part of the length, below which the component is the error of
#: differences.
FLAT = EPS**0.4


@final
@dataclass(frozen=True, slots=True)
class Crossing:
    """A simple branch point."""

    x: Array  # shape (n + 1,)
    error: Array  # samples of the error, shape (2, n + 1)
    directions: tuple[Array, Array]  # the unit tangents of the two curves, signs arbitrary
    meets: bool  # whether the curves meet to rounding; else the curves pass each other close by


@final
@dataclass(frozen=True, slots=True)
class _Null:
    """The bordered matrix at a point, in unknowns and equations scaled to about 1."""

    right: Array  # V, shape (n + 1, 2): spans the null space of J at the branch point
    left: Array  # w, shape (n,): spans the left null space
    rows: Array  # the divisors of the equations, shape (n,)
    g: Array  # the functions that vanish where J loses rank, shape (2,)
    particular: Array  # M^-1 (-H; 0), shape (n + 2,)
    size: float  # w . |J| |x|, the size of the terms of H in the equation for the unfolding mu

    @property
    def borders(self) -> tuple[Array, Array]:
        """The borders b and C that condition M best: the null vectors themselves."""
        return self.left / np.linalg.norm(self.left), np.linalg.qr(self.right)[0].T


def crossing(curve: Curve, x: Array, within: float = np.inf) -> Crossing | Failure:
    """Return the branch point near ``x``, by Newton's method on the extended system.

    ``within``: the distance from ``x``, in the metric, at which Newton's method is given up.
    """
    equations, borders, last = _equations(curve, x), _generic(len(x) - 1), np.inf
    first = x
    for iteration in range(-FIRST_BORDERS, MOST_ITERATIONS_TO_CROSSING):
        null = _null(curve, x, equations, *borders)
        if null is None:
            return Failure(FailureReason.SINGULAR)
        borders = null.borders
        if iteration < 0:
            continue
        rows = np.array([_second(curve, x, null.left / null.rows, v) for v in null.right.T])
        form = rows @ null.right
        if not np.isfinite(form).all() or np.linalg.cond(form) > 1.0 / HALF_DIGITS:
            return Failure(FailureReason.SINGULAR)
        eta = np.linalg.solve(form, null.g - rows @ null.particular[:-1])
        dx = curve.metric.scale * (null.particular[:-1] + null.right @ eta)
        before, x = x, x + dx
        differences = curve.selection.system.differences(float(before[-1]))
        alpha = min(max(x[-1], differences.lo), differences.hi)  # nothing is evaluated outside
        if abs(x[-1] - alpha) <= CONFIDENCE * ERROR_OF_DIFFERENCES * curve.metric.width:
            dx[-1] = alpha - before[-1]
        x[-1] = alpha
        size = curve.metric.relative(dx, x)
        if size <= CONVERGED:
            directions = _directions(curve, null, form)
            if directions is None:
                return Failure(FailureReason.SINGULAR)
            mu = abs(float(null.particular[-1] + null.g @ eta))
            error = np.array([dx, _error_of_differences(curve)])
            return Crossing(x, error, directions, mu <= MEETS * (1.0 + null.size))
        is_lost = not curve.metric.norm(x - first) <= within
        if is_lost or (iteration >= FAR_OFF and size > LINEAR * last):
            break
        last = size
    return Failure(FailureReason.NOT_CONVERGED)


def crossing_near(curve: Curve, x: Array, near: float = HALF_DIGITS) -> Crossing | None:
    """Return the branch point within a distance of a point, None if there is none.

    ``near``: default the distance, in the metric, of a point that was located before.
    """
    found = crossing(curve, x, LOST)
    if isinstance(found, Failure) or curve.metric.norm(found.x - x) > near:
        return None
    return found


def _error_of_differences(curve: Curve) -> Array:
    """Return how far derivatives by differences move a branch point, as a sample of the error."""
    if curve.selection.system.knows_derivatives:
        return np.zeros(len(curve.metric.scale))
    error: Array = GUARD * ERROR_OF_DIFFERENCES * curve.metric.scale
    return error


def may_cross(curve: Curve, state: State, index: int) -> bool:
    """Tell whether a branch point may lie close to a state that was located on an interface.

    The answer is no, at the price of one Jacobian, where the derivatives of the equations and of
    the bounding test of that index are far from a singular matrix.
    """
    if curve.selection.is_straight or state.located_by is None:
        return False
    scale = curve.metric.scale
    last = np.abs(curve.selection.test_gradient(state.x, index)) @ scale
    rows = np.append(_sizes_of_rows(curve, _aside(curve, state.x)), last)
    found = state.located_by.solve(rows * generic(len(rows)))
    return not curve.metric.norm(found) < CLOSE_TO_CROSSING


def may_lose_rank(curve: Curve, x: Array, equations: Array | None = None) -> bool:
    """Tell whether the Jacobian may have rank n - 1 at most near a point; seldom by mistake.

    ``equations``: their typical magnitudes, shape (n,), if known.
    """
    n, equations = len(x) - 1, _equations(curve, x) if equations is None else equations
    _, matrix = _bordered(curve, x, equations, *_generic(n))
    if matrix.is_singular():
        return True
    # generic borders make these numbers larger at other points, by far less than the bound
    g = [matrix.solve(unit)[n] for unit in np.eye(2, n + 2, n)]
    return not largest(np.abs(np.array(g))) > FULL_RANK**0.5


def loses_rank(curve: Curve, x: Array) -> bool:
    """Tell whether the Jacobian has rank n - 1 at most at a point, compared to points beside."""
    equations = _equations(curve, x)
    if not may_lose_rank(curve, x, equations):
        return False  # nearly always
    null = _null(curve, x, equations, *_generic(len(x) - 1))
    for _ in range(FIRST_BORDERS):
        null = null and _null(curve, x, equations, *null.borders)
    return null is None or largest(np.abs(null.g)) < FULL_RANK


def _generic(n: int) -> tuple[Array, Array]:
    """Return borders b, shape (n,), and C, shape (2, n + 1), related to no simple numbers."""
    angles = generic_angles(2 * n + 2)
    return np.cos(angles[:n]) / np.sqrt(n), np.sin(angles).reshape(2, n + 1) / np.sqrt(n)


def _equations(curve: Curve, x: Array) -> Array:
    """Return typical magnitudes of the equations, shape (n,), powers of two."""
    rows = [_sizes_of_rows(curve, y) for y in (x, _aside(curve, x))]
    return power_of_two(np.where(np.isfinite(rows[1]), np.maximum(*rows), rows[0]))


def _aside(curve: Curve, x: Array) -> Array:
    """Return a point with z displaced a little: a row of J may vanish at a branch point itself."""
    moved: Array = x + ASIDE * curve.metric.scale * np.append(_generic(len(x) - 1)[0], 0.0)
    return moved


def _sizes_of_rows(curve: Curve, x: Array) -> Array:
    """Return about the largest entry in each row of J at a point, unknowns scaled to about 1."""
    return largest_in_scaled_rows(curve.selection.jacobian(x), curve.metric.scale)


def _bordered(curve: Curve, x: Array, rows: Array, b: Array, C: Array) -> tuple[Matrix, Factor]:
    """Return the Jacobian in unknowns scaled to about 1, and M, whose unknown mu is number n."""
    scaled = columns_scaled(curve.selection.jacobian(x), curve.metric.scale)
    return scaled, augmented(rows_divided(scaled, rows), b, C)


def _null(curve: Curve, x: Array, rows: Array, b: Array, C: Array) -> _Null | None:
    """Solve with M and the transpose of M; None for a singular M."""
    n, scale = len(b), curve.metric.scale
    scaled, matrix = _bordered(curve, x, rows, b, C)
    if matrix.is_singular():
        return None
    units, order = np.eye(2, n + 2, n), [*range(n), n + 1, n]  # mu last
    rest = np.concatenate([-curve.selection.residual(x) / rows, np.zeros(2)])
    solved = np.column_stack([matrix.solve(f) for f in (*units, rest)])[order]
    left = matrix.solve_transposed(units[0])[:n]
    terms = np.abs(left / rows) @ (abs(scaled) @ np.abs(x / scale))
    return _Null(solved[:-1, :2], left, rows, solved[-1, :2], solved[:, 2], float(terms))


def _second(curve: Curve, x: Array, left: Array, v: Array) -> Array:
    """Return w^T H''[v, .], shape (n + 1,), by differences of the Jacobian along v."""
    scale = curve.metric.scale

    def product(y: Array) -> Array:
        row: Array = (left @ curve.selection.jacobian(y)) * scale
        return row

    differences = curve.selection.system.differences(float(x[-1]))
    return differences.along(product, x, scale * v)


def _directions(curve: Curve, null: _Null, form: Array) -> tuple[Array, Array] | None:
    """Solve the branching equation delta^T A delta = 0 for the two directions."""
    (low, high), axes = np.linalg.eigh(0.5 * (form + form.T))
    if not min(-low, high) > HALF_DIGITS * max(-low, high):
        return None
    deltas = (np.sqrt(high) * axes[:, 0] + s * np.sqrt(-low) * axes[:, 1] for s in (1.0, -1.0))
    first, second = (_direction(curve, null.right @ delta) for delta in deltas)
    return first, second


def _direction(curve: Curve, scaled: Array) -> Array:
    """Return the unit tangent, exactly vertical if the tangent is vertical up to errors."""
    scaled = scaled / np.linalg.norm(scaled)
    if abs(scaled[-1]) < FLAT:
        scaled[-1] = 0.0
    return curve.metric.normalised(curve.metric.scale * scaled)
