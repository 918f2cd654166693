"""Correctors: from a prediction back onto the curve, and to a zero of a function on the curve.

Where the curve is tangent to the zero set the bordered matrix is singular: a failure. Where the
curve is nearly tangent, at the angle d, a correction c is followed by a correction of about
c^2 / d, which need not be rounding: Newton goes on until corrections are rounding, and if no
correction ever is, the last correction counts as an error.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.printing import counted, named
from pwscont.basics.rounding import CONVERGED, EPS, GUARD
from pwscont.curve.curve import (
    ERROR_OF_DIFFERENCES,
    ERROR_OF_FINE,
    RATIO,
    Curve,
    State,
    finer_tangent,
)
from pwscont.curve.error_samples import magnitude
from pwscont.curve.newton import (
    MOST_CHORDS,
    MOST_NEWTON,
    Border,
    Root,
    again,
    direction,
    first_quotient,
    is_rounding,
    newton,
    uncertainty,
    unseen_rounding,
)
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered, last_unit


@final
@dataclass(slots=True, eq=False)
class Corrected:
    """A point on the curve, with the effort and the contraction of Newton's method.

    Attributes
    ----------
    state : State
    iterations : int
    factor : Factor
        A factorisation of [J; border] near the point, for correcting neighbouring points.
    contraction : float
        Ratio of the first two corrections: small where the prediction belongs to this curve.
    """

    state: State
    iterations: int
    factor: Factor
    contraction: float

    def __repr__(self) -> str:
        return named(self, self.state, counted(self.iterations, "iteration"))


class Corrector(ABC):
    """Brings a predicted point onto the curve H_chi = 0."""

    @abstractmethod
    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Return the corrected state, with a tangent oriented like ``tangent``, or a failure."""


@final
@dataclass(frozen=True, slots=True)
class BorderedNewton(Corrector):
    """Newton in the hyperplane through the prediction normal to the tangent (Keller 1977).

    Attributes
    ----------
    most_iterations : int

    Examples
    --------
    >>> from pwscont import BorderedNewton, PseudoArclength
    >>> PseudoArclength(corrector=BorderedNewton(most_iterations=5)).corrector.most_iterations
    5
    """

    most_iterations: int = MOST_NEWTON

    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Solve [H_chi(x); t . (x - predicted)] = 0."""
        # the border is linear: zero at the prediction, and zero at all iterates
        border = (0.0, curve.metric.covector(tangent))
        root = newton(curve, lambda _: border, predicted, self.most_iterations)
        if isinstance(root, Failure):
            return root
        factor, along = direction(curve, root)
        if factor.failed:
            return Failure(FailureReason.SINGULAR)
        state = State(root.x, along, root.error[np.newaxis], factor.sign)
        state.jacobian = root.jacobian
        return Corrected(state, root.iterations, factor, root.contraction)


@final
@dataclass(frozen=True, slots=True)
class MoorePenrose(Corrector):
    """Newton whose hyperplane turns with the curve: the border is renewed by the null vector.

    Approximates the Gauss-Newton step with the Moore-Penrose inverse of the Jacobian
    (Allgower and Georg 1990, section 3.4; the corrector of MATCONT).

    Attributes
    ----------
    most_iterations : int

    Examples
    --------
    >>> from pwscont import MoorePenrose, PseudoArclength
    >>> PseudoArclength(corrector=MoorePenrose()).corrector
    MoorePenrose(most_iterations=8)
    """

    most_iterations: int = MOST_NEWTON

    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Solve H_chi(x) = 0 by corrections normal to the current null vector."""
        selection, metric = curve.selection, curve.metric
        x, t = predicted, tangent
        sizes: list[float] = []
        for iteration in range(1, self.most_iterations + 1):
            if not metric.admits(x):
                return Failure(FailureReason.OUTSIDE)
            jacobian = selection.jacobian(x)
            factor = bordered(jacobian, metric.covector(t), metric.binary)
            if factor.failed:
                return Failure(FailureReason.SINGULAR)
            dx = factor.solve(selection.residual_and(x, 0.0))
            t = metric.normalised(factor.solve(last_unit(len(x))))
            dx = dx - metric.covector(t).dot(dx) * t
            x = x - dx
            size = metric.relative(dx, x)
            if not np.isfinite(size):
                return Failure(FailureReason.NOT_FINITE)
            sizes.append(size)
            if size <= CONVERGED and metric.admits(x):
                state = State(x, t, np.abs(dx)[np.newaxis], factor.sign)
                state.jacobian = jacobian
                return Corrected(state, iteration, factor, first_quotient(sizes))
        return Failure(FailureReason.NOT_CONVERGED)


