"""The seam of the searches for starts, and the search at both ends of the interval."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.metric import Metric
from pwscont.search.enumeration import Found, solutions_at


class Search(ABC):
    """Finds solutions from which components can be traced."""

    @abstractmethod
    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield solutions (z, alpha) with their errors; a component may be hit repeatedly."""


@final
@dataclass(frozen=True, slots=True)
class EndPoints(Search):
    """All solutions at both ends of the interval (F5 of the design).

    A component of the zero set within the interval is a closed loop or ends at an end of the
    interval, so this finds every component but loops, wherever the enumeration is complete.
    """

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield the solutions at lo, then those at hi."""
        for alpha in interval:
            yield from solutions_at(system, metric, alpha)
