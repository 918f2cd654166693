"""The function :func:`pwscont.evolve`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any

from pwscont.basics.arguments import check_callable, checked_kind
from pwscont.basics.arrays import Array
from pwscont.basics.budget import Budget, Limits
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.basics.quantities import Function, Quantities, checked_names, checked_record
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import Report, silent
from pwscont.events.user_event import Stop
from pwscont.evolution.graph import EvolutionGraph
from pwscont.evolution.memory import Evolver, Moment, Moments, SystemWithMemory, WaysOn
from pwscont.evolution.rays import ByRays
from pwscont.evolution.rules import Jumps, UserEvents
from pwscont.evolution.run import RecordedWays, Run
from pwscont.evolution.states import EvolutionNode, EvolutionPiece

#: Largest number of uncertain events that the guarantee names.
MOST_NAMED = 4
ALL = "all evolutions with finitely many events"
#: What is not listed where evolutions branch: rates may be several inside a piece as well.
AT_EVENTS = "that branch at events only, not in between"


def evolve(
    system: SystemWithMemory,
    interval: tuple[float, float],
    start: Any = None,
    *,
    jumps: str | Callable[[Array, Sequence[Array]], int] | None = None,
    events: Mapping[str, Function | Stop] | None = None,
    record: Mapping[str, Function] | None = None,
    limits: Limits | None = None,
    journal: Journal | None = None,
    report: Report = silent,
) -> EvolutionGraph:
    """Follow everything that a system with memory can do in an interval of time.

    Parameters
    ----------
    system : SystemWithMemory
    interval : tuple of float
        (t0, t1) with t0 < t1.
    start : array_like, shape (n,), optional
        The state at t0. Default: all states at t0 that the initial memory admits; where these
        cannot all be found, the state without load, and the guarantee says so.
    jumps : "nearest", "all" or callable, optional
        What follows the loss of a solution, at which the model itself says nothing. Default: the
        evolution ends there. "nearest" goes on, at the same t, at the nearest of the states that
        the memory admits, "all" at every such state; a function is given the lost state and a list
        of the others, and returns the number of the state to go on with.
    events : mapping of str to callable or Stop, optional
        Functions g(z, t) -> float by name. A zero of g is a node with that name; an evolution ends
        there if g is given as ``Stop(g)``.
    record : mapping of str to callable, optional
        Quantities f(z, t) -> float by name, at hand as ``state["name"]``.
    limits : Limits, optional
        How many pieces the graph may have, and how many seconds the run may take. Where a limit
        runs out, the graph found so far comes back, and the guarantee says why.
    journal : Journal, optional
        Where the ways on from every event are kept at once, so that an interrupted run can go on.
    report : callable, optional
        Called with the number of pieces and the time reached.

    Returns
    -------
    EvolutionGraph

    Raises
    ------
    InvalidInputError
        If the interval, the start or another argument does not fit.
    InvalidSystemError
        If the law restated with the memory of a state does not hold in the state.

    Examples
    --------
    A block on a floor with friction, pushed to the side: at first the block sticks, then slips.

    >>> from pwscont import evolve
    >>> from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> load = LoadHistory([[1, 0], [1, 3], [1, -3]])
    >>> evolution = evolve(QuasiStaticCoulomb(body, load, 0.5), (0.0, 2.0))
    >>> [point.kind for point in evolution.events()]
    ['start', 'event', 'event', 'event', 'event', 'end']
    >>> evolution.guarantee
    'all evolutions with finitely many events'
    """
    checked_kind("system", system, SystemWithMemory, is_needed=True)
    checked_kind("journal", journal, Journal)
    checked_kind("limits", limits, Limits)
    check_callable("report", report, "(number of pieces, t)")
    interval = _checked(interval)
    rule, watched = Jumps(jumps), UserEvents(events)
    with Budget(limits) as budget:
        own = system.evolver(interval)
        checked_kind(f"what {type(system).__name__}.evolver returns", own, Evolver)
        evolver = own or ByRays(system, interval)
        recorded = checked_record(record, (*evolver.names(), "t", "memory", "remark"))
        ways_on: Callable[[Moment], WaysOn] = evolver.ways_on
        if journal is not None:
            ways_on = RecordedWays(evolver, journal, system, interval)
        started = Moments((), False, "the run ended before a start was found")
        run = Run(evolver, ways_on, interval, watched, rule, report, budget)
        try:
            started = evolver.starts(interval[0], start)
            run.start(started.moments)
            run.follow()
        except KeyboardInterrupt as why:
            budget.end(why)
    _check_found(system, started, budget, interval)
    nodes, pieces = _tidied(run)
    words = _guarantee(nodes, pieces, started, budget, rule)
    if journal is not None and not budget.spent:
        journal.finish()
    if nodes:
        checked_names(tuple(evolver.names()), len(evolver.shown(nodes[0].z, nodes[0].t)))
    quantities = Quantities(evolver.names, recorded)
    return EvolutionGraph(nodes, pieces, interval, evolver, quantities, words, system)


def _checked(interval: Any) -> tuple[float, float]:
    try:
        lo, hi = (float(end) for end in interval)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"interval must be two times, got {interval!r}") from error
    if not (isfinite(lo) and isfinite(hi) and lo < hi):
        raise InvalidInputError(f"interval needs finite t0 < t1, got ({lo}, {hi})")
    return lo, hi


def _check_found(
    system: SystemWithMemory, started: Moments, budget: Budget, interval: tuple[float, float]
) -> None:
    """Refuse a system without a state at the beginning."""
    if not started.moments and started.complete and not budget.spent:
        raise InvalidSystemError(
            f"{type(system).__name__} has no state at t = {interval[0]:.10g} under its initial "
            "memory"
        )


def _tidied(run: Run) -> tuple[list[EvolutionNode], list[EvolutionPiece]]:
    """Return the nodes that are left, in the order of time, and their pieces renumbered."""
    left = [i for i, node in enumerate(run.nodes) if node is not None]
    left.sort(key=lambda i: run.nodes[i].t)  # type: ignore[union-attr]
    place = {old: new for new, old in enumerate(left)}
    pieces = [p for p in run.pieces if p.start in place and p.end in place]
    for piece in pieces:
        piece.start, piece.end = place[piece.start], place[piece.end]
    return [node for i in left if (node := run.nodes[i]) is not None], pieces


def _guarantee(
    nodes: Sequence[EvolutionNode],
    pieces: Sequence[EvolutionPiece],
    started: Moments,
    budget: Budget,
    rule: Jumps,
) -> str:
    """Return what is known about the completeness of a graph, in words."""
    doubts = [started.remark] if not started.complete else []
    uncertain = [node for node in nodes if node.remark]
    doubts += [f"{node.remark}, at t = {node.t:.8g}" for node in uncertain[:MOST_NAMED]]
    if len(uncertain) > MOST_NAMED:
        doubts.append(f"and so at {len(uncertain) - MOST_NAMED} more events")
    words = f"not certain to be all evolutions: {'; '.join(doubts)}" if doubts else ALL
    leaving = Counter(piece.start for piece in pieces)
    if not doubts and max(leaving.values(), default=0) > 1:
        words += f" {AT_EVENTS}"
    words += f" {started.origin}" if started.origin and not doubts else ""
    if budget.spent:
        words = "; ".join([f"{budget.spent}: there may be more evolutions", *doubts])
    if any(piece.is_jump for piece in pieces):
        words += f"; jumps by the rule {rule.in_words!r}"
    return words
