"""Ways on from a corner with too many cells: rays found by perturbation, each verified.

Failure modes and answers
-------------------------
- The path leads back to the ray it came along: other perturbations are tried, for every ray.
- A direction at the end of a path that is no ray of its cell is dropped.
- Rays of which no path was followed may be missing: whoever asks is told that there may be more.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.system.selection import Selection
from pwscont.transitions.corner.perturbed import PerturbedCone
from pwscont.transitions.corner.simple import Direction, only_direction, slopes_along

#: Perturbations that are tried for each ray.
TRIES = 4
#: Once two rays are known, no path begins after so many crossings.
ENOUGH = 500
#: Directions to the sides in which the cells are looked for that a ray along interfaces belongs to.
SIDES = 16
#: Two unit vectors are one when they are closer than this.
SAME = 1e-6


def ways(cone: PerturbedCone, zero: frozenset[int], back: Direction | None) -> list[Direction]:
    """Return rays of a corner, of which there may be more.

    Parameters
    ----------
    cone : PerturbedCone
    zero : frozenset of int
        The tests that vanish.
    back : Direction, optional
        The ray along which the corner was reached; it is returned too, if it is one.
    """
    known = _Rays(cone, zero)
    if back is None or not known.add(back[1][0], back[0]):
        known.add_ends()
    for direction, _ in known.found:  # grows meanwhile
        for shift in range(TRIES):
            if len(known.found) > 1 and cone.crossings > ENOUGH:
                return known.found
            if end := cone.across(direction, cone.away(shift)):
                known.add(*end)
    return known.found


class _Rays:
    """The rays found so far, each once."""

    def __init__(self, cone: PerturbedCone, zero: frozenset[int]) -> None:
        self._cone, self._zero = cone, zero
        self.found: list[Direction] = []

    def add_ends(self) -> None:
        """Add the rays at both ends of paths that begin anywhere, up to the first such ray."""
        for shift in range(TRIES):
            start = self._cone.away(shift)
            for towards in (start, -start):
                if end := self._cone.along(self._cone.character(start), start, towards):
                    self.add(*end)
            if self.found:
                return

    def add(self, character: Character, direction: Array) -> bool:
        """Add a direction, if it is a ray of the cell; tell whether it is."""
        ray = self._verified(character, direction)
        if ray is not None and not any(self._is_same(ray[0], d) for d, _ in self.found):
            self.found.append(ray)
        return ray is not None

    def _is_same(self, a: Array, b: Array) -> bool:
        return self._cone.metric.norm(a - b) < SAME

    def _verified(self, character: Character, direction: Array) -> Direction | None:
        """Return the ray of a cell next to a direction, None where there is none."""
        cone, metric = self._cone, self._cone.metric
        selection = Selection(cone.system, character)
        exact = only_direction(selection, metric, cone.x)
        if exact is None:
            return None
        ray = np.copysign(1.0, float(metric.covector(exact).dot(direction))) * exact
        slopes = slopes_along(selection, metric, cone.x, ray, self._zero)
        if not self._is_same(ray, metric.normalised(direction)) or (slopes < 0.0).any():
            return None
        return ray, (character,) if slopes.all() else self._cells_around(ray, character)

    def _cells_around(self, ray: Array, first: Character) -> tuple[Character, ...]:
        """Return cells in whose closure a ray along interfaces lies, the given one first."""
        name, cone = self._cone.system.cell, self._cone
        around = [cone.character(ray, cone.away(shift)) for shift in range(SIDES)]
        return tuple({name(c): c for c in [first, *around]}.values())
