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
from pwscont.basics.outcome import Failure, Kind
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude_of_values
from pwscont.curve.metric import Metric
from pwscont.enumeration import Cells, Slice, solve_slice
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem
from pwscont.transitions.corner.index import index_along
from pwscont.transitions.corner.linearised import Linearised, in_parts
from pwscont.transitions.corner.perturbed import PerturbedCone
from pwscont.transitions.corner.simple import Direction, simple_corner
from pwscont.transitions.corner.ways import ways
from pwscont.transitions.rays import Ray, state_on

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
    def is_balanced(self) -> bool:
        """Whether the signs of the rays cancel, as those of all rays together do (F12)."""
        return sum(map(_sign, self.rays)) == 0

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
    system: PiecewiseSystem,
    metric: Metric,
    x: Array,
    error: Array,
    zero: frozenset[int],
    back: Ray | None = None,
) -> TangentCone:
    """Return the rays at a solution ``x`` where the tests ``zero`` vanish.

    All of them, as far as the cells that meet there can all be tried; else those that paths lead to
    which begin at the ray ``back``, or anywhere.
    """
    simple = simple_corner(system, metric, x, zero)
    if simple is not None:
        rays = tuple(
            _backwards(back, found) or _ray(system, metric, x, error, found) for found in simple
        )
        return TangentCone(rays, 1, False, True)
    signs = system.test_functions(x[:-1], float(x[-1])) >= 0.0
    cone = in_parts(system, metric, x, zero, signs) or Linearised(system, metric, x, zero, signs)
    if not cone.is_small:
        return _by_perturbation(system, metric, x, error, zero, back)
    around = Metric(np.append(metric.scale, 1.0))
    slices = [solve_slice(cone, around, side) for side in (1.0, -1.0)]
    rays = _rays(system, metric, x, error, zero, _directions(slices))
    dimension = max((1 + face.dimension for s in slices for face in s.faces), default=1)
    return TangentCone(rays, dimension, _along_interface(rays), True)


def _backwards(back: Ray | None, found: Direction) -> Ray | None:
    """Return a ray in the cell in which the corner was reached, None in other cells."""
    direction, (character, *_) = found
    if back is None or back.interface_cells:
        return None
    if back.curve.selection.cell != back.curve.selection.system.cell(character):
        return None
    state, tangent = back.state, back.curve.metric.normalised(direction)
    same = float(back.curve.metric.covector(tangent).dot(state.tangent)) > 0.0
    orientation = state.orientation if same else -state.orientation
    return Ray(back.curve, State(state.x, tangent, state.error, orientation))


def _by_perturbation(
    system: PiecewiseSystem,
    metric: Metric,
    x: Array,
    error: Array,
    zero: frozenset[int],
    back: Ray | None,
) -> TangentCone:
    """Return rays found by perturbation: all, only if there can be no others."""
    along = None if back is None else (back.state.tangent, (back.curve.selection.character,))
    found = ways(PerturbedCone(system, metric, x, zero), zero, along)
    rays = _rays(system, metric, x, error, zero, found)
    return TangentCone(rays, 1, _along_interface(rays), system.unique and _to_both_sides(rays))


def _to_both_sides(rays: Sequence[Ray]) -> bool:
    """Tell whether there is a ray to each side of alpha."""
    return {np.sign(ray.curve.slope(ray.state)) for ray in rays} >= {1.0, -1.0}


def _along_interface(rays: Sequence[Ray]) -> bool:
    return any(bool(ray.interface_cells) for ray in rays)


def _rays(
    system: PiecewiseSystem,
    metric: Metric,
    x: Array,
    error: Array,
    zero: frozenset[int],
    directions: Sequence[Direction],
) -> tuple[Ray, ...]:
    """Return rays in some directions, parallel ones once."""
    rays: list[Ray] = []
    for found in directions:
        ray = _ray(system, metric, x, error, found)
        if not any(parallel(ray, other) for other in rays):
            rays.append(_with_index(ray, zero) if ray.interface_cells else ray)
    return tuple(rays)


def _directions(slices: list[Slice]) -> list[Direction]:
    points = [(p.x[:-1], _listed(p.characters)) for s in slices for p in s.points]
    corners = [
        (c[:-1], (face.character,)) for s in slices for face in s.faces for c in face.corners
    ]
    return points + corners


def _listed(cells: Sequence[Character]) -> tuple[Character, ...]:
    return cells.listed() if isinstance(cells, Cells) else tuple(cells)


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


def _sign(ray: Ray) -> int:
    """Return the orientation of a ray; along interfaces that of what small changes make of it."""
    if not ray.interface_cells:
        return ray.state.orientation
    return ray.index * int(np.sign(ray.curve.slope(ray.state)))


def _turns(a: Ray, b: Ray) -> bool:
    """Tell whether both rays leave to the same side of alpha."""
    return a.curve.slope(a.state) * b.curve.slope(b.state) > 0.0
