"""Predictors: the direction of a step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

from pwscont.foundation.arrays import Array
from pwscont.numerics.curve import Curve, State


class Predictor(ABC):
    """Chooses the direction, of length one, in which the next point is predicted."""

    @abstractmethod
    def direction(self, curve: Curve, previous: State | None, state: State) -> Array:
        """Return the direction of the step from ``state``; ``previous`` is the state before."""


@final
@dataclass(frozen=True, slots=True)
class Tangent(Predictor):
    """Along the tangent: the error of the prediction is of second order in the step."""

    def direction(self, curve: Curve, previous: State | None, state: State) -> Array:
        """Return the tangent."""
        return state.tangent


@final
@dataclass(frozen=True, slots=True)
class Secant(Predictor):
    """Through the last two points; along the tangent where there is only one."""

    def direction(self, curve: Curve, previous: State | None, state: State) -> Array:
        """Return the direction from the previous point to this one."""
        if previous is None:
            return state.tangent
        return curve.metric.normalised(state.x - previous.x)
