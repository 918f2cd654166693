"""Predictors: where the next point of a curve is looked for.

Failure modes and answers
-------------------------
- Extrapolation far beyond the step before it goes wrong: the stepper halves its step, with which
  every predictor tends to the tangent.
- The step before is so short that its chord is rounding: it is left out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONVERGED
from pwscont.curve.curve import Curve, State
from pwscont.linear.vectors import plus


class Predictor(ABC):
    """Predicts the next point, and the direction in which the hyperplane there is normal."""

    @abstractmethod
    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point about ``length`` beyond ``state`` and a direction of length one.

        ``previous`` is the state before on the same piece, None on its first step.
        """


@final
@dataclass(frozen=True, slots=True)
class Tangent(Predictor):
    """Along the tangent: the error of the prediction is of second order in the step."""

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the tangent."""
        return state.x + length * state.tangent, state.tangent


@final
@dataclass(frozen=True, slots=True)
class Secant(Predictor):
    """Through the last two points; along the tangent where there is only one."""

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the line through the previous point and this one."""
        direction = state.tangent
        if previous is not None:
            direction = curve.metric.normalised(state.x - previous.x)
        return state.x + length * direction, direction


@final
@dataclass(frozen=True, slots=True)
class Hermite(Predictor):
    """Along the cubic through the last two points and their tangents: of fourth order.

    What Newton has left to do is often rounding after one Jacobian (higher order predictors:
    Allgower and Georg 1990, section 6.3; Lundberg and Poore 1991).
    """

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the cubic; of the tangent on the first step."""
        straight, tangent = plus(state.x.copy(), length, state.tangent), state.tangent
        if previous is None:
            return straight, tangent
        behind = state.x - previous.x
        step = curve.metric.norm(behind)
        if step < CONVERGED:
            return straight, tangent
        u = length / step
        bend, turn = length * u * (1.0 + u), length * u
        point = plus(straight, turn + bend, tangent)
        point = plus(point, bend, previous.tangent)
        return plus(point, -(turn + 2.0 * bend) / step, behind), tangent
