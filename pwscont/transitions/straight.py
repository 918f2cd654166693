"""Transitions of straight pieces: from cell to cell by one solve (docs/theory, F11).

With J' = J + c g^T on the other side of an interface (F1), where g is the gradient of the test that
vanishes, the solution of J w = c alone changes the direction, and the samples of the error of a
point, into those beyond. From time to time, in small systems always, and where residuals show that
directions have drifted, an *audit* solves for all samples afresh, together with corrections of
point and direction. Only audits ask for Jacobians that are large and not at hand.

Where tests vanish together, 1 + g.w is small beside 1 and g.w, the direction is nearly vertical or
in the interface, or an audit finds that the direction does not fit the new Jacobian, the piece is
left to the general detector, see :mod:`pwscont.transitions.bounding`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, final

import numpy as np

from pwscont.basics import arrays
from pwscont.basics.arrays import Array, Matrix, Signs, add_multiples
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD, HALF_DIGITS
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import MOST_WHOLE_INVERSE, magnitude, samples, zero_up_to
from pwscont.curve.metric import Range
from pwscont.curve.stepper import Segment
from pwscont.linear.factor import GROWTH, ProductForm
from pwscont.linear.factorise import Rows, column, inner, kink_by_columns, last_unit
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.system.abilities import Ending
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.system.values import own_array
from pwscont.transitions.bounding import BoundingTests, crossed
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.ends import at_end
from pwscont.transitions.rays import ASTRAY, SLANT, Ray
from pwscont.transitions.zeros import ratio_test


class Entered(NamedTuple):
    """A cell that a piece has entered, or inside which the piece begins."""

    state: State  # the point of the interface, on the piece that ends there; inside, of the ray
    ray: Ray  # the piece
    cell: StraightCell
    tests: Array  # all tests at the point, shape (m,)
    rates: Array  # the derivatives of the tests by alpha along the piece, shape (m,)


@final
class StraightTests(TransitionDetector):
    """Watches the tests that bound the current cell of a piecewise-linear system."""

    is_affine = True

    def __init__(self) -> None:
        self._slowly = BoundingTests()
        self._system: PiecewiseSystem | None = None
        self._rows: Rows  # the gradients of all tests of the system
        self._scale: Array  # of the metric
        self._last: Entered | None = None

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the bounding tests, positive inside, and their slopes."""
        return self._slowly.read(curve, state)

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Return the point of the interface, which the piece beyond has been found for."""
        self._last = last = self._across(segment.curve, segment.start, index, bracket[0])
        return last.state if last else self._slowly.locate(segment, index, bracket)

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Cross the interface; at a corner, take every way on."""
        if self._last is None or self._last.state is not state:
            return self._slowly.arrive(curve, state, index)
        return crossed(state.x, Ray(curve, state.reversed()), self._last.ray)

    def next(self, ray: Ray, interval: Range) -> SpecialPointFound | None:
        """Return where a piece ends, if no function has to be watched but the tests and alpha.

        None where that is hard, or if the ray begins at an interface but is not the ray beyond the
        last crossing: :meth:`read` and :meth:`locate` handle every ray.
        """
        state, last = ray.state, self._last
        if last is None or last.ray.state is not state:
            self._last = last = self._begun(ray)
        if last is None:
            return None
        slope, selection = float(state.tangent[-1]), ray.curve.selection
        end = interval[1] if slope > 0.0 else interval[0]
        room = (end - state.alpha) / slope if slope else np.inf
        # apart from the test that was crossed no test is zero: the piece runs along no interface
        values = selection.side * last.tests.take(selection.bounding)
        slopes = slope * selection.side * last.rates.take(selection.bounding)
        distances = ratio_test(values, slopes)
        first = int(distances.argmin()) if len(distances) else 0
        if not (len(distances) and distances[first] < room):
            return self._at_end(last, room, end)
        self._last = self._across(ray.curve, state, first, float(distances[first]))
        return self._last and self.arrive(ray.curve, self._last.state, first)

    def _begun(self, ray: Ray) -> Entered | None:
        """Return a ray that begins inside a cell; None where that is not clear."""
        curve, state, selection = ray.curve, ray.state, ray.curve.selection
        tests = self._tests_at(curve, state.x)
        if isinstance(selection.system, Ending) or not (len(tests) and arrays.are_finite(tests)):
            return None
        extent = arrays.largest(np.abs(state.x) / self._scale)
        is_inside = (selection.side * tests[selection.bounding] > 0.0).all()
        if not is_inside or self._near_zero(tests, extent, state.size).any():
            return None
        cell = self._cell_of(curve, state)
        return cell and Entered(state, ray, cell, tests, self._rows.dot(cell.along))

    def _at_end(self, last: Entered, room: float, end: float) -> SpecialPointFound | None:
        """Return the end of the interval at a distance, None where hard; leave the cell."""
        self._last, start = None, last.ray.state
        x = start.x + room * start.tangent
        x[-1] = end
        found = last.cell.corrected(x, last_unit(len(x)), 0.0) if np.isfinite(room) else None
        if not found:
            return None
        found.x[-1] = end  # equal up to rounding
        here = State(found.x, start.tangent, found.error, start.orientation, found.size)
        return at_end(last.ray.curve, here)

    def _tests_at(self, curve: Curve, x: Array) -> Array:
        """Return a copy of all tests at a point, shape (m,); know the gradients from here on."""
        system, scale = curve.selection.system, curve.metric.scale
        if self._system is not system or self._scale is not scale:
            self._system, self._scale = system, scale
            self._rows = Rows(system.test_jacobian(x[:-1], float(x[-1])))
            self._typical: Array = arrays.product(self._rows.magnitudes, scale)
        values = system.test_functions(x[:-1], float(x[-1]))
        return own_array(system, "test_functions", values, self._typical.shape)

    def _near_zero(self, tests: Array, extent: float, size: Array) -> Signs:
        """Tell which tests may be zero because of the error, or of a correction, of a point."""
        reach = GUARD * EPS * (1.0 + extent) + 2.0 * CONFIDENCE * arrays.largest(size / self._scale)
        return np.asarray(np.abs(tests) <= reach * self._typical)

    def _is_corner(self, before: Array, tests: Array, point: CorrectedPoint, but: int) -> bool:
        """Tell whether another test vanishes at a point, or has another sign than before."""
        near = self._near_zero(tests, point.extent, point.size).nonzero()[0]
        if not len(near := near[near != but]):
            return False  # nearly always
        turned = (tests[near] >= 0.0) != (before[near] >= 0.0)
        rows, sizes = self._rows.some(near), np.abs(point.x) + self._scale
        return bool((turned | (np.abs(tests[near]) <= zero_up_to(rows, sizes, point.error))).any())

    def _across(self, curve: Curve, start: State, index: int, s: float) -> Entered | None:
        """Return the point where a test vanishes, and the ray beyond; None where that is hard."""
        selection, x = curve.selection, start.x + s * start.tangent
        test = int(selection.bounding[index])
        if isinstance(selection.system, Ending) or not curve.metric.admits(x):
            return None
        cell, tests = self._cell_of(curve, start), self._tests_at(curve, x)
        gradient = self._rows.one(test)
        beyond = Character.of(tests).with_sign(test, bool(selection.side[index] < 0.0))
        other = Curve(Selection(selection.system, beyond), curve.metric)
        level = SLANT * np.abs(gradient).dot(np.abs(start.tangent))
        is_crossed = abs(gradient.dot(start.tangent)) > level
        if cell is None or not is_crossed or not other.selection.is_bounded_by(test):
            return None
        if not (point := cell.cross(other, x, test, gradient, float(tests[test]))):
            return None
        rates = self._rows.dot(cell.along)
        changes = point.along * rates
        if point.aside is not None:
            changes += self._rows.dot(arrays.joined(point.aside, 0.0))
        here = tests - changes
        if not arrays.are_finite(here) or self._is_corner(tests, here, point, test):
            return None
        # alpha reverses if the path turns
        forwards = cell.turn * math.copysign(1.0, start.tangent[-1])
        onwards, rest = (forwards / cell.length) * cell.along, (point.error, start.orientation)
        before = State(point.x, start.tangent, *rest, point.size)
        ray = Ray(cell.curve, State(point.x, onwards, *rest, point.size))
        return Entered(before, ray, cell, here, rates)

    def _cell_of(self, curve: Curve, start: State) -> StraightCell | None:
        """Return the cell of a piece, factorised afresh if the last cell is another cell."""
        cell = self._last and self._last.cell
        if self._last and self._last.ray.state is start:
            return cell
        if not cell or cell.curve.selection is not curve.selection:
            cell = None if curve.selection.adjacent_cells else StraightCell.at(curve, start.x)
        if not cell:
            return None
        row = curve.metric.covector(curve.metric.normalised(cell.along))
        return cell if abs(row.dot(start.tangent)) > 1.0 - HALF_DIGITS else None


