"""The branch graph of every component that a search finds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from pwscont.basics.budget import Budget
from pwscont.basics.given import checked_kind
from pwscont.basics.guarantee import SearchScope
from pwscont.basics.limits import Limits
from pwscont.basics.quantities import Function, checked_record
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import (
    Plan,
    Report,
    checked_detectors,
    checked_interval,
    silent,
)
from pwscont.continuation.prepared import followed, prepared
from pwscont.continuation.start import Start, checked_starts, corrected
from pwscont.graph import BranchGraph
from pwscont.search import Search
from pwscont.search.default_search import default_search
from pwscont.search.enumeration import Found
from pwscont.search.search import scope_of, starts_of
from pwscont.stepping import Stepper
from pwscont.system.contract import checked_size
from pwscont.system.hidden import shown_size
from pwscont.system.promises import refuse_undefined
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions import TransitionDetector
from pwscont.transitions.user_event import Stop


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
        (lo, hi), the values of alpha that are explored.
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
        special points of kind "stopped", and its guarantee says why the run ended.

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
    lo, hi = checked_interval(system, interval)
    checked_kind("search", search, Search)
    checked_kind("journal", journal, Journal)
    checked_kind("limits", limits, Limits)
    given = checked_starts(system, starts, (lo, hi))
    watched = checked_detectors(system, detectors, events)
    recorded = checked_record(record, system.names() if record else ())
    with Budget(limits or Limits()) as budget:
        guess = np.zeros(checked_size(system))
        plan = prepared(system, (guess, lo), (lo, hi), stepper, watched)
        around = [plan.reduced(z)[: shown_size(plan.followed)] for z, _ in given]
        chosen = search or default_search(plan.followed, (lo, hi), around)
        searched = _searched(given, scope_of(chosen, plan.followed))

        def follow(plan: Plan, found: Iterator[Found]) -> BranchGraph:
            return plan.follow(found, parameter, report, searched, journal, budget, recorded)

        graph = followed(plan, guess, lambda plan: _found(plan, given, chosen), follow)
    if not graph.special_points() and not budget.spent:
        refuse_undefined(plan.system, plan.interval)
    return graph


def _found(plan: Plan, given: tuple[Start, ...], search: Search) -> Iterator[Found]:
    """Yield the given starts, corrected, then the starts of a search, which begins then."""
    for i, start in enumerate(given):
        yield corrected(plan, start, f"starts[{i}]")
    yield from starts_of(search, plan.followed, plan.metric, plan.interval, plan.branches)


def _searched(given: tuple[Start, ...], searched: SearchScope) -> SearchScope:
    """Return what was searched, given starts included."""
    if not given:
        return searched
    starts = f"{len(given)} given start{'s' if len(given) > 1 else ''}"
    return SearchScope(f"{starts}; {searched.what}", searched.promise)
