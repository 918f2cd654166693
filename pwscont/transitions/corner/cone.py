"""The tangent cone of a corner: all rays that leave a solution at which tests vanish.

Two algorithms find the rays: where the cells that meet at the corner can all be tried, enumeration
finds all rays; where the cells are too many, perturbation finds rays, and more may exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.budget import check_budget
from pwscont.basics.outcome import Kind
from pwscont.basics.rounding import EPS
from pwscont.curve.curve import Curve, State
from pwscont.system.abilities import DecidesCorners
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseLinearSystem
from pwscont.transitions.corner.enumeration import index_along, rays_cell_by_cell, rays_of_slices
from pwscont.transitions.corner.perturbation import rays_by_perturbation
from pwscont.transitions.rays import (
    Corner,
    Direction,
    Ray,
    beside,
    rounding_of_tests,
    state_on,
)

#: Length, in the metric, over which a curve tangent to an interface is followed to see to which
#: side the curve bends.
BENDING_PROBE = 1e-4
#: Two rays are parallel if the cosine of their angle differs from one by less than this.
PARALLEL = 1e-12


@final
@dataclass(frozen=True, slots=True, eq=False)
class TangentCone:
    """The rays of a corner."""

    rays: tuple[Ray, ...]  # isolated rays, and the extreme rays of faces
    dimension: int  # largest dimension of a cone of solutions: 1 unless the corner is degenerate
    exact: bool  # whether the rays are certainly all; otherwise there may be more

    @property
    def along_interface(self) -> bool:
        """Whether a ray runs along an interface instead of into a cell."""
        return any(ray.interface_cells for ray in self.rays)

    @property
    def is_balanced(self) -> bool:
        """Whether the signs of the rays cancel, as the signs of all rays together do (F12)."""
        # indices are signs of det(dH/dz), which the side of alpha makes orientations
        along = [ray for ray in self.rays if ray.interface_cells]
        indices = sum(ray.index * int(np.sign(ray.curve.slope(ray.state))) for ray in along)
        return indices + sum(r.state.orientation for r in self.rays if not r.interface_cells) == 0

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
        slopes = [ray.curve.slope(ray.state) for ray in self.rays]
        return Kind.NONSMOOTH_FOLD if len(slopes) == 2 and np.prod(slopes) > 0.0 else Kind.CORNER


def tangent_cone(corner: Corner, back: Ray | None = None) -> TangentCone:
    """Return the rays of a corner: all, or if the cells are too many, those that paths lead to.

    ``back``: the ray along which the corner was reached, at which the paths begin.
    """
    simple = rays_cell_by_cell(corner)
    enumerated = rays_of_slices(corner) if simple is None else (simple, 1)
    if enumerated is not None:
        found, dimension = enumerated
        return TangentCone(_rays(corner, found), dimension, exact=True)
    along = None if back is None else (back.state.tangent, (back.curve.selection.character,))
    rays = _rays(corner, rays_by_perturbation(corner, along))
    to_both_sides = {np.sign(ray.curve.slope(ray.state)) for ray in rays} >= {1.0, -1.0}
    system, z, alpha = corner.system, corner.x[:-1], float(corner.x[-1])
    is_unique = system.unique  # at most one ray to either side of alpha, by promise
    if isinstance(system, DecidesCorners) and not is_unique:
        is_unique = system.has_one_ray(z, alpha, corner.zero)
    return TangentCone(rays, 1, exact=to_both_sides and is_unique)


def _rays(corner: Corner, directions: Sequence[Direction]) -> tuple[Ray, ...]:
    """Return rays in some directions, one ray for parallel directions."""
    rays: list[Ray] = []
    for found in directions:
        ray = _ray(corner, found)
        if not any(parallel(ray, other) for other in rays):
            along = ray.interface_cells
            rays.append(replace(ray, index=index_along(ray, corner.zero)) if along else ray)
    return tuple(rays)


def _ray(corner: Corner, found: Direction) -> Ray:
    """Return the ray in a direction: into a cell, or along the interfaces of several cells."""
    system, metric = corner.system, corner.metric
    direction, characters = found
    tangent = metric.normalised(direction)

    def on(selection: Selection) -> Ray:
        curve = Curve(selection, metric)
        return Ray(curve, state_on(curve, corner.x, tangent, corner.error))

    if len(characters) == 1:
        return on(Selection(system, characters[0]))
    if not isinstance(system, PiecewiseLinearSystem):
        for character in characters:
            ray = on(Selection(system, character))
            if _bends_into(ray.curve, ray.state):
                return ray
    return replace(on(Selection(system, characters[0], characters)), interface_cells=characters)


def _bends_into(curve: Curve, state: State) -> bool:
    """Tell whether a curve that is tangent to an interface bends into the cell of the curve."""
    check_budget()
    there, selection = beside(curve, state, BENDING_PROBE), curve.selection
    if there is None:
        return False
    gradients = selection.test_gradients(there.x)
    rounding = rounding_of_tests(gradients, there.x, there.error, curve.metric.scale)
    return bool((selection.tests(there.x) > rounding).all())


def parallel(a: Ray, b: Ray) -> bool:
    """Tell whether two rays from one point have one direction."""
    cosine = a.curve.metric.covector(a.state.tangent).dot(b.state.tangent)
    return bool(cosine > 1.0 - PARALLEL)


def opposite(a: Ray, b: Ray) -> bool:
    """Tell whether two rays from one point have opposite directions."""
    return parallel(a, b.reversed())


def same_piece(ray: Ray, back: Ray) -> bool:
    """Tell whether a ray of a corner is the piece on which the corner was reached.

    A cell holds one ray, or several that differ clearly; the direction of the piece carries
    errors that ill conditioning magnifies.
    """
    if set(ray.cells).isdisjoint(back.cells):
        return parallel(ray, back)
    cosine = ray.curve.metric.covector(ray.state.tangent).dot(back.state.tangent)
    return bool(cosine > 1.0 - EPS**0.5)
