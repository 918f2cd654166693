"""Every component that a search finds."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import Any

import numpy as np

from pwscont.continuation.default_search import default_search
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import Plan, Report, checked_interval, checked_kind, silent
from pwscont.continuation.start import Start, checked_starts, corrected
from pwscont.foundation.guarantee import Searched
from pwscont.graph import BranchGraph
from pwscont.model.contract import check_contract, checked_size
from pwscont.model.system import PiecewiseSystem
from pwscont.search import Search
from pwscont.stepping import Stepper


def explore(
    system: PiecewiseSystem,
    interval: tuple[float, float],
    *,
    starts: Iterable[tuple[Any, float]] = (),
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
    starts : iterable of (array_like, shape (n,), and float), optional
        Starts (z, alpha) that are known, each rough as for :func:`pwscont.trace`. They are followed
        first, and what the search finds after them.
    search : Search, optional
        Where to look for starts; searches add up with ``+``. The default depends on the size:
        complete where that takes seconds (every transition point of a piecewise-linear system, or
        all solutions at both ends and at some values between), otherwise searches that promise
        nothing. That of a curved system looks around the given starts as well.
    stepper, parameter, report, journal : optional
        As for :func:`pwscont.trace`.

    Returns
    -------
    BranchGraph
        Its ``searched`` and ``guarantee`` say what was searched and what that promises.

    Raises
    ------
    InvalidInputError, InvalidSystemError, StartNotFoundError
        As for :func:`pwscont.trace`; of several starts the bad one is named by its place.
    """
    lo, hi = checked_interval(system, interval)
    checked_kind("search", search, Search)
    checked_kind("journal", journal, Journal)
    given = checked_starts(system, starts, (lo, hi))
    check_contract(system, np.zeros(checked_size(system)), lo)
    plan = Plan.of(system, (lo, hi), stepper)
    around = [plan.reduced(z) for z, _ in given]
    chosen = search or default_search(plan.followed, (lo, hi), around)
    known = [corrected(plan, start, f"starts[{i}]") for i, start in enumerate(given)]
    found = chosen.starts(plan.followed, plan.metric, plan.interval)
    searched = _searched(given, chosen.searched(plan.followed))
    return plan.follow(chain(known, found), parameter, report, searched, journal)


def _searched(given: tuple[Start, ...], searched: Searched) -> Searched:
    """Return what was searched, given starts included."""
    if not given:
        return searched
    starts = f"{len(given)} given start{'s' if len(given) > 1 else ''}"
    return Searched(f"{starts}; {searched.what}", searched.promise)
