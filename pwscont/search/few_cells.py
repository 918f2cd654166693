"""Solutions, and zeros of test functions, of systems of few cells: all cells in a batch.

The point at which a test vanishes on the line of a cell solves a system of linear equations, as
does the point at which alpha has a given value. For few cells all equations are solved together;
points that may lie in the closed cells are then corrected together, by the functions of the system.
A study of tiny systems takes 1.5 to 2.5 times as long without this batch.

Failure modes and answers
-------------------------
- A line runs along the interface, or a cell has no line, so that equations are singular or nearly
  singular: nothing is said, and the search that decides ranks exactly does all the work.
- The batch knows points to half of all digits only: a sign that may be rounding leaves no point
  out. The errors of the corrected points decide which points lie inside.
- A point of an interface is a solution in all cells that meet there, and the only solution where
  the equations of the cells are regular: the point is listed once.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs, dense, generic, indices, joined, own_dense
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.error_samples import Found, magnitude, samples
from pwscont.curve.metric import Metric
from pwscont.enumeration.slices import FEW_CELLS, REFINEMENTS
from pwscont.graph.records import FEW_DIGITS, significant
from pwscont.linear.factorise import last_unit
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.promises import checked_necessary, is_bent, refuse_bent, refuse_bent_tests
from pwscont.system.system import PiecewiseLinearSystem, characters, number_of_cells
from pwscont.system.values import expect

#: Most unknowns of a system that is solved in a batch; larger systems gain nothing.
FEW_UNKNOWNS = 64
#: Largest error of a point of the batch, as a part of typical magnitudes plus the point's own.
ROUGH = 1e2 * EPS**0.5
#: Largest condition number of equations that are solved in a batch: half of all digits are right.
WORST_CONDITION = EPS**-0.5


class _OnLines(NamedTuple):
    """Points on the lines of k cells, where functions vanish."""

    cells: Indices
    functions: Indices
    x: Array
    error: Array  # samples of the errors of x, shape (k, number, n + 1)
    signs: Array  # of the determinants of the equations
    holding: Signs  # in which closed cells the points lie, shape (k, c)

    def among(self, some: slice | Indices) -> _OnLines:
        """Return some of the points."""
        return _OnLines._make(part[some] for part in self)

    def found(self) -> list[Found]:
        """Return each point with samples of the error of the point."""
        return list(zip(self.x, self.error, strict=True))


class _Equations(NamedTuple):
    """Regular linear equations of k points, in typical magnitudes."""

    rows: Array  # of largest entry 1, shape (k, n + 1, n + 1)
    inverse: Array
    largest: Array  # the numbers by which the rows were divided

    def among(self, some: Indices) -> _Equations:
        """Return the equations of some points."""
        return _Equations._make(part[some] for part in self)

    def solve(self, values: Array) -> Array:
        """Return the unknowns, shape (k, n + 1), from right-hand sides of that shape."""
        unknowns: Array = (self.inverse @ (values / self.largest)[..., np.newaxis])[..., 0]
        return unknowns

    def errors(self, sizes: Array) -> Array:
        """Return samples of the errors of unknowns of given sizes, as newton.uncertainty does."""
        rounding = EPS * (np.abs(self.rows) @ sizes[..., np.newaxis])
        return np.swapaxes(self.inverse @ (rounding * samples(sizes.shape[1]).T), 1, 2)


def _equations(rows: Array) -> _Equations | None:
    """Return equations with these coefficients, None if a matrix is nearly singular."""
    largest = np.abs(rows).max(axis=2)
    if not largest.all():
        return None
    rows = rows / largest[..., np.newaxis]
    try:
        inverse = np.asarray(np.linalg.inv(rows), dtype=float)
    except np.linalg.LinAlgError:
        return None
    condition = np.abs(rows).sum(axis=1).max(axis=1) * np.abs(inverse).sum(axis=1).max(axis=1)
    return _Equations(rows, inverse, largest) if (condition <= WORST_CONDITION).all() else None


@final
class FewCells:
    """Equations J dx + H = 0 of the lines of all cells, and functions K dx + kappa, from x on.

    The point x is z = 0 at the lower end of the interval. The functions are all tests and, last,
    alpha from the lower end on, which bounds no cell.
    """

    def __init__(
        self, system: PiecewiseLinearSystem, metric: Metric, interval: tuple[float, float]
    ) -> None:
        self._system, self._typical = system, metric.scale
        self._x = x = joined(np.zeros(system.size), interval[0])
        self._scale = joined(metric.scale[:-1], interval[1] - interval[0])
        dx = self._scale * np.abs(generic(len(x)))
        tests = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        gradients = own_dense(system.test_jacobian(x[:-1], float(x[-1])))
        refuse_bent_tests(system, x, dx, tests, gradients)
        self._cells = list(characters(system.blocks(), len(tests)))
        self._J, self._H = _affine(system, self._cells, x, dx)
        self._K, self._kappa = np.vstack([gradients, last_unit(len(x))]), joined(tests, 0.0)
        self._sides = np.ones((len(self._cells), len(self._kappa)))
        self._bounding = np.zeros(self._sides.shape, dtype=bool)
        for cell, side, bounds in zip(self._cells, self._sides, self._bounding, strict=True):
            side[:-1] = np.where(cell.array, 1.0, -1.0)
            bounds[indices(system.bounding_tests(cell))] = True

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
        points, _ = self._points
        if points is None or (np.count_nonzero(points.holding, axis=1) > 1).any():
            return None
        digits = (significant(magnitude(*f), f[0], self._typical) for f in points.found())
        if any(number < FEW_DIGITS for number in digits):
            return None
        inside = points.among(points.holding[np.arange(len(points.x)), points.cells].nonzero()[0])
        is_known = self._system.degree in (None, int(inside.signs.sum()))
        return inside.found() if len(inside.x) and is_known else None

    def crossings(self) -> list[tuple[int, Found]] | None:
        """Return all points where a test that bounds a cell vanishes, each with the test.

        Ordered by tests; alpha may be outside the interval by the error of alpha. None if the
        batch is not certain.
        """
        _, points = self._points
        if points is None:
            return None
        places = points.functions.tolist(), points.cells.tolist()
        crossings: list[tuple[int, Found]] = []
        known: set[tuple[int, int]] = set()
        for test, cell, found, holding in zip(*places, points.found(), points.holding, strict=True):
            if holding[cell] and (test, cell) not in known:
                crossings.append((test, found))
                known.update((test, other) for other in holding.nonzero()[0].tolist())
        return crossings

    @cached_property
    def _points(self) -> tuple[_OnLines | None, _OnLines | None]:
        """The points at the lower end, and the zeros of tests, from a single batch if regular."""
        tests, crossed = np.nonzero(self._bounding.T)
        cells = np.arange(len(self._cells))
        ends = np.full(len(cells), len(self._kappa) - 1)
        both = self._where(np.concatenate([cells, crossed]), np.concatenate([ends, tests]))
        if both is None:
            return self._where(cells, ends), self._where(crossed, tests)
        number = np.count_nonzero(both.functions == ends[0])
        return both.among(slice(number)), both.among(slice(number, None))

    def _where(self, cells: Indices, functions: Indices) -> _OnLines | None:
        """Return where functions vanish on lines, if not clearly outside; None if not certain."""
        rows = np.concatenate([self._J[cells], self._K[functions, np.newaxis]], axis=1)
        equations = _equations(rows * self._scale)
        if equations is None:
            return None
        values = np.concatenate([self._H[cells], self._kappa[functions, np.newaxis]], axis=1)
        y = -equations.solve(values)
        some = self._may_hold(cells, functions, y).nonzero()[0]
        return self._solved(cells[some], functions[some], equations.among(some), y[some])

    def _may_hold(self, cells: Indices, functions: Indices, y: Array) -> Signs:
        """Tell which zeros of functions may lie in the closed cells, inside the interval."""
        slack = ROUGH * (1.0 + np.abs(y).max(axis=1, keepdims=True))
        values = self._sides[cells] * (y @ (self._K * self._scale).T + self._kappa)
        sizes = np.abs(self._K) @ self._scale + np.abs(self._kappa)
        outside = self._bounding[cells] & (values < -slack * sizes)
        outside[np.arange(len(cells)), functions] = False
        alpha = y[:, -1:]
        outside[:, -1:] = (alpha < -slack) | (alpha > 1.0 + slack)
        may_hold: Signs = ~outside.any(axis=1)
        return may_hold

    def _solved(
        self, cells: Indices, functions: Indices, equations: _Equations, y: Array
    ) -> _OnLines | None:
        """Return points near the points of the batch, corrected by the functions of the system."""
        x = self._x + self._scale * y
        for _ in range(REFINEMENTS):
            values = self._values(x)
            dy = equations.solve(self._rest(cells, functions, x, values))
            dx = self._scale * dy
            x, values = x - dx, values - dx @ self._K.T
            sizes = np.abs(x) / self._scale + np.abs(dy).max(axis=1, keepdims=True)
            errors = equations.errors(sizes)
            known = np.maximum(CONVERGED * (1.0 + np.abs(y)), CONFIDENCE * _root(errors))
            if (np.abs(dy) <= known).all():
                x[functions == len(self._kappa) - 1, -1] = self._x[-1]
                errors *= self._scale
                signs = np.linalg.slogdet(equations.rows)[0]
                holding = self._holding(x, errors, values)
                return _OnLines(cells, functions, x, errors, signs, holding)
        return None

    def _rest(self, cells: Indices, functions: Indices, x: Array, values: Array) -> Array:
        """Return H, and the value of the function that shall vanish, shape (k, n + 1)."""
        rest = np.empty_like(x)
        for row, cell, point in zip(rest, cells.tolist(), x, strict=True):
            check_budget()
            row[:-1] = residual_at(self._system, point[:-1], float(point[-1]), self._cells[cell])
        rest[:, -1] = values[np.arange(len(x)), functions]
        return rest

    def _values(self, x: Array) -> Array:
        """Return the functions at points, shape (k, m + 1)."""
        values, shape = np.empty((len(x), len(self._kappa))), (len(self._kappa) - 1,)
        for row, point in zip(values, x, strict=True):
            tests = self._system.test_functions(point[:-1], float(point[-1]))
            expect(self._system, "test_functions", tests, shape)
            row[:-1] = tests
        values[:, -1] = x[:, -1] - self._x[-1]
        return values

    def _holding(self, x: Array, error: Array, values: Array) -> Signs:
        """Tell in which closed cells points with these values of functions lie, shape (k, c)."""
        sizes, spread = np.abs(self._K), _root(error @ self._K.T)
        rounding = EPS * (np.abs(x) @ sizes.T)
        slack = CONFIDENCE * (rounding + spread) + EPS * (sizes @ self._typical)
        inside = self._sides * values[:, np.newaxis] >= -slack[:, np.newaxis]
        holding: Signs = np.all(~self._bounding | inside, axis=2)
        return holding


def _root(error: Array) -> Array:
    """Return the root of the sum of squares of samples, shape (k, l)."""
    root: Array = np.abs(np.hypot.reduce(error, axis=1))  # squares may overflow
    return root


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
