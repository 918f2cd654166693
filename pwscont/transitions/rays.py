"""The pieces that leave a point: facts F1 and F2 (docs/theory).

At a point x of the zero set let V be the set of bounding tests that vanish there. With V empty, a
single curve passes: two rays in the same cell. With V = {i}, the selections J and J' on both sides
satisfy J' - J = c grad(kappa_i)^T, hence det [J; grad] = det [J'; grad]: one ray into each cell,
each ray the solution of a linear system, with orientations that agree. The direction at a kink is a
sign, never a trial. If [J; grad] is singular, or the orientations differ, no ray is invented. For
more tests see :mod:`pwscont.transitions.corner`.

Interfaces that meet within rounding may be apart all the same: a ray then starts at a point of its
own curve, not at the common point, which is a point of another curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.printing import at, named
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD, HALF_DIGITS
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import ERROR_OF_DIFFERENCES, Curve, State
from pwscont.curve.error_samples import magnitude, zero_up_to
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.promises import refuse_jump
from pwscont.system.selection import Selection

#: Largest residual of a direction of a selection, as a part of the terms.
ASTRAY = HALF_DIGITS
#: A slope smaller than this part of the sum of the magnitudes of its terms may be zero.
SLANT = HALF_DIGITS
#: Two unit vectors have one direction if their cosine differs from one by less than this: far above
#: EPS, because the direction at the end of a path carries the errors of all updates on the way.
PARALLEL = 1e-12
#: How far from a point, in the metric, a curve is looked at beside the point: far enough for slopes
#: and determinants to be more than rounding, and near enough for the curve to be nearly straight.
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
        which small changes of H split the ray, see :mod:`pwscont.transitions.cone`.
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
    row = gradient[np.newaxis]
    if not selection.is_straight and are_level(selection, row, tangent, metric.scale):
        return None
    state = moved(x, defect, tangent, error, factor.sign)
    state.jacobian = None if selection.is_straight else jacobian
    return Ray(curve, state)


def are_level(selection: Selection, gradients: Array, tangent: Array, scale: Array) -> Signs:
    """Tell whether the slopes of tests along a unit tangent may be errors of the derivatives."""
    error = EPS if selection.system.knows_derivatives else ERROR_OF_DIFFERENCES
    level: Signs = np.abs(gradients @ tangent) <= zero_up_to(gradients, scale, part=GUARD * error)
    return level


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


# -- two rays from one point -----------------------------------------------------------------------


def are_parallel(metric: Metric, a: Array, b: Array, apart: float = PARALLEL) -> bool:
    """Tell whether two unit vectors have one direction: 1 - cosine is less than ``apart``."""
    return bool(metric.covector(a).dot(b) > 1.0 - apart)


def parallel(a: Ray, b: Ray, apart: float = PARALLEL) -> bool:
    """Tell whether two rays from one point have one direction."""
    return are_parallel(a.curve.metric, a.state.tangent, b.state.tangent, apart)


def opposite(a: Ray, b: Ray) -> bool:
    """Tell whether two rays from one point have opposite directions."""
    return parallel(a, b.reversed())


def same_piece(ray: Ray, back: Ray) -> bool:
    """Tell whether a ray of a corner is the piece on which the corner was reached.

    A cell holds one ray, or several that differ clearly; the direction of the piece carries
    errors that ill conditioning magnifies.
    """
    have_no_cell_in_common = set(ray.cells).isdisjoint(back.cells)
    return parallel(ray, back, PARALLEL if have_no_cell_in_common else HALF_DIGITS)


def turns(back: Ray, forth: Ray) -> bool:
    """Tell whether alpha reverses where two rays leave; vertical pieces do not reverse alpha."""
    return back.curve.slope(back.state) * forth.curve.slope(forth.state) > 0.0
