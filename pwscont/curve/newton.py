"""Newton's method for one selection and a border, and the error of its root.

The residual of the bordered system at the solution is a sum of terms J_ij x_j that cancel; its
own rounding error is of the order of EPS times the sum of their magnitudes, and the inverse of
the bordered matrix turns it into an error of x. For large systems the inverse is not formed: a
few right-hand sides with these magnitudes and random signs are solved for, which sees the same
cancellation as the true error does (statistical condition estimation, Kenney and Laub 1994).

With the border t . (x - predicted) = 0 Newton is a corrector, with kappa_i = 0 it locates a
transition, with alpha = constant it finds a solution.

Failure modes and answers
-------------------------
- The solution is zero where the terms were not (an unloaded body reached from a loaded one):
  the terms are taken before the last correction as well as after it.
- Constants in H cancel, of which no derivative tells: (z + B) - B moves in stairs as high as the
  rounding of B. H is asked next to the solution for how far it is off its own derivative. It is so
  by its curvature as well, which shows farther away and is taken off.
- The selection is undefined far from its cell: non-finite values are a failure, and the caller
  shortens its step.
- H need not be defined outside the interval of alpha: an iterate that leaves the interval is a
  failure.
- Newton converges from far away, to another curve: the sizes of its corrections are kept, by
  whose first ratio the caller judges (Deuflhard 2011, chapter 5).
- Scale: convergence is judged by the correction of each unknown relative to its own size, which
  neither the units of z nor those of the equations change.
- Ill conditioning: corrections stall at the condition number times rounding. The point is accepted
  there, and the error estimate says how few digits are left.
- An iteration too many costs as much as the rest of a step: where quadratic contraction lets
  hope that one or two corrections more are enough, these are computed with the old factorisation
  (each shrinks by what the last one changed). The factorisation is marked as stale: next to a
  branch point the tangent turns within these corrections.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, generic, joined, largest, product
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.curve import LEAN, Curve, State
from pwscont.curve.error_samples import magnitude, samples
from pwscont.curve.metric import LARGEST, SHORTEST
from pwscont.linear.factorise import Factor, bordered, last_unit
from pwscont.linear.vectors import times
from pwscont.system.system import SlicewiseLinearSystem

#: A first correction below this relative size is followed by one that is rounding.
SMALL = CONVERGED**0.5


@final
@dataclass(slots=True, eq=False)
class Root:
    """A solution of {H_chi = 0, border = 0}.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (n + 1,)
        Size of the last correction.
    jacobian, row
        Jacobian and gradient of the border, from before the last correction.
    factor : Factor
        Factorisation of both together.
    scale : ndarray, shape (n + 1,)
        Typical magnitudes of x.
    iterations : int
    stale : bool
        Whether the factorisation is too old for the tangent.
    contraction : float
        Ratio of the first two corrections, see :func:`first_quotient`.
    """

    x: Array
    error: Array
    jacobian: Matrix
    row: Matrix
    factor: Factor
    scale: Array
    iterations: int
    stale: bool = False
    contraction: float = 0.0


def first_quotient(sizes: Sequence[float]) -> float:
    """Return the ratio of the first two corrections, 0 where the first was small itself."""
    return sizes[1] / sizes[0] if len(sizes) > 1 and sizes[0] > SMALL else 0.0


#: How far from a solution H is asked, as a part of typical magnitudes; and at how many places.
NEAR, FAR = EPS**0.5, EPS ** (1.0 / 3.0)
PLACES = 4
#: Third derivatives make the curvature near by differ from that farther away.
BENT = 4.0


def uncertainty(root: Root, unseen: Array | float = 0.0) -> Array:
    """Return independent contributions to the error of ``root.x``, shape (k, n + 1).

    Their root of the sum of squares, component by component or through a linear function, is
    the estimated error. ``unseen`` is rounding of the rows beyond that of their terms.
    """
    # the last correction was solved with errors of its largest parts everywhere
    size = np.abs(root.x) + largest(root.error / root.scale) * root.scale
    return root.factor.solve_all(_rounding(root.jacobian, root.row, size, unseen))


def unseen_rounding(curve: Curve, root: Root, border: Callable[[Array], float]) -> Array:
    """Return rounding of the rows at a root of which their derivatives do not tell, (n + 1,).

    Systems that are linear at fixed alpha are made of matrices, where terms tell everything.
    """
    if isinstance(curve.selection.system, SlicewiseLinearSystem):
        return np.zeros(len(root.x))
    far = _off_derivative(curve, root, border, FAR, 0)
    near = np.max([_off_derivative(curve, root, border, NEAR, i) for i in range(PLACES)], axis=0)
    unseen: Array = np.maximum(near - BENT * (NEAR / FAR) ** 2 * far, 0.0)
    return np.where(np.isfinite(unseen), unseen, 0.0)


def _off_derivative(
    curve: Curve, root: Root, border: Callable[[Array], float], part: float, shift: int
) -> Array:
    """Return by how much the rows change in another way than their derivatives say."""
    x, metric = root.x, curve.metric
    step = part * generic(len(x), shift) * (np.abs(x) + metric.scale)
    grows = product(root.row, step).item() >= 0.0  # so it does where the path comes from
    there = x + (step if grows else -step)
    there[-1] = x[-1] + math.copysign(part * metric.width, sum(metric.interval) - 2.0 * x[-1])
    dx = there - x
    before, after = (curve.selection.residual_and(y, border(y)) for y in (x, there))
    linear = joined(product(root.jacobian, dx), product(root.row, dx).item())
    off: Array = np.abs(after - before - linear)
    return off


def uncertainty_beside(curve: Curve, state: State) -> Array:
    """Return how far a point may be from its curve, which :func:`uncertainty` returns of a root."""
    jacobian, row = curve.selection.jacobian(state.x), curve.metric.covector(state.tangent)
    factor, known = bordered(jacobian, row, curve.metric.binary), np.abs(state.error).max(axis=0)
    if factor.failed:
        return state.error
    root = Root(state.x, known, jacobian, row, factor, curve.metric.scale, 0)
    return uncertainty(root, unseen_rounding(curve, root, lambda x: float(row.dot(x))))


def corrected(curve: Curve, x: Array, value: float, row: Array) -> tuple[Root, Array] | None:
    """Correct a point that is nearly exact, and estimate its error, by one solve for both.

    Parameters
    ----------
    curve : Curve
        Of an affine selection.
    x : ndarray, shape (n + 1,)
    value, row
        The border there and its gradient, as for :func:`~pwscont.curve.newton.newton`.

    Returns
    -------
    Root and ndarray, or None
        The error is that of :func:`uncertainty`; None where the correction is more than rounding,
        or cannot be computed.
    """
    metric = curve.metric
    if not metric.admits(x):
        return None
    jacobian, rest = curve.selection.jacobian(x), curve.selection.residual_and(x, value)
    factor = bordered(jacobian, row, metric.binary)
    if factor.failed:
        return None
    rounding = _rounding(jacobian, row, np.abs(x) + CONVERGED * metric.scale)
    dx, *error = factor.solve_all(np.vstack([rest, rounding]))
    if not metric.relative(dx, x - dx) <= CONVERGED or not metric.admits(x := x - dx):
        return None
    return Root(x, np.abs(dx), jacobian, row, factor, metric.scale, 1), np.array(error)


def _rounding(jacobian: Matrix, row: Matrix, size: Array, unseen: Array | float = 0.0) -> Array:
    """Return samples of the rounding of all rows, for unknowns of a size."""
    terms = joined(product(abs(jacobian), size), product(abs(row), size).item())
    rounding: Array = (EPS * terms + unseen) * samples(len(size))
    return rounding


def is_rounding(root: Root) -> bool:
    """Tell whether the last correction was nothing but rounding, as ill conditioning makes it."""
    return is_within(root, uncertainty(root))


def is_within(root: Root, error: Array) -> bool:
    """Tell whether the last correction is no more than an error, as from :func:`uncertainty`."""
    return bool((root.error <= CONFIDENCE * magnitude(root.x, error)).all())


#: A scalar function of x together with its gradient, shape (n + 1,) or a sparse row.
Border: TypeAlias = Callable[[Array], tuple[float, Matrix]]

#: Corrections with the last factorisation, where these are expected to be enough.
MOST_CHORDS = 2
#: Corrections with a factorisation from close by.
MOST_CORRECTIONS = 6
#: A correction that is not smaller than this part of the one before does not converge any more.
STALLED = 0.1
#: A factorisation is stale where it changes by more than this part within the last correction.
#: A direction that such a factorisation corrects by no more than this part is right to rounding.
TURNED = math.sqrt(CONVERGED)


def newton(curve: Curve, border: Border, x: Array, most_iterations: int) -> Root | Failure:
    """Solve {H_chi = 0, border = 0} from the guess ``x``."""
    selection, metric, before = curve.selection, curve.metric, 0.0
    sizes: list[float] = []
    for iteration in range(1, most_iterations + 1):
        if not metric.admits(x):
            return Failure(FailureReason.OUTSIDE)
        value, row = border(x)
        jacobian = selection.jacobian(x)
        factor = bordered(jacobian, row, metric.binary)
        if factor.failed:
            return Failure(FailureReason.SINGULAR)
        dx = factor.solve(selection.residual_and(x, value))
        x, last = x - dx, np.abs(dx)
        relative_to = metric.sizes(x)
        size = largest(last / relative_to)
        if not math.isfinite(size):
            return Failure(FailureReason.NOT_FINITE)
        sizes.append(size)
        ratio, stale = contraction(size, before), False
        if size > CONVERGED >= size * ratio**MOST_CHORDS:
            stale = before == 0.0 or ratio > TURNED
            x, last = _chords(curve, border, factor, x, relative_to, sizes)
            size = sizes[-1]
        if size <= CONVERGED or size > STALLED * before > 0.0:
            quotient = first_quotient(sizes)
            root = Root(x, last, jacobian, row, factor, metric.scale, iteration, stale, quotient)
            if size <= CONVERGED or is_rounding(root):
                return root if metric.admits(x) else Failure(FailureReason.OUTSIDE)
        before = size
    return Failure(FailureReason.NOT_CONVERGED)


def _chords(
    curve: Curve,
    border: Border,
    factor: Factor,
    x: Array,
    relative_to: Array,
    sizes: list[float],
) -> tuple[Array, Array]:
    """Correct ``x`` with the last factorisation until the next correction is rounding.

    Returns the point and the size of the last correction; appends the relative sizes of all. What
    they are relative to hardly changes any more.
    """
    last = x
    for _ in range(MOST_CHORDS):
        if sizes[-1] > CONVERGED and curve.metric.admits(x):
            dx = factor.solve(curve.selection.residual_and(x, border(x)[0]))
            x, last = x - dx, np.abs(dx)
            sizes.append(largest(last / relative_to))
    return x, last


def by_chords(curve: Curve, factor: Factor, x: Array) -> Array | None:
    """Return the point of a curve next to ``x``, by a factorisation [J; border] from close by.

    None where corrections do not shrink as fast as they would with one that is new enough.
    """
    before = math.inf
    for _ in range(MOST_CORRECTIONS):
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


def contraction(size: float, before: float) -> float:
    """Return the ratio of the next two corrections, if convergence is quadratic.

    d -> c d^2 turns the ratio q of two corrections into q^2 for the next two; after the first
    correction the factor c is not known, and taken for one.
    """
    return (size / before) ** 2 if before > 0.0 else size


def again(curve: Curve, border: Border, root: Root) -> Root:
    """Correct a root once more, with the factorisation that it has."""
    dx = root.factor.solve(curve.selection.residual_and(root.x, border(root.x)[0]))
    return replace(root, x=root.x - dx, error=np.abs(dx), stale=True)


def direction(curve: Curve, root: Root) -> tuple[Factor, Array]:
    """Return the direction of the curve at a root, of length one, along which the border grows.

    And a factorisation that is new enough.
    """
    metric, unit = curve.metric, last_unit(len(root.x))
    along = root.factor.solve(unit)
    length = metric.norm(along)
    if not SHORTEST < length < LARGEST:  # the border is in extreme units
        along, length = metric.normalised(along), 1.0
    if not root.stale and abs(along[-1]) > LEAN * metric.width * length:
        return root.factor, times(1.0 / length, along)
    jacobian = curve.selection.lent_jacobian(root.x)
    for _ in range(MOST_CHORDS):
        # along the border nothing is corrected: only the length of the direction would change
        correction = root.factor.solve(joined(jacobian.dot(along), 0.0))
        along = along - correction
        length = metric.norm(along)
        if metric.norm(correction) <= TURNED * length:
            return root.factor, times(1.0 / length, along)
    factor = bordered(jacobian, root.row, metric.binary)
    return factor, along if factor.failed else metric.normalised(factor.solve(unit))
