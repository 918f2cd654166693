"""The step of pseudo-arclength continuation: predict, correct, accept or say why not.

1. A :class:`Predictor` guesses the next point from the last points of the curve.
2. A corrector leads from the guess to a point of the curve.
3. :func:`accepted` tells whether that point is the next point of the same curve: the corrector may
   also converge on another part of the curve or on a neighbouring sheet. A step is true if

   - the correction is a small part of the step,
   - Newton contracts at once (Deuflhard 2011, chapter 5),
   - the cubic between the two points, which the graph interpolates, is on the curve inside the step
     (:mod:`pwscont.curve.looks`). Sheets closer than about a thousandth of a step stay unseen.

4. :meth:`PseudoArclength.step` shortens the step until the step is true.

A step ends early at the end of the interval (:func:`land_on_end`), because H may be undefined
beyond, or at a zero of a function (:meth:`PseudoArclength.aim`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from pwscont.basics.arguments import checked_kind, wrong_result
from pwscont.basics.arrays import Array, dot, plus
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, HALF_DIGITS
from pwscont.curve.corrector import BorderedNewton, Corrected, Corrector, zero
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude
from pwscont.curve.looks import CLOSER_PLACES, farthest_off, gap_of
from pwscont.curve.metric import Range
from pwscont.curve.newton import STALLED, Border, Root, uncertainty
from pwscont.curve.stepper import (
    BESIDE,
    SHORTEST_CHORD,
    CurvedSegment,
    ExactLinear,
    Segment,
    Stepper,
    StepSize,
)


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


#: Largest correction, as a part of the step.
FARTHEST = 0.1
#: Largest distance of the cubic between the two points from the curve, as a part of the step.
OFF = 0.1 * BESIDE
#: Largest correction, as a part of the step, for which a single look at the cubic is enough.
SURE = 3e-3
#: Largest correction, as a part of the step, for which OFF holds; OFF shrinks as corrections grow.
CLOSE = 1e-2
#: Largest distance, in lengths of the step, of an end of the interval or a zero at which the step
#: ends instead.
STRETCH = 1.5
#: Farthest prediction, in the metric, that is looked at: H may overflow beyond.
FARTHEST_PREDICTION = 10.0
#: A refused step is shortened to this part, not to a half: where a step ends exactly on a branch
#: point, two halves would end there again.
SHORTER = 0.6

NOT_CONVERGED, OUTSIDE = Failure(FailureReason.NOT_CONVERGED), Failure(FailureReason.OUTSIDE)


@final
@dataclass(frozen=True, slots=True)
class PseudoArclength(Stepper):
    """Predict along the curve behind, correct normal to the tangent; turns at folds.

    Keller (1977), Allgower and Georg (1990), chapters 2 to 6.

    Attributes
    ----------
    predictor : Predictor
        :class:`Hermite` (default), :class:`Tangent` or :class:`Secant`.
    corrector : Corrector
        :class:`BorderedNewton` (default) or :class:`MoorePenrose`.
    step_size : StepSize

    Raises
    ------
    InvalidInputError
        If a part is of another class.

    Examples
    --------
    >>> from pwscont import PseudoArclength, Secant, StepSize, Switched, trace
    >>> fine = PseudoArclength(predictor=Secant(), step_size=StepSize(largest=0.02))
    >>> circle = Switched(1, lambda z, t, sw: z**2 + t**2 - 1)
    >>> len(trace(circle, ([1.0], 0.0), (-2.0, 2.0), stepper=fine).special_points("fold"))
    2
    """

    predictor: Predictor = field(default_factory=Hermite)
    corrector: Corrector = field(default_factory=BorderedNewton)
    step_size: StepSize = field(default_factory=StepSize)

    def __post_init__(self) -> None:
        """Check the parts."""
        checked_kind("predictor of PseudoArclength", self.predictor, Predictor, is_needed=True)
        checked_kind("corrector of PseudoArclength", self.corrector, Corrector, is_needed=True)
        checked_kind("step_size of PseudoArclength", self.step_size, StepSize, is_needed=True)

    def step(
        self, curve: Curve, interval: Range, state: State, before: Segment | None, longest: float
    ) -> Segment | Failure:
        """Return a true step of the proposed length, of a part of that length, and so on."""
        previous, length = self._proposed(before)
        length, failure = min(length, longest), NOT_CONVERGED
        wanted, gap = length, gap_of(self.step_size, curve.selection.system)
        if isinstance(before, CurvedSegment):  # closer after a step that was looked into closely
            gap = min(gap, 2.0 * before.gap)
        while length >= self.step_size.smallest:
            segment = self._try(curve, interval, previous, state, length, gap)
            if not isinstance(segment, Failure):
                if length < wanted:  # a length that was just refused is not tried again at once
                    segment.suggestion = min(segment.suggestion, segment.length)
                return segment
            if segment.trouble is FailureReason.HIDDEN_FOLDS:
                gap = min(gap, 0.5 * length / CLOSER_PLACES)
            failure, length = segment, SHORTER * length
        return failure

    def _proposed(self, before: Segment | None) -> tuple[State | None, float]:
        """Return the state before on the same piece, and the length of the next step."""
        if isinstance(before, CurvedSegment):
            return before.start, before.suggestion
        return None, self.step_size.first

    def _try(
        self,
        curve: Curve,
        interval: Range,
        previous: State | None,
        state: State,
        length: float,
        gap: float,
    ) -> CurvedSegment | Failure:
        """Return a step of a length, or a step to the end of the interval instead of beyond."""
        predicted, direction = self._predicted(curve, previous, state, length)
        lo, hi = interval
        corrected: Corrected | Failure = OUTSIDE
        alpha = float(predicted[-1])
        if lo < alpha < hi or alpha == state.alpha:  # a vertical piece may lie on an end
            corrected = self.corrector.correct(curve, predicted, direction)
            if not isinstance(corrected, Corrected | Failure):
                wanted = "a Corrected or a Failure"
                raise wrong_result(self.corrector, "correct()", wanted, corrected)
        if not isinstance(corrected, Failure):
            return accepted(curve, state, predicted, corrected, length, self.step_size, gap)
        if corrected.trouble is FailureReason.OUTSIDE:
            return land_on_end(curve, interval, state, direction, length, self.step_size)
        return corrected

    def aim(
        self, curve: Curve, state: State, before: Segment | None, distance: float, border: Border
    ) -> CurvedSegment | None:
        """Return the step that ends at a zero about a step away, None where the zero is farther.

        At the beginning of a piece only the tangent is known, and a step may have any length: a
        zero no farther than the longest step is tried, as a short step first would cost as much.
        """
        previous, length = self._proposed(before)
        if distance > (STRETCH * length if previous else self.step_size.largest):
            return None
        predicted, _ = self._predicted(curve, previous, state, distance)
        return land_on_zero(curve, state, predicted, border, self.step_size)

    def _predicted(
        self, curve: Curve, previous: State | None, state: State, length: float
    ) -> tuple[Array, Array]:
        """Return the predicted point and the direction, in the shapes of a point."""
        pair = self.predictor.predict(curve, previous, state, length)
        shape = state.x.shape
        if not isinstance(pair, tuple) or [getattr(p, "shape", None) for p in pair] != [shape] * 2:
            wanted = f"a point and a direction, arrays of the shape {shape}"
            raise wrong_result(self.predictor, "predict()", wanted, pair)
        return pair

    def stretched(self, factor: float) -> PseudoArclength:
        """Return a stepper whose longest step is longer by a factor."""
        return replace(self, step_size=self.step_size.stretched(factor))


#: The default steppers of straight and of curved pieces.
STRAIGHT, CURVED = ExactLinear(), PseudoArclength()


def accepted(
    curve: Curve,
    state: State,
    predicted: Array,
    corrected: Corrected,
    length: float,
    step_size: StepSize,
    gap: float | None = None,
) -> CurvedSegment | Failure:
    """Return the segment from a state to a corrected prediction, a Failure if the step is not true.

    Parameters
    ----------
    curve : Curve
    state : State
        The state from which the step begins.
    predicted : ndarray, shape (n + 1,)
    corrected : Corrected
    length : float
        Length of the step, in the metric.
    step_size : StepSize
        Judges the turn, and suggests the length of the next step.
    gap : float, optional
        Distance between looks into the step; default that of ``step_size``.
    """
    end = corrected.state
    cosine = dot(curve.metric.covector(state.tangent), end.tangent)
    segment = CurvedSegment.between(curve, state, end, length)
    if not (cosine >= step_size.least_cosine and segment.length > 0.0):  # also where not a number
        return Failure(FailureReason.JUMP)
    segment.factor_at_end = corrected.factor
    segment.gap = gap_of(step_size, curve.selection.system) if gap is None else gap
    correction = curve.metric.norm(end.x - predicted)
    strain = _strain(curve, corrected, correction, length, 0.0)
    if strain <= 1.0 and not curve.selection.is_straight:
        is_sure = correction <= SURE * length
        off = farthest_off(segment, corrected.factor, OFF * length, is_sure)
        if isinstance(off, Failure):
            return off
        strain = _strain(curve, corrected, correction, length, off)
    if not strain <= 1.0:  # also where not a number
        return Failure(FailureReason.JUMP)
    segment.suggestion = step_size.after(length, strain, cosine)
    return segment


def _strain(
    curve: Curve, corrected: Corrected, correction: float, length: float, off: float
) -> float:
    """Return the largest ratio of a measure of a step to the bound; above 1, no step is true.

    Distances of half of the digits are always allowed, however short the step is: tangents from
    differences are no better. How far a point is off because of rounding is estimated only if the
    step would be refused.

    ``off``: the distance of the curve from the cubic of the step.
    """

    def beyond(noise: float) -> float:
        by_contraction = corrected.contraction / STALLED if correction > noise else 0.0
        by_correction = correction / (FARTHEST * length + noise)
        allowed = OFF * length * min(1.0, CLOSE * length / max(correction, noise))
        return max(off / (allowed + noise), by_contraction, by_correction)  # nan comes first

    strain = beyond(HALF_DIGITS)
    if not strain > 1.0:
        return strain  # nearly always
    state, metric = corrected.state, curve.metric
    jacobian, row = curve.selection.jacobian(state.x), metric.covector(state.tangent)
    root = Root(state.x, state.error[0], jacobian, row, corrected.factor, metric.scale)
    return beyond(HALF_DIGITS + CONFIDENCE * metric.norm(magnitude(state.x, uncertainty(root))))


def land_on_end(
    curve: Curve,
    interval: Range,
    state: State,
    direction: Array,
    length: float,
    step_size: StepSize,
) -> CurvedSegment | Failure:
    """Return the step to the end of the interval that a step of ``length`` overshoots."""
    end = interval[1] if direction[-1] > 0.0 else interval[0]
    if abs(end - state.alpha) > STRETCH * length * abs(direction[-1]):
        return Failure(FailureReason.OUTSIDE)
    return land_on(curve, state, direction, end, step_size)


def land_on(
    curve: Curve, state: State, direction: Array, alpha: float, step_size: StepSize
) -> CurvedSegment | Failure:
    """Return the step to ``alpha``, predicted from ``state`` along ``direction``."""
    if direction[-1] * (alpha - state.alpha) <= 0.0:
        return Failure(FailureReason.NO_TURN)
    predicted = state.x + (alpha - state.alpha) / direction[-1] * direction
    predicted[-1] = alpha
    length = curve.metric.norm(predicted - state.x)
    if not length <= FARTHEST_PREDICTION:
        return Failure(FailureReason.JUMP)
    along_alpha = np.zeros_like(predicted)
    along_alpha[-1] = np.copysign(curve.metric.scale[-1], direction[-1])
    corrected = BorderedNewton().correct(curve, predicted, along_alpha)
    if isinstance(corrected, Failure):
        return corrected
    corrected.state.x[-1] = alpha  # equal up to rounding in the border
    return accepted(curve, state, predicted, corrected, length, step_size)


def land_on_zero(
    curve: Curve, state: State, predicted: Array, border: Border, step_size: StepSize
) -> CurvedSegment | None:
    """Return the step to a zero of ``border`` near a prediction, None if that step is not true.

    A zero closer than the shortest chord is located within a longer step.
    """
    length = curve.metric.norm(predicted - state.x)
    if not (SHORTEST_CHORD <= length <= FARTHEST_PREDICTION and curve.metric.admits(predicted)):
        return None
    corrected = zero(curve, border, predicted)
    if isinstance(corrected, Failure):
        return None
    segment = accepted(curve, state, predicted, corrected, length, step_size)
    return None if isinstance(segment, Failure) else segment


@final
@dataclass(frozen=True, slots=True)
class NaturalParameter(Stepper):
    """Increase or decrease alpha and correct z at fixed alpha.

    Follows kinks and non-smooth folds, where the tangent says which way alpha goes; stops with
    a message at a smooth fold or a vertical piece. Here for comparison and for load paths that
    are known not to turn smoothly.

    Attributes
    ----------
    step_size : StepSize
        Lengths along the tangent, in the metric, in which the interval of alpha has length 1.

    Raises
    ------
    InvalidInputError
        If step_size is no StepSize.

    Examples
    --------
    >>> from pwscont import NaturalParameter, Switched, trace
    >>> curve = Switched(1, lambda z, t, sw: z + z**3 - sw.abs(t))
    >>> len(trace(curve, ([0.5], 0.6), (-1.0, 1.0), stepper=NaturalParameter()).pieces)
    2
    """

    step_size: StepSize = field(default_factory=StepSize)

    def __post_init__(self) -> None:
        """Check the parts."""
        checked_kind("step_size of NaturalParameter", self.step_size, StepSize, is_needed=True)

    def step(
        self, curve: Curve, interval: Range, state: State, before: Segment | None, longest: float
    ) -> Segment | Failure:
        """Shorten the increment of alpha until the corrector converges."""
        length = before.suggestion if isinstance(before, CurvedSegment) else self.step_size.first
        length = min(length, longest)
        lo, hi = interval
        # beside a fold alpha hardly changes along the tangent: to creep there is not to turn
        while length * abs(state.tangent[-1]) >= self.step_size.smallest * (hi - lo):
            alpha = min(max(state.alpha + length * state.tangent[-1], lo), hi)
            segment = land_on(curve, state, state.tangent, alpha, self.step_size)
            if not isinstance(segment, Failure):
                return segment
            length *= SHORTER
        return Failure(FailureReason.NO_TURN)
