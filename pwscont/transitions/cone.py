"""Corners, where several interfaces meet: all rays that leave a solution at which tests vanish.

Two algorithms find the rays of the tangent cone: where the cells that meet at the corner can all be
tried, enumeration finds all rays (docs/theory, F8); where the cells are too many, perturbation
finds rays, and more may exist (:mod:`pwscont.transitions.corner_paths`).

At most corners few cells meet, and in each cell J_chi d = 0 has one solution d up to its length.
The vector d is a ray if the tests that vanish grow along d into the cell. The matrices are those of
the paths, so that structure and updates of factorisations serve at corners as well.

At all other corners the rays are the solutions of a piecewise-linear problem, the cone problem
H'(x; d) = 0. A linear condition c . d = +1 or -1 fixes the length of d, and the solutions of these
two slices are enumerated like those of any other slice, part by part where the problem has parts.
All rays are found, the extreme rays where a cone of dimension two or more solves the problem.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from math import prod
from typing import TypeGuard, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, by_rows, dense, generic
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure, Kind
from pwscont.basics.printing import at
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import has_digits, zero_up_to
from pwscont.curve.metric import Metric
from pwscont.enumeration.by_parts import PartSlice, is_regular, most_cells, parts_of_table
from pwscont.enumeration.options import Table
from pwscont.enumeration.polyhedron import Cells, Slice
from pwscont.enumeration.slices import FEW_CELLS, solve_slice
from pwscont.linear.factorise import last_unit
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.system.abilities import DecidesCorners
from pwscont.system.contract import jacobian_at
from pwscont.system.selection import Selection
from pwscont.system.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    number_of_cells,
)
from pwscont.system.values import refuse_infinite
from pwscont.transitions.corner import Corner, Direction
from pwscont.transitions.corner_paths import rays_by_perturbation
from pwscont.transitions.rays import (
    ASTRAY,
    NEARBY,
    SLANT,
    Ray,
    are_level,
    beside,
    parallel,
    state_on,
)


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
        """The kind of special point that a corner with rays is."""
        if not self.exact:
            return Kind.PARTIAL_CORNER
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
    if simple is None and corner.system.unique and _has_many_cells(corner):
        cone = _cone_by_paths(corner, back)  # two rays are all, and found sooner than in all cells
        if cone.exact and not cone.along_interface:
            return cone
    enumerated = rays_of_slices(corner) if simple is None else (simple, 1)
    if enumerated is None:
        return _cone_by_paths(corner, back)
    found, dimension = enumerated
    return TangentCone(_rays(corner, found), dimension, exact=True)


def _has_many_cells(corner: Corner) -> bool:
    """Tell whether more cells meet at a corner than are tried one after another."""
    return (blocks := _blocks(corner)) is None or number_of_cells(blocks) > FEW_CELLS


def _cone_by_paths(corner: Corner, back: Ray | None) -> TangentCone:
    """Return the rays that paths lead to; ``exact`` if the system says that there are no more."""
    along = back and (back.state.tangent, (back.curve.selection.character,))
    rays = _rays(corner, rays_by_perturbation(corner, along))
    to_both_sides = {np.sign(ray.curve.slope(ray.state)) for ray in rays} >= {1.0, -1.0}
    system, x = corner.system, corner.x
    is_unique = system.unique  # at most one ray to either side of alpha, by promise
    if isinstance(system, DecidesCorners) and not is_unique:
        is_unique = system.has_one_ray(x[:-1], float(x[-1]), corner.zero)
    return TangentCone(rays, 1, exact=to_both_sides and is_unique)


def _rays(corner: Corner, directions: Sequence[Direction]) -> tuple[Ray, ...]:
    """Return rays in some directions, one ray for parallel directions.

    A curve that begins so far from the corner that no digit agrees does not leave from there.
    """
    rays: list[Ray] = []
    for found in _completed(corner, directions):
        ray = _ray(corner, found)
        state = ray.state
        is_there = state.x is corner.x or has_digits(state.x, state.error, corner.metric.scale)
        if is_there and not any(parallel(ray, other) for other in rays):
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
        each = (on(Selection(system, character)) for character in characters)
        if ray := next((ray for ray in each if _bends_into(ray.curve, ray.state)), None):
            return ray
        if len(characters) <= FEW_CELLS:
            characters = tuple(c for c in characters if is_solid(corner, c)) or characters
    return replace(on(Selection(system, characters[0], characters)), interface_cells=characters)


def _completed(corner: Corner, directions: Sequence[Direction]) -> Iterator[Direction]:
    """Yield directions with all cells to which each belongs, and the opposite of a direction.

    Slopes of tests that are errors of derivatives have a sign all the same: a direction along
    interfaces may seem to lie in a single cell, and the opposite direction in none.
    """
    for direction, cells in directions:
        if len(cells) > 1 or isinstance(corner.system, PiecewiseLinearSystem):
            yield direction, cells
            continue
        selection = Selection(corner.system, cells[0])
        every_test, rows = corner.vanishing(selection)
        tangent, scale = corner.metric.normalised(direction), corner.metric.scale
        level = are_level(selection, dense(rows), tangent, scale)
        tests = every_test[level].tolist()[:MOST_PATTERN_TESTS]
        every = [cells[0]]
        for signs in product((False, True), repeat=len(tests)):
            if (cell := cells[0].with_signs(tests, signs)) == cells[0]:
                continue
            jacobian = Selection(corner.system, cell).jacobian(corner.x)
            terms = abs(jacobian) @ np.abs(direction)
            if (np.abs(jacobian @ direction) <= ASTRAY * terms).all():
                every.append(cell)
        yield direction, tuple(every)
        if len(every) > 1 and level.all():
            yield -direction, tuple(every)


def is_solid(corner: Corner, character: Character) -> bool:
    """Tell whether a cell has points inside next to the corner, as not all patterns of signs have.

    By Gordan's theorem no direction makes all tests positive only if a combination of the gradients
    with weights of at least zero, and with sum one, is zero.
    """
    from scipy.optimize import nnls  # noqa: PLC0415  the import takes long

    rows = dense(corner.vanishing(Selection(corner.system, character))[1]) * corner.metric.scale
    sizes = np.linalg.norm(rows, axis=1)
    if len(rows) < 2 or not sizes.all():
        return True
    weights = np.vstack([(rows / sizes[:, np.newaxis]).T, np.ones(len(rows))])
    return bool(nnls(weights, last_unit(len(weights)))[1] > SLANT)


def _bends_into(curve: Curve, state: State) -> bool:
    """Tell whether a curve that is tangent to an interface bends into the cell of the curve."""
    check_budget()
    there, selection = beside(curve, state, NEARBY), curve.selection
    if isinstance(there, Failure):
        return False
    gradients = selection.test_gradients(there.x)
    rounding = zero_up_to(gradients, np.abs(there.x) + curve.metric.scale, there.error)
    return bool((selection.tests(there.x) > rounding).all())


#: Most cells that the cone problem tries at a corner: those of eight contact nodes.
MOST_CELLS_OF_CONE = 4**8
#: Most vanishing tests of a system without blocks, whose sign patterns are tried one after another.
MOST_PATTERN_TESTS = 12
#: Generic right-hand sides e that are tried for an index.
MOST_RIGHT_HAND_SIDES = 3


def rays_cell_by_cell(corner: Corner) -> list[Direction] | None:
    """Return the directions of all rays, None where this simple way does not find all.

    That is where the cells are many or not known, where a cell has more than one null vector, or
    where the slope of a vanishing test along the null vector may be zero.
    """
    system, zero, found = corner.system, corner.zero, list[Direction]()
    if not isinstance(system, SlicewiseLinearSystem) or not zero:
        return None
    if _has_blocks(system):
        blocks = [block for block in system.blocks() if not zero.isdisjoint(block.tests)]
        choices = [block.modes for block in corner.restricted(blocks)]
        if prod(map(len, choices)) > FEW_CELLS:
            return None
        tests = [test for block in blocks for test in block.tests]
        cells = [corner.character.with_signs(tests, chain(*some)) for some in product(*choices)]
    elif len(zero) > MOST_PATTERN_TESTS:
        return None
    else:
        cells = corner.all_cells()
    for character in cells:
        selection = Selection(corner.system, character)
        if (ray := corner.ray_in(selection)) is None:
            return None
        direction, slopes = ray
        if not (len(slopes) and slopes.all()):
            return None
        if (slopes > 0.0).all() or (slopes < 0.0).all():
            found.append((np.copysign(1.0, slopes[0]) * direction, (character,)))
    return found


def rays_of_slices(corner: Corner) -> tuple[list[Direction], int] | None:
    """Return the directions of all rays, and the largest dimension of a cone of solutions.

    None where the cells that meet at the corner are too many. Of a cone of dimension two or more
    the extreme rays are returned.
    """
    if (blocks := _blocks(corner)) is None:
        return None
    size, cells, table = len(corner.x), number_of_cells(blocks), None
    if _has_blocks(corner.system) and cells > FEW_CELLS:
        # alpha fixes the length, so that parts may have far fewer cells: then no ray may be
        # vertical, and none is, if every part is regular in all cells
        table = _cone_table(corner, blocks, last_unit(size))
        parts = parts_of_table(table)
        are_far_fewer = FEW_CELLS * most_cells(parts, blocks) <= cells
        if not (are_far_fewer and is_regular(table, parts, corner.metric.scale)):
            table = None
    table = table or _cone_table(corner, blocks, generic(size) / corner.metric.scale)
    if not _is_small(table):
        return None
    rays, extreme, dimension = [], [], 1
    tests = [test for block in blocks for test in block.tests]
    for side in (1.0, -1.0):
        forms = [(matrix, side * constants) for matrix, constants in table.rows]
        found = _solved(corner, replace(table, rows=forms))
        for point in found.points:
            cells_of = point.characters
            own = cells_of.listed() if isinstance(cells_of, Cells) else cells_of
            around = (corner.character.with_signs(tests, cell.signs) for cell in own)
            rays.append((point.x[:-1], tuple(around)))
        for face in found.faces:
            cell = corner.character.with_signs(tests, face.character.signs)
            extreme += [(x[:-1], (cell,)) for x in face.corners]
            dimension = max(dimension, 1 + face.dimension)
    return rays + extreme, dimension


def _has_blocks(system: PiecewiseSystem) -> TypeGuard[SlicewiseLinearSystem]:
    """Tell whether a system says by blocks which cells there are, or by its own ``cells``."""
    kind, default = type(system), SlicewiseLinearSystem
    own = kind.cells is not default.cells or getattr(kind, "blocks", None) is not default.blocks
    return isinstance(system, default) and own


def index_along(ray: Ray, zero: frozenset[int]) -> int:
    """Return the index of a ray along interfaces, from where the tests ``zero`` vanish."""
    system, state, metric = ray.curve.selection.system, ray.state, ray.curve.metric
    near = Corner.at(system, metric, state.x, state.error, zero)
    rows, which, tangent = near.gradients, near.which, state.tangent
    slopes = np.asarray(rows @ tangent)
    level = np.abs(slopes) <= zero_up_to(rows, np.abs(tangent) + SLANT * metric.scale, part=SLANT)
    near.tests[which] = np.where(level, 0.0, slopes)  # tests that grow along the ray are positive
    return index_at(ray, replace(near, zero=frozenset(which[level].tolist())))


def index_at(ray: Ray, near: Corner) -> int:
    """Return the index of a ray along interfaces, near a point of the ray.

    Where tests vanish all along a ray, small changes of H move the path into one cell or into
    several, or leave no solution there. The index is the sum of the signs of det(dH/dz) over the
    solutions nearby, which does not change (docs/theory, "Degenerate paths"): the solutions w of
    H'(x; (w, 0)) = e for a generic e, a cone problem in which the tests that vanish along the path
    choose the cell. If a solution lies on an interface or in a singular cell, e is not generic, and
    another e is tried; if the cells are too many, the sign in the first cell is taken.

    ``near``: the point, with only the tests that vanish along the ray as tests that vanish.
    """
    blocks, row = _blocks(near), last_unit(len(near.x))
    size = abs(ray.curve.selection.jacobian(ray.state.x)) @ ray.curve.metric.scale
    for shift in range(MOST_RIGHT_HAND_SIDES):
        right = np.append(generic(len(size), float(shift)) * size, 0.0)
        table = None if blocks is None else _cone_table(near, blocks, row, right)
        if table is None or not _is_small(table):
            break
        found = _solved(near, table)
        isolated = (len(point.characters) == 1 and point.det_sign for point in found.points)
        if not found.faces and all(isolated):  # and inside of a cell
            return sum(point.det_sign for point in found.points)
    return ray.det_sign


# -- the cone problem H'(x; d) = e together with c . d = 1 or another number -----------------------


def _blocks(corner: Corner) -> list[Block] | None:
    """Return the blocks of the cone problem, with only the modes of cells that meet at the corner.

    For a system that does not name its cells, return all these cells as one block, None for many.
    """
    if _has_blocks(corner.system):
        return corner.restricted(corner.system.blocks())
    if len(corner.zero) > MOST_PATTERN_TESTS:
        return None
    cells = tuple(cell.signs for cell in corner.all_cells())
    return [Block(tuple(range(len(corner.tests))), tuple(range(len(corner.x) - 1)), cells)]


def _cone_table(
    corner: Corner, blocks: Sequence[Block], row: Array, right: Array | None = None
) -> Table:
    """Return the cone problem for the unknown direction d: (J_chi d, row . d) = right.

    The signs of the vanishing tests along d choose the cell. ``right``, shape (n + 1,): default
    (0, ..., 0, 1).
    """
    system, x, here = corner.system, corner.x, corner.character
    constant = np.where(corner.tests >= 0.0, 1.0, -1.0)
    constant[list(corner.zero)] = 0.0
    gradients = +dense(system.test_jacobian(x[:-1], float(x[-1])))
    gradients[constant != 0.0] = 0.0
    rows, right = list[tuple[Array, Array]](), last_unit(len(x)) if right is None else right
    for k in range(max((len(block.modes) for block in blocks), default=1)):
        cell = here
        for block in blocks:
            cell = cell.with_signs(block.tests, block.modes[min(k, len(block.modes) - 1)])
        jacobian = jacobian_at(system, x[:-1], float(x[-1]), cell)
        entries = by_rows(jacobian).data if sp.issparse(jacobian) else jacobian
        if not isinstance(jacobian, StructuredJacobian) and not np.isfinite(entries).all():
            why = f"this cell meets others at {at(x)}, where H is continued into it"
            refuse_infinite(system, f"jacobian in {system.label(cell)}", jacobian, why)
        rows.append((np.vstack([dense(jacobian), row]), -right))

    def bounds(block: Block, mode: tuple[bool, ...]) -> list[int]:
        """Return the tests of a block that vanish at the corner and bound a mode."""
        bounding = system.bounding_tests(here.with_signs(block.tests, mode))
        return [i for i in bounding if i in corner.zero and i in block.tests]

    bounding = [[bounds(block, mode) for mode in block.modes] for block in blocks]
    return Table(rows, (gradients, constant), tuple(blocks), bounding)


def _is_small(table: Table) -> bool:
    """Tell whether all cells that meet at the corner can be tried."""
    few, blocks = MOST_CELLS_OF_CONE, table.blocks
    return number_of_cells(blocks) <= few or most_cells(parts_of_table(table), blocks) <= few


def _solved(corner: Corner, table: Table) -> Slice:
    """Return all directions that solve a cone problem; characters have the tests of the blocks."""
    metric = Metric(np.append(corner.metric.scale, 1.0))
    return solve_slice(PartSlice.whole(table), metric, 0.0)
