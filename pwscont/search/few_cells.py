"""Solutions, and zeros of test functions, of systems of few cells: all cells in a batch.

The point at which a test vanishes on the line of a cell solves a system of linear equations, as
does the point at which alpha has a given value. For few cells all equations are solved together;
points that may lie in the closed cells are then corrected together, by the functions of the system.
A study of many tiny systems takes 1.5 times as long without this batch.

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

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs, dense, generic, indices, joined, own_dense
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS
from pwscont.curve.error_samples import Found, magnitude
from pwscont.curve.metric import Metric
from pwscont.enumeration.slices import FEW_CELLS, REFINEMENTS
from pwscont.graph.records import FEW_DIGITS, significant
from pwscont.linear.factorise import last_unit
from pwscont.search.linear_batch import LinearBatch
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.promises import checked_necessary, is_bent, refuse_bent, refuse_bent_tests
from pwscont.system.system import PiecewiseLinearSystem, characters, number_of_cells
from pwscont.system.values import expect

#: Most unknowns of a system that is solved in a batch; larger systems gain nothing.
FEW_UNKNOWNS = 64
#: Largest error of a point of the batch, as a part of typical magnitudes plus the point's own.
ROUGH = 1e2 * EPS**0.5


@final
@dataclass(frozen=True, eq=False)
class FewCells:
    """Equations J dx + H = 0 of the lines of all cells, and functions K dx + kappa, from x on.

    Attributes
    ----------
    system : PiecewiseLinearSystem
    metric : Metric
    x, scale : ndarray, shape (n + 1,)
        A point at the lower end of the interval, and typical magnitudes of dx, for alpha the length
        of the interval.
    cells : list of Character
    J, H : ndarray, shapes (c, n, n + 1) and (c, n)
    K, kappa : ndarray, shapes (m + 1, n + 1) and (m + 1,)
        The tests and a further function: alpha from the lower end on, which bounds no cell.
    sides, bounding : ndarray, shape (c, m + 1)
        The factors that make functions positive in each cell, and which functions bound the cell.
    """

    system: PiecewiseLinearSystem
    metric: Metric
    x: Array
    scale: Array
    cells: list[Character]
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

        None if cells or unknowns are too many. The blocks of the system have been checked.
        """
        blocks = system.blocks()
        if number_of_cells(blocks) > FEW_CELLS or system.size > FEW_UNKNOWNS:
            return None
        x = joined(np.zeros(system.size), interval[0])
        scale = joined(metric.scale[:-1], interval[1] - interval[0])
        dx = scale * np.abs(generic(len(x)))
        kappa = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        K = own_dense(system.test_jacobian(x[:-1], float(x[-1])))
        refuse_bent_tests(system, x, dx, kappa, K)
        cells = list(characters(blocks, len(kappa)))
        forms = (
            *_affine(system, cells, x, dx),
            np.vstack([K, last_unit(len(x))]),
            joined(kappa, 0.0),
        )
        return cls(system, metric, x, scale, cells, *forms, *_borders(system, cells, len(kappa)))

    def solutions(self) -> list[Found] | None:
        """Return all solutions at the lower end of the interval.

        None if the batch is not certain: if a point lies on an interface, or is known to few
        digits, if no solution is found, or the signs of det(dH/dz) do not sum to the degree.
        """
        checked_necessary(self.system, float(self.x[-1]))  # refused if wrong, otherwise not needed
        points, _ = self._points
        if points is None:
            return None
        found, meeting = points.found(), points.holding
        if (np.count_nonzero(meeting, axis=1) > 1).any() or any(map(self._has_few_digits, found)):
            return None
        inside = meeting[np.arange(len(found)), points.cells].nonzero()[0]
        signs = int(points.equations.among(inside).signs().sum())
        known = len(inside) and self.system.degree in (None, signs)
        return [found[i] for i in inside.tolist()] if known else None

    def crossings(self) -> list[tuple[int, Found]] | None:
        """Return all points where a test that bounds a cell vanishes, each with the test.

        Ordered by tests; alpha may be outside the interval by the error of alpha. None if the
        batch is not certain.
        """
        _, points = self._points
        if points is None:
            return None
        every = zip(points.places(), points.found(), points.holding, strict=True)
        crossings: list[tuple[int, Found]] = []
        known: set[tuple[int, int]] = set()
        for (test, cell), found, holding in every:
            if holding[cell] and (test, cell) not in known:
                crossings.append((test, found))
                known.update((test, other) for other in holding.nonzero()[0].tolist())
        return crossings

    @cached_property
    def _points(self) -> tuple[_OnLines | None, _OnLines | None]:
        """The points at the lower end, and the zeros of tests, from a single batch if regular."""
        tests, crossed = np.nonzero(self.bounding.T)
        cells = np.arange(len(self.cells))
        ends = np.full(len(cells), len(self.kappa) - 1)
        both = self._where(np.concatenate([cells, crossed]), np.concatenate([ends, tests]))
        if both is None:
            return self._where(cells, ends), self._where(crossed, tests)
        number = np.count_nonzero(both.functions == ends[0])
        return both.among(slice(number)), both.among(slice(number, None))

    def _where(self, cells: Indices, functions: Indices) -> _OnLines | None:
        """Return where functions vanish on the lines of cells, without points clearly outside.

        None if equations are nearly singular, or corrections do not become rounding.
        """
        rows = np.concatenate([self.J[cells], self.K[functions, np.newaxis]], axis=1)
        equations = LinearBatch.of(rows, self.scale)
        if equations is None:
            return None
        values = np.concatenate([self.H[cells], self.kappa[functions, np.newaxis]], axis=1)
        y = -equations.solve(values)
        some = self._may_hold(cells, functions, y).nonzero()[0]
        return self._solved(cells[some], functions[some], equations.among(some), y[some])

    def _may_hold(self, cells: Indices, functions: Indices, y: Array) -> Signs:
        """Tell which points may lie in the closed cells, between the ends of the interval.

        At each point the function vanishes.
        """
        slack = ROUGH * (1.0 + np.abs(y).max(axis=1, keepdims=True))
        values = self.sides[cells] * (y @ (self.K * self.scale).T + self.kappa)
        sizes = np.abs(self.K) @ self.scale + np.abs(self.kappa)
        outside = self.bounding[cells] & (values < -slack * sizes)
        outside[np.arange(len(cells)), functions] = False
        alpha = y[:, -1:]
        outside[:, -1:] = (alpha < -slack) | (alpha > 1.0 + slack)
        may_hold: Signs = ~outside.any(axis=1)
        return may_hold

    def _solved(
        self, cells: Indices, functions: Indices, equations: LinearBatch, y: Array
    ) -> _OnLines | None:
        """Return points near the points of the batch, corrected by the functions of the system."""
        x = self.x + self.scale * y
        for _ in range(REFINEMENTS):
            values = self._values(x)
            dy = equations.solve(self._rest(cells, functions, x, values))
            dx = self.scale * dy
            x, values = x - dx, values - dx @ self.K.T
            sizes = np.abs(x) / self.scale + np.abs(dy).max(axis=1, keepdims=True)
            errors = equations.errors(sizes)
            known = np.maximum(CONVERGED * (1.0 + np.abs(y)), CONFIDENCE * _root(errors))
            if (np.abs(dy) <= known).all():
                x[functions == len(self.kappa) - 1, -1] = self.x[-1]
                errors *= self.scale
                holding = self._holding(x, errors, values)
                return _OnLines(cells, functions, equations, x, errors, holding)
        return None

    def _rest(self, cells: Indices, functions: Indices, x: Array, values: Array) -> Array:
        """Return H, and the value of the function that shall vanish, shape (k, n + 1)."""
        rest = np.empty_like(x)
        for row, cell, point in zip(rest, cells.tolist(), x, strict=True):
            check_budget()
            row[:-1] = residual_at(self.system, point[:-1], float(point[-1]), self.cells[cell])
        rest[:, -1] = values[np.arange(len(x)), functions]
        return rest

    def _values(self, x: Array) -> Array:
        """Return the functions at points, shape (k, m + 1)."""
        values, shape = np.empty((len(x), len(self.kappa))), (len(self.kappa) - 1,)
        for row, point in zip(values, x, strict=True):
            tests = self.system.test_functions(point[:-1], float(point[-1]))
            expect(self.system, "test_functions", tests, shape)
            row[:-1] = tests
        values[:, -1] = x[:, -1] - self.x[-1]
        return values

    def _holding(self, x: Array, error: Array, values: Array) -> Signs:
        """Tell in which closed cells points with these values of functions lie, shape (k, c)."""
        sizes, spread = np.abs(self.K), _root(error @ self.K.T)
        rounding = EPS * (np.abs(x) @ sizes.T)
        slack = CONFIDENCE * (rounding + spread) + EPS * (sizes @ self.metric.scale)
        inside = self.sides * values[:, np.newaxis] >= -slack[:, np.newaxis]
        holding: Signs = np.all(~self.bounding | inside, axis=2)
        return holding

    def _has_few_digits(self, found: Found) -> bool:
        """Tell whether a point lost digits."""
        x, error = found
        return significant(magnitude(x, error), x, self.metric.scale) < FEW_DIGITS


