"""The bounds of the unknowns: a branch ends where an unknown leaves its bounds.

Failure modes and answers
-------------------------
- A piece may run along a bound, as a multiplier that stays zero does: a distance that is zero,
  and stays so, is no event.
- A test may vanish where a bound is met, as the test of a complementarity does: the rays of that
  transition that stay within the bounds are followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.curve.curve import Curve, State
from pwscont.stepping.stepper import Segment
from pwscont.system.box import Box
from pwscont.transitions.bounding import BoundingTests
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import locate_zero
from pwscont.transitions.rays import Ray, vanishing


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
        """Return the distances to the bounds; a distance that is zero and stays so is set to 1."""
        values = self._side * (state.x[self._which] - self._limit)
        slopes = self._side * state.tangent[self._which]
        rides = self._is_on(curve, state) & (np.abs(slopes) <= self._flat(curve, state))
        values[rides], slopes[rides] = 1.0, 0.0
        return Reading(values, slopes)

    def _is_on(self, curve: Curve, state: State) -> Array:
        """Tell for which bounds the state is on them, but for rounding."""
        error = state.size[self._which]
        rounding = EPS * (curve.metric.scale[self._which] + np.abs(self._limit))
        on: Array = np.abs(state.x[self._which] - self._limit) <= CONFIDENCE * (error + rounding)
        return on

    def _flat(self, curve: Curve, state: State) -> Array:
        """Return the size below which a slope is rounding."""
        flat: Array = GUARD * EPS * (curve.metric.scale + np.abs(state.x))[self._which]
        return flat

    def left_by(self, ray: Ray) -> str | None:
        """Return in words which bound a ray leaves at once, None if none."""
        if not len(self._which):
            return None
        slopes = self._side * ray.state.tangent[self._which]
        out = slopes < -self._flat(ray.curve, ray.state)
        found = np.flatnonzero(self._is_on(ray.curve, ray.state) & out)
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
