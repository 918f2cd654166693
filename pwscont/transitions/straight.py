"""Transitions of straight pieces: from cell to cell by one solve (docs/theory, F11).

A piece whose end is hard to find, because tests vanish together, the piece is nearly vertical or
nearly in the interface, or something is wrong with the system, is left by the general detector, see
:mod:`pwscont.transitions.bounding`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, are_finite, is_everywhere, joined, product
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.curve.curve import Curve, State
from pwscont.curve.stepper import Segment
from pwscont.curve.straight import Settled, StraightCell
from pwscont.linear.factorise import last_unit
from pwscont.linear.vectors import Rows
from pwscont.system.abilities import Ending
from pwscont.system.selection import Selection
from pwscont.system.values import own_array
from pwscont.transitions.bounding import BoundingTests, crossed
from pwscont.transitions.corner.cells import SLANT
from pwscont.transitions.detector import (
    Reading,
    SpecialPointFound,
    TransitionDetector,
    soonest,
)
from pwscont.transitions.ends import at_end
from pwscont.transitions.rays import Ray, is_zero

#: A piece keeps the direction in which it began up to this part of the direction.
ALIGNED = EPS**0.5


class Entered(NamedTuple):
    """A cell that a piece has entered, or inside which the piece begins.

    Attributes
    ----------
    state : State
        The point of the interface, on the piece that ends there; inside that of the ray.
    ray : Ray
        The piece.
    cell : StraightCell
        The cell of the piece.
    tests, rates : ndarray, shape (m,)
        All tests at the point, and the derivatives of the tests by alpha along the piece.
    """

    state: State
    ray: Ray
    cell: StraightCell
    tests: Array
    rates: Array

    def ahead(self) -> tuple[int, float]:
        """Return which bounding test of the piece vanishes first, and at what distance.

        Apart from the test that was crossed no test is zero at the point: the piece runs along no
        interface. The distance is infinite where no test falls.
        """
        selection, pace = self.ray.curve.selection, self.ray.state.tangent[-1]
        values = selection.side * self.tests[selection.bounding]
        return soonest(values, (pace * selection.side) * self.rates[selection.bounding])


@final
class StraightTests(TransitionDetector):
    """Watches the tests that bound the current cell of a piecewise-linear system."""

    is_affine = True

    def __init__(self) -> None:
        self._slowly = BoundingTests()
        self._gradients: Gradients | None = None
        self._last: Entered | None = None
        self._hard: State | None = None  # where a piece begins that next() gave up

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the bounding tests, positive inside, and their slopes.

        A piece may run along an interface: a test that is zero, and stays so, is no event.
        """
        return self._slowly.read(curve, state)

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Return the point of the interface, which the piece beyond has been found for."""
        if segment.start is not self._hard:
            self._last = self._across(segment.curve, segment.start, index, bracket[0])
        if self._last is None:
            return self._slowly.locate(segment, index, bracket)
        return self._last.state

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Cross the interface; at a corner, take every way on."""
        if self._last is None or self._last.state is not state:
            return self._slowly.arrive(curve, state, index)
        return crossed(state.x, Ray(curve, state.reversed()), self._last.ray)

    def next(self, ray: Ray, interval: tuple[float, float]) -> SpecialPointFound | None:
        """Return where a piece ends, if no function has to be watched but the tests and alpha.

        None where that is hard, or if the ray begins at an interface but is not the ray beyond the
        last crossing: :meth:`read` and :meth:`locate` handle every ray.
        """
        last, state = self._last, ray.state
        if last is None or last.ray.state is not state:
            self._last = last = self._begun(ray)
        if last is None:
            return None
        ahead, room = last.ahead(), _room(state, interval)
        if not ahead[1] < room:
            return self._at_end(last, room, interval)
        self._last = self._across(ray.curve, state, *ahead)
        self._hard = None if self._last else state
        return self._last and self.arrive(ray.curve, self._last.state, ahead[0])

    def _begun(self, ray: Ray) -> Entered | None:
        """Return a ray that begins inside a cell; None where that is not clear."""
        curve, state = ray.curve, ray.state
        gradients = self._gradients_of(curve, state.x)
        tests = gradients.tests_at(state.x)
        if gradients.may_end or not gradients.are_inside(curve, tests, state):
            return None
        cell = self._cell_of(curve, state)
        return cell and Entered(state, ray, cell, tests, gradients.rows.dot(cell.along))

    def _at_end(
        self, last: Entered, room: float, interval: tuple[float, float]
    ) -> SpecialPointFound | None:
        """Return the end of the interval, which a piece reaches at this distance; leave the cell.

        None where that is hard.
        """
        self._last, start = None, last.ray.state
        x = start.x + room * start.tangent
        x[-1] = end = interval[1] if start.tangent[-1] > 0.0 else interval[0]
        if self._gradients is None or self._gradients.may_end or not np.isfinite(room):
            return None
        found = last.cell.settled(x, last_unit(len(x)), 0.0)
        if found is None:
            return None
        found.x[-1] = end  # equal up to rounding
        here = State(found.x, start.tangent, found.error, start.orientation, found.size)
        return at_end(last.ray.curve, here)

    def _gradients_of(self, curve: Curve, x: Array) -> Gradients:
        """Return the gradients of all tests, which are constant."""
        if self._gradients is None or not self._gradients.are_of(curve):
            self._gradients = Gradients(curve, x)
        return self._gradients

    def _across(self, curve: Curve, start: State, index: int, s: float) -> Entered | None:
        """Return the point where a test vanishes, and the ray beyond; None where that is hard."""
        gradients, test = self._gradients_of(curve, start.x), int(curve.selection.bounding[index])
        x, gradient = start.x + s * start.tangent, gradients.rows.one(test)
        if gradients.may_end or not curve.metric.admits(x):
            return None
        last = self._last if self._last and self._last.ray.state is start else None
        cell = last.cell if last else self._cell_of(curve, start)
        tests = gradients.tests_at(x)
        other = _other_side(curve, tests, index)
        if cell is None or not gradients.is_crossed(test, gradient, start):
            return None
        if not other.selection.is_bounded_by(test):
            return None
        settled = cell.cross(other, x, test, gradient, float(tests[test]))
        if settled is None:
            return None
        rates = gradients.rows.dot(cell.along)
        here = tests - gradients.changes(settled, rates)
        if not are_finite(here) or gradients.is_corner(tests, here, settled, test):
            return None
        return _entered(cell, start, settled, here, rates)

    def _cell_of(self, curve: Curve, start: State) -> StraightCell | None:
        """Return the cell of a piece, factorised afresh if the last cell is another cell."""
        cell = self._last.cell if self._last else None
        if cell is None or cell.curve.selection is not curve.selection:
            cell = None if curve.selection.adjacent_cells else StraightCell.at(curve, start.x)
        return cell if cell and _agree(cell, start) else None


