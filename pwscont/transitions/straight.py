"""Transitions of straight pieces: from cell to cell by one solve (docs/theory, F11).

A piece that the fast way cannot leave, because tests vanish together, the piece is nearly vertical
or nearly in the interface, or something is wrong with the system, is left as every other one, see
:mod:`pwscont.transitions.bounding`.
"""

from __future__ import annotations

from typing import final

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
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.bounding import BoundingTests, crossed, is_zero_along, next_to_zero
from pwscont.transitions.corner.complementary import SLANT
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector, ratio_test
from pwscont.transitions.rays import Ray, is_zero

#: Tests that change by more than this part of typical terms are not looked at more closely.
FLAT = 1e-4
#: A piece goes on in the direction in which it began, but for this part of it.
ALIGNED = EPS**0.5


@final
class StraightTests(TransitionDetector):
    """Watches the tests that bound the current cell of a piecewise-linear system."""

    def __init__(self) -> None:
        self._slowly = BoundingTests()
        self._gradients: tuple[PiecewiseSystem, Rows] | None = None
        self._cell: StraightCell | None = None
        self._crossed: tuple[State, Ray] | None = None

    def read(self, curve: Curve, state: State) -> Reading:
        """Return the bounding tests, positive inside, and their slopes.

        A piece may run along an interface: a test that is zero, and stays so, is no event.
        """
        selection, scale = curve.selection, curve.metric.scale
        if not len(selection.bounding):
            return Reading(np.zeros(0), np.zeros(0))
        rows = self._rows(selection.system, state.x)
        values = selection.tests(state.x)
        slopes = selection.side * (rows.matrix @ state.tangent)[selection.bounding]
        riding = next_to_zero(values, slopes)
        if len(riding):
            gradients = rows.some(selection.bounding[riding])
            riding = riding[_still(gradients, values[riding], slopes[riding], state, scale)]
            values[riding], slopes[riding] = 1.0, 0.0
        return Reading(values, slopes)

    def falls(self, segment: Segment, start: Reading, farthest: float) -> Array:
        """Return where each falls to zero, all being affine; what has fallen falls at once."""
        return ratio_test(start.values, start.slopes)

    def locate(self, segment: Segment, index: int, bracket: tuple[float, float]) -> State | Failure:
        """Return the point of the interface, which the piece beyond has been found for."""
        self._crossed = self._across(segment, index, bracket[0])
        if self._crossed is None:
            self._cell = None
            return self._slowly.locate(segment, index, bracket)
        return self._crossed[0]

    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Cross the interface; where several meet, take every way on."""
        if self._crossed is None or self._crossed[0] is not state:
            return self._slowly.arrive(curve, state, index)
        return crossed(state.x, Ray(curve, state).reversed(), self._crossed[1])

    def _rows(self, system: PiecewiseSystem, x: Array) -> Rows:
        """Return the gradients of all tests, which are constant."""
        if self._gradients is None or self._gradients[0] is not system:
            self._gradients = system, Rows(system.test_jacobian(x[:-1], float(x[-1])))
        return self._gradients[1]

    def _across(self, segment: Segment, index: int, s: float) -> tuple[State, Ray] | None:
        """Return the point where a test vanishes, and the ray beyond; None where that is hard."""
        curve, start, metric = segment.curve, segment.start, segment.curve.metric
        system, test = curve.selection.system, int(curve.selection.bounding[index])
        x = segment.near(s)
        if isinstance(system, Ending) or not metric.admits(x):
            return None
        tests = system.test_functions(x[:-1], float(x[-1]))
        if len(self._near_zero(curve, x, magnitude(x, start.error), tests, test)):
            return None
        cell = self._cell_of(curve, start)
        gradient = self._rows(system, x).some(np.array([test]))[0]
        if cell is None or not _is_crossed(gradient, start.tangent):
            return None
        sign = not curve.selection.character.array[test]
        other = Curve(Selection(system, Character.of(tests).with_sign(test, sign)), metric)
        beyond = cell.beyond(other, x, gradient) if test in other.selection.bounding else None
        settled = beyond.settled(x, gradient, float(tests[test])) if beyond else None
        if beyond is None or settled is None or self._is_corner(other, settled, tests, test):
            return None
        self._cell, (x, error, _) = beyond, settled
        forwards = beyond.turn * np.copysign(1.0, start.tangent[-1])
        tangent = metric.normalised(forwards * beyond.along)
        here = State(x, start.tangent, error, start.orientation)
        return here, Ray(other, State(x, tangent, error, start.orientation))

    def _cell_of(self, curve: Curve, start: State) -> StraightCell | None:
        """Return the cell of a piece, factorised afresh where the last one is another."""
        if self._cell is None or self._cell.curve.selection is not curve.selection:
            self._cell = None if curve.selection.adjacent_cells else StraightCell.at(curve, start.x)
        return self._cell if self._cell and _agree(self._cell, start) else None

    def _is_corner(self, curve: Curve, found: Settled, tests: Array, test: int) -> bool:
        """Tell whether more tests than one vanish at a point."""
        x, scale = found.x, curve.metric.scale
        suspects = self._near_zero(curve, x, found.size, tests, test)
        rows = self._rows(curve.selection.system, x)
        if not len(suspects):
            return False
        return bool(is_zero(rows.some(suspects), tests[suspects], x, found.error, scale).any())

    def _near_zero(self, curve: Curve, x: Array, error: Array, tests: Array, but: int) -> Indices:
        """Return the tests that may vanish at a point with this error, all but the given one."""
        size = EPS * (np.abs(x) + curve.metric.scale) + error
        rows = self._rows(curve.selection.system, x)
        near = np.abs(tests) <= 2.0 * CONFIDENCE * (rows.magnitudes @ size)
        near[but] = False
        return np.flatnonzero(near)


def _still(gradients: Array, values: Array, slopes: Array, state: State, scale: Array) -> Signs:
    """Tell which tests are zero along a piece; most of those that are zero clearly change."""
    if (np.abs(slopes) > FLAT * (np.abs(gradients) @ scale)).all():
        return np.zeros(len(values), dtype=bool)
    return is_zero_along(gradients, values, slopes, state, scale)


def _is_crossed(gradient: Array, tangent: Array) -> bool:
    """Tell whether a direction leads clearly through an interface."""
    terms = float(np.abs(gradient).dot(np.abs(tangent)))
    return bool(abs(float(gradient.dot(tangent))) > SLANT * terms)


def _agree(cell: StraightCell, start: State) -> bool:
    """Tell whether a piece has the direction of its cell, whichever way it is followed."""
    metric = cell.curve.metric
    row = metric.covector(metric.normalised(cell.along))
    return bool(abs(row.dot(start.tangent)) > 1.0 - ALIGNED)
