"""The pieces that leave a point: facts F1, F2 and F8 (docs/theory).

At a point x of the zero set let V be the set of bounding tests that vanish there. With V
empty, one curve passes: two rays in one cell. With V = {i}, the selections J and J' on both
sides satisfy J' - J = c grad(kappa_i)^T, hence det [J; grad] = det [J'; grad]: one ray into
each cell, each the solution of one linear system, and their orientations agree. The direction
at a kink is a sign, never a trial.

Failure modes and answers
-------------------------
- A test counts as zero when it is below the rounding of its own terms plus what the error of
  the point contributes: relative, so units and magnitudes do not matter.
- [J; grad] is singular: the curve is tangent to the interface, no ray is invented.
- Interfaces that meet within rounding may be apart all the same: a ray then starts on its own
  curve, not at the common point, which is a point of another curve.
- The orientations differ: the user's selections disagree on the interface. The user is told, and no
  ray is returned.
- H jumps: the system is refused. A jump below rounding counts as no jump, and a jump below the
  error of the point cannot be told from no jump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, Signs, generic, joined
from pwscont.basics.character import Character
from pwscont.basics.looks import at, named
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude, rounding_of_values
from pwscont.curve.metric import LARGEST, SHORTEST, Metric
from pwscont.curve.newton import MOST_CORRECTIONS, STALLED
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.promises import refuse_jump
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem

#: Selections that differ by more than this (relative) at a common point do not agree there.
DISAGREE = EPS**0.5


@final
@dataclass(slots=True, eq=False)  # see State
class Ray:
    """A piece leaving a point: the curve it lies on and the state it starts from.

    Attributes
    ----------
    curve : Curve
    state : State
    interface_cells : tuple of Character
        For a ray along an interface, all cells that it belongs to; else empty.
    index : int
        For a ray along an interface, the sum of the signs of det(dH/dz) over the solutions that
        small changes of H make of it, see :mod:`pwscont.transitions.corner.index`.
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

    Parameters
    ----------
    system : PiecewiseSystem
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (k, n + 1)
        Samples of the error of ``x``.
    scale : ndarray, shape (n + 1,), optional
        Typical magnitudes of ``x``, needed where all unknowns of a test vanish, as at a node that
        lifts off while it begins to slip: there their own size is no measure of rounding.
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
    """Return the gradient of one test, positive towards the inside of the cell."""
    return selection.test_gradient(x, int(np.flatnonzero(selection.bounding == test)[0]))


def inward_ray(curve: Curve, x: Array, error: Array, test: int) -> Ray | None:
    """Return the ray from ``x`` on the zero set of one test into the cell, if there is one.

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


def ray_beyond(curve: Curve, state: State, test: int) -> Ray | None:
    """Return the ray into the cell of ``curve`` from a state located on its interface (F2).

    None where the factorisation that located the state does not serve, because it is old or the
    selections do not agree along the interface, or where there is no ray: :func:`inward_ray` tells.
    """
    selection, metric, x = curve.selection, curve.metric, state.x
    if state.located_by is None or test not in selection.bounding:
        return None
    there = _Beyond(selection.jacobian(x), -gradient_of(selection, x, test), state)
    some, rest = metric.scale * generic(len(x)), selection.residual_and(x, 0.0)
    asked = np.stack([there @ some, rest, there.excess(there.before)])
    same, defect, change = there.solve_all(asked)
    agree = metric.norm(same - some) <= STALLED * metric.norm(some)
    if not (agree and metric.norm(defect) <= metric.slack(x, DISAGREE)):
        return None
    outwards = there.direction(there.before - change, metric)
    if outwards is None:
        return None
    onwards = metric.normalised(-outwards)
    return Ray(curve, moved(x, defect, onwards, state.error, state.orientation))


@final
class _Beyond:
    """[J'; g] on the far side of an interface, by the factorisation of [J; g] on the near one.

    With c = J' w, where J w = 0 and g.w = 1, it is [[I, c], [0, 1]] [J; g], if the selections agree
    along the interface. Determinants are the same.

    Attributes
    ----------
    before : ndarray, shape (n + 1,)
        w.
    """

    def __init__(self, jacobian: Matrix, row: Array, state: State) -> None:
        assert state.located_by is not None, "the factorisation that located the state"
        self._jacobian, self._row, self._factor = jacobian, row, state.located_by
        self.before = state.tangent / float(row.dot(state.tangent))
        self._c = jacobian @ self.before

    def __matmul__(self, x: Array) -> Array:
        return joined(self._jacobian @ x, float(self._row.dot(x)))

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for right-hand sides, shape (l, n + 1), which are overwritten."""
        rhs[:, :-1] -= np.outer(rhs[:, -1], self._c)
        return self._factor.solve_all(rhs)

    def excess(self, along: Array) -> Array:
        """Return by how much a direction misses the one in which the test rises by one."""
        return self @ along - last_unit(len(along))

    def direction(self, along: Array, metric: Metric) -> Array | None:
        """Return the direction in which the test rises, None where corrections do not converge.

        It is right to rounding: a piece on which alpha does not change at all is known by it. None
        also where a test in extreme units makes it too short or too long for its squares.
        """
        before = math.inf
        if not SHORTEST < metric.norm(along) < LARGEST:
            return None
        for _ in range(MOST_CORRECTIONS):
            (change,) = self.solve_all(self.excess(along)[np.newaxis])
            along, size = along - change, metric.norm(change) / metric.norm(along)
            if size <= GUARD * EPS or STALLED * before < size < CONVERGED:
                return np.asarray(along)
            before = size
        return None


def check_continuity(
    curve: Curve, other: Selection, ray: Ray | None, x: Array, error: Array
) -> None:
    """Refuse a jump of H between the selection of a curve and another one at a common point.

    Nothing is computed where a ray of the other selection begins at the point within its error.

    Raises
    ------
    InvalidSystemError
    """
    if ray is None or ray.state.x is not x:
        refuse_jump(curve.selection, other, x, magnitude(x, error), curve.metric.scale)


def state_on(curve: Curve, x: Array, tangent: Array, error: Array) -> State:
    """Return the state of a curve at a common point of several, or at its own point close by."""
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