#: Few unknowns, whose inverse is formed as a whole, are audited at every transition, all systems
#: after AUDIT_AFTER transitions: true errors of random bodies are then at most 1.6 times the stated
#: errors, and 2.8 times after 64 transitions.
AUDIT_AFTER = 24
#: Least number of transitions after which a residual above rounding asks for an audit: directions
#: have drifted.
DRIFTED_AFTER = 8
#: Systems of fewer unknowns are asked for Jacobians at every transition: two residuals cost more.
ASKED_FOR_JACOBIANS = 64
#: Least residual that is corrected, as a part of the terms of the same row: three quarters of the
#: residual that the stated error of the point covers.
UNSEEN = 0.75 * CONFIDENCE * EPS
#: Errors are estimated afresh if an unknown is larger than GROWN times the largest unknown of the
#: same typical magnitude at the last audit; a magnitude of a single unknown counts as an unknown.
GROWN = 2.0
#: How many times larger than all other unknowns an unknown is made, in typical magnitudes.
FAR_AWAY = 2.0**20


class CorrectedPoint(NamedTuple):
    """A point of an interface or of an end, after the correction."""

    x: Array
    error: Array  # samples of the error of x, shape (k, n + 1)
    size: Array  # the estimate of the error of x, shape (n + 1,)
    along: float  # by how much alpha was corrected along the piece
    aside: Array | None  # by how much z was corrected as well; None if not needed
    extent: float  # the largest component of x, in typical magnitudes


