"""Correctors: from a prediction back onto the curve of one frozen selection.

Failure modes and answers
-------------------------
- The selection is undefined far from its cell: non-finite values count as no convergence,
  and the caller shortens its step.
- Newton converges to a far part of the curve: the correction is bounded by the step length.
- Scale: convergence is judged by the length of the correction in the metric, which neither the
  units of z nor those of the equations change.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.foundation.rounding import CONVERGED
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.linalg import bordered, last_unit


@final
@dataclass(frozen=True, slots=True)
class Corrected:
    """A point on the curve and how hard it was to get there."""

    state: State
    iterations: int


class Corrector(ABC):
    """Brings a predicted point onto the curve H_chi = 0."""

    @abstractmethod
    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Return the corrected state, tangent oriented like ``tangent``, or the failure."""


@final
@dataclass(frozen=True, slots=True)
class BorderedNewton(Corrector):
    """Newton in the hyperplane through the prediction normal to the tangent (Keller 1977).

    Attributes
    ----------
    most_iterations : int
    """

    most_iterations: int = 8

    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Solve [H_chi(x); t . (x - predicted)] = 0."""
        selection, metric = curve.selection, curve.metric
        x, row = predicted, metric.covector(tangent)
        for iteration in range(1, self.most_iterations + 1):
            factor = bordered(selection.jacobian(x), row)
            if factor.sign == 0:
                return Failure(Trouble.SINGULAR)
            dx = factor.solve(np.append(selection.residual(x), 0.0))
            x = x - dx
            size = metric.norm(dx)
            if not np.isfinite(size):
                return Failure(Trouble.NOT_FINITE)
            if size <= CONVERGED * (1.0 + metric.norm(x)):
                tangent = factor.solve(last_unit(len(x)))
                state = State(x, metric.normalised(tangent), np.abs(dx), factor.sign)
                return Corrected(state, iteration)
        return Failure(Trouble.NOT_CONVERGED)


@final
@dataclass(frozen=True, slots=True)
class MoorePenrose(Corrector):
    """Newton whose hyperplane turns with the curve: the border is renewed by the null vector.

    Approximates the Gauss-Newton step with the Moore-Penrose inverse of the Jacobian
    (Allgower and Georg 1990, section 3.4; the corrector of MATCONT).

    Attributes
    ----------
    most_iterations : int
    """

    most_iterations: int = 8

    def correct(self, curve: Curve, predicted: Array, tangent: Array) -> Corrected | Failure:
        """Solve H_chi(x) = 0 by corrections normal to the current null vector."""
        selection, metric = curve.selection, curve.metric
        x, t = predicted, tangent
        for iteration in range(1, self.most_iterations + 1):
            factor = bordered(selection.jacobian(x), metric.covector(t))
            if factor.sign == 0:
                return Failure(Trouble.SINGULAR)
            dx = factor.solve(np.append(selection.residual(x), 0.0))
            t = metric.normalised(factor.solve(last_unit(len(x))))
            dx = dx - metric.covector(t).dot(dx) * t
            x = x - dx
            size = metric.norm(dx)
            if not np.isfinite(size):
                return Failure(Trouble.NOT_FINITE)
            if size <= CONVERGED * (1.0 + metric.norm(x)):
                return Corrected(State(x, t, np.abs(dx), factor.sign), iteration)
        return Failure(Trouble.NOT_CONVERGED)
