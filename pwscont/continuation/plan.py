"""The plan of a run: its parts chosen, its pieces followed.

Solutions may fill more than curves. Signs of such sets are: a corner at which solutions fill a
cone, a piece that could not be followed, starts without a digit (as from cells that have no
corner), or an empty graph (as if solutions fill whole lines). A run without a sign has only curves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from itertools import chain, combinations, pairwise
from math import isfinite
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, generic
from pwscont.basics.budget import INTERRUPTED, Budget
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.basics.given import checked_kind
from pwscont.basics.outcome import FILL, FILL_CURVES, Guarantee, Kind, SearchScope
from pwscont.basics.quantities import Function
from pwscont.basics.rounding import CONFIDENCE
from pwscont.continuation.assembly import assemble, mark
from pwscont.continuation.discovery import CROSSED, Discovery, Node
from pwscont.continuation.follow import Follower, PieceFollower, alone, default_detectors
from pwscont.continuation.journal import Journal, Recorded
from pwscont.continuation.known import FollowedBranches
from pwscont.continuation.reentry import Beyond, reentries
from pwscont.curve.error_samples import Found, has_digits, is_inside
from pwscont.curve.looks import gap_of
from pwscont.curve.magnitudes import Gauge
from pwscont.curve.metric import Metric
from pwscont.curve.pseudo_arclength import PseudoArclength
from pwscont.curve.stepper import Stepper
from pwscont.curve.steppers import ExactLinear
from pwscont.enumeration.continua import find_continua
from pwscont.graph import BranchGraph
from pwscont.graph.queries import joined
from pwscont.graph.records import Solution, Stretch
from pwscont.graph.structure import NOT_SEARCHED
from pwscont.linear.threads import MOST_FACTORISED, MOST_MULTIPLIED, few_threads
from pwscont.search import Search
from pwscont.search.search import scope_of
from pwscont.system.abilities import Reduction, reduction_of, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import check_attributes
from pwscont.system.system import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
)
from pwscont.transitions import TransitionDetector
from pwscont.transitions.departures import Standing
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.ends import NO_BOUNDS, Bounds, ended
from pwscont.transitions.events import Events, checked_events
from pwscont.transitions.watch import Watch


@final
class Usable:
    """Starts within the bounds with at least one certain digit; uncertain starts are counted.

    Parameters
    ----------
    starts : iterable of (x, error)
    metric : Metric
    box : Box
    """

    def __init__(self, starts: Iterable[Found], metric: Metric, box: Box) -> None:
        self._starts, self._metric, self._box = starts, metric, box
        self._uncertain = 0

    def __iter__(self) -> Iterator[Found]:
        for x, given in self._starts:
            error = np.atleast_2d(given)  # searches may give one sample as a vector
            if not has_digits(x, error, self._metric.scale):
                self._uncertain += 1
            elif is_inside(self._box, x, error, self._metric.scale):
                yield x, error

    @property
    def is_part(self) -> bool:
        """Whether some starts could not be followed."""
        return self._uncertain > 0

    def lowered(self, searched: SearchScope) -> SearchScope:
        """Return what was searched, without a promise where a start could not be followed."""
        if not self._uncertain:
            return searched
        lost = (
            f"{self._uncertain} of the points found not followed, for no digit of them is certain"
        )
        return SearchScope(f"{searched.what}; {lost}", Guarantee.NOTHING)


def unique(searched: SearchScope) -> SearchScope:
    """Return what a search promises of a system that has one solution at most."""
    what = f"{searched.what}; at most one solution, by the system's promise"
    return replace(searched, what=what, promise=Guarantee.UNIQUE)


def check_unique(graph: BranchGraph) -> None:
    """Refuse a graph with two different solutions at one alpha.

    Raises
    ------
    InvalidSystemError
        Naming both solutions.
    """
    breaks = graph.breaks()
    for alpha in [*breaks, *(0.5 * (lo + hi) for lo, hi in pairwise(breaks))]:
        if graph.count(alpha) > 1:
            _check_at(graph, alpha)


def _check_at(graph: BranchGraph, alpha: float) -> None:
    for first, second in combinations(graph.solutions(alpha), 2):
        if _differ(first, second):
            raise InvalidSystemError(
                f"{type(graph.system).__name__}.unique promises one solution at one "
                f"{graph.parameter}, but there are two at {graph.parameter} = {alpha:.10g}: "
                f"{first!r} and {second!r}; set unique = False"
            )


def _differ(first: Solution, second: Solution) -> bool:
    """Tell whether two solutions are apart by more than their errors."""
    apart = np.abs(first.z - second.z)
    errors = (first.error + second.error)[:-1] if len(first.error) else np.zeros_like(apart)
    return bool((apart > CONFIDENCE * errors).any())


def is_sign(node: Node) -> bool:
    """Tell whether a special point is a sign that solutions fill more than curves."""
    if node.lost > 0 or node.kind == Kind.STOPPED:
        return True
    return node.kind not in CROSSED and FILL in node.message


Report = Callable[[int, float], None]


def silent(pieces: int, alpha: float) -> None:
    """Report nothing."""


def checked_interval(system: PiecewiseSystem, interval: tuple[float, float]) -> tuple[float, float]:
    """Return the interval as two floats, or say what is wrong with it."""
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


def default_stepper(system: PiecewiseSystem) -> Stepper:
    """Return the exact stepper where pieces are straight, pseudo-arclength elsewhere."""
    return ExactLinear() if isinstance(system, PiecewiseLinearSystem) else PseudoArclength()


def checked_stepper(system: PiecewiseSystem, stepper: Stepper | None) -> Stepper:
    """Return the stepper to use."""
    checked_kind("stepper", stepper, Stepper)
    if isinstance(stepper, ExactLinear) and not isinstance(system, PiecewiseLinearSystem):
        raise InvalidInputError(
            f"ExactLinear needs a PiecewiseLinearSystem, and {type(system).__name__} is none; "
            "use PseudoArclength"
        )
    return stepper if stepper is not None else default_stepper(system)


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
        The detectors that a user gave, beside the default ones.
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
    gauge: Gauge | None = None
    branches: FollowedBranches = field(default_factory=FollowedBranches)

    @classmethod
    def of(
        cls,
        system: PiecewiseSystem,
        interval: tuple[float, float],
        stepper: Stepper | None,
        detectors: tuple[TransitionDetector | Events, ...] = (),
        magnitudes: Array | None = None,
    ) -> Plan:
        """Choose the parts for a system on an interval that was checked.

        Detectors are added to the default ones. Typical magnitudes of z are those given here, or
        those that the system gives.
        """
        chosen = checked_stepper(system, stepper)
        metric = Metric.of(system, interval)  # refuses magnitudes that cannot be computed with
        system = system.within(*interval, magnitudes)
        box = Box.of(system)
        # a reduced system has neither a box nor the states that detectors expect
        free = not (box.is_bounded or box.is_periodic or detectors)
        reduction = reduction_of(system, interval) if free else None
        followed = reduction.system.within(*interval) if reduction else system
        if reduction or magnitudes is not None:
            metric, box = Metric.of(followed, interval), Box.of(followed)
        return cls(system, interval, reduction, followed, metric, box, chosen, tuple(detectors))

    @property
    def detectors(self) -> tuple[TransitionDetector, ...]:
        """The default detectors, and those that were added."""
        return (*default_detectors(self.stepper, self.interval), *self.foreign)

    @property
    def foreign(self) -> list[TransitionDetector]:
        """The detectors that a user gave."""
        return [each for each in self.added if isinstance(each, TransitionDetector)]

    @property
    def events(self) -> Events | None:
        """The events that are watched."""
        return next((each for each in self.added if isinstance(each, Events)), None)

    def told(self, search: Search) -> dict[str, str]:
        """Return the parts of the run in words, all of them."""
        left_out = self.reduction.reasons if self.reduction else ()
        unknowns = f"{self.followed.size} of {self.system.size}"
        return {
            "steps": repr(self.stepper),
            "watched": ", ".join(type(detector).__name__ for detector in self.detectors),
            "starts": scope_of(search, self.followed).what,
            "unknowns": "; ".join([unknowns, *left_out]),
        }

    def reduced(self, z: Array) -> Array:
        """Return a state of the system as one of the followed system."""
        return self.reduction.state(z) if self.reduction else z

    def follow(
        self,
        starts: Iterable[Found],
        parameter: str,
        report: Report,
        searched: SearchScope,
        journal: Journal | None,
        budget: Budget,
        record: Mapping[str, Function] | None = None,
    ) -> BranchGraph:
        """Return the graph of everything that is reached from starts of the followed system.

        Where the budget is spent, the graph has what was found until then.
        """
        is_bounded = self.box.is_bounded
        bounds = Bounds(self.box, self.followed.names()) if is_bounded else NO_BOUNDS
        watched = (*self.detectors, bounds) if is_bounded else self.detectors
        gauge = self.gauge if journal is None else None  # a journal is of one run
        events, straight = self.events, None if self.events else alone(watched)
        watch = Watch(watched, self.foreign)
        follower: Follower = PieceFollower(
            self.stepper, watch, self.interval, bounds, straight, gauge, events
        )
        if journal is not None:
            self._check(journal)
            follower, starts = Recorded(follower, journal), journal.starts(starts)
        discovery = Discovery(follower, report, budget)
        if searched.promise == Guarantee.NOTHING and searched != NOT_SEARCHED:
            beyond = Beyond(self.followed, self.metric, self.stepper, bounds)
            starts = chain(starts, reentries(discovery, beyond))
        self.branches.edges = discovery.edges
        usable = Usable(starts, self.metric, self.box)
        # trial points may lie where H cannot be computed; values that are not finite are refused
        with self.few_threads(), np.errstate(all="ignore"):
            try:
                self._follow_from(usable, discovery, budget)
            except KeyboardInterrupt as why:
                budget.end(why)
            if gauge and not budget.spent:
                gauge.close()
            discovery.close(budget.spent)
            mark(discovery, self.followed, self.metric, self.added)
        if journal is not None and not budget.spent:
            journal.finish()
        searched = usable.lowered(searched)
        if searched.spent != budget.spent:
            searched = replace(searched, spent=budget.spent)
        infinite = self._infinite(discovery, usable.is_part) if not budget.spent else ()
        return self._graph(discovery, parameter, searched, record, infinite)

    def few_threads(self) -> AbstractContextManager[Any]:
        """Let BLAS use as few threads as are fast for the steps of the stepper."""
        if isinstance(self.stepper, ExactLinear):
            return few_threads(self.followed.size, MOST_MULTIPLIED)
        return few_threads(self.followed.size, MOST_FACTORISED, few=0)

    def _infinite(self, discovery: Discovery, is_part: bool) -> tuple[Stretch, ...]:
        """Return the stretches of alpha at which solutions fill more than curves."""
        nodes = list(discovery.nodes.values())
        if nodes and not (is_part or any(map(is_sign, nodes))):
            return ()
        alphas = [*self.interval, *(node.place.alpha for node in nodes)]
        one_of_many = [node.place.x for node in nodes if node.message == FILL_CURVES]
        return joined(find_continua(self.followed, self.metric, alphas, one_of_many), alphas)

    def _follow_from(self, starts: Iterable[Found], discovery: Discovery, budget: Budget) -> None:
        for x, error in starts:
            if discovery.is_beyond(x):
                continue
            standing = Standing.of(self.followed, self.metric, x, error)
            if not discovery.has(standing):
                discovery.add(self._begun(standing.departures()))
            if budget.spent or (self.system.unique and discovery.spans(*self.interval)):
                return

    def _begun(self, arrival: SpecialPointFound) -> SpecialPointFound:
        """Return a start, changed by the system or a detector for which it is a special point."""
        for each in self.added:
            arrival = each.begun(arrival)
        return ended(arrival)

    def _graph(
        self,
        discovery: Discovery,
        parameter: str,
        searched: SearchScope,
        record: Mapping[str, Function] | None,
        infinite: Sequence[Stretch],
    ) -> BranchGraph:
        """Return the graph of a discovery, after checking the promise of uniqueness."""
        if self.system.unique:
            searched = unique(searched)
        system, reduction = self.system, self.reduction
        metric = Metric.of(system, self.interval) if reduction else self.metric
        searched = replace(searched, gap=gap_of(self.stepper, self.followed))
        parts = (parameter, searched, reduction, record, self.events, infinite)
        graph = assemble(discovery, system, metric, *parts)
        if self.system.unique:
            check_unique(graph)
        return graph

    def _check(self, journal: Journal) -> None:
        """Refuse a journal of another run."""
        facts = {
            "system": type(self.system).__name__,
            "number of unknowns": str(self.followed.size),
            "interval": str(list(self.interval)),
            "stepper": repr(self.stepper),
            "detectors": ", ".join(type(d).__name__ for d in self.foreign),
            "events": self.events.names if self.events else "",
        }
        journal.check(facts, _probes(self.followed, self.metric, self.interval))


def checked_detectors(
    system: PiecewiseSystem, detectors: Any, events: Any
) -> tuple[TransitionDetector | Events, ...]:
    """Return the detectors that a caller adds, that of the events last.

    Raises
    ------
    InvalidInputError
        If a detector is no :class:`~pwscont.TransitionDetector`, or an event is no function.
    """
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


def _probes(system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]) -> list[float]:
    """Return sums of H and of the tests at generic points: other problems have other sums."""
    sums = []
    for shift, alpha in enumerate((interval[0], 0.5 * sum(interval), interval[1])):
        z = metric.scale[:-1] * generic(system.size, shift)
        tests = system.test_functions(z, alpha)
        residual = system.residual(z, alpha, Character.of(tests))
        sums += [float(generic(len(v), shift) @ v) for v in (tests, residual)]
    return sums
