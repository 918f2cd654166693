"""The pieces that leave a point, and corners: facts F1, F2 and F8 (docs/theory).

At a point x of the zero set let V be the set of bounding tests that vanish there. With V empty, a
single curve passes: two rays in the same cell. With V = {i}, the selections J and J' on both sides
satisfy J' - J = c grad(kappa_i)^T, hence det [J; grad] = det [J'; grad]: one ray into each cell,
each ray the solution of a linear system, with orientations that agree. The direction at a kink is a
sign, never a trial. If [J; grad] is singular, or the orientations differ, no ray is invented.

Interfaces that meet within rounding may be apart all the same: a ray then starts at a point of its
own curve, not at the common point, which is a point of another curve.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Matrix, Signs, generic, joined
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.outcome import Failure
from pwscont.basics.printing import at, named
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD, HALF_DIGITS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import ERROR_OF_DIFFERENCES, Curve, State
from pwscont.curve.error_samples import magnitude, rounding_of_values, slack_by_constants
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.promises import refuse_jump
from pwscont.system.selection import Selection
from pwscont.system.system import Block, PiecewiseSystem, SlicewiseLinearSystem

#: Largest residual of a direction of a selection, as a part of the terms.
ASTRAY = HALF_DIGITS
#: Two unit vectors have one direction if their cosine differs from one by less than this: far above
#: EPS, because the direction at the end of a path carries the errors of all updates on the way.
PARALLEL = 1e-12
#: How far from a point, in the metric, a curve is looked at beside the point: far enough for slopes
#: and determinants to be no rounding, and near enough for the first of these to be the largest.
NEARBY = HALF_DIGITS**0.5


@final
@dataclass(slots=True, eq=False)  # see State
class Ray:
    """A piece leaving a point: the curve of the piece and the state where the piece starts.

    Attributes
    ----------
    curve : Curve
    state : State
    interface_cells : tuple of Character
        For a ray along an interface, all cells to which the ray belongs; else empty.
    index : int
        For a ray along an interface, the sum of the signs of det(dH/dz) over the solutions into
        which small changes of H split the ray, see :mod:`pwscont.transitions.corner`.
    """

    curve: Curve
    state: State
    interface_cells: tuple[Character, ...] = ()
    index: int = 0

    def __repr__(self) -> str:
        return named(self, self.curve.selection, f"from {at(self.state.x)}")

    @property
    def cells(self) -> tuple[bytes, ...]:
        """The cells in which the ray may be met again."""
        selection = self.curve.selection
        return selection.adjacent_names if self.interface_cells else (selection.cell,)

    @property
    def det_sign(self) -> int:
        """The sign of det(dH/dz) where the ray begins, which is that of the slope of alpha (F3)."""
        slope = self.curve.slope(self.state)
        return self.state.orientation * ((slope > 0.0) - (slope < 0.0))

    def reversed(self) -> Ray:
        """Return the same place with the opposite direction."""
        return Ray(self.curve, self.state.reversed(), self.interface_cells, self.index)


def are_parallel(metric: Metric, a: Array, b: Array, apart: float = PARALLEL) -> bool:
    """Tell whether two unit vectors have one direction: 1 - cosine is less than ``apart``."""
    return bool(metric.covector(a).dot(b) > 1.0 - apart)


def rounding_of_tests(gradients: Matrix, x: Array, error: Array, scale: Array) -> Array:
    """Return the sizes up to which tests with these gradients are zero at ``x``, shape (l,).

    That is the rounding of a test's own terms plus what the error of the point contributes, shape
    (k, n + 1). Where all unknowns of a test vanish, as at a node that lifts off while it begins to
    slip, their own size is no measure of rounding: the typical magnitudes ``scale`` are added.
    """
    return np.asarray(CONFIDENCE * rounding_of_values(gradients, np.abs(x) + scale, error))


def beside(curve: Curve, state: State, s: float) -> State | Failure:
    """Return the curve's own state at a distance along the tangent, within the interval."""
    x = state.x + s * state.tangent
    x[-1] = np.clip(x[-1], *curve.metric.interval)
    found = BorderedNewton().correct(curve, x, state.tangent)
    return found if isinstance(found, Failure) else found.state


def inward_ray(curve: Curve, x: Array, error: Array, test: int) -> Ray | None:
    """Return the ray from x on the zero set of a test into the cell.

    None where the curve is tangent to the interface, where ``x`` does not solve this selection, or
    where the test does not bound the cell: within rounding of a corner the signs of the other tests
    may name a neighbouring cell.
    """
    selection, metric = curve.selection, curve.metric
    if test not in selection.bounding:
        return None
    jacobian, rest = selection.jacobian(x), selection.residual_and(x, 0.0)
    gradient = selection.test_gradient(x, int(np.flatnonzero(selection.bounding == test)[0]))
    factor = bordered(jacobian, gradient, metric.binary)
    if factor.is_singular():
        return None
    defect = factor.solve(rest)
    if not metric.norm(defect) <= metric.slack(x, HALF_DIGITS):
        return None
    tangent = metric.normalised(factor.solve(last_unit(len(x))))
    if not selection.is_straight and are_level(selection, gradient, tangent, metric.scale):
        return None
    state = moved(x, defect, tangent, error, factor.sign)
    state.jacobian = None if selection.is_straight else jacobian
    return Ray(curve, state)


