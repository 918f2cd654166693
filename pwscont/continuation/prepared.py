"""The plan of a run, made after its system is checked and its unknowns are measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain, islice

import numpy as np

from pwscont.basics.arrays import Array, product
from pwscont.basics.errors import StartNotFoundError
from pwscont.continuation.gauge import Gauge, MisjudgedError
from pwscont.continuation.magnitudes import (
    are_alike,
    magnitudes_of,
    rough_magnitudes,
    rounded_to_one,
)
from pwscont.continuation.plan import Plan
from pwscont.graph import BranchGraph
from pwscont.linear.threads import few_threads
from pwscont.search.enumeration import Found
from pwscont.stepping import Stepper
from pwscont.system.abilities import check_abilities
from pwscont.system.contract import check_contract, check_names, checked_size
from pwscont.system.promises import check_promises
from pwscont.system.slopes import refuse_wrong_gradients, refuse_wrong_jacobian
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.system.units import refuse_extreme_rows
from pwscont.transitions import TransitionDetector
from pwscont.transitions.events import Events

#: Number of starts that measure the unknowns.
FIRST = 2
#: How often magnitudes are revised by the path.
REVISIONS = 6


def prepared(
    system: PiecewiseSystem,
    start: tuple[Array, float],
    interval: tuple[float, float],
    stepper: Stepper | None,
    detectors: tuple[TransitionDetector | Events, ...] = (),
) -> Plan:
    """Return the plan for a system whose promises hold at a start.

    Raises
    ------
    InvalidSystemError
        If a promise is broken there, names do not fit the unknowns, or a method would never be
        called.
    """
    z, alpha = start
    checked_size(system)
    check_names(system)
    check_abilities(system)
    plan = Plan.of(system, interval, stepper, detectors)
    sample = check_contract(plan.system, z, alpha)
    terms = product(abs(sample.jacobian), plan.system.differences(alpha).scale)
    refuse_extreme_rows(plan.system, np.abs(sample.residual) + terms)
    check_promises(plan.system, interval, sample)
    if not isinstance(system, PiecewiseLinearSystem):
        with np.errstate(all="ignore"):
            refuse_wrong_jacobian(plan.system, sample.character, sample.x)
            refuse_wrong_gradients(plan.system, sample.x)
    if plan.followed is plan.system:
        plan.last.begin(sample)
    return plan


def followed(
    plan: Plan,
    guess: Array,
    starts_of: Callable[[Plan], Iterator[Found]],
    follow: Callable[[Plan, Iterator[Found]], BranchGraph],
) -> BranchGraph:
    """Return the graph from all starts; where the path shows other magnitudes, it begins again.

    Parameters
    ----------
    plan : Plan
    guess : ndarray, shape (n,)
        Around which the system is asked for typical magnitudes if it gives none.
    starts_of : callable
        Plan -> its starts, computed as they are taken.
    follow : callable
        (plan, starts) -> the graph.
    """
    if plan.system.gives_scale or plan.reduction:
        return follow(plan, starts_of(plan))
    with few_threads(plan.system.size):
        plan, starts = _measured(plan, guess, starts_of)
    for _ in range(REVISIONS):
        try:
            return follow(replace(plan, gauge=Gauge(plan.metric)), starts)
        except MisjudgedError as wrong:
            plan = _with(plan, wrong.magnitudes)
            starts = starts_of(plan)
    return follow(plan, starts)


def _measured(
    plan: Plan, guess: Array, starts_of: Callable[[Plan], Iterator[Found]]
) -> tuple[Plan, Iterator[Found]]:
    """Return a plan with magnitudes from H, then from its first solutions, and its starts."""
    first: list[Found] = []
    starts: Iterator[Found] = iter(())
    try:
        plan = _with(plan, rough_magnitudes(plan.system, plan.interval, guess))
        first, starts = _looked_ahead(starts_of(plan))
    except KeyboardInterrupt as why:  # or the budget is spent: the starts found so far are followed
        return plan, chain(first, _raising(why))
    if not first:
        return plan, starts
    sizes = rounded_to_one(magnitudes_of(plan.system, plan.metric, first))
    if are_alike(sizes, plan.metric.scale[:-1]):
        return plan, chain(first, starts)
    plan = _with(plan, sizes)
    return plan, starts_of(plan)


def _with(plan: Plan, magnitudes: Array) -> Plan:
    """Return a plan with other magnitudes."""
    sizes = rounded_to_one(magnitudes)
    if (sizes == plan.metric.scale[:-1]).all():
        return plan
    other = Plan.of(plan.system, plan.interval, plan.stepper, plan.added, sizes)
    is_straight = isinstance(plan.system, PiecewiseLinearSystem)  # elsewhere differences change
    return replace(other, last=plan.last) if is_straight else other


def _looked_ahead(starts: Iterator[Found]) -> tuple[list[Found], Iterator[Found]]:
    """Return the first starts and the others; if no start is found, the others raise the error."""
    try:
        return list(islice(starts, FIRST)), starts
    except StartNotFoundError as error:
        return [], _raising(error)


def _raising(error: BaseException) -> Iterator[Found]:
    """Raise when the next start is taken."""
    raise error
    yield
