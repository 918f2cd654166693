"""Transitions of straight pieces: from cell to cell by one solve (docs/theory, F11).

A piece that the fast way cannot leave, because tests vanish together, the piece is nearly vertical
or nearly in the interface, or something is wrong with the system, is left as every other one, see
:mod:`pwscont.transitions.bounding`.
"""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.curve import Curve, State
from pwscont.curve.straight import Settled, StraightCell
from pwscont.curve.uncertainty import magnitude
from pwscont.linear.rows import Rows
from pwscont.stepping.stepper import Segment
from pwscont.system.ending import Ending
from pwscont.system.selection import Selection
from pwscont.transitions.bounding import BoundingTests, crossed, is_zero_along, next_to_zero
from pwscont.transitions.corner.complementary import SLANT
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import Ray, is_zero

#: Tests that change by more than this part of typical terms are not looked at more closely.
FLAT = 1e-4
#: A piece goes on in the direction in which it began, but for this part of it.
ALIGNED = EPS**0.5


class Crossed(NamedTuple):
    """An interface that was crossed.

    Attributes
    ----------
    state : State
        The point of the interface, on the piece that ends there.
    ray : Ray
        The piece beyond.
    cell : StraightCell
        The cell of that piece.
    error : ndarray, shape (n + 1,)
        The estimated error of the point.
    """

    state: State
    ray: Ray
    cell: StraightCell
    error: Array


@final
class StraightTests(TransitionDetector):
    """Watches the tests that bound the current cell of a piecewise-linear system."""

    is_affine = True

    def __init__(self) -> None:
        self._slowly = BoundingTests()
        self._gradients: Gradients | None = None
        self._last: Crossed | None = None

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the bounding tests, positive inside, and their slopes.

        A piece may run along an interface: a test that is zero, and stays so, is no event.
        """
        selection, scale = curve.selection, curve.metric.scale
        if not len(selection.bounding):
            return Reading(np.zeros(0), np.zeros(0))
        gradients = self._gradients_of(curve, state.x)
        values = selection.tests(state.x)
        slopes = selection.side * (gradients.rows.matrix @ state.tangent)[selection.bounding]
        riding = next_to_zero(values, slopes)
        riding = riding[gradients.are_flat(selection.bounding[riding], slopes[riding])]
        if len(riding):
            rows = gradients.rows.some(selection.bounding[riding])
            riding = riding[is_zero_along(rows, values[riding], slopes[riding], state, scale)]
            values[riding], slopes[riding] = 1.0, 0.0
        return Reading(values, slopes)

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Return the point of the interface, which the piece beyond has been found for."""
        self._last = self._across(segment, index, bracket[0])
        if self._last is None:
            return self._slowly.locate(segment, index, bracket)
        return self._last.state

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Cross the interface; where several meet, take every way on."""
        if self._last is None or self._last.state is not state:
            return self._slowly.arrive(curve, state, index)
        return crossed(state.x, Ray(curve, state).reversed(), self._last.ray)

    def _gradients_of(self, curve: Curve, x: Array) -> Gradients:
        """Return the gradients of all tests, which are constant."""
        if self._gradients is None or not self._gradients.are_of(curve):
            self._gradients = Gradients(curve, x)
        return self._gradients

    def _across(self, segment: Segment, index: int, s: float) -> Crossed | None:
        """Return the point where a test vanishes, and the ray beyond; None where that is hard."""
        curve, start, metric = segment.curve, segment.start, segment.curve.metric
        system, test = curve.selection.system, int(curve.selection.bounding[index])
        x = segment.near(s)
        if isinstance(system, Ending) or not metric.admits(x):
            return None
        last = self._last if self._last and self._last.ray.state is start else None
        error = last.error if last else magnitude(x, start.error)
        tests, gradients = system.test_functions(x[:-1], float(x[-1])), self._gradients_of(curve, x)
        gradient = gradients.rows.some(np.array([test]))[0]
        if len(gradients.near_zero(tests, x, error, test)) or not _is_crossed(gradient, start):
            return None
        cell = last.cell if last else self._cell_of(curve, start)
        sign = not curve.selection.character.array[test]
        other = Curve(Selection(system, Character.of(tests).with_sign(test, sign)), metric)
        if cell is None or test not in other.selection.bounding:
            return None
        beyond = cell.beyond(other, x, gradient)
        settled = beyond.settled(x, gradient, float(tests[test])) if beyond else None
        if beyond is None or settled is None or gradients.is_corner(tests, settled, test):
            return None
        forwards = beyond.turn * np.copysign(1.0, start.tangent[-1])
        tangent = metric.normalised(forwards * beyond.along)
        here = State(settled.x, start.tangent, settled.error, start.orientation)
        there = State(settled.x, tangent, settled.error, start.orientation)
        return Crossed(here, Ray(other, there), beyond, settled.size)

    def _cell_of(self, curve: Curve, start: State) -> StraightCell | None:
        """Return the cell of a piece, factorised afresh where the last one is another."""
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
        Of the system and the metric.
    x : ndarray, shape (n + 1,)
        Where the system may be asked.
    """

    def __init__(self, curve: Curve, x: Array) -> None:
        self._system, self._scale = curve.selection.system, curve.metric.scale
        self.rows = Rows(self._system.test_jacobian(x[:-1], float(x[-1])))
        self._typical: Array = self.rows.magnitudes @ self._scale

    def are_of(self, curve: Curve) -> bool:
        """Tell whether these are the gradients of the tests of a curve's system."""
        return self._system is curve.selection.system and self._scale is curve.metric.scale

    def are_flat(self, which: Indices, slopes: Array) -> Signs:
        """Tell which of some tests hardly change along a piece: most that are zero clearly do."""
        flat: Signs = np.abs(slopes) <= FLAT * self._typical[which]
        return flat

    def near_zero(self, tests: Array, x: Array, error: Array, but: int) -> Indices:
        """Return the tests that may vanish at a point with this error, all but the given one.

        Those that are larger than any error of this size, measured by typical magnitudes, makes
        them are not looked at: nearly always all.
        """
        size = EPS * (np.abs(x) + self._scale) + error
        sizes, reach = np.abs(tests), 2.0 * CONFIDENCE * float(np.max(size / self._scale))
        near: Indices = np.flatnonzero(sizes <= reach * self._typical)
        near = near[near != but]
        if len(near):
            rows = np.abs(self.rows.some(near))
            near = near[sizes[near] <= 2.0 * CONFIDENCE * (rows @ size)]
        return near

    def is_corner(self, tests: Array, found: Settled, but: int) -> bool:
        """Tell whether more tests than one vanish at a point."""
        suspects = self.near_zero(tests, found.x, found.size, but)
        if not len(suspects):
            return False
        rows = self.rows.some(suspects)
        return bool(is_zero(rows, tests[suspects], found.x, found.error, self._scale).any())


def _is_crossed(gradient: Array, start: State) -> bool:
    """Tell whether a piece leads clearly through an interface."""
    terms = gradient * start.tangent
    return bool(abs(float(np.add.reduce(terms))) > SLANT * float(np.add.reduce(np.abs(terms))))


def _agree(cell: StraightCell, start: State) -> bool:
    """Tell whether a piece has the direction of its cell, whichever way it is followed."""
    metric = cell.curve.metric
    row = metric.covector(metric.normalised(cell.along))
    return bool(abs(row.dot(start.tangent)) > 1.0 - ALIGNED)