#: Most corrections next to a double root, where each correction is about half of the previous.
MOST_HALVING = 40
#: All corrections to come next to a multiple root, as a multiple of the last correction: P - 1 at
#: a root of order P.
CORRECTIONS_TO_COME = 10.0


def zero(curve: Curve, border: Border, x: Array) -> Corrected | Failure:
    """Return the state next to ``x`` at which ``border`` vanishes, and falls along the tangent."""
    root = newton(curve, border, x, MOST_NEWTON)
    if isinstance(root, Failure):
        return root
    if root.factor.is_singular():
        return Failure(FailureReason.SINGULAR)
    if curve.selection.is_straight:
        error = uncertainty(root)
    else:
        root, error = _settled_root(curve, border, root)
    factor, rising = direction(curve, root)
    if factor.failed:
        return Failure(FailureReason.SINGULAR)
    state = State(root.x, -rising, error, -factor.sign, located_by=factor)
    if not curve.selection.is_straight:
        state.jacobian = root.jacobian
    return Corrected(state, root.iterations, factor, root.contraction)


def _settled_root(curve: Curve, border: Border, root: Root) -> tuple[Root, Array]:
    """Return the root once the corrections are rounding, and the uncertainty of the root.

    For nearly every root a few corrections with the factorisation of the root leave only rounding.
    If these corrections do not shrink, Newton's method begins again with a new factorisation.
    """
    settled = again(curve, border, root)
    unseen = unseen_rounding(curve, settled, lambda y: border(y)[0])
    error = uncertainty(settled, unseen)  # more corrections hardly change the error
    for _ in range(MOST_CHORDS):
        if is_rounding(settled, error) and curve.metric.admits(settled.x):
            return settled, _to_come(settled, error, root.error)
        settled = again(curve, border, settled)
    for _ in range(MOST_HALVING):
        found = newton(curve, border, root.x, MOST_NEWTON)
        if isinstance(found, Failure):
            break
        root, error = found, uncertainty(found, unseen)
        if is_rounding(root, error):
            break
    return root, _to_come(root, uncertainty(root, unseen), root.error)


def _to_come(root: Root, error: Array, correction: Array) -> Array:
    """Return an error, with all corrections to come where the last correction is not rounding.

    Next to a multiple root the corrections of Newton's method shrink by a factor, and all of them
    add up to a multiple of one.
    """
    rounding = GUARD * EPS * (np.abs(root.x) + root.scale)
    if (root.error <= np.maximum(rounding, magnitude(root.x, error))).all():
        return error
    return np.vstack([error, CORRECTIONS_TO_COME * correction])


def corrected_again(curve: Curve, state: State) -> State:
    """Return a state after another correction, or the state itself where a correction fails."""
    found = BorderedNewton().correct(curve, state.x, state.tangent)
    return state if isinstance(found, Failure) else found.state


def polished(curve: Curve, state: State) -> tuple[State, float]:
    """Return a state after another correction, and the error of the slope of alpha.

    The tangent has nearly all digits where Jacobians are exact. Elsewhere the tangent by
    differences of fourth order is taken if that tangent is better.
    """
    state = corrected_again(curve, state)
    if curve.selection.system.knows_jacobian:
        return state, GUARD * EPS
    finer = finer_tangent(curve.selection, curve.metric, state.x, state.tangent)
    if finer is None:
        return state, ERROR_OF_DIFFERENCES
    tangent, _ = finer
    # other components may be far worse where alpha changes little along the curve
    apart = abs(float(tangent[-1] - state.tangent[-1])) / curve.metric.width
    if RATIO * apart >= 1.0:
        return state, max(ERROR_OF_DIFFERENCES, apart)
    return State(state.x, tangent, state.error, state.orientation), max(
        ERROR_OF_FINE, RATIO * apart**2
    )
