"""Predictors: where the next point of a curve is looked for.

Failure modes and answers
-------------------------
- Extrapolation far beyond the step before it goes wrong: the stepper halves its step, with which
  every predictor tends to the tangent.
- The step before is so short that its chord is rounding: it is left out.
- Tangents by differences may be off by a percent where a function changes within their steps, and
  the quintic takes such errors dozens of times: there the cubic is as far as it goes.
- A polynomial of the chord, along tangents of length one, is of fourth order whatever its degree:
  it is one of arc length, which the angle between the tangents tells well enough.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONVERGED
from pwscont.curve.curve import Curve, State
from pwscont.linear.vectors import plus

#: Three points are used where neither of the steps between them is more than this times the other:
#: of a short one the polynomial sees rounding, of a long one what the curve did long ago.
ALIKE = 4.0


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
    """Through the last two points; along the tangent where there is only one.

    Examples
    --------
    >>> from pwscont import PseudoArclength, Secant
    >>> PseudoArclength(predictor=Secant()).predictor
    Secant()
    """

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
    """Along the quintic through the last three points and their tangents: of sixth order.

    Along the cubic, of fourth order, where there are two points only, the two steps before differ
    too much, or Jacobians are differences. What Newton has left to do is often rounding after one
    Jacobian (higher order predictors: Allgower and Georg 1990, section 6.3; Lundberg and Poore
    1991).

    Examples
    --------
    >>> from pwscont import Hermite, PseudoArclength
    >>> PseudoArclength().predictor == Hermite()
    True
    """

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the polynomial; of the tangent on the first step."""
        if previous is None or curve.selection.is_straight:
            return _straight_on(state, length), state.tangent
        s = _arc_between(curve, previous, state)
        if s < CONVERGED:
            return _straight_on(state, length), state.tangent
        earlier, r = previous.behind, previous.arc
        is_exact = curve.selection.system.knows_jacobian
        if earlier is None or not (is_exact and s <= ALIKE * r <= ALIKE**2 * s):
            return _cubic(state, previous, s, length), state.tangent
        return _quintic(state, (previous, s), (earlier, s + r), length), state.tangent


def arc(chord: float, cosine: float) -> float:
    """Return the length of a curve from its chord and the angle between its tangents.

    But for a part of fourth order in that angle, which the quintic does not see either.
    """
    return chord * (1.0 + (1.0 - cosine) / 12.0)


def _arc_between(curve: Curve, previous: State, state: State) -> float:
    """Return the length of the curve between two states, which most states know."""
    if state.behind is previous:
        return state.arc
    metric = curve.metric
    cosine = float(metric.covector(previous.tangent).dot(state.tangent))
    return arc(metric.norm(state.x - previous.x), cosine)


def _straight_on(state: State, u: float) -> Array:
    return plus(state.x.copy(), u, state.tangent)


def _cubic(state: State, previous: State, s: float, u: float) -> Array:
    """Return Hermite's cubic at ``u``, with a state at 0 and the one before at ``-s``."""
    here, there = ((u + s) / s) ** 2, (u / s) ** 2
    point = plus(state.x.copy(), (3.0 + 2.0 * u / s) * there, previous.x - state.x)
    point = plus(point, u * here, state.tangent)
    return plus(point, (u + s) * there, previous.tangent)


def _quintic(
    state: State, previous: tuple[State, float], earlier: tuple[State, float], u: float
) -> Array:
    """Return Hermite's quintic at ``u``, with a state at 0 and two before at these distances.

    It is made of the squares of Lagrange's polynomials, which are one at one of three states and
    zero at both others.
    """
    (one, s), (two, t) = previous, earlier
    v, w, r = u + s, u + t, t - s
    first, second, third = v * w / (s * t), u * w / (s * r), u * v / (t * r)
    here, there, before = first * first, second * second, third * third
    point = plus(state.x.copy(), (1.0 + 2.0 * v * (1.0 / s - 1.0 / r)) * there, one.x - state.x)
    point = plus(point, (1.0 + 2.0 * w * (1.0 / t + 1.0 / r)) * before, two.x - state.x)
    point = plus(point, u * here, state.tangent)
    point = plus(point, v * there, one.tangent)
    return plus(point, w * before, two.tangent)
