"""Solutions, and where test functions vanish, for systems of few cells: all cells in one batch.

Where a test vanishes on the line of a cell is one system of linear equations, as is where alpha has
a value. For few cells they are solved together; a point that may lie in its closed cell is then
solved for once more, with the functions of the system themselves.

Failure modes and answers
-------------------------
- A line runs along the interface, or a cell has no line: its equations are singular, or nearly so.
  Nothing is said then, and the search that decides ranks exactly does all the work.
- The batch knows points to half of their digits only: what may be rounding is no reason to leave a
  point out. What lies inside is decided by the errors of the point that is solved for last.
- A point of an interface is a solution in all cells that meet there, and where their equations are
  regular the only one: it is solved for once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs, dense, own_dense
from pwscont.basics.budget import check_budget
from pwscont.basics.generic import generic
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import EPS
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import magnitude, slack_of_values
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Border, newton
from pwscont.curve.root import Root
from pwscont.curve.uncertainty import uncertainty
from pwscont.enumeration.slices import FEW_CELLS, REFINEMENTS
from pwscont.graph.accuracy import significant
from pwscont.graph.records import FEW_DIGITS
from pwscont.linear.factorise import last_unit
from pwscont.search.enumeration import Found
from pwscont.system.blocks import characters, number_of_cells
from pwscont.system.promises import checked_necessary, refuse_bent, refuse_bent_tests
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem

#: Systems of more unknowns gain nothing.
FEW_UNKNOWNS = 64
#: Equations with a larger condition number are not solved in a batch.
WORST = EPS**-0.5
#: What a point of the batch may be wrong by, as a part of typical magnitudes and its own.
ROUGH = 1e2 * EPS**0.5


@final
@dataclass(frozen=True, slots=True, eq=False)
class FewCells:
    """Equations J dx + H = 0 of the lines of all cells, and tests K dx + kappa, from x on.

    Attributes
    ----------
    system : PiecewiseLinearSystem
    metric : Metric
    x, scale : ndarray, shape (n + 1,)
        At the lower end of the interval, and typical magnitudes of dx, of alpha the length of it.
    selections : list of Selection
    J, H : ndarray, shapes (c, n, n + 1) and (c, n)
    K, kappa : ndarray, shapes (m, n + 1) and (m,)
    sides, bounding : ndarray, shape (c, m)
        By what tests are multiplied to be positive in each cell, and whether they bound it.
    """

    system: PiecewiseLinearSystem
    metric: Metric
    x: Array
    scale: Array
    selections: list[Selection]
    J: Array
    H: Array
    K: Array
    kappa: Array
    sides: Array
    bounding: Signs

    @classmethod
    def of(
        cls, system: PiecewiseLinearSystem, metric: Metric, interval: tuple[float, float]
    ) -> FewCells | None:
        """Return the lines of a system, whose functions are checked to be affine.

        None where there are too many cells or unknowns. Its blocks have been checked.
        """
        if number_of_cells(system.blocks()) > FEW_CELLS or system.size > FEW_UNKNOWNS:
            return None
        x = np.append(np.zeros(system.size), interval[0])
        scale = np.append(metric.scale[:-1], interval[1] - interval[0])
        dx = scale * np.abs(generic(len(x)))
        kappa = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        K = own_dense(system.test_jacobian(x[:-1], float(x[-1])))
        refuse_bent_tests(system, x, dx, kappa, K)
        cells = characters(system.blocks(), len(kappa))
        selections = [Selection(system, character) for character in cells]
        bounding = np.zeros((len(selections), len(kappa)), dtype=bool)
        for row, selection in zip(bounding, selections, strict=True):
            row[selection.bounding] = True
        J, H = zip(*(_affine(selection, x, dx) for selection in selections), strict=True)
        sides = np.where([selection.character.array for selection in selections], 1.0, -1.0)
        forms = np.array(J), np.array(H), K, kappa
        return cls(system, metric, x, scale, selections, *forms, sides, bounding)

    def solutions(self) -> list[Found] | None:
        """Return all solutions at the lower end of the interval.

        None where this way is not certain: where a point lies on an interface, or is known to few
        digits, where there is none, or the signs of det(dH/dz) do not sum to the degree.
        """
        checked_necessary(self.system, float(self.x[-1]))  # not needed, but refused if wrong
        cells, row = np.arange(len(self.selections)), last_unit(len(self.x))
        y = self._points(cells, np.tile(row, (len(cells), 1)), np.zeros(len(cells)))
        if y is None:
            return None
        found, signs = [], 0
        for cell in np.flatnonzero(self._may_hold(cells, y)).tolist():
            root = self._solved(cell, lambda x: (float((x - self.x)[-1]), row), y[cell])
            if isinstance(root, Failure):
                return None
            point = np.append(root.x[:-1], self.x[-1]), uncertainty(root)
            meeting = self._holding(point)
            if np.count_nonzero(meeting) > 1 or self._has_few_digits(point):
                return None
            if meeting[cell]:
                found.append(point)
                signs += root.factor.sign
        return found if found and self.system.degree in (None, signs) else None

    def crossings(self) -> list[tuple[int, Found]] | None:
        """Return all points where a test that bounds a cell vanishes, each with the test.

        Ordered by tests; alpha may be outside the interval by its error. None where this way is not
        certain.
        """
        tests, cells = np.nonzero(self.bounding.T)
        y = self._points(cells, self.K[tests], self.kappa[tests])
        if y is None:
            return None
        found: list[tuple[int, Found]] = []
        known: set[tuple[int, int]] = set()
        for i in np.flatnonzero(self._may_hold(cells, y, tests)):
            check_budget()
            test, cell = int(tests[i]), int(cells[i])
            if (test, cell) in known:
                continue
            root = self._solved(cell, _test_of(self.selections[cell], test), y[i])
            if isinstance(root, Failure):
                return None
            point = root.x, uncertainty(root)
            meeting = self._holding(point)
            if meeting[cell]:
                found.append((test, point))
                known |= {(test, int(other)) for other in np.flatnonzero(meeting)}
        return found

    def _points(self, cells: Indices, borders: Array, values: Array) -> Array | None:
        """Return dx in typical magnitudes where functions vanish on the lines of several cells.

        None where one of the equations is nearly singular.
        """
        rows = np.concatenate([self.J[cells], borders[:, np.newaxis]], axis=1) * self.scale
        values = np.column_stack([self.H[cells], values])
        largest = np.abs(rows).max(axis=2)
        if not largest.all():
            return None
        rows /= largest[..., np.newaxis]
        try:
            inverse = np.linalg.inv(rows)
        except np.linalg.LinAlgError:
            return None
        condition = np.abs(rows).sum(axis=1).max(axis=1) * np.abs(inverse).sum(axis=1).max(axis=1)
        if not (condition <= WORST).all():
            return None
        points: Array = -(inverse @ (values / largest)[..., np.newaxis])[..., 0]
        return points

    def _may_hold(self, cells: Indices, y: Array, tests: Indices | None = None) -> Signs:
        """Tell which points may lie in their closed cells, between the ends of the interval.

        ``tests`` are those that vanish, one at each point.
        """
        slack = ROUGH * (1.0 + np.abs(y).max(axis=1, initial=0.0))
        values = self.sides[cells] * (y @ (self.K * self.scale).T + self.kappa)
        sizes = np.abs(self.K) @ self.scale + np.abs(self.kappa)
        outside = self.bounding[cells] & (values < -slack[:, np.newaxis] * sizes)
        if tests is not None:
            outside[np.arange(len(tests)), tests] = False
        between: Signs = (y[:, -1] >= -slack) & (y[:, -1] <= 1.0 + slack)
        between &= ~outside.any(axis=1)
        return between

    def _solved(self, cell: int, border: Border, y: Array) -> Root | Failure:
        """Return the point near one of the batch where a function vanishes in a cell."""
        # its alpha may be outside the interval by rounding
        curve = Curve(self.selections[cell], Metric(self.metric.scale))
        return newton(curve, border, self.x + self.scale * y, REFINEMENTS)

    def _holding(self, found: Found) -> Signs:
        """Tell in which closed cells a point lies, shape (c,)."""
        (x, error), system = found, self.system
        gradients = system.test_jacobian(x[:-1], float(x[-1]))
        values = system.test_functions(x[:-1], float(x[-1]))
        slack = slack_of_values(gradients, x, error, self.metric.scale)
        holding: Signs = np.all(~self.bounding | (self.sides * values >= -slack), axis=1)
        return holding

    def _has_few_digits(self, found: Found) -> bool:
        """Tell whether a point lost its digits."""
        x, error = found
        return significant(magnitude(x, error), x, self.metric.scale) < FEW_DIGITS


def _test_of(selection: Selection, test: int) -> Border:
    """Return a test that bounds a cell, with its gradient."""
    index = int(np.flatnonzero(selection.bounding == test)[0])
    return lambda x: (selection.test(x, index), selection.test_gradient(x, index))


def _affine(selection: Selection, x: Array, dx: Array) -> tuple[Array, Array]:
    """Return the Jacobian of a selection and its value at x; it must be affine up to x + dx."""
    jacobian = dense(selection.jacobian(x))
    residual = selection.residual(x)
    refuse_bent(selection.system, selection.character, x, dx, residual, jacobian)
    return jacobian, residual
