"""Places of points, stored with the essential unknowns only (see ``Compact``).

The mode of a contact node fixes two of its four unknowns. Only the other two are stored.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.graph.place import Place, Stored, estimates, kept
from pwscont.system.compact import Compact
from pwscont.system.hidden import shown_points
from pwscont.system.reduction import Reduction
from pwscont.system.system import PiecewiseSystem


def place(system: PiecewiseSystem, character: Character, x: Array, error: Array) -> Place:
    """Return a solution of a selection and its error, of which no more is computed than stored.

    Parameters
    ----------
    system : PiecewiseSystem
    character : Character
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (n + 1,)
        The estimate of its error.
    """
    if not isinstance(system, Compact):
        return Stored(x, error)
    essential = system.essential(character)
    if essential is None:
        return Stored(x, error)
    known = np.append(essential, len(x) - 1)
    return Packed(system, character, x[known], error[known])


@final
class Packed(Place):
    """A place of which only alpha and the essential unknowns of a cell are stored.

    Parameters
    ----------
    system : Compact
    character : Character
    values, error : ndarray, shape (k + 1,)
        The essential unknowns, alpha last, and the estimate of their error.
    """

    __slots__ = ("_character", "_error", "_system", "_values")

    def __init__(self, system: Compact, character: Character, values: Array, error: Array) -> None:
        self._system, self._character = system, character
        self._values, self._error = values, kept(error)

    @property
    def alpha(self) -> float:
        """The parameter."""
        return float(self._values[-1])

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return np.append(self._completed(self._values[:-1]), self._values[-1])

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        error = estimates(self._error)
        spread = self._completed(error[:-1]) - self._completed(np.zeros(len(error) - 1))
        return np.append(np.abs(spread), error[-1])

    def _completed(self, values: Array) -> Array:
        return self._system.completed(values, self.alpha, self._character)


@final
class WithoutHidden(Place):
    """A place with the unknowns that a user knows of."""

    __slots__ = ("_place", "_system")

    def __init__(self, place: Place, system: PiecewiseSystem) -> None:
        self._place, self._system = place, system

    @property
    def alpha(self) -> float:
        """The parameter."""
        return self._place.alpha

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return shown_points(self._system, self._place.x)

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        return shown_points(self._system, self._place.error)


@final
class Lifted(Place):
    """A place of a reduced system, with all unknowns of the full one."""

    __slots__ = ("_place", "_reduction", "_size")

    def __init__(self, place: Place, reduction: Reduction, size: int) -> None:
        self._place, self._reduction, self._size = place, reduction, size

    @property
    def alpha(self) -> float:
        """The parameter."""
        return self._place.alpha

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return self._reduction.points(self._place.x, self._size)

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        return self._reduction.points(self._place.error, self._size)
