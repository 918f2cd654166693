"""All solutions of a slice alpha = constant.

Solutions may be 1e-12 apart next to a fold, with no solution just beyond: every candidate is
refined on the full system, and accepted by the signs of the tests to within the rounding of the
terms. A solution on the common boundary of several cells is counted once, with all these cells. A
cell with infinitely many solutions gives a face.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs, product
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import (
    ONE_DIGIT,
    has_digits,
    is_same,
    slack_by_constants,
    slack_of_values,
)
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Border, Root, newton, uncertainty
from pwscont.enumeration import by_parts
from pwscont.enumeration.by_parts import Partial, PartSlice
from pwscont.enumeration.choices import Choices
from pwscont.enumeration.options import Problem, Table, problem_of
from pwscont.enumeration.polyhedron import Cells, Face, Point, Slice, face_of
from pwscont.enumeration.tree import leaves
from pwscont.linear.factorise import last_unit
from pwscont.system.promises import checked_necessary
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem, number_of_cells

#: Most cells that are tried at once, without splitting the system into parts.
FEW_CELLS = 64
#: The known signs of solutions of singular cells.
ALONE = (0,)
#: Most Newton iterations on an affine selection: the first solves, the rest mends rounding.
REFINEMENTS = 3


def solve_slice(system: SlicewiseLinearSystem, metric: Metric, alpha: float) -> Slice:
    """Return all solutions of a system at ``alpha``; refuse blocks that do not fit the system."""
    part = system if isinstance(system, PartSlice) else None
    table = part.table if part else Table.at(system, alpha, metric.scale[:-1])
    return _by_parts(system, metric, alpha, table) or _at_once(system, metric, alpha, table)


def _at_once(system: SlicewiseLinearSystem, metric: Metric, alpha: float, table: Table) -> Slice:
    """Return all solutions, by choosing the modes of all blocks together."""
    problem = problem_of(table, checked_necessary(system, alpha), metric.scale[:-1])
    if problem is None:
        return Slice((), ())
    found, faces = Points(system, metric, problem, alpha), list[Face]()
    for choices in leaves(problem):
        if choices.directions.shape[-1]:
            for k in range(len(choices)):
                check_budget()
                face = face_of(problem, choices[k : k + 1], alpha)
                faces += [face] if face else []
                found.undecided += bool(choices.rounding[k] > ONE_DIGIT)
        else:
            found.add(choices)
    points, wide = found.points(), tuple(face for face in faces if face.dimension)
    # beside a face, a single solution of a singular cell most often belongs to the face
    alone = [] if wide else lone_points(faces, metric, points)
    return Slice((*points, *alone), wide, found.undecided)


def lone_points(faces: Iterable[Face], metric: Metric, known: Sequence[Point] = ()) -> list[Point]:
    """Return the representatives of faces as points, each once, and none that is known."""
    points: list[Point] = []
    for face in faces:
        for x in face.representatives:
            error = GUARD * EPS * (np.abs(x) + metric.scale)[np.newaxis]
            if not any(is_same(metric, (p.x, p.error), (x, error)) for p in (*known, *points)):
                points.append(Point(x, error, (face.character,), 0, ALONE, False))
    return points


def cells_to_try(system: SlicewiseLinearSystem, metric: Metric, alpha: float) -> int:
    """Return how many cells of a slice are solved: the sum over parts, not the product."""
    table = Table.at(system, alpha, metric.scale[:-1])
    blocks = ([table.blocks[i] for i in part.blocks] for part in by_parts.parts_of_table(table))
    return sum(map(number_of_cells, blocks))


def _by_parts(
    system: SlicewiseLinearSystem, metric: Metric, alpha: float, table: Table
) -> Slice | None:
    """Return all solutions part by part; None for a system of a single part, or of few cells."""
    if number_of_cells(table.blocks) <= FEW_CELLS:
        return None
    parts = by_parts.parts_of_table(table)
    if len(parts) == 1:
        return None

    def solve(part: PartSlice) -> Slice:
        scale = part.magnitudes(metric.scale[part.unknowns])
        if part.size == 1 and (scalar := by_parts.solve_scalar(part, float(scale[0]))):
            return scalar
        around = Metric(np.append(scale, 1.0))
        found = _at_once(part, around, 0.0, part.table)
        points = (replace(p, in_doubt=is_in_doubt(part, around, p)) for p in found.points)
        return replace(found, points=tuple(points))

    found = by_parts.solve_parts(table, parts, solve)
    if found is None:
        return None
    points = [
        _whole(system, metric, alpha, partial, by_parts.cells_of(table, parts, partial))
        for partial in found
    ]
    return Slice(tuple(filter(None, points)), (), points.count(None))


def _whole(
    system: SlicewiseLinearSystem, metric: Metric, alpha: float, found: Partial, cells: Cells
) -> Point | None:
    """Return the solution of the whole system near a solution found part by part."""
    selection = Selection(system, cells[0])
    root = _root(Curve(selection, metric), np.append(found.z, alpha))
    if isinstance(root, Failure):
        return None
    error = uncertainty(root)
    tests, slack = tests_of(selection, metric, root.x, error)
    if not (tests >= -slack).all():
        return None
    return Point(root.x, error, cells, root.factor.sign, in_doubt=found.in_doubt)


def is_in_doubt(system: PiecewiseSystem, metric: Metric, point: Point) -> bool:
    """Tell whether a solution lies within rounding of an interface, and in a single cell."""
    if len(point.characters) > 1:
        return False
    if point.in_doubt is not None:
        return point.in_doubt
    selection = Selection(system, point.characters[0])
    tests, slack = tests_of(selection, metric, point.x, point.error)
    return bool((tests <= slack).any())


def tests_of(selection: Selection, metric: Metric, x: Array, error: Array) -> tuple[Array, Array]:
    """Return the bounding tests at a solution, and the errors of these values."""
    slack = slack_of_values(selection.test_gradients(x), x, error, metric.scale)
    if isinstance(part := selection.system, PartSlice):
        slack += part.inherited_slack[selection.bounding]
    return selection.tests(x), slack


def det_sign(system: PiecewiseSystem, metric: Metric, x: Array, character: Character) -> int:
    """Return the sign of det(dH/dz) in a cell of a point, 0 for a singular cell."""
    root = _root(Curve(Selection(system, character), metric), x)
    return 0 if isinstance(root, Failure) else root.factor.sign


def _root(curve: Curve, start: Array) -> Root | Failure:
    """Return the solution of a selection at the alpha of ``start``."""
    alpha, row = float(start[-1]), last_unit(len(start))
    root = newton(curve, lambda x: (float(x[-1]) - alpha, row), start, REFINEMENTS)
    if not isinstance(root, Failure):
        root.x[-1] = alpha
    return root


@final
class Points:
    """The isolated solutions so far, each with the choices of all cells that share the solution.

    ``border``: vanishes at all solutions, whose alpha is then an unknown, counted from ``alpha``.
    """

    def __init__(
        self,
        system: SlicewiseLinearSystem,
        metric: Metric,
        problem: Problem,
        alpha: float,
        border: Border | None = None,
    ) -> None:
        self._system, self._metric, self._problem = system, metric, problem
        self._alpha, self._border = alpha, border
        self.found: list[Known] = []
        #: Cells whose solution could not be refined.
        self.undecided = 0

    def points(self) -> list[Point]:
        """Return the solutions."""

        def cells(picks: Indices) -> Cells:
            return Cells([picks.shape[1]], lambda k: self._problem.character(picks[:, k[0]]))

        return [Point(k.x, k.error, cells(np.hstack(k.picks)), k.det_sign) for k in self.found]

    def add(self, choices: Choices) -> None:
        """Add the solutions of some choices without free directions."""
        for known in self.found:
            choices = known.claim(choices)
        while len(choices):
            check_budget()
            first, choices = choices[:1], choices[1:]
            new = self._refined(first)
            if new is not None:
                place = new.x, new.error
                alike = (k for k in self.found if k.is_certain == new.is_certain)
                same = (k for k in alike if is_same(self._metric, (k.x, k.error), place))
                known = next(same, new)
                self.found += [new] if known is new else []
                known.picks.append(first.picks)
                choices = known.claim(choices)

    def _refined(self, one: Choices) -> Known | None:
        """Return the solution of a choice, None for a solution outside of the closed cell."""
        problem, picks = self._problem, one.picks[:, 0]
        curve = Curve(Selection(self._system, problem.character(picks)), self._metric)
        start = problem.origin + problem.basis @ one.starts[0]
        if self._border is None:
            root = _root(curve, np.append(start[: self._system.size], self._alpha))
        else:
            start[-1] += self._alpha
            root = newton(curve, self._border, start, REFINEMENTS)
        if isinstance(root, Failure):
            self.undecided += 1
            return None
        error = uncertainty(root)
        if isinstance(self._system, PartSlice):
            more = self._system.inherited_error(root, curve.selection.character)
            error = np.vstack([error, more])
        x, alpha = root.x, float(root.x[-1])
        tests = np.array(self._system.test_functions(x[:-1], alpha), dtype=float)
        gradients = self._system.test_jacobian(x[:-1], alpha)
        slack = slack_of_values(gradients, x, error, self._metric.scale)
        if (is_doubtful := (tests != 0.0) & (np.abs(tests) <= slack)).any():
            terms = np.append(product(root.jacobian, x), -product(root.row, x))
            constants = curve.selection.residual_and(x, 0.0) - terms
            equations = root.factor, root.jacobian, constants
            less = slack_by_constants(gradients, tests, x, error, *equations)
            slack[is_doubtful] = np.minimum(slack, less)[is_doubtful]
        if isinstance(self._system, PartSlice):
            slack += self._system.inherited_slack
        holds = [
            np.array([(o.side * tests[o.bounding] >= -slack[o.bounding]).all() for o in options])
            for options in problem.blocks
        ]
        is_certain = has_digits(x, error, self._metric.scale)
        known = Known(x, error, holds, root.factor.sign, [], is_certain)
        return known if known.lies_in(one.picks).all() else None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """A solution, whose ``picks`` grow as choices that share the solution are met."""

    x: Array
    error: Array
    holds: list[Signs]  # per block, the options whose inequalities hold
    det_sign: int
    picks: list[Indices]
    #: Whether a digit is known: else the error hides in which cells the solution lies.
    is_certain: bool

    def lies_in(self, picks: Indices) -> Signs:
        """Tell in which closed cells the solution lies, of choices of shape (blocks, N)."""
        inside = np.ones(picks.shape[1], dtype=bool)
        for holds, picked in zip(self.holds, picks, strict=True):
            inside &= holds[picked]
        return inside

    def claim(self, choices: Choices) -> Choices:
        """Take the choices that share the solution, and return all other choices."""
        mine = self.lies_in(choices.picks)
        if not self.is_certain:
            mine &= choices.rounding > ONE_DIGIT
        if mine.any():
            self.picks.append(choices.picks[:, mine])
        return choices[np.flatnonzero(~mine)]
