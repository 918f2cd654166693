"""Transitions: the bounding tests of the cell, and the way across each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from pwscont.foundation.arrays import Array, Matrix
from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Failure
from pwscont.model.selection import Selection
from pwscont.numerics.curve import Curve, State
from pwscont.stepping.stepper import Segment
from pwscont.transitions.detector import Arrival, Reading, TransitionDetector
from pwscont.transitions.location import locate_zero
from pwscont.transitions.rays import Ray, beyond, gradient_of, inward_ray, vanishing


@final
@dataclass(frozen=True, slots=True)
class BoundingTests(TransitionDetector):
    """Watches the test functions that bound the current cell, and no others."""

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the bounding tests, positive inside, and their slopes."""
        selection = curve.selection
        slopes = selection.test_gradients(state.x) @ state.tangent
        return Reading(selection.tests(state.x), slopes)

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Solve {H_chi = 0, kappa_i = 0}."""
        selection = segment.curve.selection
        test = int(selection.bounding[index])

        def function(x: Array) -> tuple[float, Matrix]:
            return float(selection.tests(x)[index]), gradient_of(selection, x, test)

        return locate_zero(segment, function, bracket)

    def arrive(self, curve: Curve, state: State, index: int) -> Arrival:
        """Cross the interface where it can be crossed; otherwise stop and say why."""
        old, x = curve.selection, state.x
        test = int(old.bounding[index])
        back = Ray(curve, state).reversed()
        new = Selection(old.system, beyond(old, x, test))
        zero = {test, *vanishing(old, x, state.error), *vanishing(new, x, state.error)}
        if len(zero) > 1:
            return Arrival(Kind.CORNER, x, _corner_message(old, x, zero), (back,))
        forth = inward_ray(Curve(new, curve.metric), x, state.error, test)
        if forth is None or forth.state.orientation != state.orientation:
            return Arrival(Kind.STOPPED, x, _disagreement(old, new, test), (back,))
        message = old.system.describe_transition(old.character, new.character)
        kind = Kind.NONSMOOTH_FOLD if turns(back, forth) else Kind.TRANSITION
        return Arrival(kind, x, message, (back, forth))


def turns(back: Ray, forth: Ray) -> bool:
    """Tell whether alpha reverses where two rays leave; vertical pieces do not reverse it."""
    return back.curve.slope(back.state) * forth.curve.slope(forth.state) > 0.0


def _corner_message(selection: Selection, x: Array, zero: set[int]) -> str:
    tests = ", ".join(str(i) for i in sorted(int(i) for i in zero))
    return (
        f"several test functions ({tests}) vanish together where {selection.label} ends; "
        "the pieces that leave from here are not followed"
    )


def _disagreement(old: Selection, new: Selection, test: int) -> str:
    return (
        f"no way across test function {test} from {old.label} to {new.label}: the curve is "
        "tangent to the interface, or the selections do not agree on it; run check_system"
    )
