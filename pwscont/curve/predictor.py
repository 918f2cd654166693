"""Predictors: from the last points of a curve to a guess for the next point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONVERGED
from pwscont.curve.curve import Curve, State
from pwscont.linear.vectors import dot, plus


class Predictor(ABC):
    """Predicts the next point, and the direction in which the hyperplane there is normal."""

    @abstractmethod
    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point about ``length`` beyond ``state`` and a unit direction.

        ``previous`` is the state before on the same piece, None on the first step of the piece.
        """


@final
@dataclass(frozen=True, slots=True)
class Tangent(Predictor):
    """Along the tangent: the error of the prediction is of second order in the step.

    Examples
    --------
    >>> from pwscont import PseudoArclength, Tangent
    >>> PseudoArclength(predictor=Tangent()).predictor
    Tangent()
    """

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the tangent."""
        return state.x + length * state.tangent, state.tangent


@final
@dataclass(frozen=True, slots=True)
class Secant(Predictor):
    """Through the last two points; along the tangent on the first step of a piece.

    Examples
    --------
    >>> from pwscont import PseudoArclength, Secant
    >>> PseudoArclength(predictor=Secant()).predictor
    Secant()
    """

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the line through the points of the two states."""
        direction = state.tangent
        if previous is not None:
            direction = curve.metric.normalised(state.x - previous.x)
        return state.x + length * direction, direction


@final
@dataclass(frozen=True, slots=True)
class Hermite(Predictor):
    """Along the cubic through the last two points and tangents: of fourth order.

    Newton often needs a single Jacobian from there (higher order predictors: Allgower and Georg
    1990, section 6.3; Lundberg and Poore 1991).

    Examples
    --------
    >>> from pwscont import Hermite, PseudoArclength
    >>> PseudoArclength().predictor == Hermite()
    True
    """

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the cubic; of the tangent on the first step and on a straight curve."""
        on_tangent = plus(state.x.copy(), length, state.tangent), state.tangent
        if previous is None or curve.selection.is_straight:
            return on_tangent
        chord = curve.metric.norm(state.x - previous.x)
        if chord < CONVERGED:
            return on_tangent
        cosine = dot(curve.metric.covector(previous.tangent), state.tangent)
        # arc length, whose relative error is of fourth order in the angle between the tangents
        s, u = chord * (1.0 + (1.0 - cosine) / 12.0), length
        here, there = ((u + s) / s) ** 2, (u / s) ** 2
        point = plus(state.x.copy(), (3.0 + 2.0 * u / s) * there, previous.x - state.x)
        point = plus(point, u * here, state.tangent)
        return plus(point, (u + s) * there, previous.tangent), state.tangent
