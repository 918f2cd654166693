"""Systems for which there are searches of their kind."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any


class BringsSearches(ABC):
    """A system for which there are searches of its kind.

    They are added to the default of :func:`pwscont.explore` where trying every cell would take
    too long.
    """

    __slots__ = ()

    @abstractmethod
    def searches(self) -> Sequence[Any]:
        """Return these searches, each a :class:`~pwscont.Search`."""
