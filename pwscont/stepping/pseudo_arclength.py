"""Keller's pseudo-arclength continuation on one smooth selection."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import final

from pwscont.basics.given import needed_kind
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.corrector import BorderedNewton, Corrected, Corrector
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import Border
from pwscont.curve.predictor import Hermite, Predictor
from pwscont.curve.step_size import StepSize
from pwscont.stepping.acceptance import accepted
from pwscont.stepping.landing import STRETCH, land_on_end, land_on_zero
from pwscont.stepping.stepper import CurvedSegment, Segment, Stepper

NOT_CONVERGED, OUTSIDE = Failure(FailureReason.NOT_CONVERGED), Failure(FailureReason.OUTSIDE)


@final
@dataclass(frozen=True, slots=True)
class PseudoArclength(Stepper):
    """Predict along the curve behind, correct normal to its tangent; turns at folds.

    Keller (1977), Allgower and Georg (1990), chapters 2 to 6.

    Attributes
    ----------
    predictor : Predictor
        :class:`Hermite` (default), :class:`Tangent` or :class:`Secant`.
    corrector : Corrector
        :class:`BorderedNewton` (default) or :class:`MoorePenrose`.
    step_size : StepSize

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
        needed_kind("predictor of PseudoArclength", self.predictor, Predictor)
        needed_kind("corrector of PseudoArclength", self.corrector, Corrector)
        needed_kind("step_size of PseudoArclength", self.step_size, StepSize)

    def step(
        self,
        curve: Curve,
        interval: tuple[float, float],
        state: State,
        before: Segment | None,
        longest: float,
    ) -> Segment | Failure:
        """Halve the step until the corrector converges and the curve turns little."""
        previous, length = self._proposed(before)
        length, failure = min(length, longest), NOT_CONVERGED
        wanted = length
        while length >= self.step_size.smallest:
            segment = self._try(curve, interval, previous, state, length)
            if not isinstance(segment, Failure):
                if length < wanted:  # what was just refused is not tried again at once
                    segment.suggestion = min(segment.suggestion, segment.length)
                return segment
            failure, length = segment, 0.5 * length
        return failure

    def aim(
        self,
        curve: Curve,
        state: State,
        before: Segment | None,
        distance: float,
        border: Border,
    ) -> CurvedSegment | None:
        """Predict the zero like any other point; land on it where it is about a step away.

        At the beginning of a piece, of which nothing is known but its tangent, a step may be any
        length: where the zero is no farther than the longest, a short step first costs as much.
        """
        previous, length = self._proposed(before)
        if distance > (STRETCH * length if previous else self.step_size.largest):
            return None
        predicted, _ = self.predictor.predict(curve, previous, state, distance)
        return land_on_zero(curve, state, predicted, border, self.step_size)

    def stretched(self, factor: float) -> PseudoArclength:
        """Return the same with a step size whose longest step is so many times as long."""
        return replace(self, step_size=self.step_size.stretched(factor))

    def _proposed(self, before: Segment | None) -> tuple[State | None, float]:
        """Return the state before on the same piece, and the length of the next step."""
        if isinstance(before, CurvedSegment):
            return before.start, before.suggestion
        return None, self.step_size.first

    def _try(
        self,
        curve: Curve,
        interval: tuple[float, float],
        previous: State | None,
        state: State,
        length: float,
    ) -> CurvedSegment | Failure:
        """Return a step, to the end of the interval where it would overshoot it."""
        predicted, direction = self.predictor.predict(curve, previous, state, length)
        lo, hi = interval
        corrected: Corrected | Failure = OUTSIDE
        if lo < float(predicted[-1]) < hi:
            corrected = self.corrector.correct(curve, predicted, direction)
        if not isinstance(corrected, Failure):
            return accepted(curve, state, predicted, corrected, length, self.step_size)
        if corrected.trouble is FailureReason.OUTSIDE:
            return land_on_end(curve, interval, state, direction, length, self.step_size)
        return corrected