def are_level(selection: Selection, gradients: Array, tangent: Array, scale: Array) -> Any:
    """Tell whether the slopes of tests along a unit tangent may be errors of the derivatives."""
    error = EPS if selection.system.knows_derivatives else ERROR_OF_DIFFERENCES
    return np.abs(gradients @ tangent) <= GUARD * error * (np.abs(gradients) @ scale)


def check_continuity(
    curve: Curve, other: Selection, ray: Ray | None, x: Array, error: Array
) -> None:
    """Refuse a jump of H between the selection of a curve and ``other`` at a common point.

    A ray of the other selection that begins at the point within its error proves continuity.
    """
    if ray is None or ray.state.x is not x:
        refuse_jump(curve.selection, other, x, magnitude(x, error), curve.metric.scale)


def state_on(curve: Curve, x: Array, tangent: Array, error: Array) -> State:
    """Return the state of a curve at a point common to several curves, or close to the point."""
    border = curve.metric.covector(tangent)
    jacobian = curve.selection.jacobian(x)
    factor = bordered(jacobian, border, curve.metric.binary)
    if factor.is_singular():
        return State(x, tangent, error, factor.sign)
    defect = factor.solve(curve.selection.residual_and(x, 0.0))
    state = moved(x, defect, tangent, error, factor.sign)
    state.jacobian = None if curve.selection.is_straight else jacobian
    return state


def moved(x: Array, defect: Array, tangent: Array, error: Array, orientation: int) -> State:
    """Return the state at ``x``, or at ``x - defect`` if that is further away than rounding."""
    if (np.abs(defect) <= CONFIDENCE * magnitude(x, error)).all():
        return State(x, tangent, error, orientation)
    return State(x - defect, tangent, np.vstack([error, defect]), orientation)


def beyond(selection: Selection, x: Array, test: int) -> Character:
    """Return the character on the other side of ``kappa_test = 0`` at ``x``.

    Tests that do not bound the old cell may have changed sign since the piece began, so all
    signs but that of ``test`` are read off at the point.
    """
    character = selection.system.character(x[:-1], float(x[-1]))
    return character.with_sign(test, not selection.character.signs[test])


def _vanish(system: PiecewiseSystem, metric: Metric, x: Array, error: Array, tests: Array) -> Signs:
    """Tell which tests are zero at ``x``, shape (m,).

    Where only typical magnitudes say so, and H is linear in z, the constants of H and of the tests
    decide: the constants are what typical magnitudes stand for.
    """
    gradients, sizes = system.test_jacobian(x[:-1], float(x[-1])), np.abs(tests)
    vanish = np.asarray(sizes <= rounding_of_tests(gradients, x, error, metric.scale))
    surely = sizes <= CONFIDENCE * rounding_of_values(gradients, np.abs(x), error)
    if surely[vanish].all() or not isinstance(system, SlicewiseLinearSystem):
        return vanish  # nearly always
    here = Selection(system, Character.of(tests))
    jacobian = here.jacobian(x)
    factor = bordered(jacobian, last_unit(len(x)), metric.binary)
    if factor.is_singular():
        return vanish
    constants = here.residual_and(x, 0.0) - joined(jacobian @ x, 0.0)
    known = slack_by_constants(gradients, tests, x, error, factor, jacobian, constants)
    return np.asarray(vanish & (sizes <= known))


#: A direction d of length one in the metric, and the cells whose closures contain d.
Direction: TypeAlias = tuple[Array, tuple[Character, ...]]

#: A slope smaller than this part of the sum of the magnitudes of its terms may be zero.
SLANT = HALF_DIGITS
#: Error of a component of a unit direction, in typical magnitudes and divided by SLANT, because
#: SLANT multiplies this error: a component that should be zero is not compared with itself.
NOISE = GUARD * EPS / SLANT


