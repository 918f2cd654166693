"""The plan of a run, once its system has kept its promises at a first point."""

from __future__ import annotations

from pwscont.continuation.magnitudes import magnitudes
from pwscont.continuation.plan import Plan
from pwscont.foundation.arrays import Array
from pwscont.foundation.budget import OutOfBudget
from pwscont.model.contract import check_contract
from pwscont.model.promises import check_promises
from pwscont.model.system import PiecewiseSystem
from pwscont.stepping import Stepper


def prepared(
    system: PiecewiseSystem,
    start: tuple[Array, float],
    interval: tuple[float, float],
    stepper: Stepper | None,
) -> Plan:
    """Return the plan for a system whose promises hold at a start, measured by its solutions.

    Raises
    ------
    InvalidSystemError
        If a promise is broken there.
    """
    z, alpha = start
    plan = Plan.of(system, interval, stepper)
    check_promises(plan.system, interval, check_contract(plan.system, z, alpha))
    try:
        fitting = magnitudes(plan.system, interval, z)
    except OutOfBudget:  # the run that the plan is for ends before it begins
        return plan
    return plan if fitting is None else Plan.of(system, interval, stepper, fitting)
