"""Solutions, and zeros of test functions, of systems of few cells: all cells in a batch.

The point at which a test vanishes on the line of a cell solves a system of linear equations, as
does the point at which alpha has a given value. For few cells all equations are solved together,
and each point that may lie in the closed cell is corrected by Newton's method. A study of tiny
systems takes twice as long without this batch.

A line may run along an interface, and a cell may have no line: equations are singular then, or
nearly singular. Nothing is said of such systems, and the search that decides ranks exactly does all
the work.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs, dense, generic, joined, own_dense
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import EPS
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found, magnitude, slack_of_values
from pwscont.curve.metric import Metric
from pwscont.curve.newton import newton, uncertainty
from pwscont.enumeration.slices import FEW_CELLS, REFINEMENTS
from pwscont.graph.records import FEW_DIGITS, significant
from pwscont.linear.factorise import last_unit
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.promises import checked_necessary, is_bent, refuse_bent, refuse_bent_tests
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, characters, number_of_cells

#: Most unknowns of a system that is solved in a batch; larger systems gain nothing.
FEW_UNKNOWNS = 64
#: Largest error of a point of the batch, as a part of typical magnitudes plus the point's own.
ROUGH = 1e2 * EPS**0.5
#: Largest condition number of equations that are solved in a batch: half of all digits are right.
WORST_CONDITION = EPS**-0.5


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Zero:
    """The point on the line of a cell at which a function vanishes."""

    function: int
    found: Found
    det_sign: int  # of the equations
    cells: Indices  # the closed cells in which the point lies


@final
class FewCells:
    """Equations J dx + H = 0 of the lines of all cells, and functions K dx + kappa, from x on.

    The point x is z = 0 at the lower end of the interval. The functions are all tests and, last,
    alpha from the lower end on, which bounds no cell.
    """

    def __init__(
        self, system: PiecewiseLinearSystem, metric: Metric, interval: tuple[float, float]
    ) -> None:
        self._system, self._metric = system, Metric(metric.scale)
        self._x = x = joined(np.zeros(system.size), interval[0])
        self._scale = joined(metric.scale[:-1], interval[1] - interval[0])
        dx = self._scale * np.abs(generic(len(x)))
        tests = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        gradients = own_dense(system.test_jacobian(x[:-1], float(x[-1])))
        refuse_bent_tests(system, x, dx, tests, gradients)
        cells = list(characters(system.blocks(), len(tests)))
        self._J, self._H = _affine(system, cells, x, dx)
        self._K, self._kappa = np.vstack([gradients, last_unit(len(x))]), joined(tests, 0.0)
        self._lines = [Curve(Selection(system, cell), self._metric) for cell in cells]
        self._sides = np.zeros((len(cells), len(self._kappa)))  # 0 for tests that bound no cell
        for sides, line in zip(self._sides, self._lines, strict=True):
            sides[line.selection.bounding] = line.selection.side

    @classmethod
    def of(
        cls, system: PiecewiseLinearSystem, metric: Metric, interval: tuple[float, float]
    ) -> FewCells | None:
        """Return the lines of a system, whose functions are checked to be affine.

        None if cells or unknowns are too many. The blocks of the system have been checked.
        """
        if number_of_cells(system.blocks()) > FEW_CELLS or system.size > FEW_UNKNOWNS:
            return None
        return cls(system, metric, interval)

    def solutions(self) -> list[Found] | None:
        """Return all solutions at the lower end of the interval.

        None if the batch is not certain: if a point lies on an interface, or is known to few
        digits, if no solution is found, or the signs of det(dH/dz) do not sum to the degree.
        """
        checked_necessary(self._system, float(self._x[-1]))  # refused if wrong, not needed if right
        cells = np.arange(len(self._lines))
        zeros = self._zeros(cells, np.full(len(cells), len(self._kappa) - 1))
        if not zeros or any(len(zero.cells) > 1 for zero in zeros):
            return None
        found, scale = [zero.found for zero in zeros], self._metric.scale
        if any(significant(magnitude(*f), f[0], scale) < FEW_DIGITS for f in found):
            return None
        degree = sum(zero.det_sign for zero in zeros)
        return found if self._system.degree in (None, degree) else None

    def crossings(self) -> list[tuple[int, Found]] | None:
        """Return all points where a test that bounds a cell vanishes, each with the test.

        Ordered by tests; alpha may be outside the interval by the error of alpha. None if the
        batch is not certain.
        """
        tests, cells = np.nonzero(self._sides.T)
        zeros = self._zeros(cells, tests)
        return None if zeros is None else [(zero.function, zero.found) for zero in zeros]

    def _zeros(self, cells: Indices, functions: Indices) -> list[_Zero] | None:
        """Return where functions vanish on lines within closed cells; None if not certain.

        A point of an interface lies in all cells that meet there, and is listed once.
        """
        rows = np.concatenate([self._J[cells], self._K[functions, np.newaxis]], axis=1)
        values = np.column_stack([self._H[cells], self._kappa[functions]])
        y = _solved(rows * self._scale, -values)
        if y is None:
            return None
        zeros: list[_Zero] = []
        known: set[tuple[int, int]] = set()
        for i in np.flatnonzero(self._may_hold(cells, functions, y)):
            check_budget()
            cell, function = int(cells[i]), int(functions[i])
            if (cell, function) in known:
                continue
            zero = self._corrected(cell, function, self._x + self._scale * y[i])
            if zero is None:
                return None
            if cell in zero.cells:
                zeros.append(zero)
                known.update((other, function) for other in zero.cells.tolist())
        return zeros

    def _may_hold(self, cells: Indices, functions: Indices, y: Array) -> Signs:
        """Tell which zeros of functions may lie in the closed cells, inside the interval."""
        slack = ROUGH * (1.0 + np.abs(y).max(axis=1, keepdims=True))
        values = self._sides[cells] * (y @ (self._K * self._scale).T + self._kappa)
        outside = values < -slack * (np.abs(self._K) @ self._scale + np.abs(self._kappa))
        outside[np.arange(len(cells)), functions] = False
        alpha = y[:, -1:]
        outside[:, -1:] = (alpha < -slack) | (alpha > 1.0 + slack)
        may_hold: Signs = ~outside.any(axis=1)
        return may_hold

    def _corrected(self, cell: int, function: int, x: Array) -> _Zero | None:
        """Return the zero of a function on a line near ``x``; None where Newton fails."""
        row, start = self._K[function], self._x

        def border(x: Array) -> tuple[float, Array]:
            if function == len(self._kappa) - 1:
                return float(x[-1] - start[-1]), row
            return float(self._system.test_functions(x[:-1], float(x[-1]))[function]), row

        root = newton(self._lines[cell], border, x, REFINEMENTS)
        if isinstance(root, Failure):
            return None
        x, error = root.x, uncertainty(root)
        if function == len(self._kappa) - 1:
            x[-1] = start[-1]
        tests = self._system.test_functions(x[:-1], float(x[-1]))
        slack = slack_of_values(self._K[:-1], x, error, self._metric.scale)
        inside = (self._sides[:, :-1] * tests >= -slack).all(axis=1)
        return _Zero(function, (x, error), root.factor.sign, np.flatnonzero(inside))


def _solved(rows: Array, values: Array) -> Array | None:
    """Return the solutions of several linear equations; None if a matrix is nearly singular."""
    largest = np.abs(rows).max(axis=2)
    if not largest.all():
        return None
    rows = rows / largest[..., np.newaxis]
    try:
        inverse = np.linalg.inv(rows)
    except np.linalg.LinAlgError:
        return None
    condition = np.abs(rows).sum(axis=1).max(axis=1) * np.abs(inverse).sum(axis=1).max(axis=1)
    if not (condition <= WORST_CONDITION).all():
        return None
    solved: Array = (inverse @ (values / largest)[..., np.newaxis])[..., 0]
    return solved


def _affine(
    system: PiecewiseLinearSystem, cells: list[Character], x: Array, dx: Array
) -> tuple[Array, Array]:
    """Return Jacobians and values of selections at x; refuse selections not affine to x + dx."""

    def values(at: Array) -> Array:
        return np.array([residual_at(system, at[:-1], float(at[-1]), cell) for cell in cells])

    z, alpha = x[:-1], float(x[-1])
    J = np.array([dense(jacobian_at(system, z, alpha, cell)) for cell in cells])
    H = values(x)
    if is_bent(values(x + dx), H, J, dx):  # by more than rounding of terms that cancel?
        for cell, residual, jacobian in zip(cells, H, J, strict=True):
            refuse_bent(system, cell, x, dx, residual, jacobian)
    return J, H
