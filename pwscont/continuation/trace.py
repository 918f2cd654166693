"""The component through a start."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import Plan, Report, checked_interval, checked_kind, silent
from pwscont.continuation.prepared import prepared
from pwscont.foundation.arrays import Array, finite_array
from pwscont.foundation.budget import Budget
from pwscont.foundation.errors import InvalidInputError, StartNotFoundError
from pwscont.foundation.limits import Limits
from pwscont.foundation.outcome import Failure
from pwscont.graph import BranchGraph
from pwscont.graph.branch_graph import NOT_SEARCHED
from pwscont.model.contract import checked_size
from pwscont.model.system import PiecewiseSystem
from pwscont.numerics.semismooth import semismooth_newton
from pwscont.search.enumeration import Found
from pwscont.stepping import Stepper


def trace(
    system: PiecewiseSystem,
    start: tuple[Any, float],
    interval: tuple[float, float],
    *,
    stepper: Stepper | None = None,
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
    stepper : Stepper, optional
        Default: exact for a PiecewiseLinearSystem, else PseudoArclength.
    parameter : str, optional
        Name of alpha in tables and on axes.
    report : callable, optional
        Called with the number of pieces and the alpha reached, after each piece.
    journal : Journal, optional
        Where every finished piece is kept at once, so that an interrupted run can go on.
    limits : Limits, optional
        How many pieces the graph may have, and how many seconds it may take; default no limits.
        Where one runs out, and after Ctrl-C, the graph found so far comes back: its unfinished ends
        are special points of kind "stopped", and its guarantee says why. Ctrl-C ends the step that
        is being taken first; a second one does not wait for it.

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
    """
    lo, hi = checked_interval(system, interval)
    checked_kind("journal", journal, Journal)
    checked_kind("limits", limits, Limits)
    z, alpha = _checked_start(system, start, (lo, hi))
    with Budget(limits or Limits()) as budget:
        plan = prepared(system, (z, alpha), (lo, hi), stepper)
        starts = _corrected(plan, z, alpha)
        return plan.follow(starts, parameter, report, NOT_SEARCHED, journal, budget)


def _corrected(plan: Plan, z: Array, alpha: float) -> Iterator[Found]:
    """Yield the solution near a rough start."""
    rough = plan.reduction.state(z) if plan.reduction else z
    found = semismooth_newton(plan.followed, plan.metric, rough, alpha)
    if isinstance(found, Failure):
        raise StartNotFoundError(
            f"no solution found near the start at alpha = {alpha}: {found}; start closer to a "
            "solution, or let explore() search for starts"
        )
    yield found


def _checked_start(
    system: PiecewiseSystem, start: tuple[Any, float], interval: tuple[float, float]
) -> tuple[Any, float]:
    try:
        z, alpha = start[0], float(start[1])
        pair = len(start) == 2
    except (TypeError, ValueError, IndexError) as error:
        raise InvalidInputError(f"start must be a pair (z, alpha): {error}") from error
    if not pair:
        raise InvalidInputError(f"start must be a pair (z, alpha), got {len(start)} entries")
    lo, hi = interval
    if not lo <= alpha <= hi:
        raise InvalidInputError(f"start at alpha = {alpha} lies outside the interval ({lo}, {hi})")
    return finite_array("z of the start", z, (checked_size(system),)), alpha
