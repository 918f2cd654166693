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

Branch points within a step
---------------------------
The sign of det[J; t^T] flips twice at two branch points, and not at all where an even number of
eigenvalues vanishes together, as at a branch point of a symmetric structure. The quadratic through
the Jacobians at the start, in the middle and at the end of a step is a matrix polynomial; real
zeros within the step say where the determinant vanishes, and how often.

- Three Jacobians cost a tenth of a step. They are computed unless the quadratic through the
  Jacobians of the last corrections, which are known, has no zero near the step.
- If the sign between two zeros apart differs, a shorter step is asked for, until each step has one
  zero at most. Around zeros together the step is looked at again, ever closer, until the zeros are
  apart, or vanish, or are one place to rounding.
- A branch point that is known, at the beginning of a piece or where a step ends, is no other zero.
- Of many unknowns Arnoldi's method computes the dominant zeros, a zero of any multiplicity once;
  one or two vectors show nearly always that no zero is near.
- Where all Jacobians lose rank, as along a curve of double roots, nothing is told.

Two zeros closer than a thousandth of a step to a known branch point may be missed, and an
eigenvalue that vanishes twice within a part of the step in which three Jacobians do not show that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import inf, isfinite, sqrt
from typing import final

import numpy as np

from pwscont.basics.arrays import (
    Array,
    Matrix,
    dense,
    generic,
    generic_angles,
    joined,
    largest,
    power_of_two,
    product,
)
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD, HALF_DIGITS
from pwscont.curve.curve import ERROR_OF_DIFFERENCES, Curve, State
from pwscont.curve.stepper import SHORTEST_CHORD, CurvedSegment
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import (
    augmented,
    bordered,
    columns_scaled,
    largest_in_scaled_rows,
    rows_divided,
)

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
    """Return the branch point within a distance of ``x``, by Newton on the extended system."""
    equations, borders, last, first = _equations(curve, x), _generic(len(x) - 1), np.inf, x
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
    return np.asarray(GUARD * ERROR_OF_DIFFERENCES * curve.metric.scale)


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


def may_lose_rank(curve: Curve, x: Array) -> bool:
    """Tell whether the Jacobian may have rank n - 1 at most near a point; seldom by mistake."""
    n = len(x) - 1
    _, matrix = _bordered(curve, x, _equations(curve, x), *_generic(n))
    if matrix.is_singular():
        return True
    # generic borders make these numbers larger at other points, by far less than the bound
    g = [matrix.solve(unit)[n] for unit in np.eye(2, n + 2, n)]
    return not largest(np.abs(np.array(g))) > FULL_RANK**0.5


def loses_rank(curve: Curve, x: Array) -> bool:
    """Tell whether the Jacobian has rank n - 1 at most at a point, compared to points beside."""
    if not may_lose_rank(curve, x):
        return False  # nearly always
    equations = _equations(curve, x)
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
    scale, jacobian = curve.metric.scale, curve.selection.jacobian
    differences = curve.selection.system.differences(float(x[-1]))
    return differences.along(lambda y: (left @ jacobian(y)) * scale, x, scale * v)


def _directions(curve: Curve, null: _Null, form: Array) -> tuple[Array, Array] | None:
    """Solve the branching equation delta^T A delta = 0 for the two directions."""
    (low, high), axes = np.linalg.eigh(0.5 * (form + form.T))
    if not min(-low, high) > HALF_DIGITS * max(-low, high):
        return None
    deltas = [np.sqrt(high) * axes[:, 0] + s * np.sqrt(-low) * axes[:, 1] for s in (1.0, -1.0)]
    ways = np.array(deltas) @ null.right.T
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ways[np.abs(ways[:, -1]) < FLAT, -1] = 0.0  # exactly vertical if vertical up to errors
    first, second = (curve.metric.normalised(curve.metric.scale * way) for way in ways)
    return first, second


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
    places = start.x, segment.near(0.5 * segment.length), end.x
    known = [selection.jacobian(x) for x in places]
    zeros = zeros_in(segment, known)
    if not len(zeros) or not (is_part or not all(loses_rank(segment.curve, x) for x in places)):
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
    """Return the state at a place, known to a part of a segment, if the Jacobian loses rank."""
    x = segment.near(at)
    if not loses_rank(segment.curve, x):
        return None
    error = part * (segment.end.x - segment.start.x)[np.newaxis]
    return State(x, segment.chord, error, segment.start.orientation, is_singular=True)
