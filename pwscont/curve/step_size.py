"""Control of the step length from the strain and the turn of the last step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

from pwscont.basics.arrays import finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.rounding import TINY

#: The strain that the control aims at, where 1 is the largest strain that is accepted.
WANTED_STRAIN = 0.5
#: Default lengths in the metric: the first step of a piece, and the gap between looks into a step.
FIRST_STEP = 0.02
LARGEST_GAP = 0.0025


@final
@dataclass(frozen=True, slots=True)
class StepSize:
    """Control the step length: grow where Newton converges fast and the curve is straight.

    Lengths are measured in the metric, in which the interval of alpha has length 1.

    Attributes
    ----------
    first, smallest, largest : float
        Lengths of the first step of a piece, of the last try, and of the longest step. If only
        ``largest`` is given, and is shorter than 0.02, the first step is as long as the longest.
    least_cosine : float
        Cosine of the largest angle between the tangents at the two ends of a step.
    gap : float
        Distance between the places inside a step in which H is evaluated; with n > 8 unknowns
        sqrt(n / 8) times the given distance. Two smooth folds closer together may be passed over.
        Half the gap doubles the evaluations.

    Raises
    ------
    InvalidInputError
        If not 0 < smallest <= first <= largest, the cosine is not between -1 and 1, or the gap is
        not positive.

    Examples
    --------
    >>> from pwscont import PseudoArclength, StepSize
    >>> PseudoArclength(step_size=StepSize(largest=0.01)).step_size.first
    0.01
    """

    first: float = FIRST_STEP
    smallest: float = 1e-10
    largest: float = 0.1
    least_cosine: float = 0.98
    gap: float = LARGEST_GAP

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("first", "smallest", "largest", "least_cosine", "gap"):
            number = finite_array(f"{name} of StepSize", getattr(self, name), ())
            object.__setattr__(self, name, float(number))
        if self.largest < self.first == FIRST_STEP:
            object.__setattr__(self, "first", self.largest)
        if not 0.0 < self.smallest <= self.first <= self.largest:
            raise InvalidInputError(
                f"StepSize needs 0 < smallest <= first <= largest, got smallest = {self.smallest}, "
                f"first = {self.first}, largest = {self.largest}"
            )
        if not -1.0 <= self.least_cosine < 1.0:
            raise InvalidInputError(
                f"least_cosine of StepSize must be in [-1, 1), got {self.least_cosine}"
            )
        if not self.gap > 0.0:
            raise InvalidInputError(f"gap of StepSize must be positive, got {self.gap}")

    def stretched(self, factor: float) -> StepSize:
        """Return the control with ``largest`` and ``gap`` multiplied by a factor."""
        return replace(self, largest=factor * self.largest, gap=factor * self.gap)

    def after(self, length: float, strain: float, cosine: float) -> float:
        """Return the length of the next step, at least half and at most twice ``length``.

        ``strain`` is the largest ratio of a measure of the last step to the measure's tolerance.
        """
        # the angle grows like the step, 1 - cos and the strain like the square or faster
        by_strain = WANTED_STRAIN / max(strain, TINY)
        by_angle = (1.0 - self.least_cosine) / max(2.0 * (1.0 - cosine), TINY)
        factor = min(max(min(by_strain, by_angle) ** 0.5, 0.5), 2.0)
        return float(min(max(length * factor, self.smallest), self.largest))


def step_size_of(stepper: object) -> StepSize | None:
    """Return the step control of a stepper, None for a stepper without any."""
    found = getattr(stepper, "step_size", None)
    return found if isinstance(found, StepSize) else None
