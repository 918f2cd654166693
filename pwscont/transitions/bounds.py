"""The bounds of the unknowns: a branch ends where an unknown leaves its bounds.

Failure modes and answers
-------------------------
- A piece may run along a bound, as a multiplier that stays zero does, or touch a bound: Newton
  leaves its points on either side. An unknown leaves its bounds only where it is beyond them by
  more than the error of the point.
- The last correction of Newton may be smaller than rounding by chance: where a point is beyond a
  bound by next to nothing its error is estimated anew.
- Where branches cross on a bound, those that leave the bounds are not followed: the point says so,
  for they take their sign out of the sum of signs.
- A test may vanish where a bound is met, as the test of a complementarity does: the rays of that
  transition that stay within the bounds are followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, Signs
from pwscont.basics.outcome import Failure, Kind
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude
from pwscont.curve.newton import uncertainty_beside
from pwscont.curve.stepper import Segment
from pwscont.system.box import Box
from pwscont.transitions.bounding import BoundingTests
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import locate_zero
from pwscont.transitions.rays import Ray, vanishing

#: On curved pieces a slope below this, relative to typical magnitudes, is an error of the tangent.
LEVEL = EPS**0.5
EVERY = slice(None)


@final
class Bounds(TransitionDetector):
    """Watches z - lower and upper - z, where they are finite.

    Parameters
    ----------
    box : Box
    names : sequence of str
        The names of the unknowns.
    """

    is_affine = True

    def __init__(self, box: Box, names: Sequence[str]) -> None:
        below, above = (np.flatnonzero(np.isfinite(ends)) for ends in (box.lower, box.upper))
        self._which = np.concatenate([below, above])
        self._limit = np.concatenate([box.lower[below], box.upper[above]])
        self._side = np.repeat([1.0, -1.0], [len(below), len(above)])
        self._names = names

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the distances to the bounds; one that the state is on is positive."""
        values, slopes = self._distances(state), self._side * state.tangent[self._which]
        on = self._is_on(curve, state)
        values[on] = self._rounding(curve, on)
        slopes[on & (np.abs(slopes) <= self._level(curve, state))] = 0.0
        return Reading(values, slopes)

    def _distances(self, state: State) -> Array:
        """Return how far a state is inside of each bound."""
        inside: Array = self._side * (state.x[self._which] - self._limit)
        return inside

    def _is_on(self, curve: Curve, state: State) -> Signs:
        """Tell for which bounds the state is on them, but for its error."""
        off, rounding = np.abs(self._distances(state)), self._rounding(curve)
        on: Signs = off <= CONFIDENCE * (state.size[self._which] + rounding)
        doubtful = ~on & (off <= self._level(curve, state))
        if doubtful.any():
            error = magnitude(state.x, uncertainty_beside(curve, state))[self._which]
            on |= doubtful & (off <= CONFIDENCE * (error + rounding))
        return on

    def _rounding(self, curve: Curve, some: Signs | slice = EVERY) -> Array:
        """Return the rounding of distances to bounds."""
        rounding: Array = EPS * (curve.metric.scale[self._which] + np.abs(self._limit))[some]
        return rounding

    def _level(self, curve: Curve, state: State) -> Array:
        """Return slopes that are none, and distances that may be the error of a point."""
        level = GUARD * EPS if curve.selection.is_straight else LEVEL
        sizes: Array = level * (curve.metric.scale + np.abs(state.x))[self._which]
        return sizes

    def left_by(self, ray: Ray) -> str | None:
        """Return in words which bound a ray leaves at once, None if none."""
        if not len(self._which):
            return None
        curve, state = ray.curve, ray.state
        out = self._side * state.tangent[self._which] < -self._level(curve, state)
        found = np.flatnonzero(self._is_on(curve, state) & out if out.any() else out)
        return self._message(int(found[0])) if len(found) else None

    def _message(self, index: int) -> str:
        side = "lower" if self._side[index] > 0.0 else "upper"
        name = self._names[int(self._which[index])]
        return f"{name} reaches its {side} bound {self._limit[index]:.6g}"

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Solve {H_chi = 0, z_i = bound}."""
        which, side, limit = self._which[index], self._side[index], self._limit[index]
        row = np.zeros(len(segment.start.x))
        row[which] = side

        def function(x: Array) -> tuple[float, Matrix]:
            return float(side * (x[which] - limit)), row

        state = locate_zero(segment, function, bracket)
        if isinstance(state, State):
            state.x[which] = limit  # equal but for the rounding of the solve
        return state

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """End the branch, or cross the interface that is met together with the bound."""
        selection = curve.selection
        zero = vanishing(selection.system, state.x, state.error, curve.metric.scale)
        for place, test in enumerate(selection.bounding.tolist()):
            if test in zero:
                return BoundingTests().arrive(curve, state, place)
        return SpecialPointFound(
            Kind.END, state.x, self._message(index), (Ray(curve, state).reversed(),)
        )


#: The bounds of unknowns that have none.
NO_BOUNDS = Bounds(Box(*np.empty((3, 0))), ())
