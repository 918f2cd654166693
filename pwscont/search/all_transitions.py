"""Every transition point of every cell, for systems whose pieces are all straight.

A component without a transition is a straight line across the whole interval; all other components,
closed loops included, have a transition point. The transition points and the solutions at an end
therefore give every component, unless some unknown is free: a vertical line then need not have a
transition point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, dense
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Guarantee, SearchScope
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.error_samples import Found, has_digits, is_same, magnitude
from pwscont.curve.metric import Metric
from pwscont.enumeration.options import bounding
from pwscont.enumeration.polyhedron import Face
from pwscont.enumeration.slices import solve_slice
from pwscont.linear.factorise import factor, power_of_two
from pwscont.search.enumeration import as_starts, starts_at
from pwscont.search.few_cells import FewCells
from pwscont.search.search import Search
from pwscont.system.box import Box
from pwscont.system.contract import jacobian_at
from pwscont.system.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.transitions.rays import vanishing

#: Largest component along alpha of a vertical direction, as a part of the largest component.
ALONG = EPS**0.5


@final
@dataclass(frozen=True, slots=True)
class AllTransitions(Search):
    """All transition points in the interval and all solutions at the lower end: complete.

    Examples
    --------
    >>> from pwscont import LCP, AllTransitions, explore
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    >>> explore(problem, (-1.0, 2.0), search=AllTransitions()).guarantee
    'complete'
    """

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield the solutions at lo, then the points where each test function vanishes."""
        if not isinstance(system, PiecewiseLinearSystem):
            raise InvalidInputError(
                f"AllTransitions needs a PiecewiseLinearSystem, and {type(system).__name__} is "
                "none; use EndPoints, Slices or MultiStart"
            )
        few, known = FewCells.of(system, metric, interval), list[tuple[Found, frozenset[int]]]()

        def is_known(found: Found, test: int | None) -> bool:
            """Tell whether a solution was found before; remember a new solution with a digit.

            A corner is found once for each test that vanishes there. A solution without a certain
            digit is new, and not remembered, because all other solutions would be the same.
            """
            if not has_digits(*found, metric.scale):
                return False
            if any(test in zero and is_same(metric, found, old) for old, zero in known):
                return True
            known.append((found, vanishing(system, *found, metric.scale)))
            return False

        solutions = few.solutions() if few else None
        for found in starts_at(system, metric, interval[0]) if solutions is None else solutions:
            if not is_known(found, None):
                yield found
        for test, found in _on_interfaces(system, metric, interval, few):
            if not is_known(found, test):
                yield found

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise everything, except for systems with bounds or free unknowns."""
        in_doubt = Box.of(system).is_bounded or _has_free_unknowns(system)
        promise = Guarantee.NOTHING if in_doubt else Guarantee.EVERYTHING
        return SearchScope("all transition points, and all solutions at the lower end", promise)


def _has_free_unknowns(system: PiecewiseSystem) -> bool:
    """Tell whether z may move in a direction that H and all tests do not see, in every cell."""
    differences = system.differences(0.0)
    z, alpha = np.zeros(system.size), min(max(0.0, differences.lo), differences.hi)
    jacobian = dense(jacobian_at(system, z, alpha, system.character(z, alpha)))
    if not factor(jacobian[:, :-1], power_of_two(differences.scale[:-1])).is_singular():
        return False  # nearly always, and sooner than by a rank
    rows = np.vstack([jacobian, dense(system.test_jacobian(z, alpha))])[:, :-1]
    rows = rows * differences.scale[:-1]
    sizes = np.abs(rows).max(axis=1, initial=0.0)
    scaled = rows / np.where(sizes > 0.0, sizes, 1.0)[:, np.newaxis]
    return bool(np.linalg.matrix_rank(scaled) < system.size)


def _on_interfaces(
    system: PiecewiseLinearSystem,
    metric: Metric,
    interval: tuple[float, float],
    few: FewCells | None,
) -> Iterator[tuple[int, Found]]:
    """Yield the solutions where a test vanishes, for each test."""
    crossings = few.crossings() if few else None
    if crossings is not None:
        yield from ((test, found) for test, found in crossings if _is_within(interval, *found))
        return
    around = Metric(np.append(metric.scale, 1.0))
    for block in system.blocks():
        for test in block.tests:
            points = _OnInterface(system, block, test, interval)
            for x, error in _solve(points, around) if points.is_bounding else ():
                found = np.append(x[:-2], interval[0] + x[-2]), error[:, :-1]
                if _is_within(interval, *found):
                    yield test, found


def _is_within(interval: tuple[float, float], x: Array, error: Array) -> bool:
    """Tell whether a point lies in the interval; rounding beyond an end is moved to the end."""
    nearest = min(max(float(x[-1]), interval[0]), interval[1])
    if abs(float(x[-1]) - nearest) > CONFIDENCE * float(magnitude(x, error)[-1]):
        return False
    x[-1] = nearest
    return True


def _solve(points: _OnInterface, metric: Metric) -> list[Found]:
    """Return the points where a test vanishes, of vertical faces the corners."""
    found = solve_slice(points, metric, 0.0)

    def is_vertical(face: Face) -> bool:
        """Tell whether a face has corners, or lies at a single alpha."""
        moves = np.abs(face.directions / metric.scale[:-1, np.newaxis])
        return bool(len(face.corners)) or bool((moves[-1] <= ALONG * moves.max()).all())

    return as_starts(replace(found, faces=tuple(filter(is_vertical, found.faces))))


@final
class _OnInterface(SlicewiseLinearSystem):
    """H(z, alpha) = 0 and kappa_test = 0 in cells that the test bounds, for (z, alpha - lo)."""

    def __init__(
        self,
        system: PiecewiseLinearSystem,
        block: Block,
        test: int,
        interval: tuple[float, float],
    ) -> None:
        self.size = system.size + 1
        self._system, self._test, self._interval = system, test, interval
        tests = len(self.test_functions(np.zeros(self.size), 0.0))
        modes = tuple(mode for mode in block.modes if test in bounding(system, block, mode, tests))
        self.is_bounding = bool(modes)
        self._block = Block(block.tests, block.rows, modes)

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the tests of the system."""
        return self._system.test_functions(*self._split(z))

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients of the tests, with a column of zeros for the idle parameter."""
        return _with_zero_column(self._system.test_jacobian(*self._split(z)))

    def _split(self, z: Array) -> tuple[Array, float]:
        return z[:-1], self._interval[0] + float(z[-1])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return (H_chi, kappa_test)."""
        state, parameter = self._split(z)
        kappa = self._system.test_functions(state, parameter)[self._test]
        return np.append(self._system.residual(state, parameter, character), kappa)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant Jacobian."""
        state, parameter = self._split(z)
        rows = dense(jacobian_at(self._system, state, parameter, character))
        kappa = dense(self._system.test_jacobian(state, parameter))[self._test]
        return _with_zero_column(np.vstack([rows, kappa]))

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return the bounding tests of the system without the test that vanishes."""
        return [i for i in self._system.bounding_tests(character) if i != self._test]

    def blocks(self) -> tuple[Block, ...]:
        """Return the system's blocks, the test's block restricted to cells at the interface."""
        return tuple(
            self._block if block.tests == self._block.tests else block
            for block in self._system.blocks()
        )

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return 0 <= alpha - lo <= hi - lo."""
        lo, hi = self._interval
        rows = np.zeros((2, self.size))
        rows[0, -1], rows[1, -1] = 1.0, -1.0
        return rows, np.array([0.0, hi - lo])


def _with_zero_column(matrix: Matrix) -> Array:
    whole = dense(matrix)
    return np.column_stack([whole, np.zeros(len(whole))])
