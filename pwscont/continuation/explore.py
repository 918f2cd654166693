"""Every component that a search finds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pwscont.continuation.default_search import default_search
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import Plan, Report, checked_interval, checked_kind, silent
from pwscont.continuation.prepared import prepared
from pwscont.foundation.budget import Budget
from pwscont.foundation.limits import Limits
from pwscont.graph import BranchGraph
from pwscont.model.contract import checked_size
from pwscont.model.promises import refuse_undefined
from pwscont.model.system import PiecewiseSystem
from pwscont.search import Search
from pwscont.search.enumeration import Found
from pwscont.stepping import Stepper


def explore(
    system: PiecewiseSystem,
    interval: tuple[float, float],
    *,
    search: Search | None = None,
    stepper: Stepper | None = None,
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
    search : Search, optional
        Where to look for starts; searches add up with ``+``. The default depends on the size:
        complete where that takes seconds (every transition point of a piecewise-linear system,
        or all solutions at both ends), otherwise searches that promise nothing.
    stepper, parameter, report, journal, limits : optional
        As for :func:`pwscont.trace`.

    Returns
    -------
    BranchGraph
        Its ``searched`` and ``guarantee`` say what was searched and what that promises.

    Raises
    ------
    InvalidInputError, InvalidSystemError
        As for :func:`pwscont.trace`.
    """
    lo, hi = checked_interval(system, interval)
    checked_kind("search", search, Search)
    checked_kind("journal", journal, Journal)
    checked_kind("limits", limits, Limits)
    with Budget(limits or Limits()) as budget:
        plan = prepared(system, (np.zeros(checked_size(system)), lo), (lo, hi), stepper)
        chosen = search or default_search(plan.followed)
        searched, starts = chosen.searched(plan.followed), _found(chosen, plan)
        graph = plan.follow(starts, parameter, report, searched, journal, budget)
    if not graph.special_points() and not budget.spent:
        refuse_undefined(plan.system, plan.interval)
    return graph


def _found(search: Search, plan: Plan) -> Iterator[Found]:
    """Yield what a search finds; also one that returns a list begins when it is asked."""
    yield from search.starts(plan.followed, plan.metric, plan.interval)
