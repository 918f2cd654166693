"""trace and explore: a plan is made, magnitudes are measured, and the run begins."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import Array
from pwscont.basics.budget import Budget, Limits
from pwscont.basics.errors import InvalidInputError, StartNotFoundError
from pwscont.basics.outcome import Failure, SearchScope
from pwscont.basics.printing import counted
from pwscont.basics.quantities import Function
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import (
    Plan,
    Report,
    Start,
    checked_detectors,
    checked_interval,
    checked_options,
    checked_plan,
    checked_start,
    default_search_of,
    silent,
)
from pwscont.continuation.run import follow_starts
from pwscont.curve.error_samples import Found, is_inside
from pwscont.curve.magnitudes import are_alike, magnitudes_of, rough_magnitudes, rounded_to_one
from pwscont.curve.metric import Gauge, MisjudgedError
from pwscont.curve.semismooth import semismooth_newton
from pwscont.curve.stepper import Stepper
from pwscont.graph import BranchGraph
from pwscont.graph.proved import Proof
from pwscont.graph.structure import NOT_SEARCHED
from pwscont.search import Search
from pwscont.search.search import checked_proof, scope_of, starts_of
from pwscont.system.abilities import shown_size
from pwscont.system.promises import refuse_undefined
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.transitions import TransitionDetector
from pwscont.transitions.ends import settled

if TYPE_CHECKING:
    from pwscont.events.user_event import Stop


def corrected(plan: Plan, start: Start, name: str) -> Found:
    """Return the solution near a start of the full system, or refuse the start, named ``name``."""
    z, alpha = start
    found = semismooth_newton(plan.reduced_system, plan.metric, plan.reduced(z), alpha)
    if isinstance(found, Failure):
        advice = "start closer to a solution, or let explore() search for starts"
        words = f"no solution found near {name} at alpha = {alpha}"
        raise StartNotFoundError(f"{words}: {found}; {advice}")
    on_curve = settled(plan.reduced_system, plan.metric, found)
    if on_curve is None:
        words = f"the solution nearest to {name} lies outside the interval {plan.interval}"
        raise StartNotFoundError(words)
    x, error = on_curve
    if not is_inside(plan.box, x, error, plan.metric.scale):
        where = f"lies outside the bounds of {type(plan.system).__name__}: z = {x[:-1]}"
        words = f"the solution found near {name} at alpha = {alpha} {where}"
        raise StartNotFoundError(f"{words}; start closer to a solution within them")
    return on_curve


#: Number of starts that measure the unknowns.
FIRST = 2
#: How often magnitudes are revised by the path.
REVISIONS = 6


def follow_measured(
    plan: Plan, guess: Array, starts_of: Callable[[Plan], Iterator[Found]], searched: SearchScope
) -> tuple[BranchGraph, Plan]:
    """Return the graph from all starts, and its plan, which begins again with other magnitudes.

    ``guess`` is the state around which magnitudes are measured if the system gives none.
    """
    if plan.system.gives_scale or plan.reduction:
        return follow_starts(plan, starts_of(plan), searched), plan
    # a journal has the magnitudes with which the interrupted run had begun again
    revised = None if plan.journal is None else plan.journal.magnitudes
    if revised is not None and len(revised) == plan.system.size:
        plan = plan.with_magnitudes(revised)
        starts = starts_of(plan)
    else:
        with plan.few_threads():
            plan, starts = _measured(plan, guess, starts_of)
    found: list[Found] = []
    for _ in range(REVISIONS):
        try:
            judged = replace(plan, gauge=Gauge(plan.metric))
            return follow_starts(judged, _kept(starts, found), searched), plan
        except MisjudgedError as wrong:
            plan = plan.with_magnitudes(wrong.magnitudes)
            starts = chain(tuple(found), starts_of(plan))
    return follow_starts(plan, starts, searched), plan


def _kept(starts: Iterator[Found], found: list[Found]) -> Iterator[Found]:
    """Yield starts, and keep the starts: other magnitudes may hide what lies far from zero."""
    for start in starts:
        found.append(start)
        yield start


def _measured(
    plan: Plan, guess: Array, starts_of: Callable[[Plan], Iterator[Found]]
) -> tuple[Plan, Iterator[Found]]:
    """Return a plan with magnitudes from H, then from its first solutions, and its starts."""
    first: list[Found] = []
    # the second start of straight pieces may take as long as all others
    counts = (1, FIRST) if isinstance(plan.system, PiecewiseLinearSystem) else (FIRST,)
    try:
        plan = plan.with_magnitudes(rough_magnitudes(plan.system, plan.interval, guess))
        starts = starts_of(plan)
        for count in counts:
            first += islice(starts, count - len(first))
            sizes = _sizes(plan, first)
            if not are_alike(sizes, plan.metric.scale[:-1]):
                plan = plan.with_magnitudes(sizes)
                starts = starts_of(plan)
                break
    except KeyboardInterrupt as why:  # or the budget is spent: the starts found so far are followed
        # a journal begins with magnitudes that the run that goes on measures as well
        return replace(plan, journal=None), chain(first, _raising(why))
    return plan, chain(first, starts)


def _sizes(plan: Plan, first: list[Found]) -> Array:
    """Return magnitudes of the unknowns, those of the plan before any solution is known."""
    if not first:
        return plan.metric.scale[:-1]
    return rounded_to_one(magnitudes_of(plan.system, plan.metric, first))


def _raising(error: BaseException) -> Iterator[Found]:
    """Raise when the next start is taken."""
    raise error
    yield


def trace(
    system: PiecewiseSystem,
    start: tuple[Any, float],
    interval: tuple[float, float],
    *,
    stepper: Stepper | None = None,
    detectors: Iterable[TransitionDetector] = (),
    events: Mapping[str, Function | Stop] | None = None,
    record: Mapping[str, Function] | None = None,
    parameter: str = "alpha",
    report: Report = silent,
    journal: Journal | None = None,
    limits: Limits | None = None,
) -> BranchGraph:
    """Follow the component of H(z, alpha) = 0 through a start, in both directions.

    Parameters
    ----------
    system : PiecewiseSystem
    start : tuple of (array_like, shape (n,)) and float
        (z, alpha); z may be rough and is corrected at fixed alpha by semismooth Newton.
    interval : tuple of float
        (lo, hi): the values of alpha to stay in.
    stepper, detectors, events, record, parameter, report, journal, limits : optional
        As of :func:`explore`.

    Returns
    -------
    BranchGraph

    Raises
    ------
    InvalidInputError
        If start, interval or stepper do not fit the system.
    InvalidSystemError
        If a method of the system returns the wrong shape.
    StartNotFoundError
        If no solution is found near the start.

    Examples
    --------
    >>> from pwscont import Switched, trace
    >>> arch = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    >>> branch = trace(arch, ([0.1], 0.0), (-0.5, 1.0))
    >>> [round(p.alpha, 6) for p in branch.special_points("fold")]
    [0.3849]
    """
    inside = checked_interval(system, interval)
    options = checked_options(system, journal, limits, report, parameter, record)
    rough = checked_start(system, start, inside, "the start")
    watched, given = checked_detectors(system, detectors, events), {"the start": rough}
    with Budget(limits) as budget:
        plan = checked_plan(system, inside, rough, budget, watched, stepper, **options)
        return follow_measured(plan, rough[0], lambda plan: _found(plan, given), NOT_SEARCHED)[0]


def explore(
    system: PiecewiseSystem,
    interval: tuple[float, float],
    *,
    starts: Iterable[tuple[Any, float]] = (),
    search: Search | None = None,
    stepper: Stepper | None = None,
    detectors: Iterable[TransitionDetector] = (),
    events: Mapping[str, Function | Stop] | None = None,
    record: Mapping[str, Function] | None = None,
    parameter: str = "alpha",
    report: Report = silent,
    journal: Journal | None = None,
    limits: Limits | None = None,
) -> BranchGraph:
    """Find starts in an interval of alpha and follow every component through them.

    Parameters
    ----------
    system : PiecewiseSystem
        What H is; :func:`pwscont.check_system` looks for mistakes in its formulas.
    interval : tuple of float
        (lo, hi), the values of alpha that are explored. If the search promises nothing, straight
        pieces that leave the interval may be followed outside, by a quarter of the interval's
        length, to where the path comes back: H is evaluated there, within the system's ``domain``.
    starts : iterable of (array_like, shape (n,), and float), optional
        Known starts (z, alpha); z may be rough, and is corrected at fixed alpha by semismooth
        Newton. The branches through these starts are followed before the search begins.
    search : Search, optional
        Where to look for starts; searches add up with ``+``. The default depends on the size:
        complete where that takes seconds (every transition point of a piecewise-linear system, or
        all solutions at both ends and at some values between), otherwise searches that promise
        nothing. The default search of a curved system looks around the given starts as well.
    stepper : Stepper, optional
        How pieces are followed; default :class:`pwscont.ExactLinear` for a
        :class:`pwscont.PiecewiseLinearSystem`, else :class:`pwscont.PseudoArclength`.
    detectors : iterable of TransitionDetector, optional
        Detectors beside the default ones; their special points may be of kinds of their own.
    events : mapping of str to callable or Stop, optional
        Functions g(z, alpha) -> float by name. A zero of g is a special point of kind "event" with
        that name; the branch ends there if g is given as ``Stop(g)``. Events change no count and
        no balance. A transition, a fold or an end at which g is zero stays of its kind, and has
        the event's ``name``.
    record : mapping of str to callable, optional
        Quantities f(z, alpha) -> float by name, at hand as ``solution["name"]`` and
        ``point["name"]``, in data frames, tables and pictures.
    parameter : str, optional
        Name of alpha in tables and on axes.
    report : callable, optional
        Called with the number of pieces and the alpha reached, after each piece.
    journal : Journal, optional
        Where every finished piece is kept at once, so that an interrupted run can go on.
    limits : Limits, optional
        How many pieces the graph may have, and how many seconds the run may take; default no
        limits. After a limit or Ctrl-C, the graph found so far comes back: its unfinished ends are
        special points of kind "stopped", and its guarantee says why the run ended. After Ctrl-C
        the run first ends the current step; a second Ctrl-C does not wait for the step.

    Returns
    -------
    BranchGraph
        Its ``searched`` and ``guarantee`` say what was searched and what that promises.

    Raises
    ------
    InvalidInputError
        If interval, stepper or a start do not fit the system; the message names the start by its
        place.
    InvalidSystemError
        If a method of the system returns the wrong shape.
    StartNotFoundError
        If no solution is found near one of the starts.

    Examples
    --------
    >>> from pwscont import Limits, Switched, explore
    >>> arch = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    >>> graph = explore(
    ...     arch,
    ...     (-0.5, 1.0),
    ...     starts=[([2.0], 0.3)],
    ...     events={"half": lambda z, load: z[0] - 0.5},
    ...     record={"energy": lambda z, load: load * z[0]},
    ...     parameter="load",
    ...     limits=Limits(seconds=60.0),
    ... )
    >>> graph.count(0.2), graph.guarantee
    (3, 'balanced')
    >>> (half,) = graph.special_points("event")
    >>> round(half.alpha, 6), round(half["energy"], 6)
    (0.375, 0.1875)
    >>> [round(p.alpha, 6) for p in graph.special_points("fold")]
    [0.3849]
    """
    inside = checked_interval(system, interval)
    checked_kind("search", search, Search)
    options = checked_options(system, journal, limits, report, parameter, record)
    try:
        listed = list(starts)
    except TypeError as error:
        raise InvalidInputError(f"starts must be pairs (z, alpha): {error}") from error
    named = ((f"starts[{i}]", start) for i, start in enumerate(listed))
    given = {name: checked_start(system, start, inside, name) for name, start in named}
    watched, guess = checked_detectors(system, detectors, events), np.zeros(system.size)
    # a system need not be defined wherever a search looks
    with Budget(limits) as budget, np.errstate(all="ignore"):
        at = guess, inside[0]
        plan = checked_plan(system, inside, at, budget, watched, stepper, **options)
        around = [plan.reduced(z)[: shown_size(plan.reduced_system)] for z, _ in given.values()]
        chosen = search or default_search_of(plan, around)
        searched = scope_of(chosen, plan.reduced_system)
        if given:
            what = f"{counted(len(given), 'given start')}; {searched.what}"
            searched = SearchScope(what, searched.promise)
        before = chosen.proved(plan.reduced_system, plan.interval)
        graph, plan = follow_measured(
            plan, guess, lambda plan: _found(plan, given, chosen), searched
        )
        graph.proof = checked_proof(chosen, _proof(chosen, plan, before))
        graph.searched = replace(graph.searched, spent=graph.searched.spent or budget.spent)
    if not graph.pieces and not budget.spent:
        refuse_undefined(plan.system, plan.interval)
    return graph


def _proof(search: Search, plan: Plan, before: Proof | None) -> Proof | None:
    """Return what a search proved in this run; ``before`` is what the search had proved earlier.

    A search that the run did not ask, as with a journal, is asked again: the formula of an earlier
    proof may have changed since.
    """
    proof = search.proved(plan.reduced_system, plan.interval)
    is_new = proof is not None and proof is not before
    if is_new or (proof is None and plan.journal is None):
        return proof
    asked = plan.reduced_system, plan.metric, plan.interval, plan.branches
    return plan.budget.spend(lambda: search.prove_again(*asked), None)


def _found(plan: Plan, given: Mapping[str, Start], search: Search | None = None) -> Iterator[Found]:
    """Yield the given starts, corrected, then the starts of a search, which begins then."""
    for name, start in given.items():
        yield corrected(plan, start, name)
    if search is not None:
        yield from starts_of(search, plan.reduced_system, plan.metric, plan.interval, plan.branches)
