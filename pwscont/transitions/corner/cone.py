"""All rays at a corner: the cone problem H'(x; d) = 0 (docs/theory, F8).

Where several test functions vanish at x, the zero set near x is the set of directions d with
J_chi d = 0 and grad(kappa_i) . d of the sign that chi demands, over all cells chi that meet at
x. This is a piecewise-linear problem in d; fixing the length of d by a generic linear condition
c . d = +1 or -1 makes its rays the solutions of two slices, which are enumerated like any other.

Most corners are simple and need none of this, see :mod:`pwscont.transitions.corner.simple`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.semismooth import semismooth_newton
from pwscont.curve.uncertainty import magnitude_of_values
from pwscont.enumeration import Cells, Point, Slice, solve_slice
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions.corner.index import index_along
from pwscont.transitions.corner.linearised import Linearised, in_parts
from pwscont.transitions.corner.simple import Direction, simple_corner
from pwscont.transitions.rays import Ray, state_on

#: Newton starts that may fail at a corner with more cells before the search ends.
MOST_FAILURES = 2
#: How far a curve tangent to an interface is followed to see to which side it bends.
PROBE = 1e-4
#: Two directions are one when the cosine of their angle differs from one by less than this.
SAME_DIRECTION = 1e-12


@final
@dataclass(frozen=True, slots=True, eq=False)
class TangentCone:
    """The rays at a corner.

    Attributes
    ----------
    rays : tuple of Ray
        Isolated rays, and the extreme rays of faces.
    dimension : int
        Largest dimension of a cone of solutions: 1 unless the corner is degenerate.
    along_interface : bool
        Whether a ray runs along an interface instead of into a cell.
    exact : bool
        Whether all cells that meet at the corner were tried; otherwise there may be more rays.
    """

    rays: tuple[Ray, ...]
    dimension: int
    along_interface: bool
    exact: bool

    @property
    def kind(self) -> Kind:
        """The kind of special point that the corner is."""
        if not self.exact:
            return Kind.PARTIAL_CORNER
        if not self.rays:
            return Kind.ISOLATED
        if self.dimension > 1 or self.along_interface:
            return Kind.DEGENERATE
        if len(self.rays) > 2:
            return Kind.NONSMOOTH_BRANCH_POINT
        if len(self.rays) == 2 and _turns(*self.rays):
            return Kind.NONSMOOTH_FOLD
        return Kind.CORNER


def fan(
    system: PiecewiseSystem, metric: Metric, x: Array, error: Array, zero: frozenset[int]
) -> TangentCone:
    """Return all rays at a solution ``x`` where the tests ``zero`` vanish."""
    simple = simple_corner(system, metric, x, zero)
    if simple is not None:
        return TangentCone(
            tuple(_ray(system, metric, x, error, found) for found in simple), 1, False, True
        )
    signs = system.test_functions(x[:-1], float(x[-1])) >= 0.0
    cone = in_parts(system, metric, x, zero, signs) or Linearised(system, metric, x, zero, signs)
    around = Metric(np.append(metric.scale, 1.0))
    exact = cone.is_small
    solve = solve_slice if exact else _sample_slice
    slices = [solve(cone, around, side) for side in (1.0, -1.0)]
    rays: list[Ray] = []
    for found in _directions(slices):
        ray = _ray(system, metric, x, error, found)
        if not any(parallel(ray, other) for other in rays):
            rays.append(_with_index(ray, zero) if ray.interface_cells else ray)
    dimension = max((1 + face.dimension for s in slices for face in s.faces), default=1)
    return TangentCone(
        tuple(rays), dimension, any(bool(ray.interface_cells) for ray in rays), exact
    )


def _directions(slices: list[Slice]) -> list[Direction]:
    points = [(p.x[:-1], _listed(p.characters)) for s in slices for p in s.points]
    corners = [
        (c[:-1], (face.character,)) for s in slices for face in s.faces for c in face.corners
    ]
    return points + corners


def _listed(cells: Sequence[Character]) -> tuple[Character, ...]:
    return cells.listed() if isinstance(cells, Cells) else tuple(cells)


def _sample_slice(cone: SlicewiseLinearSystem, metric: Metric, side: float) -> Slice:
    """Return solutions of a slice with too many cells, by Newton from a few starts.

    Each is deflated away once it is found; nothing says that there are no others.
    """
    rng = np.random.default_rng(MOST_FAILURES)  # fixed: two runs are identical
    found: list[Point] = []
    failures = 0
    while failures < MOST_FAILURES:
        guess = rng.normal(size=cone.size) * metric.scale[:-1]
        root = semismooth_newton(cone, metric, guess, side, [point.x for point in found])
        if isinstance(root, Failure):
            failures += 1
            continue
        x, error = root
        found.append(Point(x, error, (cone.character(x[:-1], side),), 0))
    return Slice(tuple(found), ())


def _ray(
    system: PiecewiseSystem,
    metric: Metric,
    x: Array,
    error: Array,
    found: Direction,
) -> Ray:
    direction, characters = found
    tangent = metric.normalised(direction)
    curves = (Curve(Selection(system, character), metric) for character in characters)
    if len(characters) == 1:
        return _on(next(curves), x, tangent, error)
    if not isinstance(system, PiecewiseLinearSystem):
        for curve in curves:
            ray = _on(curve, x, tangent, error)
            if _bends_into(curve, ray.state):
                return ray
    riding = Curve(Selection(system, characters[0], characters), metric)
    return replace(_on(riding, x, tangent, error), interface_cells=characters)


def _on(curve: Curve, x: Array, tangent: Array, error: Array) -> Ray:
    return Ray(curve, state_on(curve, x, tangent, error))


def _with_index(ray: Ray, zero: frozenset[int]) -> Ray:
    """Return a ray along an interface with its index."""
    return replace(ray, index=index_along(ray, zero))


def _bends_into(curve: Curve, state: State) -> bool:
    """Tell whether a curve that is tangent to an interface leaves it into this cell."""
    check_budget()
    beside = state.x + PROBE * state.tangent
    corrected = BorderedNewton().correct(curve, beside, state.tangent)
    if isinstance(corrected, Failure):
        return False
    selection, x = curve.selection, corrected.state.x
    rounding = magnitude_of_values(selection.test_gradients(x), x, corrected.state.error)
    return bool((selection.tests(x) > CONFIDENCE * rounding).all())


def parallel(a: Ray, b: Ray) -> bool:
    """Tell whether two rays from one point have one direction."""
    cosine = a.curve.metric.covector(a.state.tangent).dot(b.state.tangent)
    return bool(cosine > 1.0 - SAME_DIRECTION)


def same_piece(ray: Ray, back: Ray) -> bool:
    """Tell whether a ray of the cone problem is the piece on which the corner was reached.

    A cell holds one ray, or several that differ clearly; the direction of the piece carries
    errors that ill conditioning magnifies.
    """
    if set(ray.cells).isdisjoint(back.cells):
        return parallel(ray, back)
    cosine = ray.curve.metric.covector(ray.state.tangent).dot(back.state.tangent)
    return bool(cosine > 1.0 - EPS**0.5)


def opposite(a: Ray, b: Ray) -> bool:
    """Tell whether two rays from one point have opposite directions."""
    return parallel(a, b.reversed())


def _turns(a: Ray, b: Ray) -> bool:
    """Tell whether both rays leave to the same side of alpha."""
    return a.curve.slope(a.state) * b.curve.slope(b.state) > 0.0
