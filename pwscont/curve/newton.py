"""Newton's method for a selection and a border, and the error of the root.

:func:`newton` solves {H_chi = 0, border = 0}. With the border t . (x - predicted) = 0 Newton is a
corrector, with kappa_i = 0 Newton locates a transition, with alpha = constant Newton finds a
solution. Corrections are judged relative to the size of each unknown, so units do not matter.

The residual at the root is a sum of terms J_ij x_j that cancel. The rounding error of the sum is
about EPS times the sum of the magnitudes of the terms, and the inverse of the bordered matrix turns
that rounding into an error of x. For large systems a few right-hand sides with these magnitudes and
random signs are solved for (statistical condition estimation, Kenney and Laub 1994). Derivatives do
not tell the rounding of constants that cancel, as in (z + B) - B: :func:`unseen_rounding` evaluates
H next to the root.

A needless factorisation costs as much as the rest of a step: if quadratic convergence predicts that
two more corrections suffice, these corrections use the old factorisation, which is marked as stale,
because next to a branch point the tangent turns within these corrections.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, generic, joined, largest, product, times
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD, HALF_DIGITS
from pwscont.curve.curve import LEAN, Curve, State
from pwscont.curve.error_samples import SAMPLES, magnitude, samples
from pwscont.curve.metric import LARGEST, SHORTEST, Metric
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered, column, last_unit
from pwscont.system.selection import Selection

#: A scalar function of x together with the gradient, shape (n + 1,) or a sparse row.
Border: TypeAlias = Callable[[Array], tuple[float, Matrix]]

#: Relative size of a correction below which the next correction is rounding, also of a direction:
#: a factorisation is stale where the Jacobian changes by more than this part.
NEXT_IS_ROUNDING = CONVERGED**0.5
#: Most Newton iterations to a root.
MOST_NEWTON = 8
#: Most corrections with the last factorisation, if expected to be enough.
MOST_CHORDS = 2
#: Relative size of a correction from which the next is none of these: x may have run far away.
TOO_FAR_FOR_CHORDS = 0.5
#: Largest ratio of two corrections that still converge.
STALLED = 0.1
#: Largest last correction, as a part of the length of z, that rounding of constants may explain:
#: closer to a point where H has infinite slope, curvature would pass for rounding.
SMALL = 100.0 * CONVERGED
#: Largest residual at a root, as a part of what alpha changes in the row over the interval.
SOLVED = 1e-4


@final
@dataclass(slots=True, eq=False)
class Root:
    """A solution of {H_chi = 0, border = 0}."""

    x: Array  # shape (n + 1,)
    error: Array  # the size of the last correction, shape (n + 1,)
    jacobian: Matrix  # from before the last correction, as is the row
    row: Matrix  # the gradient of the border
    factor: Factor  # of [jacobian; row]
    scale: Array  # typical magnitudes of x, shape (n + 1,)
    iterations: int = 0
    stale: bool = False  # whether the factorisation is too old for the tangent
    contraction: float = 0.0  # the ratio of the first two corrections, see first_quotient


def newton(curve: Curve, border: Border, x: Array, most_iterations: int) -> Root | Failure:
    """Solve {H_chi = 0, border = 0} from the guess ``x``.

    Each iteration factorises and corrects once. Where two further corrections are expected to be
    enough, these use the same factorisation (chords). A root is accepted where the last correction
    is rounding, or where corrections stall and the last one is no larger than the root's error.
    """
    selection, metric, before = curve.selection, curve.metric, 0.0
    sizes: list[float] = []
    iteration = chords = 0
    while iteration < most_iterations or chords:
        if not metric.admits(x):
            return Failure(FailureReason.OUTSIDE)
        value, row = border(x)
        is_chord = chords > 0
        if is_chord:
            chords -= 1
        else:
            iteration, stale = iteration + 1, False
            jacobian = selection.jacobian(x)
            factor = bordered(jacobian, row, metric.binary)
            if factor.failed:
                return _singular(jacobian)
        rest = selection.residual_and(x, value)
        dx = factor.solve(rest)
        x, last = x - dx, np.abs(dx)
        if not is_chord:
            relative_to = metric.sizes(x)  # hardly changes along chords
        size = largest(last / relative_to)
        if not math.isfinite(size):
            return Failure(FailureReason.NOT_FINITE)
        sizes.append(size)
        if size <= CONVERGED and not is_solved(selection, metric, x, jacobian, rest[:-1]):
            before, chords = 0.0, 0
            continue
        if size <= CONVERGED or (not chords and size > STALLED * before > 0.0):
            quotient = first_quotient(sizes)
            root = Root(x, last, jacobian, row, factor, metric.scale, iteration, stale, quotient)
            if size <= CONVERGED or is_rounding(root) or _is_unseen_rounding(curve, root, border):
                return root if metric.admits(x) else Failure(FailureReason.OUTSIDE)
        if not is_chord:
            # quadratic: d -> c d^2, so that a ratio q is followed by q^2; at first c is taken for 1
            ratio = size / before * (size / before) if before > 0.0 else size
            if size < TOO_FAR_FOR_CHORDS and size * ratio**MOST_CHORDS <= CONVERGED:
                chords, stale = MOST_CHORDS, before == 0.0 or ratio > NEXT_IS_ROUNDING
        before = size
    return Failure(FailureReason.NOT_CONVERGED)


def _singular(jacobian: Matrix) -> Failure:
    """Return why a bordered matrix has no factorisation."""
    entries = jacobian if isinstance(jacobian, np.ndarray) else getattr(jacobian, "data", 0)
    is_finite = bool(np.isfinite(entries).all())
    return Failure(FailureReason.SINGULAR if is_finite else FailureReason.NOT_FINITE)


def is_solved(
    selection: Selection, metric: Metric, x: Array, jacobian: Matrix, residual: Array
) -> bool:
    """Tell whether the residual before the last correction is as small as at a solution.

    Where a derivative is nearly infinite, as of a root of zero, corrections vanish although the
    residual does not: each row must be a small part of what alpha changes in the row over the
    interval, or rounding of the terms, at the point and at a point of typical magnitude. Systems
    that are linear at fixed alpha have no such rows.
    """
    if selection.is_slicewise:
        return True
    by_alpha = metric.width * np.abs(column(jacobian, len(x) - 1))
    if largest(above := np.abs(residual) - SOLVED * by_alpha) <= 0.0:
        return True  # nearly always
    depends = by_alpha > 0.0
    above -= GUARD * EPS * product(abs(jacobian), np.abs(x))
    if not (above > 0.0)[depends].any():
        return True
    typical = selection.jacobian(joined((x + metric.scale * generic(len(x)))[:-1], x[-1]))
    terms = np.minimum(*(product(abs(each), metric.scale) for each in (jacobian, typical)))
    return bool((above <= GUARD * EPS * terms)[depends].all())


def first_quotient(sizes: Sequence[float]) -> float:
    """Return the ratio of the first two corrections, 0 where the first correction was small."""
    return sizes[1] / sizes[0] if len(sizes) > 1 and sizes[0] > NEXT_IS_ROUNDING else 0.0


def again(curve: Curve, border: Border, root: Root) -> Root:
    """Return a root after another correction with the factorisation of the root."""
    dx = root.factor.solve(curve.selection.residual_and(root.x, border(root.x)[0]))
    return replace(root, x=root.x - dx, error=np.abs(dx), stale=True)


def by_chords(curve: Curve, factor: Factor, x: Array) -> Array | None:
    """Return the point of a curve next to ``x``, by a factorisation [J; border] from close by.

    None if corrections do not shrink as fast as with a factorisation that is new enough.
    """
    before = math.inf
    for _ in range(MOST_NEWTON):
        if not curve.metric.admits(x):
            return None
        dx = factor.solve(curve.selection.residual_and(x, 0.0))
        x, size = x - dx, curve.metric.relative(dx, x - dx)
        if size <= CONVERGED:
            return x
        if not size <= STALLED * before:
            return None
        before = size
    return None


# -- the tangent at a root ------------------------------------------------------------------------


def direction(curve: Curve, root: Root) -> tuple[Factor, Array]:
    """Return a factorisation at a root, and the unit tangent along which the border grows.

    The factorisation is made afresh if the root's factorisation is too old.
    """
    metric, unit = curve.metric, last_unit(len(root.x))
    along = root.factor.solve(unit)
    length = metric.norm(along)
    if not SHORTEST < length < LARGEST:  # the border is in extreme units
        along, length = metric.normalised(along), 1.0
    if not root.stale and abs(along[-1]) > LEAN * metric.width * length:
        return root.factor, times(1.0 / length, along)
    jacobian = curve.selection.jacobian(root.x)
    for _ in range(MOST_CHORDS):
        # along the border nothing is corrected: only the length of the direction would change
        correction = root.factor.solve(joined(jacobian.dot(along), 0.0))
        along = along - correction
        length = metric.norm(along)
        if metric.norm(correction) <= NEXT_IS_ROUNDING * length:
            return root.factor, times(1.0 / length, along)
    factor = bordered(jacobian, root.row, metric.binary)
    return factor, along if factor.failed else metric.normalised(factor.solve(unit))


# -- the error of a root --------------------------------------------------------------------------

#: How far from a root H is evaluated, as a part of typical magnitudes: near enough for rounding to
#: show, and far enough for curvature to show.
ROUNDING_SHOWS, CURVATURE_SHOWS = HALF_DIGITS, EPS ** (1.0 / 3.0)
#: Third derivatives make the curvatures near a root and farther away differ by this factor.
CURVATURE_VARIES = 4.0


def uncertainty(root: Root, unseen: Array | float = 0.0) -> Array:
    """Return independent contributions to the error of ``root.x``, shape (k, n + 1).

    The root of the sum of squares of the contributions, component by component or through a linear
    function, is the estimated error. ``unseen`` is rounding of the rows beyond the rounding of the
    terms.
    """
    # the last solve made errors as large as the largest part of the correction everywhere
    size = np.abs(root.x) + largest(root.error / root.scale) * root.scale
    terms = joined(product(abs(root.jacobian), size), product(abs(root.row), size).item())
    return root.factor.solve_all((EPS * terms + unseen) * samples(len(size)))


def is_rounding(root: Root, error: Array | None = None) -> bool:
    """Tell whether an error, default :func:`uncertainty`, explains the last correction."""
    error = uncertainty(root) if error is None else error
    return bool((root.error <= CONFIDENCE * magnitude(root.x, error)).all())


def _is_unseen_rounding(curve: Curve, root: Root, border: Border) -> bool:
    """Tell whether rounding that derivatives do not tell explains the last correction.

    Constants that cancel in H may be far larger than all other terms.
    """
    size, far = curve.metric.relative(root.error, root.x), np.abs(root.x / root.scale)[:-1]
    if size > SMALL * largest(far) or not curve.metric.admits(root.x):
        return False
    unseen = unseen_rounding(curve, root, lambda x: border(x)[0])
    return bool(unseen.any()) and is_rounding(root, uncertainty(root, unseen))


def uncertainty_beside(curve: Curve, state: State) -> Array:
    """Return samples of how far a state is from the curve, as :func:`uncertainty` of a root."""
    jacobian, row = curve.selection.jacobian(state.x), curve.metric.covector(state.tangent)
    factor, known = bordered(jacobian, row, curve.metric.binary), np.abs(state.error).max(axis=0)
    if factor.failed:
        return state.error
    root = Root(state.x, known, jacobian, row, factor, curve.metric.scale)
    return uncertainty(root, unseen_rounding(curve, root, lambda x: float(row.dot(x))))


def unseen_rounding(curve: Curve, root: Root, border: Callable[[Array], float]) -> Array:
    """Return rounding of the rows at a root that derivatives do not tell, shape (n + 1,).

    Systems that are linear at fixed alpha are made of matrices, whose terms tell all rounding.
    """
    if curve.selection.is_slicewise:
        return np.zeros(len(root.x))
    asides, (places, size) = _asides(curve, root), (SAMPLES, len(root.x))
    farther = np.array([ROUNDING_SHOWS, 2.0 * ROUNDING_SHOWS, CURVATURE_SHOWS])
    beside = root.x + farther[:, np.newaxis] * asides[:, np.newaxis]
    points = np.vstack([root.x, beside.reshape(-1, size)])
    rows = curve.selection.residuals(points)
    rows[:, -1] = [border(x) for x in points]
    here, rows = rows[0], rows[1:].reshape(places, len(farther), size)
    # the Jacobian of the root is from before the last correction: a line needs none
    bends = 0.5 * np.abs(here - 2.0 * rows[:, 0] + rows[:, 1])
    # the same direction has the same curvature
    linear = np.empty_like(asides)
    linear[:, :-1] = [product(root.jacobian, dx) for dx in asides]
    linear[:, -1] = np.ravel(product(root.row, asides.T))
    curvatures = np.abs(rows[:, 2] - here - CURVATURE_SHOWS * linear)
    ratio = CURVATURE_VARIES * (ROUNDING_SHOWS / CURVATURE_SHOWS) ** 2
    unseen = np.fmax.reduce(bends - ratio * curvatures, axis=0, initial=0.0)
    return np.where(np.isfinite(unseen), unseen, 0.0)


def _asides(curve: Curve, root: Root) -> Array:
    """Return steps from a root, of typical magnitudes, into the interval and the cell, (k, n + 1).

    The path comes from where the border grows. The tests need not be defined beyond the cell.
    """
    x, metric, selection = root.x, curve.metric, curve.selection
    ways = np.array([generic(len(x), place) for place in range(SAMPLES)])
    steps = ways * (np.abs(x) + metric.scale)
    steps[np.ravel(product(root.row, steps.T)) < 0.0] *= -1.0
    steps[:, -1] = math.copysign(metric.width, sum(metric.interval) - 2.0 * x[-1])
    along = CURVATURE_SHOWS * product(selection.test_gradients(x), steps.T)
    leaves = (selection.tests(x)[:, np.newaxis] + along < 0.0).any(axis=0)
    steps[leaves, :-1] *= -1.0
    return steps
