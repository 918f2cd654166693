"""A run: its plan, and the starts that are followed until no ray is left.

A path may leave the interval, turn beyond, and come back. Where the search promises nothing, each
path that leaves is followed a little further, and where the path comes back is another start. Only
straight pieces, which make sense everywhere, are followed there, within the domain of the system,
and whatever goes wrong says nothing about the interval.

Solutions may fill more than curves. Signs of such sets are: a corner at which solutions fill a
cone, a piece that could not be followed, starts without a digit, or an empty graph.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice
from math import isfinite
from typing import Any, final

import numpy as np

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import Array, generic
from pwscont.basics.budget import INTERRUPTED, Budget, Limits
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import (
    FILL,
    FILL_CURVES,
    GIVEN_UP,
    IN_VAIN,
    Guarantee,
    Kind,
    SearchScope,
)
from pwscont.basics.printing import counted, short
from pwscont.basics.quantities import Function
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.assembly import assemble, check_unique, divide, mark
from pwscont.continuation.discovery import CROSSED, Discovery
from pwscont.continuation.follow import PieceFollower, alone, default_detectors
from pwscont.continuation.journal import Journal
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found, has_digits, is_inside
from pwscont.curve.looks import gap_of
from pwscont.curve.magnitudes import rounded_to_one
from pwscont.curve.metric import Gauge, Metric, MisjudgedError, Range
from pwscont.curve.pseudo_arclength import CURVED, STRAIGHT
from pwscont.curve.step_size import step_size_of
from pwscont.curve.stepper import Stepper
from pwscont.enumeration.continua import find_continua
from pwscont.graph import BranchGraph
from pwscont.graph.queries import joined
from pwscont.graph.records import Stretch
from pwscont.graph.structure import NOT_SEARCHED
from pwscont.linear.threads import MOST_FACTORISED, MOST_MULTIPLIED, few_threads
from pwscont.search import Search
from pwscont.search.default_search import default_search
from pwscont.search.search import KnownBranches, scope_of
from pwscont.system.abilities import Reducible, Reduction, formula_of, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import check_attributes, residual_at
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions import TransitionDetector
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.ends import Bounds, departures, ended_by_system, solves
from pwscont.transitions.events import Events, checked_events
from pwscont.transitions.rays import Corner, Ray
from pwscont.transitions.user_event import Stop
from pwscont.transitions.watch import Watch

Report = Callable[[int, float], None]
#: The detectors and the events that a user gave.
Watched = tuple[tuple[TransitionDetector, ...], Events | None]


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
    if not (isfinite(lo) and isfinite(hi) and lo < hi):
        raise InvalidInputError(f"interval needs finite lo < hi, got ({lo}, {hi})")
    low, high = system.domain
    if lo < low or hi > high:
        words = f"leaves the domain [{low}, {high}] of {type(system).__name__}"
        raise InvalidInputError(f"interval ({lo}, {hi}) {words}")
    return lo, hi


def check_stepper_fits(system: PiecewiseSystem, stepper: Any) -> None:
    """Refuse what is no stepper, and a stepper that takes rays where pieces are curved."""
    checked_kind("stepper", stepper, Stepper)
    if stepper is None or not stepper.takes_rays or isinstance(system, PiecewiseLinearSystem):
        return
    words = f"{type(stepper).__name__} needs a PiecewiseLinearSystem, and {type(system).__name__}"
    raise InvalidInputError(f"{words} is none; use PseudoArclength")


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
    gauge: Gauge | None = None  # judges the typical magnitudes by the path
    branches: KnownBranches = field(default_factory=KnownBranches)  # for searches

    @classmethod
    def of(
        cls,
        system: PiecewiseSystem,
        interval: Range,
        stepper: Stepper | None,
        watched: Watched,
        budget: Budget,
        **options: Any,
    ) -> Plan:
        """Choose the parts for a system on an interval that was checked; options are fields."""
        if stepper is None:
            is_straight = isinstance(system, PiecewiseLinearSystem)
            stepper = STRAIGHT if is_straight else CURVED
        metric = Metric.of(system, interval)  # refuses magnitudes to which no system can be fitted
        fitted = system.within(*interval)
        plan = cls(fitted, interval, metric, None, stepper, *watched, budget, **options)
        # a reduced system has neither a box nor the states that detectors expect
        free = not (plan.box.is_bounded or plan.box.is_periodic or any(watched))
        reduction = fitted.reduction(*interval) if isinstance(fitted, Reducible) and free else None
        return replace(plan, reduction=reduction) if reduction else plan

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


def checked_detectors(system: PiecewiseSystem, detectors: Any, events: Any) -> Watched:
    """Return the detectors that a caller adds, and the events, or refuse what is none."""
    added = tuple(detectors) if isinstance(detectors, Iterable) else (detectors,)
    for detector in added:
        checked_kind("each of detectors", detector, TransitionDetector)
    return added, checked_events(events, shown_size(system)) if events else None


def uninterrupted(graph: BranchGraph) -> BranchGraph:
    """Return a graph, or raise the KeyboardInterrupt that ended its run."""
    if graph.searched.spent.startswith(INTERRUPTED):
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
    plan = Plan.of(system, (lo, hi), stepper, watched, Budget())
    search = search or default_search_of(plan)
    unknowns = f"{plan.reduced_system.size} of {plan.system.size}"
    return {
        "steps": repr(plan.stepper),
        "watched": ", ".join(type(detector).__name__ for detector in plan.detectors),
        "starts": scope_of(search, plan.reduced_system).what,
        "unknowns": "; ".join([unknowns, *(plan.reduction.reasons if plan.reduction else ())]),
    }


def default_search_of(plan: Plan, around: Sequence[Array] = ()) -> Search:
    """Return the default search, also around states; of a formula, with proofs that are quick."""
    search = default_search(plan.reduced_system, plan.interval, list(around))
    if formula_of(plan.reduced_system) is None:
        return search
    from pwscont.proof.everywhere import Everywhere  # noqa: PLC0415  for formulas only

    return Everywhere.after(search)


#: How far beyond an end of the interval a path is followed, as a part of the interval.
PART_BEYOND = 0.25
#: Fewest pieces over which a path is followed beyond the interval, and most paths.
FEW_PIECES, MOST_PATHS = 20, 100


def follow_starts(plan: Plan, starts: Iterable[Found], searched: SearchScope) -> BranchGraph:
    """Return the graph of all that the budget lets the run reach from starts."""
    gauge, budget, journal = plan.gauge, plan.budget, plan.journal
    watched = (*plan.detectors, *filter(None, [plan.bounds]))
    # from cell to cell where only straight pieces are watched
    straight = None if plan.events else alone(watched)
    parts = (plan.interval, plan.bounds, straight, gauge, plan.events)
    follower, follow = PieceFollower(plan.stepper, Watch(watched, plan.foreign), *parts), None
    if journal is not None:
        _check(journal, plan)
        follow, starts = journal.recording(follower.follow, gauge), journal.starts(starts)
    discovery = Discovery(follower, plan.report, budget, follow)
    plan.branches.followed = lambda: ((edge.cells[0], edge.points) for edge in discovery.edges)
    if searched.promise == Guarantee.NOTHING and searched != NOT_SEARCHED:
        starts = chain(starts, _reentries(discovery, plan))
    without_digits: list[Array] = []
    # trial points may lie where H cannot be computed; values that are not finite are refused
    with plan.few_threads(), np.errstate(all="ignore"):
        try:
            _follow_from(starts, plan, discovery, without_digits)
            if gauge and not budget.spent:
                gauge.close()
        except KeyboardInterrupt as why:
            budget.end(why)
        except MisjudgedError as wrong:
            if journal is not None:
                journal.record("magnitudes", rows=np.array(wrong.magnitudes, float).tobytes())
            raise
        discovery.close(budget.spent)
        if journal is not None and not budget.spent:
            journal.finish()
        system, metric = plan.reduced_system, plan.metric
        mark(discovery, system, metric, plan.foreign)
        unmarked = divide(discovery, system, metric, plan.events, budget) if plan.events else 0
    is_part = bool(without_digits)
    infinite: tuple[Stretch, ...] = budget.spend(lambda: _infinite(plan, discovery, is_part), ())
    scope = _scope(plan, searched, len(without_digits), discovery, unmarked)
    return _graph(plan, discovery, scope, infinite)


def _follow_from(
    starts: Iterable[Found], plan: Plan, discovery: Discovery, without_digits: list[Array]
) -> None:
    """Follow the solutions among starts within the bounds; collect starts without a digit."""
    scale = plan.metric.scale
    is_curved = not isinstance(plan.reduced_system, SlicewiseLinearSystem)
    for x, given in starts:
        error = np.atleast_2d(given)  # searches may give one sample as a vector
        if not has_digits(x, error, scale):
            without_digits.append(x)
            continue
        if not is_inside(plan.box, x, error, scale) or discovery.is_beyond(x):
            continue
        corner = Corner.of_start(plan.reduced_system, plan.metric, x, error)
        if is_curved and not solves(plan.reduced_system, plan.metric, x):
            discovery.unsolved += 1
            continue
        if plan.gauge:
            plan.gauge.begin()
        arrival = departures(corner)
        arrival = plan.events.begun(arrival) if plan.events else arrival
        discovery.add(ended_by_system(arrival), corner)
        if discovery.is_net:  # every start would lead to another part of it
            plan.branches.leave_off()
            return
        if plan.budget.spent or (plan.system.unique and discovery.spans(*plan.interval)):
            return


def _infinite(plan: Plan, discovery: Discovery, is_part: bool) -> tuple[Stretch, ...]:
    """Return the stretches of alpha at which solutions fill more than curves."""
    nodes = list(discovery.nodes.values())
    doubtful = [
        node.place.x
        for node in nodes
        if node.lost > 0
        or node.kind == Kind.STOPPED
        or (node.kind not in CROSSED and FILL in node.message)
    ]
    if nodes and not (is_part or doubtful):
        return ()
    alphas = [*plan.interval, *(node.place.alpha for node in nodes)]
    one_of_many = [node.place.x for node in nodes if node.message == FILL_CURVES]
    system, metric = plan.reduced_system, plan.metric
    return joined(find_continua(system, metric, alphas, one_of_many, doubtful), alphas)


def _scope(
    plan: Plan, searched: SearchScope, without_digits: int, discovery: Discovery, unmarked: int
) -> SearchScope:
    """Return what was searched and what that promises.

    ``without_digits``: the number of starts without a digit; ``unmarked``: of pieces without marked
    events.
    """
    what, promise = searched.what, searched.promise
    if without_digits:
        what += (
            f"; {without_digits} of the points found not followed, for no digit of them is certain"
        )
        promise = Guarantee.NOTHING
    if discovery.left_out:
        what += f"; {discovery.left_out} of the points found {IN_VAIN}"
        promise = Guarantee.NOTHING
    if discovery.unsolved:
        what += (
            f"; {discovery.unsolved} of the points found not followed, for H does not vanish there"
        )
        promise = Guarantee.NOTHING
    if plan.branches.is_left_off:
        what += f"; {GIVEN_UP}"
    if plan.system.unique:
        what += "; at most one solution, by the system's promise"
        promise = Guarantee.UNIQUE
    gap = gap_of(step_size_of(plan.stepper), plan.reduced_system)
    spent = plan.budget.spent
    if unmarked:
        spent += f"; no events are marked on {counted(unmarked, 'piece')}"
    return SearchScope(what, promise, spent, gap)


def _graph(
    plan: Plan, discovery: Discovery, searched: SearchScope, infinite: Sequence[Stretch]
) -> BranchGraph:
    """Return the graph of a discovery, after checking the promise of uniqueness."""
    system, metric = plan.system, plan.full_metric
    points, pieces, starts = assemble(discovery, system, metric, plan.reduction, plan.events)
    graph = BranchGraph(
        points,
        pieces,
        plan.interval,
        starts=starts,
        system=system,
        parameter=plan.parameter,
        searched=searched,
        record=plan.record,
        infinite=infinite,
    )
    if system.unique:
        check_unique(graph)
    return graph


def _reentries(discovery: Discovery, plan: Plan) -> Iterator[Found]:
    """Yield the solutions at which paths come back that leave the interval."""
    (lo, hi), (low, high) = plan.interval, plan.reduced_system.domain
    same, further = SAME_ALPHA * (hi - lo), PART_BEYOND * (hi - lo)
    beyond = {lo: (max(lo - further, low), lo), hi: (hi, min(hi + further, high))}
    straight = (ray for ray in discovery.leaving if ray.curve.selection.is_straight)
    for ray in islice(straight, MOST_PATHS):
        limits = Limits(pieces=max(FEW_PIECES, len(discovery.edges)))
        for end, there in beyond.items():
            if abs(ray.state.alpha - end) > same or not there[0] < there[1]:
                continue
            try:
                found = _coming_back(plan, ray, end, there, limits)
            except Exception:  # H may be undefined beyond the interval, as users may have meant it
                continue
            yield from found


def _coming_back(plan: Plan, ray: Ray, end: float, beyond: Range, limits: Limits) -> list[Found]:
    """Return where the path of a ray comes back from an interval to the same end."""
    scale, selection = plan.metric.scale, ray.curve.selection
    system = plan.reduced_system.within(*beyond, scale[:-1])
    there = Selection(system, selection.character, selection.adjacent_cells)
    curve = Curve(there, Metric(scale, beyond, Box.of(plan.reduced_system).period))
    onwards = (Ray(curve, ray.state, ray.interface_cells, ray.index),)
    watch = Watch((*default_detectors(plan.stepper, beyond), *filter(None, [plan.bounds])))
    follower = PieceFollower(plan.stepper, watch, beyond, plan.bounds)
    with Budget(limits) as budget:
        discovery = Discovery(follower, silent, budget)
        discovery.add(SpecialPointFound(Kind.END, ray.state.x, "", onwards))
    reached = [node for node in list(discovery.nodes.values())[1:] if node.kind == Kind.END]
    return [(n.place.x, n.place.error[None]) for n in reached if n.place.alpha == end]


def _check(journal: Journal, plan: Plan) -> None:
    """Refuse a journal of another run, or of a system with other values at generic points."""
    facts = {
        "system": type(plan.system).__name__,
        "number of unknowns": str(plan.reduced_system.size),
        "interval": str(list(plan.interval)),
        "stepper": repr(plan.stepper),
        "detectors": ", ".join(type(d).__name__ for d in plan.foreign),
        "events": plan.events.names if plan.events else "",
    }
    sums, system, (lo, hi) = [], plan.reduced_system, plan.interval
    with np.errstate(all="ignore"):
        for shift, alpha in enumerate((lo, 0.5 * (lo + hi), hi)):
            z = plan.metric.scale[:-1] * generic(system.size, shift)
            tests = system.test_functions(z, alpha)
            sums.append(float(generic(len(tests), shift) @ tests))
            cells = (Character.of(tests), *_characters(len(tests)))
            sums += [_sum_of(system, z, alpha, cell, shift) for cell in cells]
    journal.check(facts, sums)


def _characters(m: int) -> Iterator[Character]:
    """Yield characters of m tests; any two tests have each pair of signs in one of these."""
    digits = np.arange(m) >> np.arange(m.bit_length())[:, np.newaxis] & 1 > 0
    for signs in (np.ones(m, bool), *digits):
        yield Character(signs)
        yield Character(~signs)


def _sum_of(
    system: PiecewiseSystem, z: Array, alpha: float, character: Character, shift: int
) -> float:
    """Return a generic sum of H, nan where H is not defined: characters may name no cell."""
    try:
        return float(generic(system.size, shift) @ residual_at(system, z, alpha, character))
    except Exception:
        return np.nan