@final
class Gradients:
    """The gradients of all tests of a piecewise-linear system, which are constant.

    Parameters
    ----------
    curve : Curve
        A curve of the system, in the metric.
    x : ndarray, shape (n + 1,)
        Where the system may be asked.
    """

    def __init__(self, curve: Curve, x: Array) -> None:
        self._system, self._scale = curve.selection.system, curve.metric.scale
        self.rows = Rows(self._system.test_jacobian(x[:-1], float(x[-1])))
        self._typical: Array = product(self.rows.magnitudes, self._scale)
        #: Whether pieces may end where tests vanish.
        self.may_end = isinstance(self._system, Ending)

    def tests_at(self, x: Array) -> Array:
        """Return a copy of all tests at a point, shape (m,)."""
        values = self._system.test_functions(x[:-1], float(x[-1]))
        return own_array(self._system, "test_functions", values, self._typical.shape)

    def are_of(self, curve: Curve) -> bool:
        """Tell whether these gradients belong to the tests of a curve's system."""
        return self._system is curve.selection.system and self._scale is curve.metric.scale

    def changes(self, found: Settled, rates: Array) -> Array:
        """Return by how much the correction of a point changed all tests, shape (m,)."""
        changes: Array = found.along * rates
        if found.aside is not None:
            changes += self.rows.dot(joined(found.aside, 0.0))
        return changes

    def is_crossed(self, test: int, gradient: Array, start: State) -> bool:
        """Tell whether a piece leads clearly through the interface where a test vanishes."""
        slope = abs(float(gradient.dot(start.tangent)))
        if slope > SLANT * float(self._typical[test]):
            return True  # nearly always, because tangents have length one
        return bool(slope > SLANT * np.abs(gradient).dot(np.abs(start.tangent)))

    def are_inside(self, curve: Curve, tests: Array, state: State) -> bool:
        """Tell whether a state lies inside the cell of a curve, and no test is next to zero."""
        metric, selection = curve.metric, curve.selection
        extent = metric.largest(np.abs(state.x)), metric.largest(state.size)
        if not len(tests) or not are_finite(tests) or len(self.near_zero(tests, extent)):
            return False
        inside = selection.side * tests[selection.bounding] > 0.0
        return not len(inside) or is_everywhere(inside)

    def near_zero(self, tests: Array, extent: tuple[float, float]) -> Indices:
        """Return the tests that an error may have made zero, or a correction.

        Every other test exceeds what errors and corrections of this extent contribute to the test,
        measured by typical magnitudes, see :class:`Settled`.
        """
        reach = GUARD * EPS * (1.0 + extent[0]) + 2.0 * CONFIDENCE * extent[1]
        near: Indices = (np.abs(tests) <= reach * self._typical).nonzero()[0]
        return near

    def is_corner(self, before: Array, tests: Array, found: Settled, but: int) -> bool:
        """Tell whether another test vanishes at a point, or has another sign than before."""
        near = self.near_zero(tests, found.extent)
        near = near[near != but] if len(near) else near
        if not len(near):
            return False  # nearly always
        rows, values = self.rows.some(near), tests[near]
        turned = (values >= 0.0) != (before[near] >= 0.0)
        return bool((turned | is_zero(rows, values, found.x, found.error, self._scale)).any())


