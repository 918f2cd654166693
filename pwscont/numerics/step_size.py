"""Control of the step length from what the corrector reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class StepSize:
    """Grow where Newton converges fast and the curve is straight, shrink where not.

    Lengths are measured in the metric, in which the interval of alpha has length one.

    Attributes
    ----------
    first, smallest, largest : float
        Lengths of the first step of a piece, of the last try, and of the longest step.
    wanted_iterations : int
        Newton iterations per step that the control aims at.
    least_cosine : float
        Cosine of the largest angle between the tangents at both ends of a step.
    """

    first: float = 0.02
    smallest: float = 1e-10
    largest: float = 0.1
    wanted_iterations: int = 4
    least_cosine: float = 0.98

    def accepts(self, cosine: float) -> bool:
        """Tell whether the curve turned little enough within the step."""
        return cosine >= self.least_cosine

    def after(self, length: float, iterations: int, cosine: float) -> float:
        """Return the next step length: at most twice, at least half this one."""
        by_newton = 2.0 ** ((self.wanted_iterations - iterations) / 2.0)
        # the angle grows like the step: (1 - cos) like its square
        by_angle = (1.0 - self.least_cosine) / max(2.0 * (1.0 - cosine), 1e-300)
        factor = min(by_newton, by_angle**0.5, 2.0)
        return float(min(max(length * max(factor, 0.5), self.smallest), self.largest))
