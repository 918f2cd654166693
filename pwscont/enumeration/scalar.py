"""Parts of one unknown, as in chains: solved by a division in each of their modes.

The same decisions as :mod:`pwscont.enumeration.slices` makes for larger parts, without matrices.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.enumeration.by_parts import PartSlice
from pwscont.enumeration.point import Point, Slice


def solve_scalar(part: PartSlice, scale: float) -> Slice | None:
    """Return all solutions of a part with one unknown; None where a mode does not decide it.

    Parameters
    ----------
    part : PartSlice
    scale : float
        The typical magnitude of the unknown.
    """
    modes = part.blocks()[0].modes if part.blocks() else ((),)
    found: list[_Root] = []
    for character in map(Character, modes):
        tests = np.array(part.bounding_tests(character), dtype=np.intp)
        side = character.array[tests]
        known = next((root for root in found if root.lies_in(tests, side)), None)
        if known is None:
            known = _Root.of(part, character, scale)
            if known is None:
                return None
            if not known.lies_in(tests, side):
                continue
            found.append(known)
        known.cells.append(character)
        known.in_doubt |= not known.lies_in(tests, side, inside=True)
    return Slice(tuple(root.point() for root in found), ())


@final
@dataclass(slots=True, eq=False)
class _Root:
    """The solution of one mode, with all tests, and how far these may be off."""

    x: float
    error: Array
    sign: int
    tests: Array
    slack: Array
    cells: list[Character] = field(default_factory=list)
    in_doubt: bool = False

    @classmethod
    def of(cls, part: PartSlice, character: Character, scale: float) -> _Root | None:
        """Solve one mode; None where its equation does not depend on the unknown."""
        slope, value, errors = part.scalar_row(character)
        if slope == 0.0:
            return None
        x = -value / slope
        error = np.append(errors / slope, EPS * abs(x))
        gradients, values, inherited = part.scalar_tests()
        off = EPS * np.abs(gradients * x) + np.abs(gradients) * float(np.hypot.reduce(error))
        slack = CONFIDENCE * (off + inherited) + EPS * scale * np.abs(gradients)
        return cls(x, error, 1 if slope > 0.0 else -1, gradients * x + values, slack)

    def lies_in(self, tests: Indices, side: Signs, inside: bool = False) -> bool:
        """Tell whether the solution lies in a closed cell, or certainly inside."""
        values = np.where(side, self.tests[tests], -self.tests[tests])
        slack = self.slack[tests]
        return bool((values > slack).all() if inside else (values >= -slack).all())

    def point(self) -> Point:
        """Return the solution with an idle parameter of zero."""
        error = np.column_stack([self.error, np.zeros(len(self.error))])
        in_doubt = self.in_doubt and len(self.cells) == 1
        return Point(np.array([self.x, 0.0]), error, tuple(self.cells), self.sign, (), in_doubt)
