"""The units of lengths and stresses, for pictures only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Units:
    """The names of units, such as ``Units("mm", "MPa")``; nothing is converted.

    Attributes
    ----------
    length, stress : str
        Empty if not given.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Units
    >>> Units(length="mm", stress="MPa").length
    'mm'
    """

    length: str = ""
    stress: str = ""

    def with_length(self, words: str) -> str:
        """Return the name of a length with unit."""
        return f"{words} [{self.length}]" if self.length else words

    def with_stress(self, words: str) -> str:
        """Return the name of a stress with unit."""
        return f"{words} [{self.stress}]" if self.stress else words


UNITLESS = Units()
