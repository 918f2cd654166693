"""Keller's pseudo-arclength continuation on one smooth selection."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

from pwscont.foundation.outcome import Failure, Trouble
from pwscont.numerics.corrector import BorderedNewton, Corrected, Corrector
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.predictor import Hermite, Predictor
from pwscont.numerics.step_size import StepSize
from pwscont.stepping.landing import land_on, overshoots
from pwscont.stepping.stepper import CurvedSegment, Segment, Stepper


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
    """

    predictor: Predictor = field(default_factory=Hermite)
    corrector: Corrector = field(default_factory=BorderedNewton)
    step_size: StepSize = field(default_factory=StepSize)

    def step(
        self,
        curve: Curve,
        interval: tuple[float, float],
        state: State,
        before: Segment | None,
        longest: float,
    ) -> Segment | Failure:
        """Halve the step until the corrector converges and the curve turns little."""
        previous, length = None, self.step_size.first
        if isinstance(before, CurvedSegment):
            previous, length = before.start, before.suggestion
        length = min(length, longest)
        failure = Failure(Trouble.NOT_CONVERGED)
        while length >= self.step_size.smallest:
            corrected = self._try(curve, interval, previous, state, length)
            if isinstance(corrected, Failure):
                failure = corrected
            else:
                cosine = curve.metric.covector(state.tangent).dot(corrected.state.tangent)
                if self.step_size.accepts(cosine):
                    longer = self.step_size.after(length, corrected.iterations, cosine)
                    return CurvedSegment.between(curve, state, corrected.state, longer)
            length *= 0.5
        return failure

    def _try(
        self,
        curve: Curve,
        interval: tuple[float, float],
        previous: State | None,
        state: State,
        length: float,
    ) -> Corrected | Failure:
        """Return the next state, on the end of the interval where the step would overshoot it."""
        predicted, direction = self.predictor.predict(curve, previous, state, length)
        end = overshoots(interval, predicted[-1])
        if end is None:
            return self.corrector.correct(curve, predicted, direction)
        return land_on(curve, state, direction, end)
