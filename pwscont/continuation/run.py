"""A run: starts are followed until no ray is left, and the pieces become the graph.

A path may leave the interval at one of its ends, turn beyond, and come back. Inside the interval
such a path is several components, which only the way outside joins. Where the search promises
nothing, each path that leaves is followed a little further, and where the path comes back is
another start. Beyond the interval H may not make sense: only straight pieces, which make sense
everywhere, are followed there, within the domain of the system, and whatever goes wrong says
nothing about the interval.

Solutions may fill more than curves. Signs of such sets are: a corner at which solutions fill a
cone, a piece that could not be followed, starts without a digit (as from cells that have no
corner), or an empty graph (as if solutions fill whole lines). A run without a sign has only curves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, combinations, islice, pairwise

import numpy as np

from pwscont.basics.arrays import generic
from pwscont.basics.budget import Budget, Limits
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.outcome import FILL, FILL_CURVES, Guarantee, Kind, SearchScope
from pwscont.basics.rounding import CONFIDENCE, SAME_ALPHA
from pwscont.continuation.assembly import assemble, mark
from pwscont.continuation.discovery import CROSSED, Discovery
from pwscont.continuation.follow import Follower, PieceFollower, alone, default_detectors
from pwscont.continuation.journal import Journal, Recorded
from pwscont.continuation.known import Node
from pwscont.continuation.plan import Plan, silent
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found, has_digits, is_inside
from pwscont.curve.looks import gap_of
from pwscont.curve.magnitudes import MisjudgedError
from pwscont.curve.metric import Metric
from pwscont.enumeration.continua import find_continua
from pwscont.graph import BranchGraph
from pwscont.graph.queries import joined
from pwscont.graph.records import Stretch
from pwscont.graph.structure import NOT_SEARCHED
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.transitions import TransitionDetector
from pwscont.transitions.departures import Standing
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.ends import ended
from pwscont.transitions.rays import Ray
from pwscont.transitions.watch import Watch

Interval = tuple[float, float]
Watched = tuple[TransitionDetector, ...]
#: How far beyond an end of the interval a path is followed, as a part of the interval.
PART_BEYOND = 0.25
#: Fewest pieces over which a path is followed beyond the interval, and most paths.
FEW_PIECES, MOST_PATHS = 20, 100


def follow(plan: Plan, starts: Iterable[Found], searched: SearchScope) -> BranchGraph:
    """Return the graph of everything that is reached from starts of the followed system.

    Where the budget is spent, the graph has what was found until then.
    """
    gauge, budget, journal = plan.gauge, plan.budget, plan.journal
    watched = _with_bounds(plan, plan.detectors)
    # from cell to cell where only straight pieces are watched
    straight = None if plan.events else alone(watched)
    parts = (plan.interval, plan.bounds, straight, gauge, plan.events)
    follower: Follower = PieceFollower(plan.stepper, Watch(watched, plan.foreign), *parts)
    if journal is not None:
        _check(journal, plan)
        follower, starts = Recorded(follower, journal, gauge), journal.starts(starts)
    discovery = Discovery(follower, plan.report, budget)
    plan.branches.edges = discovery.edges
    if searched.promise == Guarantee.NOTHING and searched != NOT_SEARCHED:
        starts = chain(starts, _reentries(discovery, plan))
    without_digits: list[Found] = []
    # trial points may lie where H cannot be computed; values that are not finite are refused
    with plan.few_threads(), np.errstate(all="ignore"):
        try:
            _follow_from(_usable(plan, starts, without_digits), plan, discovery)
            if gauge and not budget.spent:
                gauge.close()
        except KeyboardInterrupt as why:
            budget.end(why)
        except MisjudgedError as wrong:
            if journal is not None:
                journal.revise(wrong.magnitudes)
            raise
        discovery.close(budget.spent)
        mark(discovery, plan.followed, plan.metric, plan.added)
    if journal is not None and not budget.spent:
        journal.finish()
    infinite = () if budget.spent else _infinite(plan, discovery, bool(without_digits))
    return _graph(plan, discovery, _scope(plan, searched, len(without_digits)), infinite)


def _with_bounds(plan: Plan, detectors: Watched) -> Watched:
    """Return detectors, and the detector of the bounds of the unknowns, if there are any."""
    return (*detectors, plan.bounds) if plan.box.is_bounded else detectors


def _usable(plan: Plan, starts: Iterable[Found], without_digits: list[Found]) -> Iterator[Found]:
    """Yield the starts within the bounds with a certain digit, and keep those without a digit."""
    scale = plan.metric.scale
    for x, given in starts:
        error = np.atleast_2d(given)  # searches may give one sample as a vector
        if not has_digits(x, error, scale):
            without_digits.append((x, error))
        elif is_inside(plan.box, x, error, scale):
            yield x, error


def _follow_from(starts: Iterable[Found], plan: Plan, discovery: Discovery) -> None:
    for x, error in starts:
        if discovery.is_beyond(x):
            continue
        if plan.gauge:
            plan.gauge.begin()
        standing = Standing.of(plan.followed, plan.metric, x, error)
        if not discovery.has(standing):
            arrival = standing.departures()
            for each in plan.added:  # a start may be a special point of a detector
                arrival = each.begun(arrival)
            discovery.add(ended(arrival))
        if plan.budget.spent or (plan.system.unique and discovery.spans(*plan.interval)):
            return


def _infinite(plan: Plan, discovery: Discovery, is_part: bool) -> tuple[Stretch, ...]:
    """Return the stretches of alpha at which solutions fill more than curves."""
    nodes = list(discovery.nodes.values())
    if nodes and not (is_part or any(map(_is_sign, nodes))):
        return ()
    alphas = [*plan.interval, *(node.place.alpha for node in nodes)]
    one_of_many = [node.place.x for node in nodes if node.message == FILL_CURVES]
    return joined(find_continua(plan.followed, plan.metric, alphas, one_of_many), alphas)


def _is_sign(node: Node) -> bool:
    """Tell whether a special point is a sign that solutions fill more than curves."""
    if node.lost > 0 or node.kind == Kind.STOPPED:
        return True
    return node.kind not in CROSSED and FILL in node.message


def _scope(plan: Plan, searched: SearchScope, lost: int) -> SearchScope:
    """Return what was searched and what that promises; starts without a digit were lost."""
    what, promise = searched.what, searched.promise
    if lost:
        what += f"; {lost} of the points found not followed, for no digit of them is certain"
        promise = Guarantee.NOTHING
    if plan.system.unique:
        what += "; at most one solution, by the system's promise"
        promise = Guarantee.UNIQUE
    gap = gap_of(plan.stepper, plan.followed)
    return SearchScope(what, promise, plan.budget.spent, gap)


def _graph(
    plan: Plan, discovery: Discovery, searched: SearchScope, infinite: Sequence[Stretch]
) -> BranchGraph:
    """Return the graph of a discovery, after checking the promise of uniqueness."""
    system, reduction = plan.system, plan.reduction
    metric = Metric.of(system, plan.interval) if reduction else plan.metric
    points, pieces, starts = assemble(discovery, system, metric, reduction, plan.events)
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
        _check_unique(graph)
    return graph


def _check_unique(graph: BranchGraph) -> None:
    """Refuse a graph with two solutions at one alpha that are apart by more than their errors.

    Raises
    ------
    InvalidSystemError
        Naming both solutions.
    """
    breaks = graph.breaks()
    for alpha in [*breaks, *(0.5 * (lo + hi) for lo, hi in pairwise(breaks))]:
        solutions = graph.solutions(alpha) if graph.count(alpha) > 1 else ()
        for first, second in combinations(solutions, 2):
            apart = np.abs(first.z - second.z)
            errors = (first.error + second.error)[:-1] if len(first.error) else 0.0 * apart
            if (apart > CONFIDENCE * errors).any():
                raise InvalidSystemError(
                    f"{type(graph.system).__name__}.unique promises one solution at one "
                    f"{graph.parameter}, but there are two at {graph.parameter} = {alpha:.10g}: "
                    f"{first!r} and {second!r}; set unique = False"
                )


def _reentries(discovery: Discovery, plan: Plan) -> Iterator[Found]:
    """Yield the solutions at which paths come back that leave the interval.

    The discovery grows while solutions are taken.
    """
    for ray in islice(discovery.leaving, MOST_PATHS):
        limits = Limits(pieces=max(FEW_PIECES, len(discovery.edges)))
        for end, beyond in _intervals_beyond(plan, ray):
            try:
                found = _coming_back(plan, ray, end, beyond, limits)
            except Exception:
                continue
            yield from found


def _intervals_beyond(plan: Plan, ray: Ray) -> Iterator[tuple[float, Interval]]:
    """Yield the end of the interval at which a straight ray leaves, and the interval beyond."""
    if not ray.curve.selection.is_straight:
        return
    (lo, hi), (low, high), alpha = plan.interval, plan.followed.domain, ray.state.alpha
    same, further = SAME_ALPHA * (hi - lo), PART_BEYOND * (hi - lo)
    if abs(alpha - lo) <= same and low < lo:
        yield lo, (max(lo - further, low), lo)
    if abs(alpha - hi) <= same and high > hi:
        yield hi, (hi, min(hi + further, high))


def _coming_back(plan: Plan, ray: Ray, end: float, beyond: Interval, limits: Limits) -> list[Found]:
    """Return where the path of a ray comes back from an interval to the same end."""
    watch = Watch(_with_bounds(plan, default_detectors(plan.stepper, beyond)))
    follower = PieceFollower(plan.stepper, watch, beyond, plan.bounds)
    with Budget(limits) as budget:
        discovery = Discovery(follower, silent, budget)
        onwards = (_ray_into(plan, ray, beyond),)
        discovery.add(SpecialPointFound(Kind.END, ray.state.x, "", onwards))
    reached = [node for node in list(discovery.nodes.values())[1:] if node.kind == Kind.END]
    return [(n.place.x, n.place.error[None]) for n in reached if n.place.alpha == end]


def _ray_into(plan: Plan, ray: Ray, interval: Interval) -> Ray:
    """Return a ray as one that leads into another interval."""
    scale, selection = plan.metric.scale, ray.curve.selection
    system = plan.followed.within(*interval, scale[:-1])
    there = Selection(system, selection.character, selection.adjacent_cells)
    metric = Metric(scale, interval, Box.of(plan.followed).period)
    return Ray(Curve(there, metric), ray.state, ray.interface_cells, ray.index)


def _check(journal: Journal, plan: Plan) -> None:
    """Refuse a journal of another run."""
    facts = {
        "system": type(plan.system).__name__,
        "number of unknowns": str(plan.followed.size),
        "interval": str(list(plan.interval)),
        "stepper": repr(plan.stepper),
        "detectors": ", ".join(type(d).__name__ for d in plan.foreign),
        "events": plan.events.names if plan.events else "",
    }
    journal.check(facts, _probes(plan))


def _probes(plan: Plan) -> list[float]:
    """Return sums of H and of the tests at generic points: other problems have other sums."""
    sums, system, (lo, hi) = [], plan.followed, plan.interval
    for shift, alpha in enumerate((lo, 0.5 * (lo + hi), hi)):
        z = plan.metric.scale[:-1] * generic(system.size, shift)
        tests = system.test_functions(z, alpha)
        residual = system.residual(z, alpha, Character.of(tests))
        sums += [float(generic(len(v), shift) @ v) for v in (tests, residual)]
    return sums
