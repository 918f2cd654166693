"""Every transition point of every cell, for systems whose pieces are all straight.

A component without a transition is a straight line across the whole interval. The transition points
and the solutions at an end therefore give every component, unless some unknown is free: a vertical
line then need not have a transition point. With alpha as a further unknown, the solutions in a
regular cell are a line, of which the inequalities of the cell leave a segment: the ends are the
transition points, and the solutions at the ends of the interval.

A component that turns has a transition point at which det(dH/dz) changes its sign (docs/theory,
F3). The determinant is the product of the determinants of the parts, see
:mod:`pwscont.enumeration.by_parts`. If each of these keeps its sign in all cells, every component
crosses the interval: the solutions at the lower end are enough, and are found part by part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, dense, own_dense, power_of_two
from pwscont.basics.budget import check_budget
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Guarantee, SearchScope
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.curve.error_samples import Found, has_digits, is_same, magnitude
from pwscont.curve.metric import Metric, Range
from pwscont.enumeration.by_parts import is_regular, most_cells, parts_of_table
from pwscont.enumeration.choices import SLACK, Choices, inequalities_of
from pwscont.enumeration.options import Problem, Table, problem_with_alpha
from pwscont.enumeration.polyhedron import Face, face_of
from pwscont.enumeration.slices import FEW_CELLS, Points
from pwscont.enumeration.tree import CUT_OFF_LINES, leaves
from pwscont.graph.records import FEW_DIGITS, significant
from pwscont.linear.factorise import balanced, factor
from pwscont.search.enumeration import starts_at
from pwscont.search.search import Search
from pwscont.system.abilities import Ending
from pwscont.system.box import Box
from pwscont.system.contract import jacobian_at
from pwscont.system.promises import checked_necessary
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, number_of_cells
from pwscont.transitions.corner import Corner

#: Largest component along alpha of a vertical direction, as a part of the largest component.
ALONG = EPS**0.5
#: In place of a test: an inequality of no further interest, and the lower end of the interval.
OTHER, LOWER_END = -1, -2
#: Ends of lines that are refined together; of more lines, most may end at a corner that is known.
FEW_LINES = 64


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

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield the solutions at lo, then the points where each test function vanishes.

        Raises
        ------
        InvalidInputError
            If the system is no :class:`~pwscont.PiecewiseLinearSystem`.
        """
        if not isinstance(system, PiecewiseLinearSystem):
            raise InvalidInputError(
                f"AllTransitions needs a PiecewiseLinearSystem, and {type(system).__name__} is "
                "none; use EndPoints, Slices or MultiStart"
            )
        known: list[tuple[Found, frozenset[int]]] = []

        def is_known(found: Found, test: int | None) -> bool:
            """Tell whether a solution was found before; remember a new solution with a digit.

            A corner is found once for each test that vanishes there, and a corner of faces, where
            the test is None, once for each face.
            """
            if not has_digits(*found, metric.scale):
                return False
            alike = (old for old, zero in known if test is None or test in zero)
            if any(is_same(metric, found, old) for old in alike):
                return True
            known.append((found, Corner.at(system, metric, *found).zero))
            return False

        if turns_nowhere(system):
            yield from starts_at(system, metric, interval[0])
            return
        are_few = number_of_cells(system.blocks()) <= FEW_CELLS  # then lines give all solutions
        lines = Lines(system, metric, interval) if are_few else None
        solutions = lines and lines.solutions()
        for found in starts_at(system, metric, interval[0]) if solutions is None else solutions:
            if not is_known(found, OTHER):
                yield found
        for test, found in (lines or Lines(system, metric, interval)).transitions():
            if _is_within(interval, *found) and not is_known(found, test):
                yield found

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise everything, except for systems with bounds or free unknowns."""
        in_doubt = Box.of(system).is_bounded or _has_free_unknowns(system)
        promise = Guarantee.NOTHING if in_doubt else Guarantee.EVERYTHING
        what = "all transition points, and all solutions at the lower end"
        if turns_nowhere(system):
            what = "all solutions at the lower end, for no branch turns: det(dH/dz) keeps its sign"
        return SearchScope(what, promise)


def turns_nowhere(system: PiecewiseSystem) -> bool:
    """Tell whether every branch surely crosses every interval, by the determinants of many parts.

    False also where there are few cells, or few parts: enumeration decides sooner there.
    """
    if not isinstance(system, PiecewiseLinearSystem) or isinstance(system, Ending):
        return False
    blocks = system.blocks()
    cells, scale = number_of_cells(blocks), system.differences(0.0).scale[:-1]
    if cells <= FEW_CELLS or Box.of(system).is_bounded:
        return False
    table = Table.at(system, system.somewhere, scale)
    parts = parts_of_table(table)
    are_far_fewer = FEW_CELLS * most_cells(parts, blocks) <= cells
    return are_far_fewer and is_regular(table, parts, scale, of_one_sign=True)


def _has_free_unknowns(system: PiecewiseSystem) -> bool:
    """Tell whether z may move in a direction that H and all tests do not see, in every cell."""
    differences = system.differences(0.0)
    z, alpha = np.zeros(system.size), min(max(0.0, differences.lo), differences.hi)
    jacobian = dense(jacobian_at(system, z, alpha, system.character(z, alpha)))
    if not factor(jacobian[:, :-1], power_of_two(differences.scale[:-1])).is_singular():
        return False  # nearly always, and sooner than by a rank
    rows = np.vstack([jacobian, dense(system.test_jacobian(z, alpha))])[:, :-1]
    magnitudes, sizes = balanced(rows, system.size)
    return bool(np.linalg.matrix_rank(rows * magnitudes / sizes[:, None]) < system.size)


def _is_within(interval: Range, x: Array, error: Array) -> bool:
    """Tell whether a point lies in the interval; rounding beyond an end is moved to the end."""
    nearest = min(max(float(x[-1]), interval[0]), interval[1])
    if abs(float(x[-1]) - nearest) > CONFIDENCE * float(magnitude(x, error)[-1]):
        return False
    x[-1] = nearest
    return True


@final
class Lines:
    """The lines of all cells of a system, and where the lines end."""

    def __init__(self, system: PiecewiseLinearSystem, metric: Metric, interval: Range) -> None:
        checked_necessary(system, interval[0])  # refused if wrong, not needed if right
        self._system, self._metric, self._lo = system, Metric(metric.scale), interval[0]
        self._K = own_dense(system.test_jacobian(np.zeros(system.size), interval[0]))
        self._points: dict[int, Points] = {}
        self._faces: list[Face] = []
        problem = problem_with_alpha(system, metric)
        if problem is None:
            return
        lower_end = int(np.isfinite(Box.of(system).lower).sum())
        for choices in leaves(problem, *CUT_OFF_LINES):
            if choices.directions.shape[-1] == 1:
                self._add_ends(problem, choices, lower_end)
            else:
                faces = (face_of(problem, choices[k : k + 1], 0.0) for k in range(len(choices)))
                self._faces += filter(None, faces)

    def _add_ends(self, problem: Problem, choices: Choices, lower_end: int) -> None:
        """Add the ends of the lines in the cells of choices, each end once for each test."""
        places, tests = _ends_of_lines(problem, choices, lower_end)
        for s, test_of in zip(places.T, tests.T, strict=True):
            some = np.flatnonzero(np.isfinite(s))
            for test in sorted({*test_of[some].tolist()} - {OTHER}):
                points = self._points.setdefault(test, self._points_of(problem, test))
                self._add(points, choices, some[test_of[some] == test], s)

    def _add(self, points: Points, choices: Choices, which: Indices, places: Array) -> None:
        """Add the ends of some lines at given places, unless a known end lies in the same cell."""
        checked = 0
        while len(which):
            check_budget()
            for known in points.found[checked:] if len(which) > FEW_LINES else ():
                if known.is_certain:
                    which = which[~known.lies_in(choices.picks[:, which])]
            checked, first, which = len(points.found), which[:FEW_LINES], which[FEW_LINES:]
            lines, at = choices[first], places[first, np.newaxis]
            starts = lines.starts + at * lines.directions[..., 0]
            points.add(replace(lines, starts=starts, directions=lines.directions[..., :0]))

    def _points_of(self, problem: Problem, test: int) -> Points:
        """Return a collection of points at which a test vanishes."""

        def border(x: Array) -> tuple[float, Array]:
            values = self._system.test_functions(x[:-1], float(x[-1]))
            return float(values[test]), self._K[test]

        known = None if test == LOWER_END else border
        return Points(self._system, self._metric, problem, self._lo, known)

    def solutions(self) -> list[Found] | None:
        """Return all solutions at the lower end of the interval.

        None if rounding leaves doubt: if a point lies on an interface, or is known to few digits,
        if no solution is found, or the signs of det(dH/dz) do not sum to the degree.
        """
        points, scale = self._points.get(LOWER_END), self._metric.scale
        if self._faces or points is None or points.undecided or not points.found:
            return None
        ends = points.found
        few = (significant(magnitude(e.x, e.error), e.x, scale) < FEW_DIGITS for e in ends)
        if any(holds.sum() > 1 for end in ends for holds in end.holds) or any(few):
            return None
        is_known = self._system.degree in (None, sum(end.det_sign for end in ends))
        return [(end.x, end.error) for end in ends] if is_known else None

    def transitions(self) -> Iterator[tuple[int | None, Found]]:
        """Yield where lines end because a test vanishes, with the test, and corners of faces."""
        for test in sorted(set(self._points).difference((LOWER_END, OTHER))):
            yield from ((test, (end.x, end.error)) for end in self._points[test].found)
        for face in self._faces:
            moves = np.abs(face.directions / self._metric.scale[:, np.newaxis])
            if len(face.corners) or (moves[-1] <= ALONG * moves.max()).all():
                known = GUARD * EPS if len(face.corners) else np.inf
                for z in face.representatives:
                    x = np.append(z[:-2], self._lo + z[-2])
                    yield None, (x, known * (np.abs(x) + self._metric.scale)[np.newaxis])


def _ends_of_lines(problem: Problem, choices: Choices, lower_end: int) -> tuple[Array, Indices]:
    """Return where each line leaves the closed cell of its choice, by each inequality, and tests.

    A place is the factor of the direction of the line, and infinite for an inequality that ends
    nothing. For an end of the interval, and for a bound of an unknown, the test is LOWER_END or
    OTHER. ``lower_end``: the inequality of the problem that says alpha >= lo.
    """
    sides, values, tests = inequalities_of(problem, choices)
    slopes, tests[:, lower_end] = sides[..., 0], LOWER_END
    level = np.abs(slopes) <= np.minimum(GUARD * choices.rounding, SLACK)[:, np.newaxis]
    slack, divisors = choices.slack[:, np.newaxis], np.where(level, 1.0, slopes)
    relaxed, zeros = -(values + slack) / divisors, -values / divisors
    begin = np.where(~level & (slopes > 0.0), relaxed, -np.inf).max(axis=1, keepdims=True)
    end = np.where(~level & (slopes < 0.0), relaxed, np.inf).min(axis=1, keepdims=True)
    is_end = ~level & (begin <= zeros) & (zeros <= end)
    is_end &= (~level | (values >= -slack)).all(axis=1, keepdims=True)
    return np.where(is_end, zeros, np.inf), tests
