"""Newton's method for one selection and one more equation, the border.

With the border t . (x - predicted) = 0 Newton is a corrector, with kappa_i = 0 it locates a
transition, with alpha = constant it finds a solution.

Failure modes and answers
-------------------------
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
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from pwscont.basics.arrays import Array, Matrix, joined, largest
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED
from pwscont.curve.curve import LEAN, Curve
from pwscont.curve.metric import LARGEST, SHORTEST
from pwscont.curve.root import Root, first_quotient
from pwscont.curve.uncertainty import is_rounding
from pwscont.linear.factorise import Factor, bordered, last_unit
from pwscont.linear.vectors import times

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
