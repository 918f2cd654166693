"""A run: starts are followed until no ray is left.

A path may leave the interval, turn beyond, and come back. Where the search promises nothing, each
path that leaves is followed a little further, and where the path comes back is another start. Only
straight pieces, which make sense everywhere, are followed there, within the domain of the system,
and whatever goes wrong says nothing about the interval.

Solutions may fill more than curves. Signs of such sets are: a corner at which solutions fill a
cone, a piece that could not be followed, starts without a digit, or an empty graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, islice
from typing import Any

import numpy as np

from pwscont.basics.budget import INTERRUPTED, Budget, Limits
from pwscont.basics.outcome import (
    CROSSED,
    GIVEN_UP,
    Guarantee,
    Kind,
    Remark,
    SearchScope,
    says,
)
from pwscont.basics.printing import counted
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.assembly import assemble, check_unique, divide, mark
from pwscont.continuation.discovery import NO_DIGIT, NO_SOLUTION, Discovery
from pwscont.continuation.follow import PieceFollower, alone, default_detectors
from pwscont.continuation.plan import Plan, facts_of, silent, values_of
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found, has_digits, is_inside
from pwscont.curve.looks import gap_of
from pwscont.curve.metric import Metric, MisjudgedError, Range
from pwscont.curve.stepper import step_size_of
from pwscont.enumeration.continua import find_continua
from pwscont.graph import BranchGraph
from pwscont.graph.queries import joined
from pwscont.graph.records import Stretch
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.system.system import SlicewiseLinearSystem
from pwscont.transitions.corner import Corner
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.ends import departures, ended_by_system, solves
from pwscont.transitions.rays import Ray
from pwscont.transitions.watch import Watch


def uninterrupted(graph: BranchGraph) -> BranchGraph:
    """Return a graph, or raise the KeyboardInterrupt that ended its run."""
    if graph.searched.spent.startswith(INTERRUPTED):
        raise KeyboardInterrupt
    return graph


#: How far beyond an end of the interval a path is followed, as a part of the interval.
PART_BEYOND = 0.25
#: Fewest pieces over which a path is followed beyond the interval, and most paths.
FEW_PIECES, MOST_PATHS = 20, 100


def follow_starts(plan: Plan, starts: Iterable[Found]) -> BranchGraph:
    """Return the graph of all that the budget lets the run reach from starts."""
    gauge, budget, journal = plan.gauge, plan.budget, plan.journal
    watched = (*plan.detectors, *filter(None, [plan.bounds]))
    # from cell to cell where only straight pieces are watched
    straight = None if plan.events else alone(watched)
    parts = (plan.interval, plan.bounds, straight, gauge, plan.events)
    follower, follow = PieceFollower(plan.stepper, Watch(watched, plan.foreign), *parts), None
    if journal is not None:
        journal.check(facts_of(plan), values_of(plan))
        follow, starts = journal.recording(follower.follow, gauge), journal.starts(starts)
    discovery = Discovery(follower, plan.report, follow)
    plan.branches.followed = lambda: ((edge.cells[0], edge.points) for edge in discovery.edges)
    if plan.searched.promise == Guarantee.NOTHING and plan.search is not None:
        starts = chain(starts, _reentries(discovery, plan))
    # trial points may lie where H cannot be computed; values that are not finite are refused
    with plan.few_threads(), np.errstate(all="ignore"):
        try:
            _follow_from(starts, plan, discovery)
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
        mark(discovery, plan)
        unmarked = divide(discovery, plan, plan.events) if plan.events else 0
    infinite: tuple[Stretch, ...] = budget.spend(lambda: _infinite(plan, discovery), ())
    known: Any = {"parameter": plan.parameter, "record": plan.record, "infinite": infinite}
    known["searched"] = _scope(plan, discovery, unmarked)
    points, pieces, begun = assemble(discovery, plan)
    graph = BranchGraph(points, pieces, plan.interval, starts=begun, system=plan.system, **known)
    if plan.system.unique:
        check_unique(graph)
    return graph


def _follow_from(starts: Iterable[Found], plan: Plan, discovery: Discovery) -> None:
    """Follow the solutions among starts within the bounds."""
    scale = plan.metric.scale
    is_curved = not isinstance(plan.reduced_system, SlicewiseLinearSystem)
    for x, given in starts:
        error = np.atleast_2d(given)  # searches may give one sample as a vector
        if not has_digits(x, error, scale):
            discovery.left_out[NO_DIGIT] += 1
            continue
        if not is_inside(plan.box, x, error, scale) or discovery.is_beyond(x):
            continue
        corner = Corner.of_start(plan.reduced_system, plan.metric, x, error)
        if is_curved and not solves(plan.reduced_system, plan.metric, x):
            discovery.left_out[NO_SOLUTION] += 1
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


def _infinite(plan: Plan, discovery: Discovery) -> tuple[Stretch, ...]:
    """Return the stretches of alpha at which solutions fill more than curves."""
    nodes = list(discovery.nodes.values())
    doubtful = [
        node.place.x
        for node in nodes
        if node.lost > 0
        or node.kind == Kind.STOPPED
        or (node.kind not in CROSSED and says(node.message, Remark.FILL))
    ]
    if nodes and not (discovery.left_out[NO_DIGIT] or doubtful):
        return ()
    alphas = [*plan.interval, *(node.place.alpha for node in nodes)]
    one_of_many = [node.place.x for node in nodes if node.message == Remark.FILL_CURVES]
    system, metric = plan.reduced_system, plan.metric
    return joined(find_continua(system, metric, alphas, one_of_many, doubtful), alphas)


def _scope(plan: Plan, discovery: Discovery, unmarked: int) -> SearchScope:
    """Return what was searched and what that promises; ``unmarked`` pieces have no events."""
    what, promise = plan.searched.what, plan.searched.promise
    for why, number in discovery.left_out.items():
        if number:
            what, promise = f"{what}; {number} of the points found {why}", Guarantee.NOTHING
    if plan.branches.is_left_off:
        what += f"; {GIVEN_UP}"
    if plan.system.unique:
        what += "; at most one solution, by the system's promise"
        promise = Guarantee.UNIQUE
    gap, spent = gap_of(step_size_of(plan.stepper), plan.reduced_system), plan.budget.spent
    if unmarked:
        spent += f"; no events are marked on {counted(unmarked, 'piece')}"
    return SearchScope(what, promise, spent, gap)


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
    onwards = (replace(ray, curve=curve),)
    watch = Watch((*default_detectors(plan.stepper, beyond), *filter(None, [plan.bounds])))
    follower = PieceFollower(plan.stepper, watch, beyond, plan.bounds)
    with Budget(limits):
        discovery = Discovery(follower, silent)
        discovery.add(SpecialPointFound(Kind.END, ray.state.x, "", onwards))
    reached = [node for node in list(discovery.nodes.values())[1:] if node.kind == Kind.END]
    return [(n.place.x, n.place.error[None]) for n in reached if n.place.alpha == end]
