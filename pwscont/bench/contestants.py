"""The steppers that are compared, and the settings of the steppers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import final

from pwscont import (
    ExactLinear,
    MoorePenrose,
    NaturalParameter,
    PseudoArclength,
    Secant,
    Stepper,
    StepSize,
    Tangent,
)

#: Longest steps, in the metric in which the interval of alpha has length one.
LONGEST = (0.3, 0.1, 0.03, 0.01)
#: Bounds for the turn within a step, as cosines of the largest angle.
COSINES = (0.9, 0.98, 0.998, 0.9998)


@final
@dataclass(frozen=True, slots=True)
class Contestant:
    """A stepper with a setting.

    Attributes
    ----------
    name : str
        The name of the stepper's line in the picture, equal for all settings of a stepper.
    step_size : StepSize or None
        None for a stepper without step size.
    stepper : Stepper
    """

    name: str
    step_size: StepSize | None
    stepper: Stepper

    @property
    def setting(self) -> str:
        """The setting in words."""
        if self.step_size is None:
            return "-"
        return f"step {self.step_size.largest:g}, cosine {self.step_size.least_cosine:g}"


def by_longest(largest: float) -> StepSize:
    """Return the step size that starts with a fifth of the longest step."""
    return StepSize(first=0.2 * largest, largest=largest)


def by_angle(cosine: float) -> StepSize:
    """Return a step size that is limited mainly by the turn within a step."""
    return StepSize(first=0.01, largest=0.5, least_cosine=cosine)


def _newton(size: StepSize) -> Stepper:
    return PseudoArclength(step_size=size)


def _tangent(size: StepSize) -> Stepper:
    return PseudoArclength(predictor=Tangent(), step_size=size)


def _secant(size: StepSize) -> Stepper:
    return PseudoArclength(predictor=Secant(), step_size=size)


def _moore_penrose(size: StepSize) -> Stepper:
    return PseudoArclength(corrector=MoorePenrose(), step_size=size)


def _natural(size: StepSize) -> Stepper:
    return NaturalParameter(size)


STEPPERS: dict[str, Callable[[StepSize], Stepper]] = {
    "arclength, Hermite, Newton": _newton,
    "arclength, tangent, Newton": _tangent,
    "arclength, secant, Newton": _secant,
    "arclength, Hermite, Moore-Penrose": _moore_penrose,
    "natural parameter": _natural,
}
EXACT = "exact linear"
BY_ANGLE = "arclength, Hermite, Newton, by angle"
NAMES = (EXACT, *STEPPERS, BY_ANGLE)


def contestants(is_straight: bool, quick: bool) -> Iterator[Contestant]:
    """Yield all steppers that apply, each with all settings.

    Parameters
    ----------
    is_straight : bool
        Whether all pieces are straight: then ExactLinear applies, and bounds of angles do not.
    quick : bool
        Whether to try few settings.
    """
    longest, cosines = (LONGEST[1::2], COSINES[1::2]) if quick else (LONGEST, COSINES)
    if is_straight:
        yield Contestant(EXACT, None, ExactLinear())
    for name, make in STEPPERS.items():
        for size in [by_longest(largest) for largest in longest]:
            yield Contestant(name, size, make(size))
    if not is_straight:
        for size in [by_angle(cosine) for cosine in cosines]:
            yield Contestant(BY_ANGLE, size, _newton(size))
