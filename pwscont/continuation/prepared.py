"""The plan of a run, made after its system is checked and its unknowns are measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain, islice

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import StartNotFoundError
from pwscont.continuation.magnitudes import magnitudes, ones_fit
from pwscont.continuation.plan import Plan
from pwscont.search.enumeration import Found
from pwscont.stepping import Stepper
from pwscont.system.abilities import check_abilities
from pwscont.system.contract import check_contract, check_names, checked_size
from pwscont.system.promises import check_promises
from pwscont.system.slopes import refuse_wrong_gradients, refuse_wrong_jacobian
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.transitions import TransitionDetector

#: Number of starts that measure the unknowns.
FIRST = 2


def prepared(
    system: PiecewiseSystem,
    start: tuple[Array, float],
    interval: tuple[float, float],
    stepper: Stepper | None,
    detectors: tuple[TransitionDetector, ...] = (),
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
    check_promises(plan.system, interval, sample)
    if not isinstance(system, PiecewiseLinearSystem):
        with np.errstate(all="ignore"):
            refuse_wrong_jacobian(plan.system, sample.character, sample.x)
            refuse_wrong_gradients(plan.system, sample.x)
    if plan.followed is plan.system:
        plan.last.begin(sample)
    return plan


def measured(
    plan: Plan, guess: Array, starts_of: Callable[[Plan], Iterator[Found]]
) -> tuple[Plan, Iterator[Found]]:
    """Return a plan with typical magnitudes of z, and its starts.

    A system that gives no magnitudes is measured by its first solutions; where these are far from
    one, by solutions found again with magnitudes that fit.

    Parameters
    ----------
    plan : Plan
    guess : ndarray, shape (n,)
        Where to look for solutions if there are no starts.
    starts_of : callable
        Plan -> its starts, computed as they are taken.
    """
    starts = starts_of(plan)
    first: list[Found] = []
    if plan.system.gives_scale:
        return plan, starts
    try:
        first, starts = _looked_ahead(starts)
        fit = ones_fit(plan.system, plan.interval, first)
        fitting = None if fit else magnitudes(plan.system, plan.interval, guess)
    except KeyboardInterrupt as why:  # or the budget is spent: the starts found so far are followed
        return plan, chain(first, _raising(why))
    if fitting is None:
        return plan, chain(first, starts)
    plan = Plan.of(plan.system, plan.interval, plan.stepper, plan.added, fitting)
    return plan, starts_of(plan)


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
