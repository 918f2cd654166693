"""Every component that a search finds."""

from __future__ import annotations

import numpy as np

from pwscont.continuation.default_search import default_search
from pwscont.continuation.journal import Journal
from pwscont.continuation.magnitudes import magnitudes
from pwscont.continuation.plan import Plan, Report, checked_interval, checked_kind, silent
from pwscont.graph import BranchGraph
from pwscont.model.contract import check_contract, checked_size
from pwscont.model.promises import check_promises, refuse_undefined
from pwscont.model.system import PiecewiseSystem
from pwscont.search import Search
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
    stepper, parameter, report, journal : optional
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
    z = np.zeros(checked_size(system))
    plan = Plan.of(system, (lo, hi), stepper)
    check_promises(plan.system, plan.interval, check_contract(plan.system, z, lo))
    if (fitting := magnitudes(plan.system, plan.interval, z)) is not None:
        plan = Plan.of(system, (lo, hi), stepper, fitting)
    chosen = search or default_search(plan.followed)
    starts = chosen.starts(plan.followed, plan.metric, plan.interval)
    searched = chosen.searched(plan.followed)
    graph = plan.follow(starts, parameter, report, searched, journal)
    if not graph.special_points():
        refuse_undefined(plan.system, plan.interval)
    return graph
