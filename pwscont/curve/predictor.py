"""Predictors: from the last points of a curve to a guess for the next point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
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
        direction = curve.metric.normalised(state.x - previous.x) if previous else state.tangent
        return state.x + length * direction, direction


#: Three points are used if neither step between these is longer than this many times the other.
ALIKE = 4.0


@final
@dataclass(frozen=True, slots=True)
class Hermite(Predictor):
    """Along the quintic through the last three points and tangents: of sixth order.

    Along the cubic with two points or with differences. Newton often needs a single Jacobian from
    there (higher order predictors: Allgower and Georg 1990, section 6.3; Lundberg and Poore 1991).

    Examples
    --------
    >>> from pwscont import Hermite, PseudoArclength
    >>> PseudoArclength().predictor == Hermite()
    True
    """

    def predict(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return a point of the polynomial; of the tangent on the first step and if straight."""
        nodes, tangent = [(0.0, state.x, state.tangent)], state.tangent
        if previous is not None and not curve.selection.is_straight:
            cosine = dot(curve.metric.covector(previous.tangent), tangent)
            s = arc(curve.metric.norm(state.x - previous.x), cosine)
            r, x, along = previous.behind or nodes[0]
            is_alike = s <= ALIKE * r <= ALIKE**2 * s and curve.selection.system.knows_jacobian
            if s >= CONVERGED:
                earlier = [(-s - r, x, along)] if is_alike else []
                nodes += [(-s, previous.x, previous.tangent), *earlier]
        return _polynomial(nodes, length), tangent


def arc(chord: float, cosine: float) -> float:
    """Return arc length from chord and tangents, with an error of fourth order in the angle."""
    return chord * (1.0 + (1.0 - cosine) / 12.0)


def _polynomial(nodes: Sequence[tuple[float, Array, Array]], u: float) -> Array:
    """Return Hermite's polynomial at ``u``; nodes are places, points, tangents, the first at 0."""
    point = (origin := nodes[0][1]).copy()
    for s, x, tangent in nodes:
        lagrange, steepness = 1.0, 0.0
        for r, _, _ in nodes:
            if r != s:
                lagrange *= (u - r) / (s - r)
                steepness += 2.0 / (s - r)
        square = lagrange * lagrange
        point = plus(point, (u - s) * square, tangent)
        if s:
            point = plus(point, (1.0 - (u - s) * steepness) * square, x - origin)
    return point
