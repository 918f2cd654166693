"""The component through a start."""

from __future__ import annotations

from typing import Any

from pwscont.continuation.journal import Journal
from pwscont.continuation.magnitudes import magnitudes
from pwscont.continuation.plan import Plan, Report, checked_interval, checked_kind, silent
from pwscont.foundation.arrays import Array, finite_array
from pwscont.foundation.errors import InvalidInputError, StartNotFoundError
from pwscont.foundation.outcome import Failure
from pwscont.graph import BranchGraph
from pwscont.graph.branch_graph import NOT_SEARCHED
from pwscont.model.contract import check_contract, checked_size
from pwscont.model.promises import check_promises
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
    z, alpha = _checked_start(system, start, (lo, hi))
    plan = Plan.of(system, (lo, hi), stepper)
    check_promises(plan.system, plan.interval, check_contract(plan.system, z, alpha))
    if (fitting := magnitudes(plan.system, (lo, hi), z)) is not None:
        plan = Plan.of(system, (lo, hi), stepper, fitting)
    found = _corrected(plan, z, alpha)
    if isinstance(found, Failure):
        raise StartNotFoundError(
            f"no solution found near the start at alpha = {alpha}: {found}; start closer to a "
            "solution, or let explore() search for starts"
        )
    return plan.follow([found], parameter, report, NOT_SEARCHED, journal)


def _corrected(plan: Plan, z: Array, alpha: float) -> Found | Failure:
    """Return the solution of the followed system near a rough start."""
    rough = plan.reduction.state(z) if plan.reduction else z
    return semismooth_newton(plan.followed, plan.metric, rough, alpha)


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
