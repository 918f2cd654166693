"""Places of points, stored with the essential unknowns only (see ``Compact``).

The mode of a contact node fixes two of its four unknowns. Only the other two are stored.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.graph.place import Place, Stored, first_digits, from_first_digits
from pwscont.system.compact import Compact
from pwscont.system.reduction import Reduction
from pwscont.system.system import PiecewiseSystem


def place(system: PiecewiseSystem, character: Character, x: Array, error: Array) -> Place:
    """Return the place of a solution x, shape (n + 1,), with its error, as small as it gets."""
    essential = system.essential(character) if isinstance(system, Compact) else None
    if essential is None:
        return Stored(x, error)
    assert isinstance(system, Compact)
    return Packed(system, character, x[essential], float(x[-1]), error[essential], error[-1])


@final
class Packed(Place):
    """A place that stores only the essential unknowns of its cell."""

    __slots__ = ("_alpha", "_character", "_error", "_system", "_values")

    def __init__(
        self,
        system: Compact,
        character: Character,
        values: Array,
        alpha: float,
        error: Array,
        error_of_alpha: float,
    ) -> None:
        self._system, self._character = system, character
        self._values, self._alpha = values, alpha
        self._error = first_digits(np.append(error, error_of_alpha))

    @property
    def alpha(self) -> float:
        """The parameter."""
        return self._alpha

    @property
    def x(self) -> Array:
        """The point, a new array."""
        return np.append(self._completed(self._values), self._alpha)

    @property
    def error(self) -> Array:
        """The estimate of its error."""
        *essential, of_alpha = from_first_digits(self._error)
        spread = self._completed(np.array(essential)) - self._completed(np.zeros(len(essential)))
        return np.append(np.abs(spread), of_alpha)

    def _completed(self, values: Array) -> Array:
        return self._system.completed(values, self._alpha, self._character)


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
