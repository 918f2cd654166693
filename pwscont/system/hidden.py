"""Systems with unknowns that nobody needs to see."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.system.system import PiecewiseSystem


class HidesUnknowns(ABC):
    """A system whose last unknowns follow from the others, and are shown to nobody.

    The methods of the system know all ``size`` unknowns. A user gives and gets the first ``shown``
    of them: starts, solutions, special points, names, events, recorded quantities and files. A
    user's own detectors, steppers and searches see all.

    Attributes
    ----------
    shown : int
        How many unknowns a user knows of.
    """

    __slots__ = ()

    shown: int

    @abstractmethod
    def with_hidden(self, z: Array, alpha: float) -> Array:
        """Return all unknowns, shape (size,), from those that are shown, shape (shown,)."""


def shown_size(system: PiecewiseSystem) -> int:
    """Return of how many unknowns a user knows."""
    return system.shown if isinstance(system, HidesUnknowns) else system.size


def completed(system: PiecewiseSystem, z: Array, alpha: float) -> Array:
    """Return all unknowns from those that a user knows."""
    return system.with_hidden(z, alpha) if isinstance(system, HidesUnknowns) else z


def completed_point(system: PiecewiseSystem, x: Array) -> Array:
    """Return (z, alpha) with all unknowns from the same with those that a user knows."""
    if not isinstance(system, HidesUnknowns):
        return x
    return np.append(system.with_hidden(x[:-1], float(x[-1])), x[-1])


def shown_points(system: PiecewiseSystem, points: Array) -> Array:
    """Return points (..., z, alpha), or errors of such, without the unknowns that are hidden."""
    if not isinstance(system, HidesUnknowns) or system.shown == system.size:
        return points
    return np.delete(points, np.s_[system.shown : system.size], axis=-1)


def all_names(system: PiecewiseSystem) -> tuple[str, ...]:
    """Return a name for every unknown, also for those that are hidden."""
    names = tuple(system.names())
    return (*names, *(f"hidden[{i}]" for i in range(system.size - len(names))))
