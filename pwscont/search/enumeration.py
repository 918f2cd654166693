"""Searches by enumeration at some values of alpha.

If few digits are left, if the signs do not sum to the degree, if cells are undecided or if no cell
has a solution, the slice is solved again in exact arithmetic. If that takes too long, the guarantee
says what is not certain, and a search promises nothing for such a slice.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import finite_array, generic, product
from pwscont.basics.budget import check_budget
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, Guarantee, Kind, SearchScope
from pwscont.basics.printing import counted
from pwscont.basics.quantities import Quantities
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import (
    Found,
    has_digits,
    is_inside,
    is_same,
    magnitude,
    slack_of_values,
)
from pwscont.curve.metric import Metric, Range
from pwscont.enumeration.exact import solve_exactly
from pwscont.enumeration.options import measured_at
from pwscont.enumeration.polyhedron import Point, Slice
from pwscont.enumeration.slices import ALONE, det_sign, is_in_doubt, lone_points, solve_slice
from pwscont.graph.records import FEW_DIGITS, Solution, significant
from pwscont.linear.factorise import last_unit
from pwscont.linear.threads import few_threads
from pwscont.search.search import Search
from pwscont.system.abilities import shown_points
from pwscont.system.box import Box
from pwscont.system.contract import check_attributes, check_in_domain
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions.cone import tangent_cone
from pwscont.transitions.corner import Corner

#: Distance from a solution at which H is compared with the Jacobian, as a part of the solution and
#: of typical magnitudes: half of the change of H there is rounding if no digit is known.
BESIDE = 0.01


@final
class Solutions(list[Solution]):
    """Solutions at an alpha, with a guarantee that says whether solutions may be missing.

    ``guarantee``: "complete", also with a remark in brackets; or words that begin with "not".
    ``is_finite``: whether no segment or more of solutions was found, of which some are listed.
    """

    def __init__(
        self,
        solutions: Iterable[Solution] = (),
        guarantee: str = "",
        system: PiecewiseSystem | None = None,
        alpha: float | None = None,
        *,
        is_finite: bool = True,
    ) -> None:
        super().__init__(solutions)
        self.guarantee, self.system, self.alpha = guarantee, system, alpha
        self.is_finite = is_finite


def enumerate_solutions(system: SlicewiseLinearSystem, alpha: float) -> Solutions:
    """Return all isolated solutions of a system of linear pieces at a given alpha.

    If infinitely many solutions fill a segment or more, the corners are returned, or some solution
    if there is no corner; the ``guarantee`` says so.

    Parameters
    ----------
    system : SlicewiseLinearSystem
    alpha : float

    Returns
    -------
    Solutions
        A list whose ``guarantee`` says whether a solution may be missing. A solution that several
        cells share is listed once, with the ``kind`` of the point, and with the sum of the signs of
        the solutions that meet there: 0 at a fold.

    Raises
    ------
    InvalidInputError
        If the system is not affine in z at fixed alpha, or alpha is no number in its domain.
    InvalidSystemError
        If typical magnitudes of z are too large or small to be computed with, or an attribute is
        a value where a method belongs, or a method where a value belongs.

    Examples
    --------
    >>> from pwscont import LCP, enumerate_solutions
    >>> found = enumerate_solutions(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[0, 0]), 0.0)
    >>> sorted(s.z.round(6).tolist() for s in found), found.guarantee
    ([[0.0, 1.0], [0.333333, 0.333333], [1.0, 0.0]], 'complete')
    """
    if not isinstance(system, SlicewiseLinearSystem):
        raise InvalidInputError(
            f"enumerate_solutions needs a SlicewiseLinearSystem, and {type(system).__name__} is "
            "none; if H is linear in z at fixed alpha, derive from that class (of a formula: "
            "linear=True), else ask explore(...).solutions(alpha)"
        )
    check_attributes(system)
    alpha = float(finite_array("alpha", alpha, ()))
    check_in_domain(system, alpha)
    with few_threads(system.size):
        fitted, metric = measured_at(system, alpha)
        found = solve_surely(fitted, metric, alpha)
        points = [*found.points, *lone_points(found.faces, metric, found.points)]
        solutions = [_solution(fitted, metric, point) for point in points]
    pairs, box = zip(solutions, points, strict=True), Box.of(system)
    within = [s for s, p in pairs if is_inside(box, p.x, p.error, metric.scale)]
    guarantee = _guarantee(system, found, sum(s.det_sign for s in solutions))
    return Solutions(within, guarantee, system, alpha, is_finite=not found.faces)


def solve_surely(system: SlicewiseLinearSystem, metric: Metric, alpha: float) -> Slice:
    """Return all solutions at ``alpha``, in exact arithmetic where rounding leaves doubt.

    If that takes too long, some cell is undecided. A point without a right digit is no solution.
    """
    found = solve_slice(system, metric, alpha)
    if (found.points or found.faces) and not _leaves_doubt(system, metric, found):
        return found
    exactly = solve_exactly(system, metric, alpha, lone_points(found.faces, metric))
    points = (exactly or found).points
    known = tuple(p for p in points if _digits(p, metric) > 0.0 and _is_seen(system, metric, p))
    lost = len(points) - len(known)
    if exactly is None:
        return replace(found, points=known, undecided=max(found.undecided + lost, 1))
    alone = tuple(point for point in found.points if point.known_signs == ALONE)
    return replace(exactly, points=known + alone, faces=found.faces, singular=lost)


def _digits(point: Point, metric: Metric) -> float:
    return significant(magnitude(point.x, point.error), point.x, metric.scale)


def _is_seen(system: SlicewiseLinearSystem, metric: Metric, point: Point) -> bool:
    """Tell whether H changes next to a solution as the Jacobian says, and not by rounding alone.

    Slopes that cancel except for rounding name a solution at 1e15, of which no digit is known.
    """
    selection, x = Selection(system, point.characters[0]), point.x
    step = BESIDE * (np.abs(x) + metric.scale) * generic(len(x))
    step[-1] = 0.0
    jacobian, change = selection.jacobian(x), selection.residual(x + step) - selection.residual(x)
    most = product(abs(jacobian), np.abs(step))
    return bool((np.abs(change - product(jacobian, step)) <= 0.5 * most).all())


def _leaves_doubt(system: SlicewiseLinearSystem, metric: Metric, found: Slice) -> bool:
    """Tell whether rounding may have changed the number of solutions of a slice."""
    points = found.points  # digits are lost, or a point lies on an interface and in a single cell
    lost = (_digits(p, metric) < FEW_DIGITS or is_in_doubt(system, metric, p) for p in points)
    if found.undecided or any(lost):
        return True
    if system.degree is None or found.faces:
        return False
    return sum(_index(system, metric, point)[0] for point in points) != system.degree


def _guarantee(system: SlicewiseLinearSystem, found: Slice, balance: int) -> str:
    """Return what is known about the number of solutions, in words."""
    if system.degree not in (None, balance) and not found.faces:
        return (
            f"not complete: the signs of det(dH/dz) sum to {balance:+d}, not to "
            f"{system.degree:+d}, so at least one solution is missing"
        )
    if not (found.points or found.faces or found.exact):
        return "not certain: nothing found, with too many cells for exact arithmetic"
    if found.undecided and not found.exact:
        return (
            "not certain: too ill conditioned for rounding, with too many cells for exact "
            "arithmetic; solutions may be missing"
        )
    if found.undecided:
        return (
            f"not certain: {found.undecided} more may be solutions, for all that rounding in "
            "the system itself can tell"
        )
    how = ["in exact arithmetic"] if found.exact else []
    if found.faces:
        cells = counted(len(found.faces), "cell")
        how += [f"but for {cells} with infinitely many, of which some are listed"]
    if found.singular:
        cells = counted(found.singular, "cell")
        how += [f"but for {cells} that rounding does not tell from singular"]
    return f"complete ({', '.join(how)})" if how else "complete"


def _solution(system: SlicewiseLinearSystem, metric: Metric, point: Point) -> Solution:
    character, (index, kind) = point.characters[0], _index(system, metric, point)
    error = shown_points(system, magnitude(point.x, point.error))
    known = kind, error, _digits(point, metric), Quantities(system.names)
    z, alpha = shown_points(system, point.x)[:-1], float(point.x[-1])
    return Solution(z, alpha, character, system.label(character), index, -1, *known)


def _index(system: PiecewiseSystem, metric: Metric, point: Point) -> tuple[int, Kind | None]:
    """Return the sum of signs to the right of a point, and the kind of point."""
    if point.known_signs == ALONE:
        return 0, Kind.DEGENERATE
    if len(point.characters) <= 2:
        others = (det_sign(system, metric, point.x, cell) for cell in point.characters[1:])
        signs = point.known_signs or (point.det_sign, *others)
        if len(signs) == 1:
            return signs[0], None
        return (0, Kind.NONSMOOTH_FOLD) if sum(signs) == 0 else (signs[0], Kind.TRANSITION)
    found = tangent_cone(Corner.at(system, metric, point.x, point.error))
    right = [
        ray.index if ray.interface_cells else ray.state.orientation
        for ray in found.rays
        if ray.curve.slope(ray.state) > 0.0
    ]
    return sum(right), found.kind


def starts_at(system: PiecewiseSystem, metric: Metric, alpha: float) -> Iterator[Found]:
    """Yield solutions at ``alpha`` to start from, each once; of a face, the corners.

    Complete for a :class:`~pwscont.SlicewiseLinearSystem`, where an undecided cell, and a face
    without corners, gives a start with an infinite error. For other systems Newton is tried once in
    every cell, and solutions may be missed.
    """
    if not isinstance(system, SlicewiseLinearSystem):
        known, box = list[Found](), Box.of(system)
        for character in system.cells():
            check_budget()
            solution = _in_cell(Curve(Selection(system, character), metric), box, alpha)
            if solution and not any(is_same(metric, solution, other) for other in known):
                known.append(solution)
                yield solution
        return
    found, size = solve_surely(system, metric, alpha), len(metric.scale)
    yield from ((point.x, point.error) for point in found.points)
    for face in found.faces:
        error = 0.0 if len(face.corners) else np.inf
        yield from ((x, np.full((1, size), error)) for x in face.representatives)
    unknown = np.append(np.zeros(size - 1), alpha), np.full((1, size), np.inf)
    yield from [unknown] * found.undecided


def _in_cell(curve: Curve, box: Box, alpha: float) -> Found | None:
    """Return the solution of a selection at ``alpha``, None if outside of the closed cell."""
    selection, scale = curve.selection, curve.metric.scale
    x = np.append(box.centre(scale[:-1]), alpha)
    found = BorderedNewton(most_iterations=30).correct(curve, x, last_unit(len(x)) * scale[-1])
    if isinstance(found, Failure) or not has_digits(found.state.x, found.state.error, scale):
        return None  # Newton ran off
    x, error = np.append(box.wrapped(found.state.x[:-1]), alpha), found.state.error
    slack = slack_of_values(selection.test_gradients(x), x, error, scale)
    return (x, error) if (selection.tests(x) >= -slack).all() else None


#: Most values of alpha that the scope of a search names; more values are counted.
MANY_LISTED = 5
#: Place of a slice in a part of the interval, as a fraction: the smaller part of the golden
#: section.
OFFSET = 0.5 * (3.0 - 5.0**0.5)


@final
@dataclass(frozen=True, slots=True)
class EndPoints(Search):
    """All solutions at the two ends of the interval.

    A component of the zero set within the interval is a closed loop or ends at an end of the
    interval. This search therefore finds every component except loops, if the enumeration is
    complete and solutions stay bounded: a component that comes from infinity and returns to
    infinity within the interval meets no end. If unknowns have bounds, a component may also end at
    a bound, and nothing is promised.

    Examples
    --------
    >>> from pwscont import LCP, EndPoints, explore
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    >>> explore(problem, (-1.0, 2.0), search=EndPoints()).guarantee
    'complete but for closed loops'
    """

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield the solutions at lo, then the solutions at hi."""
        for alpha in interval:
            yield from starts_at(system, metric, alpha)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise everything except loops for slices that can be enumerated."""
        if isinstance(system, SlicewiseLinearSystem):
            ends = Guarantee.NOTHING if Box.of(system).is_bounded else Guarantee.BUT_LOOPS
            return SearchScope("all solutions at both ends of the interval", ends)
        return SearchScope("Newton once per cell at both ends", Guarantee.NOTHING)


@final
@dataclass(frozen=True, slots=True)
class Slices(Search):
    """Solutions at some values of alpha inside the interval, on loops that cross these values.

    Complete where the system is affine in z at fixed alpha; otherwise Newton is tried once in every
    cell, and solutions may be missed.

    Attributes
    ----------
    alphas : tuple of float
        Values of the interval that is explored.

    Raises
    ------
    InvalidInputError
        If alphas are no finite numbers, a single number without a tuple, or none at all.

    Examples
    --------
    >>> from pwscont import LCP, Slices, explore
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    >>> explore(problem, (-1.0, 2.0), search=Slices((0.0,))).guarantee
    'balanced'
    """

    alphas: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the values."""
        if finite_array("Slices.alphas", self.alphas).ndim != 1 or not len(self.alphas):
            raise InvalidInputError(
                "Slices takes one value of alpha or several, as in Slices((0.7,)), "
                f"got {self.alphas!r}"
            )

    @classmethod
    def spread(cls, count: int, interval: Range) -> Slices:
        """Return slices at even distances that avoid the middle and other special values."""
        lo, hi = interval
        return cls(tuple((lo + (hi - lo) * (np.arange(count) + OFFSET) / count).tolist()))

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield the solutions slice by slice.

        Raises
        ------
        InvalidInputError
            If a slice lies outside the interval.
        """
        lo, hi = interval
        for alpha in self.alphas:
            if not lo <= alpha <= hi:
                where = f"{float(alpha)} lies outside the interval [{lo}, {hi}]"
                raise InvalidInputError(f"Slices: {where}")
        for alpha in self.alphas:
            yield from starts_at(system, metric, alpha)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing beyond the slices."""
        linear, alphas = isinstance(system, SlicewiseLinearSystem), self.alphas
        what = "all solutions" if linear else "Newton once per cell"
        where = "alpha = " + ", ".join(f"{alpha:.6g}" for alpha in alphas)
        if len(alphas) > MANY_LISTED:
            where = f"{len(alphas)} values of alpha from {min(alphas):.6g} to {max(alphas):.6g}"
        return SearchScope(f"{what} at {where}", Guarantee.NOTHING)