@final
@dataclass(frozen=True, slots=True, eq=False)
class Corner:
    """A solution, and the tests that vanish there: none inside a cell, one on an interface."""

    system: PiecewiseSystem
    metric: Metric
    x: Array  # shape (n + 1,)
    error: Array  # samples of the error of ``x``, shape (k, n + 1)
    zero: frozenset[int]  # the tests that vanish
    tests: Array  # all tests there, shape (m,); the signs of those that vanish mean nothing

    @classmethod
    def at(
        cls,
        system: PiecewiseSystem,
        metric: Metric,
        x: Array,
        error: Array,
        zero: frozenset[int] | None = None,
    ) -> Corner:
        """Return the corner at ``x``, by default with all tests that are zero there to rounding."""
        tests = np.array(system.test_functions(x[:-1], float(x[-1])), dtype=float)
        if zero is None:
            vanish = _vanish(system, metric, x, error, tests)
            zero = frozenset(np.flatnonzero(vanish).tolist())
        return cls(system, metric, x, error, zero, tests)

    @classmethod
    def of_start(cls, system: PiecewiseSystem, metric: Metric, x: Array, error: Array) -> Corner:
        """Return where a start lies; refuse tests that are not finite.

        Tests that bound no cell there do not count.
        """
        corner = cls.at(system, metric, x, error)
        if len(corner.tests) and not np.isfinite(corner.tests).all():
            raise InvalidSystemError(
                f"{type(system).__name__}.test_functions returned {corner.tests} at a solution, "
                f"alpha = {x[-1]:.6g}: all must be finite"
            )
        here, zero = corner.character, corner.zero
        bounding = (system.bounding_tests(cell) for cell in (here, *map(here.flip, zero)))
        return replace(corner, zero=frozenset()) if all(map(zero.isdisjoint, bounding)) else corner

    @property
    def character(self) -> Character:
        """The character of the signs of the tests, those that vanish included."""
        return Character.of(self.tests)

    @property
    def flat(self) -> Signs:
        """Tell which tests, shape (m,), are as flat as at a double zero, such as z**2 at z = 0.

        Their gradients there change by as much as they are within the rounding of the place. Tests
        of systems that are linear at fixed alpha are not flat.
        """
        flat = np.zeros(len(self.tests), dtype=bool)
        if isinstance(self.system, SlicewiseLinearSystem) or not self.zero:
            return flat
        scale, here = self.metric.scale, self.gradients
        aside = GUARD * (magnitude(self.x, self.error) + EPS * scale) * generic(len(scale))
        there = replace(self, x=self.x + aside).gradients
        flat[self.which] = abs(here) @ scale <= abs(there - here) @ scale
        return flat

    @property
    def which(self) -> Indices:
        """The tests that vanish, in order, shape (k,)."""
        return np.array(sorted(self.zero), dtype=np.intp)

    @property
    def gradients(self) -> Matrix:
        """The gradients of the tests that vanish, shape (k, n + 1)."""
        z, alpha = self.x[:-1], float(self.x[-1])
        return self.system.some_test_gradients(z, alpha, self.which)

    def all_cells(self) -> list[Character]:
        """Return a character for each cell, from all sign patterns of the vanishing tests."""
        cells: dict[bytes, Character] = {}
        here, tests = self.character, sorted(self.zero)
        for signs in product((False, True), repeat=len(tests)):
            character = here.with_signs(tests, signs)
            cells.setdefault(self.system.cell(character), character)
        return list(cells.values())

    def restricted(self, blocks: Iterable[Block]) -> list[Block]:
        """Return blocks of the system with only the modes of cells that meet at the corner."""
        here = self.character

        def meets(block: Block, mode: tuple[bool, ...]) -> bool:
            there, fixed = here.with_signs(block.tests, mode), set(block.tests) - self.zero
            bounding = fixed.intersection(self.system.bounding_tests(there))
            return all(there.array[i] == here.array[i] for i in bounding)

        return [Block(b.tests, b.rows, tuple(m for m in b.modes if meets(b, m))) for b in blocks]

    def direction_in(self, selection: Selection) -> Array | None:
        """Return the null vector d of J_chi, None where J_chi has several to rounding."""
        x, metric = self.x, self.metric
        factor = bordered(selection.jacobian(x), generic(len(x)) / metric.scale, metric.binary)
        return None if factor.is_singular() else metric.normalised(factor.solve(last_unit(len(x))))

    def vanishing(self, selection: Selection) -> tuple[Indices, Matrix]:
        """Return the tests that bound a cell and vanish, shape (k,), and the rows of gradients."""
        which = np.flatnonzero(np.isin(selection.bounding, list(self.zero)))
        return selection.bounding[which], selection.test_gradients(self.x)[which]

    def slopes_along(self, selection: Selection, direction: Array) -> Array:
        """Return the slopes along d of vanishing bounding tests, 0 for slopes within rounding."""
        tests, rows = self.vanishing(selection)
        slopes: Array = (rows @ direction) * ~self.flat[tests]
        least = SLANT * (abs(rows) @ (np.abs(direction) + NOISE * self.metric.scale))
        return np.where(np.abs(slopes) > least, slopes, 0.0)
