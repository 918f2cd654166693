"""What the signs of a character say of its cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pwscont import Character
from pwscont.extending import Indices
from pwscont_coulomb.modes import Flags, bounds


class Cell(NamedTuple):
    """A cell of a problem.

    Attributes
    ----------
    bounding : ndarray of int
        The tests that bound it, not to be written to.
    name : bytes, length 3 p
        The signs that matter, plus one, and 0 for a test that does not bound the cell.
    """

    bounding: Indices
    name: bytes

    @classmethod
    def of(
        cls, character: Character, mode: Indices, without_friction: Flags, guided: Flags
    ) -> Cell:
        """Return the cell of these modes, where some nodes have F = 0, and some are guided."""
        is_bound = bounds(mode, without_friction, guided)
        bounding: Indices = is_bound.nonzero()[0]
        bounding.flags.writeable = False
        signs = character.array.view(np.uint8) + np.uint8(1)
        return cls(bounding, (signs * is_bound).tobytes())
