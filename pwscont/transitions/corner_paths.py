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

from pwscont.basics.arrays import Array, generic
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
    selection = Selection(corner.system, character)
    exact = corner.direction_in(selection)
    if exact is None:
        return False
    ray = np.copysign(1.0, float(metric.covector(exact).dot(direction))) * exact
    slopes = corner.slopes_along(selection, ray)
    if not are_parallel(metric, ray, metric.normalised(direction)) or (slopes < 0.0).any():
        return False
    cells = [character]
    if not slopes.all():
        cells += [paths.character(ray, paths.away(shift)) for shift in range(MOST_AROUND)]
    if not any(are_parallel(metric, ray, known) for known, _ in found):
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
        """Follow the path through d in a cell, in the direction nearest to ``towards``."""
        corner = self.corner
        cell, begun = _PathInCell(corner, character), corner.system.cell(character)
        if not cell.factorise():
            return None
        cell.head(corner.metric.covector(towards))
        for _ in range(MOST_CROSSINGS + CROSSINGS_PER_TEST * len(self._zero)):
            check_budget()
            first = self._first_crossing(cell, d)
            if first is None:
                return cell.selection.character, cell.tangent
            k, distance = first
            d = d + distance * cell.tangent
            gradient = self._gradients.some(np.array([k]))[0]
            is_positive = float(gradient.dot(cell.tangent)) > 0.0
            ahead = self.character(d, cell.tangent).with_sign(int(self._zero[k]), is_positive)
            self.crossings += 1
            if corner.system.cell(ahead) == begun or not cell.cross(ahead, gradient):
                return None
        return None

    def _first_crossing(self, cell: _PathInCell, d: Array) -> tuple[int, float] | None:
        """Return which test vanishes first on the way, and how far off; None where none does."""
        inside = np.isin(self._zero, cell.selection.bounding)
        side = np.where(cell.selection.character.array[self._zero], 1.0, -1.0)
        slopes = side * (self._gradients.matrix @ cell.tangent)
        falling = np.flatnonzero(inside & (slopes < -self._rounding(cell.tangent)))
        if not len(falling):
            return None
        values = np.maximum((side * (self._gradients.matrix @ d))[falling], 0.0)
        distances = values / -slopes[falling]
        first = int(np.argmin(distances))
        return int(falling[first]), float(distances[first])


@final
class _PathInCell:
    """The cell in which a path is: H' is J d there, and J changes by rank one between cells."""

    def __init__(self, corner: Corner, character: Character) -> None:
        self._corner, self.selection = corner, Selection(corner.system, character)
        self._row = generic(len(corner.x)) / corner.metric.scale
        self._jacobian = self.selection.jacobian(corner.x)
        self._sizes = abs(self._jacobian) @ corner.metric.scale
        self._solver: ProductForm
        self.tangent: Array

    def head(self, row: Array) -> None:
        """Turn the tangent so that the product of a row and the tangent is positive."""
        if float(row.dot(self.tangent)) < 0.0:
            self.tangent = -self.tangent

    def cross(self, character: Character, gradient: Array) -> bool:
        """Enter the cell beyond an interface; tell whether the path goes on there."""
        before, ahead = self._jacobian, float(gradient.dot(self.tangent))
        self.selection = Selection(self._corner.system, character)
        self._jacobian = self.selection.jacobian(self._corner.x)
        jump = kink_by_columns(before, self._jacobian, gradient, self._corner.metric.scale)
        pivot = 0.0
        if not self._solver.is_full:
            w = self._solver.solve(np.append(jump, 0.0))
            pivot = self._solver.change(w, gradient)
        if pivot:
            self.tangent = self.tangent - (ahead / pivot) * w
        elif not self.factorise():
            return False
        self.head(ahead * gradient)
        size = self._corner.metric.norm(self.tangent)
        astray = np.abs(self._jacobian @ self.tangent) > ASTRAY * size * self._sizes
        return not bool(astray.any())

    def factorise(self) -> bool:
        """Factorise the cell; False where J d = e has more solutions than a line."""
        factor = bordered(self._jacobian, self._row, self._corner.metric.binary)
        if factor.is_singular():
            return False
        self._solver = ProductForm(factor, len(self._row))
        self.tangent = factor.solve(last_unit(len(self._row)))
        return True
