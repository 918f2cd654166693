"""The loci of all transitions of a family of systems, along the second parameter.

In the plane of alpha and mu the loci of transitions are curves. Between the loci solutions stay in
the same cells; the number of solutions changes only at loci of folds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import pairwise
from typing import final

import numpy as np
from scipy.optimize import brentq

from pwscont import (
    BranchGraph,
    Character,
    InvalidInputError,
    PiecewiseSystem,
    PseudoArclength,
    StepSize,
    explore,
    trace,
)
from pwscont.extending import (
    CONVERGED,
    EPS,
    Array,
    Curve,
    Failure,
    Indices,
    Kind,
    Metric,
    Piece,
    Report,
    Selection,
    SpecialPoint,
    State,
    completed,
    counted,
    named,
    newton,
    short,
    silent,
    uninterrupted,
    with_article,
)
from pwscont.two_parameters.family import MakeSystem
from pwscont.two_parameters.locus import TransitionLocus

#: Distance at a value of mu, in typical magnitudes of (z, alpha), up to which two loci count as one
#: locus: half of the digits.
SAME_LOCUS = EPS**0.5
#: The stepper for loci: each look inside a step builds a system anew, so that only wider bumps of a
#: locus are looked for.
SPARING = PseudoArclength(step_size=StepSize(gap=0.02))
#: Largest distance of a locus from the chords between points, as a part of the range of alpha: less
#: than ``BESIDE`` of :mod:`plane`, so that points beside an edge lie on the right side.
FLAT = 1e-4
#: Most Newton iterations from a point of a locus, which mend rounding.
FEW_STEPS = 3


@final
class Passing(StrEnum):
    """The kinds of transitions, by the way of alpha along the curve."""

    FOLD = "fold"
    TRANSITION = "transition"
    VERTICAL = "vertical"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Locus:
    """The locus of a transition, followed along mu.

    Attributes
    ----------
    system : TransitionLocus
    graph : BranchGraph
        The branch graph of the locus: unknowns (z, alpha), parameter mu.
    """

    system: TransitionLocus
    graph: BranchGraph


@final
@dataclass(frozen=True, slots=True, eq=False)
class LocusPart:
    """A part of a locus on which all transitions are of the same kind.

    Attributes
    ----------
    crossing : Passing
        A fold; a transition at which alpha goes on; or a transition with a vertical piece on a
        side, with infinitely many solutions at one alpha.
    label : str
        The labels of the cells on the two sides.
    points : ndarray, shape (k, n + 2)
        Points (z, alpha, mu), mu monotone.
    error : ndarray, shape (2, n + 2)
        Error estimates of the first and the last point.
    """

    crossing: Passing
    label: str
    points: Array
    error: Array

    def __repr__(self) -> str:
        return named(self, self.crossing, short(self.label), counted(len(self.points), "point"))

    @property
    def plane(self) -> Array:
        """The points (alpha, mu), shape (k, 2), mu increasing."""
        plane = self.points[:, -2:]
        return plane if plane[-1, 1] >= plane[0, 1] else plane[::-1]

    @property
    def lowest(self) -> Array:
        """The point (z, alpha, mu) with the smallest mu."""
        lowest: Array = self.points[int(np.argmin(self.points[:, -1]))]
        return lowest


def turning(locus: TransitionLocus, y: Array, mu: float, character: Character) -> float:
    """Return a number that is positive if a transition is a fold, negative if alpha goes on.

    The value is the product of the slopes of alpha along the curves that leave to the two sides,
    with unit tangents. The slopes are proportional to det(dH/dz) (docs/theory, F3), by factors of
    equal sign on the two sides (F2), so the value vanishes if a determinant vanishes: there the
    transition begins or stops being a fold.

    Parameters
    ----------
    locus : TransitionLocus
    y : ndarray, shape (n + 1,)
        A point (z, alpha) of the locus.
    mu : float
    character : Character
        The character of the point as a point of the locus.
    """
    return float(_slopes(locus, y, mu, character).prod())


def _slopes(locus: TransitionLocus, y: Array, mu: float, character: Character) -> Array:
    """Return the slopes of alpha along the curves to the two sides; rounding counts as zero."""
    slopes = [_slope(locus, y, mu, side) for side in locus.sides(character)]
    if None in slopes:  # the locus turns here, tangent to alpha
        return np.zeros(2)
    return np.array(slopes)


def _slope(locus: TransitionLocus, y: Array, mu: float, side: Character) -> float | None:
    """Return the slope of alpha along the curve from a transition into the cell of a side."""
    selection = Selection(locus.at(mu), side)
    scale = np.append(locus.family.scale((mu, mu)), locus.limits.width)
    curve = Curve(selection, Metric(scale))
    if locus.test not in selection.bounding:
        return None
    index = int(np.flatnonzero(selection.bounding == locus.test)[0])
    root = newton(
        curve, lambda x: (selection.test(x, index), selection.test_gradient(x, index)), y, FEW_STEPS
    )
    if isinstance(root, Failure) or root.factor.is_singular():
        return None
    inward = curve.metric.normalised(root.factor.solve(np.eye(len(y))[-1]))
    return curve.slope(State(root.x, inward, root.error[np.newaxis], root.factor.sign))


def follow_transitions(
    family: MakeSystem,
    alphas: tuple[float, float],
    mus: tuple[float, float],
    levels: Sequence[float],
    *,
    known: Sequence[Locus] = (),
    parameter: str = "mu",
    report: Report = silent,
) -> list[Locus]:
    """Return the loci of every transition found at given values of mu.

    Parameters
    ----------
    family : callable
        mu -> :class:`~pwscont.PiecewiseSystem`.
    alphas, mus : tuple of float
        The ranges within which loci are followed.
    levels : sequence of float
        Values of mu at which :func:`pwscont.explore` finds the transitions between ``alphas``; a
        locus that meets none of the levels is not found.
    known : sequence of Locus, optional
        Loci that need not be followed again.
    parameter : str, optional
        Name of mu.
    report : callable, optional
        As for :func:`pwscont.trace`.

    Returns
    -------
    list of Locus
        Known and found loci, each once, even if a locus meets several levels.

    Raises
    ------
    InvalidInputError
        If there is a smooth fold at a level, or several loci meet at a level.
    InvalidInputError, InvalidSystemError
        As for :func:`pwscont.explore`.
    """
    found = list(known)
    for mu in levels:
        for point, test, magnitudes in _transitions(family, alphas, mu):
            locus = TransitionLocus(family, test, mu, alphas)
            locus.family = locus.family.with_magnitudes(magnitudes)
            y = np.append(completed(family(mu), point.z, point.alpha), point.alpha)
            if not any(_passes(other, locus, y, mu) for other in found):
                done = sum(len(other.graph.pieces) for other in found)
                counted = partial(lambda done, pieces, mu: report(done + pieces, mu), done)
                graph = trace(
                    locus, (y, mu), mus, stepper=SPARING, parameter=parameter, report=counted
                )
                found.append(Locus(locus, uninterrupted(graph)))
    return found


def _transitions(
    family: MakeSystem, alphas: tuple[float, float], mu: float
) -> Iterator[tuple[SpecialPoint, int, Array]]:
    """Yield the transitions at a value of mu, with the vanishing test and magnitudes of z."""
    graph = uninterrupted(explore(family(mu), alphas))
    system = graph.system or family(mu)  # the graph's has the magnitudes of the solutions
    scale = Metric.of(system, alphas).scale
    for point in graph.special_points():
        if point.kind == Kind.FOLD:
            raise InvalidInputError(
                f"there is a smooth fold at alpha = {point.alpha:.8g} for the level {mu:g}, and "
                "only transitions are followed here; trace a FoldLocus from it"
            )
        if point.kind in (Kind.START, Kind.END):
            continue
        zero = _vanishing(system, point, scale)
        if len(zero) != 1:
            raise InvalidInputError(
                f"there is {with_article(point.kind)} at alpha = {point.alpha:.8g} for the level "
                f"{mu:g}, where {len(zero)} test functions vanish, so loci meet; choose another "
                f"level"
            )
        yield point, int(zero[0]), scale[:-1]


def _vanishing(system: PiecewiseSystem, point: SpecialPoint, scale: Array) -> Indices:
    """Return the numbers of the tests that vanish at a special point."""
    z = completed(system, point.z, point.alpha)
    gradients = abs(system.test_jacobian(z, point.alpha))
    tests = system.test_functions(z, point.alpha)
    return np.flatnonzero(np.abs(tests) <= gradients @ (CONVERGED * scale))


def _passes(known: Locus, locus: TransitionLocus, y: Array, mu: float) -> bool:
    """Tell whether a known locus passes through a point."""
    lo, hi = known.graph.interval
    if known.system.test != locus.test or not lo <= mu <= hi:
        return False
    scale = locus.scale(mu, mu)
    distances = [np.abs((s.z - y) / scale).max() for s in known.graph.solutions(mu)]
    return bool(min(distances, default=np.inf) <= SAME_LOCUS)


def parts_of(locus: Locus) -> list[LocusPart]:
    """Return the parts of a locus, cut where the transition begins or stops being a fold.

    Parameters
    ----------
    locus : Locus

    Returns
    -------
    list of LocusPart
        The parts in the order of the pieces of the locus.
    """
    return [part for piece in locus.graph.pieces for part in _parts(locus, piece)]


def _parts(locus: Locus, piece: Piece) -> Iterator[LocusPart]:
    """Yield the parts of a piece of a locus."""
    inside = _inner(locus, piece)
    values = [_slopes(locus.system, x[:-1], float(x[-1]), piece.character) for x in inside]
    # a slope that is zero at single points changes sign nearby, or touches zero
    known = [(x, v) for x, v in zip(inside, values, strict=True) if v.all()] or [
        (x, np.zeros(2)) for x in inside
    ]
    begin, end = (locus.graph.point(node).error for node in (piece.start, piece.end))
    first, kind = [piece.points[0], known[0][0]], float(known[0][1].prod())
    for (x, before), (y, after) in pairwise(known):
        for cut, error in _cuts(locus, piece, (x, y), np.flatnonzero(before * after < 0.0)):
            ends = np.array([begin, error])
            yield LocusPart(_crossing(kind), piece.label, np.array([*first, cut]), ends)
            first, begin, kind = [cut], error, -kind
        first.append(y)
    points, ends = np.array([*first, piece.points[-1]]), np.array([begin, end])
    yield LocusPart(_crossing(kind), piece.label, points, ends)


def _inner(locus: Locus, piece: Piece) -> list[Array]:
    """Return points within a piece, denser where the piece bends.

    The ends of the piece, where several transitions may meet, are left out.
    """
    flat = FLAT * locus.system.limits.width
    inner: list[Array] = []
    for ends in pairwise(piece.points):
        inner += [*_between(locus.graph, piece, ends, flat), ends[1]]
    return inner[:-1]


def _between(
    graph: BranchGraph, piece: Piece, ends: tuple[Array, Array], flat: float
) -> list[Array]:
    """Return points of a piece between the points ``ends``, so dense that chords are flat.

    A vertical piece, along which mu stays the same, is straight in the plane of alpha and mu.
    """
    a, b = ends
    if piece.is_vertical:
        return [0.5 * (a + b)]
    middle, _ = _on(graph, piece, 0.5 * float(a[-1] + b[-1]))
    if abs(middle[-2] - 0.5 * (a[-2] + b[-2])) <= flat:
        return [middle]
    first, second = (_between(graph, piece, ends, flat) for ends in ((a, middle), (middle, b)))
    return [*first, middle, *second]


def _on(graph: BranchGraph, piece: Piece, mu: float) -> tuple[Array, Array]:
    """Return the point (z, alpha, mu) of a piece at a value of mu, and the error of the point."""
    (found,) = (s for s in graph.solutions(mu) if s.piece == piece.id)
    return np.append(found.z, mu), found.error


def _crossing(value: float) -> Passing:
    if value == 0.0:
        return Passing.VERTICAL
    return Passing.FOLD if value > 0.0 else Passing.TRANSITION


def _cuts(
    locus: Locus, piece: Piece, ends: tuple[Array, Array], sides: Indices
) -> list[tuple[Array, Array]]:
    """Return the points where the slope of exactly one side changes sign, with errors.

    None on a vertical piece, on which mu does not tell the points.
    """
    if piece.is_vertical:
        return []
    found = [_cut(locus, piece, (float(ends[0][-1]), float(ends[1][-1])), side) for side in sides]
    found.sort(key=lambda cut: abs(cut[0][-1] - ends[0][-1]))
    if len(found) == 2 and abs(np.diff([x[-1] for x, _ in found])) <= sum(e[-1] for _, e in found):
        return []
    return found


def _cut(
    locus: Locus, piece: Piece, bracket: tuple[float, float], side: int
) -> tuple[Array, Array]:
    """Return the point of a piece where the slope of a side changes sign, and the error.

    In general the slope of a single side has a simple zero, while the product of the two slopes may
    be so flat that the product is rounding far around the zero. The error is the distance within
    which the sign is unknown.
    """

    def slope(mu: float) -> float:
        x, _ = _on(locus.graph, piece, mu)
        return float(_slopes(locus.system, x[:-1], mu, piece.character)[side])

    lo, hi = sorted(bracket)
    sign, apart = np.sign(slope(hi)), 4.0 * EPS * max(map(abs, bracket))
    mu = float(brentq(slope, lo, hi, xtol=apart, rtol=4.0 * EPS))
    while (apart := 2.0 * apart) < hi - lo:
        beside = max(lo, mu - apart), min(hi, mu + apart)
        if slope(beside[0]) * sign < 0.0 < slope(beside[1]) * sign:
            break
    else:
        beside = lo, hi
    (x, error), others = _on(locus.graph, piece, mu), [_on(locus.graph, piece, o) for o in beside]
    return x, error + np.max([abs(other - x) for other, _ in others], axis=0)
