"""The exact stepper of straight pieces, and continuation in alpha itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

from pwscont.basics.arguments import needed_kind
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.curve import Curve, State
from pwscont.curve.pseudo_arclength import land_on
from pwscont.curve.step_size import StepSize
from pwscont.curve.stepper import CurvedSegment, Segment, Stepper, StraightSegment


@final
@dataclass(frozen=True, slots=True)
class ExactLinear(Stepper):
    """Takes a whole piece of a :class:`~pwscont.PiecewiseLinearSystem` in a single step.

    The ray along the tangent is the curve. A ratio test says where the ray leaves the cell, and the
    point there is solved for afresh, so that errors do not accumulate from piece to piece.

    Examples
    --------
    >>> from pwscont import LCP, ExactLinear, explore
    >>> problem = LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0])
    >>> len(explore(problem, (-1.0, 2.0), stepper=ExactLinear()).pieces)
    2
    """

    def step(
        self,
        curve: Curve,
        interval: tuple[float, float],
        state: State,
        before: Segment | None,
        longest: float,
    ) -> Segment | Failure:
        """Return the ray from ``state``."""
        return StraightSegment(curve, state)


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
        needed_kind("step_size of NaturalParameter", self.step_size, StepSize)

    def step(
        self,
        curve: Curve,
        interval: tuple[float, float],
        state: State,
        before: Segment | None,
        longest: float,
    ) -> Segment | Failure:
        """Halve the increment of alpha until the corrector converges."""
        length = before.suggestion if isinstance(before, CurvedSegment) else self.step_size.first
        length = min(length, longest)
        lo, hi = interval
        # beside a fold alpha hardly changes along the tangent: to creep there is not to turn
        while length * abs(state.tangent[-1]) >= self.step_size.smallest * (hi - lo):
            alpha = min(max(state.alpha + length * state.tangent[-1], lo), hi)
            segment = land_on(curve, state, state.tangent, alpha, self.step_size)
            if not isinstance(segment, Failure):
                return segment
            length *= 0.5
        return Failure(FailureReason.NO_TURN)
