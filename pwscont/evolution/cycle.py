"""What a periodic load leads to: shakedown, cyclic slip, ratchetting, or nothing settled yet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.errors import InvalidInputError, SystemNeededError
from pwscont.basics.rounding import SAME_STATE

if TYPE_CHECKING:
    from pwscont.evolution.paths import EvolutionPath
    from pwscont.evolution.states import EvolutionState

#: The number of errors of single states that add up over a period.
ADDED = 16.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """The end of an evolution under a periodic load.

    Attributes
    ----------
    kind : str
        "shakedown": nothing is left behind any more, the last period is free of slip or yield.
        "cyclic slip": the state repeats itself after ``periods`` periods of the load.
        "ratchetting": the memory grows by the same ``drift`` in each of the last periods.
        "not yet": none of these within the interval, or the evolution ends before.
    periods : int
        Number of periods of the load after which the state repeats itself; 0 if the state does not.
    drift : ndarray, shape (k,)
        Change of the memory in the last period.
    """

    kind: str
    periods: int
    drift: Array


def cycle_of(path: EvolutionPath, end: float, period: float) -> Cycle:
    """Return what one evolution comes to in the last periods before a time."""
    begin = end - period * np.floor((end - path.start) / period * (1.0 + SAME_STATE))
    times = np.arange(end, begin - 0.5 * period, -period)
    try:
        states = [path.state(max(float(t), path.start)) for t in times]
    except InvalidInputError:
        return Cycle("not yet", 0, np.zeros(0))
    size = max(float(np.abs(state.memory).max(initial=0.0)) for state in states)
    drift = states[0].memory - states[1].memory
    same = [k for k in range(1, len(states)) if _same(states[0], states[k], size)]
    if same and same[0] == 1 and _is_at_rest(path, end - period, end, size):
        return Cycle("shakedown", 1, drift)
    if same:
        return Cycle("cyclic slip", same[0], drift)
    return Cycle("ratchetting" if _drifts(states, drift, size) else "not yet", 0, drift)


def _same(a: EvolutionState, b: EvolutionState, size: float) -> bool:
    near = bool((np.abs(a.memory - b.memory) <= ADDED * SAME_STATE * size).all())
    largest = np.maximum(np.abs(a.z), np.abs(b.z)).max(initial=0.0)
    return near and bool((np.abs(a.z - b.z) <= ADDED * SAME_STATE * largest).all())


def _is_at_rest(path: EvolutionPath, t0: float, t1: float, size: float) -> bool:
    """Tell whether nothing is dissipated between two times; by the memory where that is unknown."""
    try:
        lost, total = path.dissipated(t0, t1), path.dissipated(path.start, t1)
        return lost <= ADDED * SAME_STATE * total
    except SystemNeededError:
        slack, stretches = ADDED * SAME_STATE * size, path.stretches(t0, t1)
        return all((np.abs(b.memory - a.memory) <= slack).all() for a, b in stretches)


def _drifts(states: list[EvolutionState], drift: Array, size: float) -> bool:
    """Tell whether the memory changed, and by the same amount in the period before."""
    if len(states) < 3:
        return False
    before, slack = states[1].memory - states[2].memory, ADDED * SAME_STATE * size
    return bool((np.abs(drift) > slack).any() and (np.abs(drift - before) <= slack).all())
