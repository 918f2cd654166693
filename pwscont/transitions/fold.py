"""Smooth folds: alpha turns within one selection (F3 of the design)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Failure
from pwscont.numerics.curve import Curve, State
from pwscont.stepping.stepper import CurvedSegment, Segment
from pwscont.transitions.detector import Arrival, Reading, TransitionDetector
from pwscont.transitions.location import locate_sign_change
from pwscont.transitions.rays import Ray


@final
@dataclass(frozen=True, slots=True)
class SmoothFolds(TransitionDetector):
    """Watches the alpha component of the tangent, which is proportional to det(dH/dz)."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the component and its negative; zero to rounding counts as zero."""
        slope = curve.slope(state)
        return Reading(np.array([slope, -slope]), np.zeros(2))

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Find where the tangent has no alpha component."""
        assert isinstance(segment, CurvedSegment)  # straight segments have no smooth folds
        sign = 1.0 if index == 0 else -1.0
        found = locate_sign_change(segment, lambda state: sign * float(state.tangent[-1]), bracket)
        if isinstance(found, State):
            found.tangent[-1] = 0.0  # what a fold is; a rest of rounding would be found again
        return found

    def arrive(self, curve: Curve, state: State, index: int) -> Arrival:
        """Go on along the same curve."""
        forth = Ray(curve, state)
        message = f"fold on {curve.selection.label}"
        return Arrival(Kind.FOLD, state.x, message, (forth.reversed(), forth))
