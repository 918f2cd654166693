"""The plan of a run: what a caller gave, checked once, and the parts that the run needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any, TypeAlias, final

import numpy as np

from pwscont.basics.arguments import check_callable, checked_kind
from pwscont.basics.arrays import Array, finite_array, generic
from pwscont.basics.budget import Budget, Limits
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import SearchScope
from pwscont.basics.printing import short
from pwscont.basics.quantities import Function, checked_record
from pwscont.basics.rounding import EPS, GUARD
from pwscont.continuation.follow import default_detectors
from pwscont.continuation.journal import Journal
from pwscont.curve.magnitudes import rounded_to_one
from pwscont.curve.metric import Gauge, Metric, Range
from pwscont.curve.pseudo_arclength import CURVED, STRAIGHT
from pwscont.curve.stepper import Stepper
from pwscont.graph.structure import NOT_SEARCHED
from pwscont.linear.threads import MOST_FACTORISED, MOST_MULTIPLIED, few_threads
from pwscont.search import Search
from pwscont.search.default_search import default_search
from pwscont.search.search import KnownBranches, scope_of
from pwscont.system.abilities import Reducible, Reduction, completed, formula_of, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import check_attributes, check_cells, check_declaration, residual_at
from pwscont.system.promises import check_start
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.transitions import TransitionDetector
from pwscont.transitions.ends import Bounds

if TYPE_CHECKING:
    from pwscont.events.events import Events
    from pwscont.events.user_event import Stop

#: Least length of an interval, as a part of alpha: GUARD times the rounding at special points.
SHORTEST_INTERVAL = GUARD**2 * EPS
#: Called with the number of pieces and the alpha reached.
Report = Callable[[int, float], None]
#: The detectors and the events that a user gave.
Watched: TypeAlias = "tuple[tuple[TransitionDetector, ...], Events | None]"
#: A rough state and its alpha.
Start = tuple[Array, float]


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
    checked_kind("system", system, PiecewiseSystem, is_needed=True)
    check_attributes(system)
    try:
        lo, hi = (float(end) for end in interval)
    except (TypeError, ValueError, OverflowError) as error:
        words = f"interval must be two numbers, got {short(repr(interval))}"
        raise InvalidInputError(words) from error
    if not (isfinite(hi - lo) and lo < hi):
        raise InvalidInputError(f"interval needs finite lo < hi, got ({lo}, {hi})")
    if hi - lo < SHORTEST_INTERVAL * max(abs(lo), abs(hi)):
        words = f"is shorter than {SHORTEST_INTERVAL:.0e} of alpha: rounding hides what is in it"
        raise InvalidInputError(f"interval ({lo}, {hi}) {words}")
    low, high = system.domain
    if lo < low or hi > high:
        words = f"leaves the domain [{low}, {high}] of {type(system).__name__}"
        raise InvalidInputError(f"interval ({lo}, {hi}) {words}")
    return lo, hi


def checked_start(system: PiecewiseSystem, start: Any, interval: Range, name: str) -> Start:
    """Return z, with hidden unknowns, and alpha of a start, or say what is wrong with it."""
    try:
        z, alpha, pair = start[0], float(start[1]), len(start) == 2
    except (TypeError, ValueError, OverflowError, LookupError) as error:
        got = short(repr(start))
        raise InvalidInputError(f"{name} must be a pair (z, alpha), got {got}") from error
    if not pair:
        raise InvalidInputError(f"{name} must be a pair (z, alpha), got {len(start)} entries")
    if not interval[0] <= alpha <= interval[1]:
        raise InvalidInputError(f"{name} at alpha = {alpha} lies outside the interval {interval}")
    return completed(system, finite_array(f"z of {name}", z, (shown_size(system),)), alpha), alpha


def checked_options(
    system: PiecewiseSystem, journal: Any, limits: Any, report: Any, parameter: Any, record: Any
) -> dict[str, Any]:
    """Return the options of a plan, or refuse what is no journal, limits, function or name."""
    checked_kind("journal", journal, Journal)
    checked_kind("limits", limits, Limits)
    check_callable("report", report, "(number of pieces, alpha)")
    if not (isinstance(parameter, str) and parameter):
        raise InvalidInputError(f"parameter must be a text, got {parameter!r}")
    recorded = checked_record(record, system.names() if record else ())
    return {"parameter": parameter, "record": recorded, "report": report, "journal": journal}


def checked_detectors(system: PiecewiseSystem, detectors: Any, events: Any) -> Watched:
    """Return the detectors that a caller adds, and the events, or refuse what is none."""
    added = tuple(detectors) if isinstance(detectors, Iterable) else (detectors,)
    for detector in added:
        checked_kind("each of detectors", detector, TransitionDetector)
    if not events:
        return added, None
    from pwscont.events.events import checked_events  # noqa: PLC0415  for runs with events

    return added, checked_events(events, shown_size(system))


@final
@dataclass(frozen=True)
class Plan:
    """The parts of a run."""

    system: PiecewiseSystem  # fitted to the interval, as by PiecewiseSystem.within
    interval: Range
    full_metric: Metric  # of the system
    reduction: Reduction | None  # where parts of the system provably stay in one mode
    stepper: Stepper
    foreign: tuple[TransitionDetector, ...]  # detectors that a user gave
    events: Events | None
    budget: Budget
    parameter: str = "alpha"  # this and the next three as of explore
    record: Mapping[str, Function] | None = None
    report: Report = silent
    journal: Journal | None = None
    given: Mapping[str, Start] = field(default_factory=dict)  # starts of the full system, by name
    search: Search | None = None  # for starts after those that were given
    searched: SearchScope = NOT_SEARCHED
    gauge: Gauge | None = None  # judges the typical magnitudes by the path
    branches: KnownBranches = field(default_factory=KnownBranches)  # for searches

    @cached_property
    def reduced_system(self) -> PiecewiseSystem:
        """The system whose pieces are followed: the system itself without a reduction."""
        return self.reduction.system.within(*self.interval) if self.reduction else self.system

    @cached_property
    def metric(self) -> Metric:
        """The metric of the reduced system."""
        return Metric.of(self.reduced_system, self.interval) if self.reduction else self.full_metric

    @cached_property
    def box(self) -> Box:
        """The bounds and periods of the unknowns of the reduced system."""
        return Box.of(self.reduced_system)

    def with_magnitudes(self, magnitudes: Array) -> Plan:
        """Return a plan without a reduction with other typical magnitudes."""
        sizes = rounded_to_one(magnitudes)
        if (sizes == self.metric.scale[:-1]).all():
            return self
        system = self.system.within(*self.interval, sizes)
        metric = Metric.of(system, self.interval)
        return replace(self, system=system, full_metric=metric, branches=KnownBranches())

    @property
    def detectors(self) -> tuple[TransitionDetector, ...]:
        """The default detectors, and those that were added."""
        return (*default_detectors(self.stepper, self.interval), *self.foreign)

    @property
    def bounds(self) -> Bounds | None:
        """The detector of the bounds of the unknowns, if there are any."""
        return Bounds(self.box, self.reduced_system.names()) if self.box.is_bounded else None

    def reduced(self, z: Array) -> Array:
        """Return a state of the system as a state of the reduced system."""
        return self.reduction.state(z) if self.reduction else z

    def few_threads(self) -> AbstractContextManager[Any]:
        """Let BLAS use as few threads as are fast for the steps of the stepper."""
        if self.stepper.takes_rays:
            return few_threads(self.reduced_system.size, MOST_MULTIPLIED)
        return few_threads(self.reduced_system.size, MOST_FACTORISED, few=0)


def checked_plan(
    system: PiecewiseSystem,
    interval: Range,
    start: Start | None,
    budget: Budget,
    watched: Watched,
    stepper: Stepper | None,
    **options: Any,
) -> Plan:
    """Return the plan for a system that keeps its promises at a start; options are of a Plan."""
    check_declaration(system)
    checked_kind("stepper", stepper, Stepper)
    is_straight = isinstance(system, PiecewiseLinearSystem)
    stepper = stepper or (STRAIGHT if is_straight else CURVED)
    if stepper.takes_rays and not is_straight:
        words = f"needs a PiecewiseLinearSystem, and {type(system).__name__} is none"
        raise InvalidInputError(f"{type(stepper).__name__} {words}; use PseudoArclength")
    metric = Metric.of(system, interval)  # refuses magnitudes to which no system can be fitted
    fitted = system.within(*interval)
    plan = Plan(fitted, interval, metric, None, stepper, *watched, budget, **options)
    # a reduced system has neither a box nor the states that detectors expect
    free = not (plan.box.is_bounded or plan.box.is_periodic or any(watched))
    reduction = fitted.reduction(*interval) if isinstance(fitted, Reducible) and free else None
    checked_kind(f"what {type(system).__name__}.reduction() returns", reduction, Reduction)
    if start is not None:
        check_cells(fitted)
        check_start(fitted, interval, *start)
    return replace(plan, reduction=reduction) if reduction else plan


def default_search_of(plan: Plan, around: Sequence[Array] = ()) -> Search:
    """Return the default search, also around states; of a formula, with proofs that are quick."""
    search = default_search(plan.reduced_system, plan.interval, list(around))
    if formula_of(plan.reduced_system) is None:
        return search
    from pwscont.proof.everywhere import Everywhere  # noqa: PLC0415  for formulas only

    return Everywhere.after(search)


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
    inside, watched = (
        checked_interval(system, interval),
        checked_detectors(system, detectors, events),
    )
    plan = checked_plan(system, inside, None, Budget(), watched, stepper)
    search = search or default_search_of(plan)
    unknowns = f"{plan.reduced_system.size} of {plan.system.size}"
    return {
        "steps": repr(plan.stepper),
        "watched": ", ".join(type(detector).__name__ for detector in plan.detectors),
        "starts": scope_of(search, plan.reduced_system).what,
        "unknowns": "; ".join([unknowns, *(plan.reduction.reasons if plan.reduction else ())]),
    }


def facts_of(plan: Plan) -> dict[str, str]:
    """Return what a run is about, in words by which a journal knows the run."""
    return {
        "system": type(plan.system).__name__,
        "number of unknowns": str(plan.reduced_system.size),
        "interval": str(list(plan.interval)),
        "stepper": repr(plan.stepper),
        "detectors": ", ".join(type(d).__name__ for d in plan.foreign),
        "events": plan.events.names if plan.events else "",
    }


def values_of(plan: Plan) -> list[float]:
    """Return sums of H and its tests at generic points, by which a journal knows a system."""
    sums, system, (lo, hi) = [], plan.reduced_system, plan.interval
    with np.errstate(all="ignore"):
        for shift, alpha in enumerate((lo, 0.5 * (lo + hi), hi)):
            z = plan.metric.scale[:-1] * generic(system.size, shift)
            tests, weights = system.test_functions(z, alpha), generic(system.size, shift)
            sums.append(float(generic(len(tests), shift) @ tests))
            for cell in (Character.of(tests), *_characters(len(tests))):
                try:
                    sums.append(float(weights @ residual_at(system, z, alpha, cell)))
                except Exception:  # characters may name no cell, where H is not defined
                    sums.append(np.nan)
    return sums


def _characters(m: int) -> Iterator[Character]:
    """Yield characters of m tests; any two tests have each pair of signs in one of these."""
    digits = np.arange(m) >> np.arange(m.bit_length())[:, np.newaxis] & 1 > 0
    for signs in (np.ones(m, bool), *digits):
        yield Character(signs)
        yield Character(~signs)
