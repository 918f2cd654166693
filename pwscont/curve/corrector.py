"""Correctors: from a prediction back onto the curve of one frozen selection."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.looks import counted, named
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONVERGED
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import direction, newton
from pwscont.curve.root import first_quotient
from pwscont.linear.factorise import Factor, bordered, last_unit


@final
@dataclass(slots=True, eq=False)
class Corrected:
    """A point on the curve and how hard it was to get there.

    Attributes
    ----------
    state : State
    iterations : int
    factor : Factor
        A factorisation of [J; border] near the point, with which points beside it are corrected.
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
        """Return the corrected state, its tangent oriented like ``tangent``, or the failure."""


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

    most_iterations: int = 8

    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Solve [H_chi(x); t . (x - predicted)] = 0."""
        # the border is linear: zero at the prediction, it stays zero
        border = (0.0, curve.metric.covector(tangent))
        root = newton(curve, lambda _: border, predicted, self.most_iterations)
        if isinstance(root, Failure):
            return root
        factor, along = direction(curve, root)
        if factor.failed:
            return Failure(FailureReason.SINGULAR)
        state = State(root.x, along, root.error[np.newaxis], factor.sign)
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

    most_iterations: int = 8

    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Solve H_chi(x) = 0 by corrections normal to the current null vector."""
        selection, metric = curve.selection, curve.metric
        x, t = predicted, tangent
        sizes: list[float] = []
        for iteration in range(1, self.most_iterations + 1):
            if not metric.admits(x):
                return Failure(FailureReason.OUTSIDE)
            factor = bordered(selection.jacobian(x), metric.covector(t), metric.binary)
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
                return Corrected(state, iteration, factor, first_quotient(sizes))
        return Failure(FailureReason.NOT_CONVERGED)
