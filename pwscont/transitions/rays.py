"""The pieces that leave a point: facts F1, F2 and F8 (docs/theory).

At a point x of the zero set let V be the set of bounding tests that vanish there. With V empty, a
single curve passes: two rays in the same cell. With V = {i}, the selections J and J' on both sides
satisfy J' - J = c grad(kappa_i)^T, hence det [J; grad] = det [J'; grad]: one ray into each cell,
each ray the solution of a linear system, with orientations that agree. The direction at a kink is a
sign, never a trial.

Failure modes and answers
-------------------------
- A test counts as zero when its value is below the rounding of the test's own terms plus what the
  error of the point contributes: relative, so units and magnitudes do not matter.
- [J; grad] is singular, as the curve is tangent to the interface, or the orientations differ, as
  the user's selections disagree: no ray is invented. If H jumps, the system is refused; a jump
  below the error of the point cannot be told from no jump.
- Interfaces that meet within rounding may be apart all the same: a ray then starts at a point of
  its own curve, not at the common point, which is a point of another curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, Signs
from pwscont.basics.character import Character
from pwscont.basics.looks import at, named
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude, rounding_of_values
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.promises import refuse_jump
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem

#: Selections that differ by more than this (relative) at a common point do not agree there.
DISAGREE = EPS**0.5


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
        which small changes of H split the ray, see :mod:`pwscont.transitions.corner.enumeration`.
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

    def reversed(self) -> Ray:
        """Return the same place with the opposite direction."""
        return Ray(self.curve, self.state.reversed(), self.interface_cells, self.index)


def vanishing(
    system: PiecewiseSystem, x: Array, error: Array, scale: Array | None = None
) -> frozenset[int]:
    """Return the indices of the tests that are zero at ``x``.

    ``error``, shape (k, n + 1): samples of the error of ``x``.
    ``scale``, shape (n + 1,): typical magnitudes of x, needed where all unknowns of a test vanish,
    as at a node that lifts off while it begins to slip: the unknowns' own size is no measure of
    rounding there.
    """
    z, alpha = x[:-1], float(x[-1])
    gradients, values = system.test_jacobian(z, alpha), system.test_functions(z, alpha)
    return zeros(gradients, values, x, error, scale)


def zeros(
    gradients: Matrix, values: Array, x: Array, error: Array, scale: Array | None = None
) -> frozenset[int]:
    """Return the indices of the tests with these gradients and values that are zero at ``x``."""
    return frozenset(is_zero(gradients, values, x, error, scale).nonzero()[0].tolist())


def is_zero(
    gradients: Matrix, values: Array, x: Array, error: Array, scale: Array | None = None
) -> Signs:
    """Tell which of some tests with these gradients and values are zero at ``x``.

    The other parameters are those of :func:`vanishing`.
    """
    sizes = np.abs(x) if scale is None else np.abs(x) + scale
    zero: Signs = np.abs(values) <= CONFIDENCE * rounding_of_values(gradients, sizes, error)
    return zero


def gradient_of(selection: Selection, x: Array, test: int) -> Array:
    """Return the gradient of a test, signed positive towards the inside of the cell."""
    return selection.test_gradient(x, int(np.flatnonzero(selection.bounding == test)[0]))


def inward_ray(curve: Curve, x: Array, error: Array, test: int) -> Ray | None:
    """Return the ray from x on the zero set of a test into the cell; None without a ray.

    None where the curve is tangent to the interface, where ``x`` does not solve this selection, or
    where the test does not bound the cell: within rounding of a corner the signs of the other tests
    may name a neighbouring cell.
    """
    selection, metric = curve.selection, curve.metric
    if test not in selection.bounding:
        return None
    jacobian, rest = selection.jacobian(x), selection.residual_and(x, 0.0)
    factor = bordered(jacobian, gradient_of(selection, x, test), metric.binary, rest)
    if factor.is_singular():
        return None
    defect = factor.solve(rest)
    if not metric.norm(defect) <= metric.slack(x, DISAGREE):
        return None
    tangent = metric.normalised(factor.solve(last_unit(len(x))))
    return Ray(curve, moved(x, defect, tangent, error, factor.sign))


def check_continuity(
    curve: Curve, other: Selection, ray: Ray | None, x: Array, error: Array
) -> None:
    """Refuse a jump of H between the selection of a curve and ``other`` at a common point.

    A ray of the other selection that begins at the point within its error proves continuity.

    Raises
    ------
    InvalidSystemError
    """
    if ray is None or ray.state.x is not x:
        refuse_jump(curve.selection, other, x, magnitude(x, error), curve.metric.scale)


def state_on(curve: Curve, x: Array, tangent: Array, error: Array) -> State:
    """Return the state of a curve at a point common to several curves, or close to the point."""
    border = curve.metric.covector(tangent)
    factor = bordered(curve.selection.jacobian(x), border, curve.metric.binary)
    if factor.is_singular():
        return State(x, tangent, error, factor.sign)
    defect = factor.solve(curve.selection.residual_and(x, 0.0))
    return moved(x, defect, tangent, error, factor.sign)


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
