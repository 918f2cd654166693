"""Systems in whose solutions some components determine all others."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.character import Character


class Compact(ABC):
    """A system of whose special points only the essential components are stored.

    Every other component is a multiple of one essential component, plus a constant.
    """

    __slots__ = ()

    @abstractmethod
    def essential(self, character: Character) -> Indices | None:
        """Return which components of z determine the others on this selection, None for all."""

    @abstractmethod
    def completed(self, values: Array, alpha: float, character: Character) -> Array:
        """Return z, shape (n,), from the components that :meth:`essential` names."""