@final
class StraightCell:
    """The linear algebra of the cell in which a straight piece lies, led from cell to cell."""

    def __init__(self, curve: Curve, solver: ProductForm, along: Array) -> None:
        self.curve, self._solver = curve, solver
        self.turn = 1  # the sign of 1 + g.w where the cell was entered: -1 at a fold
        self.length = curve.metric.norm(along)
        system = curve.selection.system
        self._is_told = isinstance(system, PiecewiseLinearSystem) and system.knows_kinks
        self._jacobian: Matrix | None = None  # kept if kinks are read off Jacobians
        self._samples = samples(len(along))
        #: The direction of the piece, and samples of the error of points, with alpha component 0.
        self._lines = np.zeros((1 + len(self._samples), len(along)))
        self._lines[0] = along
        self.along: Array = self._lines[0]  # with alpha component 1; changes with the cell
        self._terms = np.empty(0)  # magnitudes of the terms of the rows of H at the last audit
        self._most, self._since = np.empty(0), AUDIT_AFTER
        scale = curve.metric.scale
        self._kinds = np.unique(scale, return_inverse=True, return_counts=True)

    @classmethod
    def at(cls, curve: Curve, x: Array) -> StraightCell | None:
        """Return the factorised cell of a curve; None where the Jacobian is next to singular."""
        jacobian, n = curve.selection.jacobian(x), len(x) - 1
        if not (core := inner(jacobian, curve.metric.binary)):
            return None
        solver = ProductForm(core, n)
        cell = cls(curve, solver, arrays.joined(-solver.solve(column(jacobian, n)), 1.0))
        is_at_hand = isinstance(jacobian, StructuredJacobian) and jacobian.is_at_hand
        is_cheap = n < ASKED_FOR_JACOBIANS or is_at_hand
        if not cell._is_told and (is_cheap or Box.of(curve.selection.system).is_bounded):
            cell._jacobian = jacobian
        return cell if cell._is_tame() else None

    def cross(
        self, other: Curve, x: Array, test: int, gradient: Array, value: float
    ) -> CorrectedPoint | None:
        """Lead into the cell of the curve ``other``, beyond the interface where a test vanishes.

        Return the point of the interface near ``x``, where the test has the given gradient and
        value. None if the correction is more than rounding, or cannot be computed: the cell is of
        no use then.
        """
        if self._solver.is_full and not self._has_renewed(self._jacobian_at(x)):
            return None
        before, jacobian, self.curve = self.curve.selection, self._jacobian, other
        kink: Array | None
        if self._is_told:
            kink = other.selection.kink(before, test)
        elif jacobian is None:
            kink = _kink_by_residuals(before, other, x, gradient)
        else:
            self._jacobian = other.selection.jacobian(x)
            kink = kink_by_columns(jacobian, self._jacobian, gradient, other.metric.scale)
        if kink is None:
            return None
        w = self._solver.solve(kink)
        pivot = self._solver.change(w, gradient[:-1])
        if pivot == 0.0:
            return None
        slopes = self._lines.dot(gradient) / pivot
        add_multiples(self._lines, -slopes, arrays.joined(w, 0.0))  # alpha does not change
        self.turn, self._since = 1 if pivot > 0.0 else -1, self._since + 1
        self.length = other.metric.norm(self.along)
        return self.corrected(x, gradient, value, slopes) if self._is_tame() else None

    def corrected(
        self, x: Array, gradient: Array, value: float, slopes: Array | None = None
    ) -> CorrectedPoint | None:
        """Return the point of the piece near ``x`` where a function vanishes, as :meth:`cross`.

        Audits correct the direction and the samples as well. ``slopes``: of the function along all
        lines, if known.
        """
        residual, sizes, aside = self.curve.selection.residual(x), np.abs(x), None
        is_due = self._since >= AUDIT_AFTER or len(sizes) <= MOST_WHOLE_INVERSE
        is_due = is_due or arrays.is_anywhere(sizes > self._most)
        is_off = not is_due and not arrays.is_everywhere(np.abs(residual) <= UNSEEN * self._terms)
        if is_due or (is_off and self._since >= DRIFTED_AFTER):
            if (aside := self._audited(x, sizes, residual)) is None:
                return None
            slopes = None
        elif is_off:
            aside = self._solver.solve(residual)
        slopes = self._lines.dot(gradient) if slopes is None else slopes
        if not slopes[0]:
            return None
        metric = self.curve.metric
        along = (value - (0.0 if aside is None else gradient[:-1].dot(aside))) / slopes[0]
        dx = along * self._lines[0]
        if aside is not None:
            dx[:-1] += aside
        error: Array = self._lines[1:].copy()  # and where the rounding of the test puts the point
        last = EPS * np.abs(gradient).dot(sizes) * self._samples[:, -1] - slopes[1:]
        add_multiples(error, last / slopes[0], self._lines[0])
        extent = arrays.largest(sizes / metric.scale)
        point = CorrectedPoint(x - dx, error, magnitude(sizes, error), along, aside, extent)
        # a correction is no more than the rounding and the error of the corrected point
        rounding = GUARD * EPS * extent * metric.scale + CONFIDENCE * point.size
        is_rounding = arrays.is_everywhere(np.abs(dx) <= rounding)
        return point if is_rounding and metric.admits(point.x) else None

    def _has_renewed(self, jacobian: Matrix) -> bool:
        """Factorise the Jacobian of the cell afresh; False for a singular Jacobian."""
        if core := inner(jacobian, self.curve.metric.binary):
            self._solver.renew(core)
        return bool(core)

    def _jacobian_at(self, x: Array) -> Matrix:
        return self.curve.selection.jacobian(x) if self._jacobian is None else self._jacobian

    def _is_tame(self) -> bool:
        """Tell whether the direction is finite, and far from vertical."""
        return self.length * self.curve.metric.width < GROWTH

    def _audited(self, x: Array, sizes: Array, residual: Array) -> Array | None:
        """Solve for errors, point and direction afresh; return the correction, None if astray."""
        n, along, scale = len(x) - 1, self.along, self.curve.metric.scale
        jacobian = self._jacobian_at(x)
        magnitudes, astray = abs(jacobian), jacobian.dot(along)
        self._most = sizes
        if n >= MOST_WHOLE_INVERSE:
            typical, kinds, shared = self._kinds  # of magnitudes
            most = np.where(shared == 1, typical, 0.0)
            np.maximum.at(most, kinds, sizes)
            self._most = GROWN * most[kinds]
        self._terms = arrays.product(magnitudes, self._most + CONVERGED * scale)
        most = ASTRAY * self.length * arrays.product(magnitudes, scale)
        if not arrays.is_everywhere(np.abs(astray) <= most):
            return None
        if self._solver.is_full:
            self._has_renewed(jacobian)  # due at the next change, when no Jacobian is at hand
        asked = np.empty((1 + len(self._lines), n))
        asked[0], asked[1] = residual, astray
        np.multiply(self._samples[:, :n], EPS * self._terms, out=asked[2:])
        solved = self._solver.solve_all(asked)
        along[:-1] -= solved[1]
        self._lines[1:, :-1] = solved[2:]
        self.length, self._since = self.curve.metric.norm(along), 0
        return np.asarray(solved[0])


def _kink_by_residuals(before: Selection, after: Curve, x: Array, gradient: Array) -> Array | None:
    """Return c, shape (n,), without Jacobians; None where the test changes with alpha alone.

    The residuals on the two sides are compared far away along the unknown along which the test
    changes most, where the rounding of all other terms is small.
    """
    scale = after.metric.scale
    weights = np.abs(gradient * scale)[:-1]
    steepest = int(weights.argmax())
    far = x.copy()
    far[steepest] += FAR_AWAY * max(1.0, after.metric.norm(x)) * scale[steepest]
    test = gradient[steepest] * (far[steepest] - x[steepest])
    if weights[steepest] <= abs(gradient[-1] * scale[-1]) / FAR_AWAY or not math.isfinite(test):
        return None
    return np.asarray((after.selection.residual(far) - before.residual(far)) / test)
