"""Pieces of an affine selection: no step size, no corrector (docs/theory, F6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from pwscont.basics.outcome import Failure
from pwscont.curve.curve import Curve, State
from pwscont.stepping.stepper import Segment, Stepper, StraightSegment


@final
@dataclass(frozen=True, slots=True)
class ExactLinear(Stepper):
    """Takes a whole piece of a :class:`~pwscont.PiecewiseLinearSystem` in one step.

    The ray along the tangent is the curve; where it leaves its cell is a ratio test, and the
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