def _other_side(curve: Curve, tests: Array, index: int) -> Curve:
    """Return the curve on the other side of an interface, where all other tests are as given."""
    selection = curve.selection
    test, is_negative = int(selection.bounding[index]), bool(selection.side[index] < 0.0)
    beyond = Character.beyond(tests, test, is_negative)
    return Curve(Selection(selection.system, beyond), curve.metric)


def _entered(
    cell: StraightCell, start: State, settled: Settled, tests: Array, rates: Array
) -> Entered:
    """Return what was found where a piece from ``start`` led into a cell."""
    x, error, size = settled.x, settled.error, settled.size
    forwards = cell.turn * math.copysign(1.0, start.tangent[-1])
    tangent = (forwards / cell.length) * cell.along
    here = State(x, start.tangent, error, start.orientation, size)
    there = State(x, tangent, error, start.orientation, size)
    return Entered(here, Ray(cell.curve, there), cell, tests, rates)


def _room(state: State, interval: tuple[float, float]) -> float:
    """Return the distance at which a straight piece reaches an end of the interval."""
    slope = float(state.tangent[-1])
    end = interval[1] if slope > 0.0 else interval[0]
    return (end - state.alpha) / slope if slope else np.inf


def _agree(cell: StraightCell, start: State) -> bool:
    """Tell whether a piece has the direction of its cell, in either sense of travel."""
    metric = cell.curve.metric
    row = metric.covector(metric.normalised(cell.along))
    return bool(abs(row.dot(start.tangent)) > 1.0 - ALIGNED)
