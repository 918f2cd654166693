"""All rays at a corner: the cone problem H'(x; d) = 0 (docs/theory, F8).

Where several test functions vanish at x, the zero set near x is the set of directions d with
J_chi d = 0 and grad(kappa_i) . d of the sign that chi demands, over all cells chi that meet at
x. This is a piecewise-linear problem in d; fixing the length of d by a generic linear condition
c . d = +1 or -1 makes its rays the solutions of two slices, which are enumerated like any other.

Most corners are simple and need none of this, see :mod:`pwscont.transitions.simple_corner`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import final

import numpy as np

from pwscont.enumeration import Point, Slice, solve_slice
from pwscont.foundation.arrays import Array, Matrix, dense
from pwscont.foundation.character import Character
from pwscont.foundation.generic import generic
from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Failure
from pwscont.foundation.rounding import CONFIDENCE, EPS
from pwscont.model.selection import Selection
from pwscont.model.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.numerics.corrector import BorderedNewton
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.metric import Metric
from pwscont.numerics.semismooth import semismooth_newton
from pwscont.numerics.uncertainty import magnitude_of_values
from pwscont.transitions.rays import Ray, state_on
from pwscont.transitions.simple_corner import Admits, Direction, simple_corner

#: All cells at a corner are tried up to this number: eight contact nodes.
MANY_CELLS = 4**8
#: The same for systems that do not name their blocks, whose cells are gone through one by one.
MANY_TESTS = 12
#: Newton starts that may fail at a corner with more cells before the search ends.
MOST_FAILURES = 2
#: How far a curve tangent to an interface is followed to see where it bends to.
PROBE = 1e-4
#: Two directions are one when the cosine of their angle differs from one by less than this.
SAME_DIRECTION = 1e-12


@final
@dataclass(frozen=True, slots=True, eq=False)
class Fan:
    """The rays at a corner.

    Attributes
    ----------
    rays : tuple of Ray
        Isolated rays, and the extreme rays of faces.
    dimension : int
        Largest dimension of a cone of solutions: 1 unless the corner is degenerate.
    riding : bool
        Whether a ray runs along an interface instead of into a cell.
    exact : bool
        Whether all cells that meet here were tried; otherwise there may be more rays.
    """

    rays: tuple[Ray, ...]
    dimension: int
    riding: bool
    exact: bool

    @property
    def kind(self) -> Kind:
        """What the corner is."""
        if not self.exact:
            return Kind.PARTIAL_CORNER
        if not self.rays:
            return Kind.ISOLATED
        if self.dimension > 1 or self.riding:
            return Kind.DEGENERATE
        if len(self.rays) > 2:
            return Kind.NONSMOOTH_BRANCH_POINT
        if len(self.rays) == 2 and _turns(*self.rays):
            return Kind.NONSMOOTH_FOLD
        return Kind.CORNER


def fan(
    system: PiecewiseSystem, metric: Metric, x: Array, error: Array, zero: frozenset[int]
) -> Fan:
    """Return all rays at a solution ``x`` where the tests ``zero`` vanish."""
    simple = simple_corner(system, metric, x, zero)
    if simple is not None:
        return Fan(tuple(_ray(system, metric, x, error, found) for found in simple), 1, False, True)
    cone = _Cone(system, metric, x, zero)
    around = Metric(np.append(metric.scale, 1.0))
    exact = cone.is_small
    solve = solve_slice if exact else _sample_slice
    slices = [solve(cone, around, side) for side in (1.0, -1.0)]
    rays: list[Ray] = []
    for found in _directions(slices):
        ray = _ray(system, metric, x, error, found)
        if not any(parallel(ray, other) for other in rays):
            rays.append(ray)
    dimension = max((1 + face.dimension for s in slices for face in s.faces), default=1)
    return Fan(tuple(rays), dimension, any(ray.shared for ray in rays), exact)


def _directions(slices: list[Slice]) -> list[Direction]:
    points = [(p.x[:-1], tuple(p.characters)) for s in slices for p in s.points]
    corners = [
        (c[:-1], (face.character,)) for s in slices for face in s.faces for c in face.corners
    ]
    return points + corners


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
    curves = [Curve(Selection(system, character), metric) for character in characters]
    states = [state_on(curve, x, tangent, error) for curve in curves]
    state, signs = states[0], {state.orientation for state in states}
    if len(characters) == 1:
        return Ray(curves[0], state)
    if not isinstance(system, PiecewiseLinearSystem):
        for curve, own in zip(curves, states, strict=True):
            if _bends_into(curve, own):
                return Ray(curve, own)
    slope = curves[0].slope(state)
    index = state.orientation * int(np.sign(slope)) if len(signs) == 1 else 0
    riding = Curve(Selection(system, characters[0], characters), metric)
    return Ray(riding, state, characters, index)


def _bends_into(curve: Curve, state: State) -> bool:
    """Tell whether a curve that is tangent to an interface leaves it into this cell."""
    beside = state.x + PROBE * state.tangent
    if not curve.selection.system.differences(state.alpha).contains(beside[-1]):
        return False
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


@final
class _Cone(SlicewiseLinearSystem):
    """H'(x; d) = 0 together with c . d = alpha, for the unknown direction d."""

    def __init__(
        self, system: PiecewiseSystem, metric: Metric, x: Array, zero: frozenset[int]
    ) -> None:
        self.size = len(x)
        self._system, self._x, self._zero = system, x, zero
        self._length = generic(len(x)) / metric.scale
        self._scale = metric.scale
        tests = system.test_functions(x[:-1], float(x[-1]))
        self._constant = np.where(tests >= 0.0, 1.0, -1.0)
        self._constant[list(zero)] = 0.0

    @cached_property
    def _gradients(self) -> Array:
        rows = self._system.test_jacobian(self._x[:-1], float(self._x[-1]))
        gradients = +dense(rows)
        gradients[self._constant != 0.0] = 0.0
        return gradients

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return grad(kappa_i) . d for the tests that vanish, their sign for the others."""
        values: Array = self._gradients @ z + self._constant
        return values

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients by (d, alpha)."""
        return np.column_stack([self._gradients, np.zeros(len(self._gradients))])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return (J_chi d, c . d - alpha)."""
        return np.append(self._rows(character) @ z, self._length @ z - alpha)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant Jacobian."""
        rows = self._rows(character)
        matrix = np.zeros((self.size, self.size + 1))
        matrix[:-1, :-1] = dense(rows)
        matrix[-1, :-1], matrix[-1, -1] = self._length, -1.0
        return matrix

    def _rows(self, character: Character) -> Matrix:
        return self._system.jacobian(self._x[:-1], float(self._x[-1]), character)

    def bounding_tests(self, character: Character) -> list[int]:
        """Return the bounding tests of the cell that vanish at the corner."""
        return [i for i in self._system.bounding_tests(character) if i in self._zero]

    def scale(self, lo: float, hi: float) -> Array:
        """Return the metric's scale."""
        return self._scale

    @property
    def is_small(self) -> bool:
        """Whether all cells that meet here can be tried."""
        if not isinstance(self._system, SlicewiseLinearSystem):
            return len(self._zero) <= MANY_TESTS
        return prod(len(block.modes) for block in self.blocks()) <= MANY_CELLS

    def blocks(self) -> tuple[Block, ...]:
        """Return the system's blocks, with only the modes of the cells that meet here."""
        if not isinstance(self._system, SlicewiseLinearSystem):
            return (self._one_block(),)
        return tuple(
            Block(block.tests, block.rows, tuple(filter(self._admits(block), block.modes)))
            for block in self._system.blocks()
        )

    def _admits(self, block: Block) -> Admits:
        signs = self._constant >= 0.0
        return Admits(self._system, block, signs.tolist(), self._zero)

    def _one_block(self) -> Block:
        """Return all cells that meet here as the modes of one block."""
        zero = sorted(self._zero)
        signs = Character(tuple((self._constant >= 0.0).tolist()))
        cells: dict[bytes, tuple[bool, ...]] = {}
        for pattern in range(2 ** len(zero)):
            character = signs
            for k, test in enumerate(zero):
                character = character.with_sign(test, bool(pattern >> k & 1))
            cells.setdefault(self._system.cell(character), character.signs)
        rows = tuple(range(self.size - 1))
        return Block(tuple(range(len(signs.signs))), rows, tuple(cells.values()))
