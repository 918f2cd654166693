"""Starts that a caller gives: checked, and corrected to solutions."""

from __future__ import annotations

from typing import Any

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError, StartNotFoundError
from pwscont.basics.outcome import Failure
from pwscont.continuation.plan import Plan
from pwscont.curve.error_samples import is_inside
from pwscont.curve.semismooth import semismooth_newton
from pwscont.system.contract import checked_size
from pwscont.system.hidden import completed, shown_size
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.standing import settled

#: A rough state and its alpha, and a solution with samples of its error.
Start = tuple[Array, float]
Found = tuple[Array, Array]


def checked_start(
    system: PiecewiseSystem, start: Any, interval: tuple[float, float], name: str = "the start"
) -> Start:
    """Return z, with hidden unknowns, and alpha of a start, or say what is wrong with it.

    Raises
    ------
    InvalidInputError
        Naming the start by ``name``.
    """
    try:
        z, alpha = start[0], float(start[1])
        pair = len(start) == 2
    except (TypeError, ValueError, IndexError, KeyError) as error:
        raise InvalidInputError(f"{name} must be a pair (z, alpha): {error}") from error
    if not pair:
        raise InvalidInputError(f"{name} must be a pair (z, alpha), got {len(start)} entries")
    lo, hi = interval
    if not lo <= alpha <= hi:
        raise InvalidInputError(f"{name} at alpha = {alpha} lies outside the interval ({lo}, {hi})")
    checked_size(system)
    return completed(system, finite_array(f"z of {name}", z, (shown_size(system),)), alpha), alpha


def checked_starts(
    system: PiecewiseSystem, starts: Any, interval: tuple[float, float]
) -> tuple[Start, ...]:
    """Return several starts; a bad one is named by its place, as in ``starts[2]``."""
    try:
        listed = list(starts)
    except TypeError as error:
        raise InvalidInputError(f"starts must be pairs (z, alpha): {error}") from error
    return tuple(
        checked_start(system, start, interval, f"starts[{i}]") for i, start in enumerate(listed)
    )


def corrected(plan: Plan, start: Start, name: str = "the start") -> Found:
    """Return the solution near a start of the full system, by semismooth Newton at its alpha.

    Raises
    ------
    StartNotFoundError
        If there is no solution nearby, or it lies outside the bounds.
    """
    z, alpha = start
    found = semismooth_newton(plan.followed, plan.metric, plan.reduced(z), alpha, last=plan.last)
    if isinstance(found, Failure):
        raise StartNotFoundError(
            f"no solution found near {name} at alpha = {alpha}: {found}; start closer to a "
            "solution, or let explore() search for starts"
        )
    on_curve = settled(plan.followed, plan.metric, found)
    if on_curve is None:
        raise StartNotFoundError(
            f"the solution nearest to {name} lies outside the interval {plan.interval}"
        )
    x, error = on_curve
    if not is_inside(plan.box, x, error, plan.metric.scale):
        raise StartNotFoundError(
            f"the solution found near {name} at alpha = {alpha} lies outside the bounds of "
            f"{type(plan.system).__name__}: z = {x[:-1]}; start closer to a solution within them"
        )
    return on_curve
