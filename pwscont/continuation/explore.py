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
    interval : tuple of float
        (lo, hi).
    starts : iterable of (array_like, shape (n,), and float), optional
        Starts (z, alpha) that are known, each rough as for :func:`pwscont.trace`. They are followed
        first, and what the search finds after them.
    search : Search, optional
        Where to look for starts; searches add up with ``+``. The default depends on the size:
        complete where that takes seconds (every transition point of a piecewise-linear system, or
        all solutions at both ends and at some values between), otherwise searches that promise
        nothing. The default search of a curved system looks around the given starts as well.
    stepper, detectors, events, record, parameter, report, journal, limits : optional
        As for :func:`pwscont.trace`.

    Returns
    -------
    BranchGraph
        Its ``searched`` and ``guarantee`` say what was searched and what that promises.

    Raises
    ------
    InvalidInputError, InvalidSystemError, StartNotFoundError
        As for :func:`pwscont.trace`; the message names the bad start by its place.
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
    yield from starts_of(search, plan.followed, plan.metric, plan.interval)


def _searched(given: tuple[Start, ...], searched: SearchScope) -> SearchScope:
    """Return what was searched, given starts included."""
    if not given:
        return searched
    starts = f"{len(given)} given start{'s' if len(given) > 1 else ''}"
    return SearchScope(f"{starts}; {searched.what}", searched.promise)
