"""A way through any corner: the path of the perturbed cone problem (docs/theory, F12).

The rays of a corner are the solutions of the cone problem H'(x; d) = 0, which is piecewise linear
and homogeneous. For a generic constant e the solutions of H'(x; d) = e are paths that cross one
interface at a time. Far out a path has the direction of a ray: so whoever comes along one ray, and
follows the path beside that ray to its other end, has found another. That takes about one crossing
per test that vanishes, where the cells number two to that power.

The constant e is never formed: a path is given by one of its points, s r + w beside the ray r, with
w generic, and e is H' there.

Failure modes and answers
-------------------------
- A ray runs along interfaces: w chooses one of the cells in whose closure the ray lies.
- Tests with parallel gradients vanish together wherever the path is: they change sign together.
- A generic number is not generic enough, or rounding leads the path astray: directions are checked
  against the matrix of each cell, and whoever asks verifies the ray at the end on its own.
- A path that does not begin at a ray may be closed: it ends where it comes back to its first cell.
- The path is as long as the number of cells, which happens in examples made for it: it is given up.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Signs, generic
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.metric import Metric
from pwscont.curve.rank_one import by_columns
from pwscont.linear.factorise import bordered, last_unit
from pwscont.linear.updates import ProductForm
from pwscont.linear.vectors import Rows
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem

#: A path that crosses more interfaces than this, and than so many per vanishing test, is given up.
MOST_CROSSINGS, CROSSINGS_PER_TEST = 1000, 20
#: A direction is one of its cell where its residual is below this part of its terms.
ASTRAY = EPS**0.5


@final
class PerturbedCone:
    """The paths of H'(x; d) = e at a corner, for generic e.

    Parameters
    ----------
    system : PiecewiseSystem
    metric : Metric
    x : ndarray, shape (n + 1,)
    zero : frozenset of int
        The tests that vanish at x.

    Attributes
    ----------
    crossings : int
        The interfaces crossed so far, on all paths.
    """

    def __init__(
        self, system: PiecewiseSystem, metric: Metric, x: Array, zero: frozenset[int]
    ) -> None:
        self.system, self.metric, self.x = system, metric, x
        self.crossings = 0
        self._zero = np.array(sorted(zero), dtype=np.intp)
        self._tests = system.test_functions(x[:-1], float(x[-1]))
        rows = system.some_test_gradients(x[:-1], float(x[-1]), self._zero)
        self._gradients = Rows(rows)

    def away(self, shift: int) -> Array:
        """Return a generic direction; each but the first comes with its opposite."""
        side = -1.0 if shift % 2 else 1.0
        return side * generic(len(self.x), float(shift // 2)) * self.metric.scale

    def character(self, d: Array, beside: Array | None = None) -> Character:
        """Return the character of the cell that d points into; where d is level, ``beside``."""
        return self._character(self._signs(d, d if beside is None else beside))

    def _signs(self, d: Array, beside: Array) -> Signs:
        """Return on which side of each interface d is; where it is on one, ``beside``."""
        values, others = self._gradients.matrix @ d, self._gradients.matrix @ beside
        level = np.abs(values) <= self._rounding(d)
        signs: Signs = np.where(level, others, values) >= 0.0
        return signs

    def _rounding(self, d: Array) -> Array:
        rounding: Array = GUARD * EPS * (self._gradients.magnitudes @ np.abs(d))
        return rounding

    def _character(self, signs: Signs) -> Character:
        tests = self._tests.copy()
        tests[self._zero] = np.where(signs, 1.0, -1.0)
        return Character.of(tests)

    def across(self, ray: Array, away: Array) -> tuple[Character, Array] | None:
        """Follow the path beside a ray, from far out towards the corner and on to its other end.

        Parameters
        ----------
        ray : ndarray, shape (n + 1,)
            Leads away from the corner.
        away : ndarray, shape (n + 1,)
            A generic direction, to the side of which the path lies.

        Returns
        -------
        (Character, ndarray) or None
            The last cell, and the direction of the path there.
        """
        slopes, values = self._gradients.matrix @ ray, self._gradients.matrix @ away
        steep = np.abs(slopes) > np.sqrt(EPS) * (self._gradients.magnitudes @ np.abs(ray))
        far = float(np.abs(values[steep] / slopes[steep]).max(initial=0.0))
        return self.along(self.character(ray, away), 2.0 * far * ray + away, -ray)

    def along(
        self, character: Character, d: Array, towards: Array
    ) -> tuple[Character, Array] | None:
        """Follow the path through d in a cell, in the direction nearest to ``towards``."""
        cell, begun = _Cell.at(self, character), self.system.cell(character)
        if cell is None:
            return None
        cell.head(self.metric.covector(towards))
        for _ in range(MOST_CROSSINGS + CROSSINGS_PER_TEST * len(self._zero)):
            check_budget()
            first = self._first(cell, d)
            if first is None:
                return cell.character, cell.tangent
            k, s = first
            d = d + s * cell.tangent
            gradient = self._gradients.some(np.array([k]))[0]
            signs = self._signs(d, cell.tangent)
            signs[k] = float(gradient.dot(cell.tangent)) > 0.0
            self.crossings += 1
            ahead = self._character(signs)
            if self.system.cell(ahead) == begun or not cell.cross(ahead, gradient):
                return None
        return None

    def _first(self, cell: _Cell, d: Array) -> tuple[int, float] | None:
        """Return which test vanishes first on the way, and how far off; None where none does."""
        inside = np.isin(self._zero, cell.selection.bounding)
        side = np.where(cell.character.array[self._zero], 1.0, -1.0)
        slopes = side * (self._gradients.matrix @ cell.tangent)
        falling = np.flatnonzero(inside & (slopes < -self._rounding(cell.tangent)))
        if not len(falling):
            return None
        values = np.maximum((side * (self._gradients.matrix @ d))[falling], 0.0)
        distances = values / -slopes[falling]
        first = int(np.argmin(distances))
        return int(falling[first]), float(distances[first])


@final
class _Cell:
    """The cell in which a path is: H' is J d there, and changes by rank one from cell to cell."""

    def __init__(self, cone: PerturbedCone, selection: Selection) -> None:
        self._cone, self.selection = cone, selection
        self._row = generic(len(cone.x)) / cone.metric.scale
        self._jacobian = selection.jacobian(cone.x)
        self._sizes = abs(self._jacobian) @ cone.metric.scale
        self._solver: ProductForm
        self.tangent: Array

    @classmethod
    def at(cls, cone: PerturbedCone, character: Character) -> _Cell | None:
        """Return a cell, factorised; None where J d = e has more solutions than a line."""
        cell = cls(cone, Selection(cone.system, character))
        return cell if cell._factorise() else None

    @property
    def character(self) -> Character:
        """The character of the cell."""
        return self.selection.character

    def head(self, row: Array) -> None:
        """Turn the tangent so that a row has a positive product with it."""
        if float(row.dot(self.tangent)) < 0.0:
            self.tangent = -self.tangent

    def cross(self, character: Character, gradient: Array) -> bool:
        """Enter the cell beyond an interface; tell whether the path goes on there."""
        before, ahead = self._jacobian, float(gradient.dot(self.tangent))
        self.selection = Selection(self._cone.system, character)
        self._jacobian = self.selection.jacobian(self._cone.x)
        jump = by_columns(before, self._jacobian, gradient, self._cone.metric.scale)
        if not (self._update(jump, gradient) or self._factorise()):
            return False
        self.head(ahead * gradient)
        size = self._cone.metric.norm(self.tangent)
        astray = np.abs(self._jacobian @ self.tangent) > ASTRAY * size * self._sizes
        return not bool(astray.any())

    def _update(self, jump: Array, gradient: Array) -> bool:
        if self._solver.is_full:
            return False
        w = self._solver.solve(np.append(jump, 0.0))
        pivot = self._solver.change(w, gradient)
        if pivot == 0.0:
            return False
        self.tangent = self.tangent - (float(gradient.dot(self.tangent)) / pivot) * w
        return True

    def _factorise(self) -> bool:
        factor = bordered(self._jacobian, self._row, self._cone.metric.binary)
        if factor.is_singular():
            return False
        self._solver = ProductForm(factor, len(self._row))
        self.tangent = factor.solve(last_unit(len(self._row)))
        return True
