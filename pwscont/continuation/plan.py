"""The plan of a run: the parts that a user chose, and defaults for all others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any, final

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import Array
from pwscont.basics.budget import INTERRUPTED, Budget, Limits
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.quantities import Function
from pwscont.continuation.follow import default_detectors
from pwscont.continuation.journal import Journal
from pwscont.continuation.known import FollowedBranches
from pwscont.curve.magnitudes import Gauge, rounded_to_one
from pwscont.curve.metric import Metric
from pwscont.curve.pseudo_arclength import PseudoArclength
from pwscont.curve.stepper import Stepper
from pwscont.curve.steppers import ExactLinear
from pwscont.graph import BranchGraph
from pwscont.linear.threads import MOST_FACTORISED, MOST_MULTIPLIED, few_threads
from pwscont.search import Search
from pwscont.search.default_search import default_search
from pwscont.search.search import scope_of
from pwscont.system.abilities import Reducible, Reduction, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import check_attributes
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.transitions import TransitionDetector
from pwscont.transitions.ends import NO_BOUNDS, Bounds
from pwscont.transitions.events import Events, checked_events
from pwscont.transitions.user_event import Stop

Report = Callable[[int, float], None]


def silent(pieces: int, alpha: float) -> None:
    """Report nothing."""


def checked_interval(system: PiecewiseSystem, interval: tuple[float, float]) -> tuple[float, float]:
    """Return the interval of a run as two floats, or refuse what is no pair in the domain.

    Examples
    --------
    >>> from pwscont import LCP
    >>> from pwscont.extending import checked_interval
    >>> checked_interval(LCP([[1.0]], q=[0.0], d=[1.0]), (0, 1))
    (0.0, 1.0)
    """
    if system is None:
        raise InvalidInputError("system must be a PiecewiseSystem, got None")
    checked_kind("system", system, PiecewiseSystem)
    check_attributes(system)
    try:
        lo, hi = (float(end) for end in interval)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"interval must be two numbers, got {interval!r}") from error
    if not (isfinite(lo) and isfinite(hi) and lo < hi):
        raise InvalidInputError(f"interval needs finite lo < hi, got ({lo}, {hi})")
    low, high = system.domain
    if lo < low or hi > high:
        raise InvalidInputError(
            f"interval ({lo}, {hi}) leaves the domain [{low}, {high}] of {type(system).__name__}"
        )
    return lo, hi


def check_stepper_fits(system: PiecewiseSystem, stepper: Any) -> None:
    """Refuse what is no stepper, and the exact stepper where pieces are curved."""
    checked_kind("stepper", stepper, Stepper)
    if isinstance(stepper, ExactLinear) and not isinstance(system, PiecewiseLinearSystem):
        raise InvalidInputError(
            f"ExactLinear needs a PiecewiseLinearSystem, and {type(system).__name__} is none; "
            "use PseudoArclength"
        )


@final
@dataclass(frozen=True, slots=True)
class Plan:
    """The parts of a run.

    Attributes
    ----------
    system : PiecewiseSystem
        Fitted to the interval, as by :meth:`PiecewiseSystem.within`.
    interval : tuple of float
    reduction : Reduction or None
        The smaller system, where parts of the system provably stay in one mode.
    followed : PiecewiseSystem
        The reduced system, or the system itself.
    metric : Metric
        The metric of the followed system.
    box : Box
        The bounds and periods of the unknowns of the followed system.
    stepper : Stepper
    added : tuple of TransitionDetector
        The detectors that a user gave, beside the default ones, that of the events last.
    budget : Budget
    parameter, record, report, journal
        What a user gave to :func:`pwscont.explore` under these names.
    gauge : Gauge, optional
        Judges the typical magnitudes by the path.
    branches : FollowedBranches
        What searches may ask about the branches that were followed.
    """

    system: PiecewiseSystem
    interval: tuple[float, float]
    reduction: Reduction | None
    followed: PiecewiseSystem
    metric: Metric
    box: Box
    stepper: Stepper
    added: tuple[TransitionDetector | Events, ...]
    budget: Budget
    parameter: str = "alpha"
    record: Mapping[str, Function] | None = None
    report: Report = silent
    journal: Journal | None = None
    gauge: Gauge | None = None
    branches: FollowedBranches = field(default_factory=FollowedBranches)

    @classmethod
    def of(
        cls,
        system: PiecewiseSystem,
        interval: tuple[float, float],
        stepper: Stepper | None,
        added: tuple[TransitionDetector | Events, ...],
        budget: Budget,
        *asked: Any,
    ) -> Plan:
        """Choose the parts for a system on an interval that was checked.

        ``asked``: parameter, record, report and journal, as fields.
        """
        if stepper is None:
            is_straight = isinstance(system, PiecewiseLinearSystem)
            stepper = ExactLinear() if is_straight else PseudoArclength()
        metric = Metric.of(system, interval)  # refuses magnitudes that cannot be computed with
        system = system.within(*interval)
        box = Box.of(system)
        # a reduced system has neither a box nor the states that detectors expect
        free = not (box.is_bounded or box.is_periodic or added)
        reduction = system.reduction(*interval) if isinstance(system, Reducible) and free else None
        followed = system
        if reduction:
            followed = reduction.system.within(*interval)
            metric, box = Metric.of(followed, interval), Box.of(followed)
        parts = (reduction, followed, metric, box, stepper, added, budget)
        return cls(system, interval, *parts, *asked)

    def with_magnitudes(self, magnitudes: Array) -> Plan:
        """Return a plan without a reduction with other typical magnitudes."""
        sizes = rounded_to_one(magnitudes)
        if (sizes == self.metric.scale[:-1]).all():
            return self
        system = self.system.within(*self.interval, sizes)
        metric, box, known = Metric.of(system, self.interval), Box.of(system), FollowedBranches()
        return replace(self, system=system, followed=system, metric=metric, box=box, branches=known)

    @property
    def detectors(self) -> tuple[TransitionDetector, ...]:
        """The default detectors, and those that were added."""
        return (*default_detectors(self.stepper, self.interval), *self.foreign)

    @property
    def bounds(self) -> Bounds:
        """The detector of the bounds of the unknowns."""
        return Bounds(self.box, self.followed.names()) if self.box.is_bounded else NO_BOUNDS

    @property
    def foreign(self) -> list[TransitionDetector]:
        """The detectors that a user gave."""
        return [each for each in self.added if isinstance(each, TransitionDetector)]

    @property
    def events(self) -> Events | None:
        """The events that are watched."""
        return next((each for each in self.added if isinstance(each, Events)), None)

    def reduced(self, z: Array) -> Array:
        """Return a state of the system as one of the followed system."""
        return self.reduction.state(z) if self.reduction else z

    def few_threads(self) -> AbstractContextManager[Any]:
        """Let BLAS use as few threads as are fast for the steps of the stepper."""
        if isinstance(self.stepper, ExactLinear):
            return few_threads(self.followed.size, MOST_MULTIPLIED)
        return few_threads(self.followed.size, MOST_FACTORISED, few=0)


def checked_detectors(
    system: PiecewiseSystem, detectors: Any, events: Any
) -> tuple[TransitionDetector | Events, ...]:
    """Return the detectors that a caller adds, that of the events last, or refuse what is none."""
    added = tuple(detectors) if isinstance(detectors, Iterable) else (detectors,)
    for detector in added:
        checked_kind("each of detectors", detector, TransitionDetector)
    watched = checked_events(events, shown_size(system))
    return (*added, watched) if watched else added


def uninterrupted(graph: BranchGraph) -> BranchGraph:
    """Return a graph, for callers that cannot use the graph of an interrupted run.

    Raises
    ------
    KeyboardInterrupt
        If Ctrl-C was pressed while the graph was computed.
    """
    if graph.searched.spent == INTERRUPTED:
        raise KeyboardInterrupt
    return graph


def plan_in_words(
    system: PiecewiseSystem,
    interval: tuple[float, float],
    *,
    stepper: Stepper | None = None,
    detectors: Iterable[TransitionDetector] = (),
    events: Mapping[str, Function | Stop] | None = None,
    search: Search | None = None,
) -> dict[str, str]:
    """Return the parts of a run of :func:`pwscont.explore` in words; errors as of explore.

    Examples
    --------
    >>> from pwscont import LCP
    >>> from pwscont.extending import plan_in_words
    >>> plan_in_words(LCP([[2.0]], q=[0.0], d=[-1.0]), (-1.0, 1.0))["steps"]
    'ExactLinear()'
    """
    lo, hi = checked_interval(system, interval)
    watched = checked_detectors(system, detectors, events)
    check_stepper_fits(system, stepper)
    plan = Plan.of(system, (lo, hi), stepper, watched, Budget(Limits()))
    search = search or default_search(plan.followed, (lo, hi))
    unknowns = f"{plan.followed.size} of {plan.system.size}"
    return {
        "steps": repr(plan.stepper),
        "watched": ", ".join(type(detector).__name__ for detector in plan.detectors),
        "starts": scope_of(search, plan.followed).what,
        "unknowns": "; ".join([unknowns, *(plan.reduction.reasons if plan.reduction else ())]),
    }
