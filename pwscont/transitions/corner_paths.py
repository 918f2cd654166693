"""Rays of a corner with too many cells, along paths of a perturbed problem (docs/theory, F12).

The rays of a corner are the solutions of the cone problem H'(x; d) = 0, which is piecewise linear
and homogeneous. For a generic constant e the solutions of H'(x; d) = e are paths that cross one
interface at a time, and far out a path has the direction of a ray. Following the path beside a
known ray to the other end of the path therefore leads to another ray, in about one crossing per
vanishing test. The constant e is never formed: a path is given by a point s r + w beside the ray r,
with w generic, and e is H' there.

Every direction returned is a ray, verified by the matrix of the cell of the ray and the signs of
the slopes. Rays to which no path was followed may be missing. A path that is closed, led astray by
rounding, or meets nearly all cells is given up.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, generic, joined
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.error_samples import zero_up_to
from pwscont.linear.factor import ProductForm
from pwscont.linear.factorise import Rows, bordered, kink_by_columns, last_unit
from pwscont.system.selection import Selection
from pwscont.transitions.corner import Corner, Direction
from pwscont.transitions.rays import ASTRAY, SLANT, are_parallel

#: Paths that are followed from each ray, each with a perturbation of its own.
PATHS_PER_RAY = 4
#: Once two rays are known, no path begins after this many crossings on all paths together.
ENOUGH_CROSSINGS = 500
#: Most interfaces that one path crosses: this number, and this number per vanishing test.
MOST_CROSSINGS, CROSSINGS_PER_TEST = 1000, 20
#: Generic directions away from a ray along interfaces in which the cells around the ray are named.
MOST_AROUND = 16
#: Most cells that are tried for the ray at the end of a path: rounding may name a cell beside.
MOST_REPAIRS = 8


def rays_by_perturbation(corner: Corner, back: Direction | None) -> list[Direction]:
    """Return rays of a corner; there may be more.

    ``back``: the ray along which the corner was reached, returned as well if verified.
    """
    paths, found = Paths(corner), list[Direction]()
    if back is None or not _add(paths, found, (back[1][0], back[0])):
        for start in map(paths.away, range(PATHS_PER_RAY)):  # paths that begin anywhere
            for towards in () if found else (start, -start):
                _add(paths, found, paths.along(paths.character(start), start, towards))
    for direction, _ in found:  # grows meanwhile
        for shift in range(PATHS_PER_RAY):
            if len(found) > 1 and paths.crossings > ENOUGH_CROSSINGS:
                return found
            _add(paths, found, paths.across(direction, paths.away(shift)))
    return found


def _add(paths: Paths, found: list[Direction], end: tuple[Character, Array] | None) -> bool:
    """Add the ray of a cell next to the end of a path, unless known; tell whether there is one."""
    if end is None:
        return False
    (character, direction), corner, metric = end, paths.corner, paths.corner.metric
    for _ in range(MOST_REPAIRS):
        if (exact := corner.ray_in(Selection(corner.system, character))) is None:
            return False
        side = np.copysign(1.0, float(metric.covector(exact[0]).dot(direction)))
        ray, slopes = side * exact[0], side * exact[1]
        if not are_parallel(metric, ray, metric.normalised(direction)):
            return False
        if (slopes >= 0.0).all():
            break
        character = paths.character(ray)  # rounding has named a cell beside
    else:
        return False
    cells = [character]
    if not slopes.all():
        cells += [paths.character(ray, paths.away(shift)) for shift in range(MOST_AROUND)]
    if not any(are_parallel(metric, ray, known) for known, _ in found):
        cells.sort(key=lambda cell: cell.signs, reverse=True)  # rounding does not name the first
        found.append((ray, tuple({corner.system.cell(cell): cell for cell in cells}.values())))
    return True


@final
class Paths:
    """The paths of H'(x; d) = e at a corner, for generic e, and all ``crossings``."""

    def __init__(self, corner: Corner) -> None:
        self.corner, self.crossings = corner, 0
        self._zero, self._gradients = corner.which, Rows(corner.gradients)

    def away(self, shift: int) -> Array:
        """Return a generic direction, for odd numbers the opposite of the direction before."""
        side = -1.0 if shift % 2 else 1.0
        return side * generic(len(self.corner.x), float(shift // 2)) * self.corner.metric.scale

    def character(self, d: Array, beside: Array | None = None) -> Character:
        """Return the character of the cell that d points into; where d is level, ``beside``."""
        tests, values = self.corner.tests.copy(), self._gradients.matrix @ d
        others = values if beside is None else self._gradients.matrix @ beside
        tests[self._zero] = np.where(np.abs(values) <= self._rounding(d), others, values)
        return Character.of(tests)

    def _rounding(self, d: Array, part: float = GUARD * EPS) -> Array:
        return zero_up_to(self._gradients.magnitudes, np.abs(d), part=part)

    def across(self, ray: Array, away: Array) -> tuple[Character, Array] | None:
        """Follow the path beside a ray, from far out towards the corner and on to the other end.

        The path lies to the side of the generic direction ``away``. Return the last cell, and the
        direction of the path there.
        """
        slopes, values = self._gradients.matrix @ ray, self._gradients.matrix @ away
        steep = np.abs(slopes) > self._rounding(ray, SLANT)
        last_crossing = float(np.abs(values[steep] / slopes[steep]).max(initial=0.0))
        return self.along(self.character(ray, away), 2.0 * last_crossing * ray + away, -ray)

    def along(
        self, character: Character, d: Array, towards: Array
    ) -> tuple[Character, Array] | None:
        """Follow the path through d in a cell, in the direction nearest to ``towards``.

        H' is J d in a cell, and J changes by rank one between cells (F1).
        """
        corner, metric, size = self.corner, self.corner.metric, len(d)
        ahead, row = metric.covector(towards), generic(size) / metric.scale
        begun, solver, tangent = corner.system.cell(character), None, towards
        jacobian: Matrix = None
        for _ in range(MOST_CROSSINGS + CROSSINGS_PER_TEST * len(self._zero)):
            check_budget()
            selection = Selection(corner.system, character)
            before, jacobian, pivot = jacobian, selection.jacobian(corner.x), 0.0
            if solver and not solver.is_full:
                jump = kink_by_columns(before, jacobian, ahead, metric.scale)
                w = solver.solve(joined(jump, 0.0))
                if pivot := solver.change(w, ahead):
                    tangent = tangent - (float(ahead.dot(tangent)) / pivot) * w
            if not pivot:
                factor = bordered(jacobian, row, metric.binary)
                if factor.is_singular():  # J d = e has more solutions than a line
                    return None
                sizes, solver = abs(jacobian) @ metric.scale, ProductForm(factor, size)
                tangent = factor.solve(last_unit(size))
            tangent = np.copysign(1.0, float(ahead.dot(tangent))) * tangent
            if (np.abs(jacobian @ tangent) > ASTRAY * metric.norm(tangent) * sizes).any():
                return None
            k, distance = self._first_crossing(selection, d, tangent)
            if np.isinf(distance):
                return character, tangent
            d, gradient = d + distance * tangent, self._gradients.one(k)
            is_positive = float(gradient.dot(tangent)) > 0.0
            ahead = gradient if is_positive else -gradient
            character = self.character(d, tangent).with_sign(int(self._zero[k]), is_positive)
            self.crossings += 1
            if corner.system.cell(character) == begun:
                return None
        return None

    def _first_crossing(self, selection: Selection, d: Array, tangent: Array) -> tuple[int, float]:
        """Return which test vanishes first on the way, and at what distance; infinite for none."""
        side = np.where(selection.character.array[self._zero], 1.0, -1.0)
        slopes = side * (self._gradients.matrix @ tangent)
        falling = np.isin(self._zero, selection.bounding) & (slopes < -self._rounding(tangent))
        values = np.maximum(side * (self._gradients.matrix @ d), 0.0)
        distances = np.where(falling, values, np.inf) / np.where(falling, -slopes, 1.0)
        return int(distances.argmin()), float(distances.min())