@final
@dataclass(frozen=True, slots=True, eq=False)
class _OnLines:
    """Points on the lines of k cells, where functions vanish.

    Attributes
    ----------
    cells, functions : ndarray of int, shape (k,)
    equations : LinearBatch
    x, error : ndarray, shapes (k, n + 1) and (k, number, n + 1)
        The points and samples of the errors of the points.
    holding : ndarray of bool, shape (k, c)
        In which closed cells the points lie.
    """

    cells: Indices
    functions: Indices
    equations: LinearBatch
    x: Array
    error: Array
    holding: Signs

    def among(self, some: slice) -> _OnLines:
        """Return some of the points."""
        equations, holding = self.equations.among(some), self.holding[some]
        places, points = (self.cells[some], self.functions[some]), (self.x[some], self.error[some])
        return _OnLines(*places, equations, *points, holding)

    def found(self) -> list[Found]:
        """Return each point with samples of the error of the point."""
        return list(zip(self.x, self.error, strict=True))

    def places(self) -> Iterator[tuple[int, int]]:
        """Yield the function and the cell of each point."""
        return zip(self.functions.tolist(), self.cells.tolist(), strict=True)


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


def _borders(
    system: PiecewiseLinearSystem, cells: list[Character], tests: int
) -> tuple[Array, Signs]:
    """Return the signs of all functions in each cell, and which functions bound the cell."""
    sides, bounding = (
        np.ones((len(cells), tests + 1)),
        np.zeros((len(cells), tests + 1), dtype=bool),
    )
    for i, cell in enumerate(cells):
        sides[i, :-1] = np.where(cell.array, 1.0, -1.0)
        bounding[i, indices(system.bounding_tests(cell))] = True
    return sides, bounding
