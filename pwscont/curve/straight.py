"""Straight pieces, cell by cell: a single solve from cell to cell (docs/theory, F11).

With J' = J + c g^T on the other side of an interface (F1), where g is the gradient of the test that
vanishes, the direction beyond follows from the direction before by the solution of J w = c alone.
The same update holds for all solutions: the samples of the error of a point are carried along. From
time to time, in small systems always, and where residuals show that directions have drifted,
an *audit* solves for all samples afresh, together with corrections of point and direction. Only
audits ask for Jacobians that are large and not at hand.

Failure modes and answers
-------------------------
- Rounding adds up from cell to cell: the residual of the system is asked for at every transition.
  A residual larger than the stated error covers corrects the point, and asks for an audit if the
  last audit was long ago.
- The Jacobians of the cells differ by a matrix of rank 2 or more, because the system is wrong, or
  returns all matrices, or c, in the same array: an audit compares the direction with the new
  Jacobian, and the residual of the next point is more than rounding.
- 1 + g.w is small beside 1 and g.w, or the direction is nearly vertical or in the interface: the
  caller is given nothing, and goes the way of :mod:`pwscont.transitions.bounding`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, is_anywhere, is_everywhere, joined, product
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import magnitude_beside, samples
from pwscont.curve.metric import Metric
from pwscont.linear.bordered import GROWTH
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import column, inner
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.linear.updates import ProductForm
from pwscont.linear.vectors import add_multiples
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseLinearSystem

#: Systems of fewer unknowns are audited at every transition, all systems after AUDIT_AFTER
#: transitions: true errors of random bodies are then at most 1.6 times the stated errors, and 2.8
#: times after 64 transitions.
ALWAYS_AUDITED, AUDIT_AFTER = 16, 24
#: Least number of transitions after which a residual above rounding asks for an audit: directions
#: have drifted.
DRIFTED_AFTER = 8
#: Systems of fewer unknowns are asked for Jacobians at every transition: two residuals cost more.
ASKED_FOR_JACOBIANS = 64
#: Least residual that is corrected, as a part of the terms of the same row: three quarters of the
#: residual that the stated error of the point covers.
UNSEEN = 0.75 * CONFIDENCE * EPS
#: Errors are estimated afresh if an unknown is larger than GROWN times the largest unknown of the
#: same typical magnitude at the last audit.
GROWN = 2.0
#: How many times larger than all other unknowns an unknown is made, in typical magnitudes.
FAR_AWAY = 2.0**20
#: Largest residual of a direction of a selection, as a part of the terms.
ASTRAY = EPS**0.5


class Settled(NamedTuple):
    """A corrected point.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (k, n + 1)
        Samples of the error of x.
    size : ndarray, shape (n + 1,)
        The estimate of the error of x.
    extent : tuple of two float
        The largest component of the point, and of the estimate, in typical magnitudes.
    along : float
        By how much alpha was corrected along the piece.
    aside : ndarray, shape (n,), or None
        By how much z was corrected as well; None if not needed.
    """

    x: Array
    error: Array
    size: Array
    extent: tuple[float, float]
    along: float
    aside: Array | None


@final
class StraightCell:
    """The linear algebra of the cell in which a straight piece lies, led from cell to cell.

    Attributes
    ----------
    curve : Curve
    along : ndarray, shape (n + 1,)
        Direction of the piece, with alpha component 1; changes with the cell, not to be kept.
    turn : int
        The sign of 1 + g.w where the cell was entered: -1 at a fold.
    length : float
        Length of the direction ``along``, in the metric.
    """

    def __init__(self, curve: Curve, solver: ProductForm, along: Array) -> None:
        self.curve, self.turn, self.length = curve, 1, curve.metric.norm(along)
        self._solver = solver
        system = curve.selection.system
        self._is_told = isinstance(system, PiecewiseLinearSystem) and system.knows_kinks
        self._jacobian: Matrix | None = None
        #: The direction of the piece, and samples of the error of points, with alpha component 0.
        self._samples = samples(len(along))
        self._lines = np.zeros((1 + len(self._samples), len(along)))
        self._lines[0] = along
        self.along: Array = self._lines[0]
        self._wide = np.zeros(len(along))
        self._slopes = np.empty(0)  # of the last test crossed, along all lines
        self._terms = np.empty(0)  # magnitudes of the terms of the rows of H at the last audit
        self._most, self._since = np.empty(0), AUDIT_AFTER

    @classmethod
    def at(cls, curve: Curve, x: Array) -> StraightCell | None:
        """Return the factorised cell of a curve; None where the Jacobian is next to singular."""
        jacobian, core = _factorised(curve, x)
        if core is None:
            return None
        n = len(x) - 1
        solver = ProductForm(core, n)
        cell = cls(curve, solver, joined(-solver.solve(column(jacobian, n)), 1.0))
        if not cell._is_told and _compares_columns(curve, jacobian):
            cell._jacobian = jacobian
        return cell if cell._is_tame() else None

    def cross(
        self, other: Curve, x: Array, test: int, gradient: Array, value: float
    ) -> Settled | None:
        """Lead into the cell on the other side of an interface, and return a point there.

        Parameters
        ----------
        other : Curve
            The curve of the selection on the other side.
        x : ndarray, shape (n + 1,)
            A point of the interface, up to rounding.
        test, gradient, value
            The test that vanishes there.

        Returns
        -------
        Settled or None
            None if the correction is more than rounding, or cannot be computed: the cell is of
            no use then.
        """
        if not self._enter(other, x, test, gradient):
            return None
        return self._settled(x, gradient, value)

    def settled(self, x: Array, gradient: Array, value: float) -> Settled | None:
        """Return a point of the piece where a function vanishes, as :meth:`cross` does."""
        self._slopes = self._lines.dot(gradient)
        return self._settled(x, gradient, value)

    def _settled(self, x: Array, gradient: Array, value: float) -> Settled | None:
        """Correct a point, and in audits also the direction and the samples."""
        residual, sizes, aside = self.curve.selection.residual(x), np.abs(x), None
        is_due = self._is_due(sizes)
        is_off = not is_due and not is_everywhere(np.abs(residual) <= UNSEEN * self._terms)
        if is_due or (is_off and self._since >= DRIFTED_AFTER):
            aside = self._audited(x, sizes, residual)
            if aside is None:
                return None
            self._slopes = self._lines.dot(gradient)
        elif is_off:
            aside = self._solver.solve(residual)
        return self._moved(x, sizes, gradient, value, aside) if self._slopes[0] else None

    def _is_due(self, sizes: Array) -> bool:
        """Tell whether an audit is due at a point with unknowns of given sizes."""
        if self._since >= AUDIT_AFTER or len(sizes) <= ALWAYS_AUDITED:
            return True
        return is_anywhere(sizes > self._most)

    def _enter(self, other: Curve, x: Array, test: int, gradient: Array) -> bool:
        """Change to the Jacobian on the other side; False if the change loses too many digits."""
        is_ready, kink = self._has_room(x), self._kink(other, x, test, gradient)
        if not is_ready or kink is None:
            return False
        w = self._solver.solve(kink)
        pivot = self._solver.change(w, gradient[:-1])
        if pivot == 0.0:
            return False
        self._slopes = self._lines.dot(gradient) / pivot
        self._wide[:-1] = w  # alpha of the lines does not change
        add_multiples(self._lines, -self._slopes, self._wide)
        self.turn, self._since = 1 if pivot > 0.0 else -1, self._since + 1
        self.length = other.metric.norm(self.along)
        return self._is_tame()

    def _moved(
        self, x: Array, sizes: Array, gradient: Array, value: float, aside: Array | None
    ) -> Settled | None:
        """Return the point of an interface, None where the correction is more than rounding."""
        metric = self.curve.metric
        along = (value - (0.0 if aside is None else gradient[:-1].dot(aside))) / self._slopes[0]
        dx = along * self._lines[0]
        if aside is not None:
            dx[:-1] += aside
        error = self._bordered(EPS * np.abs(gradient).dot(sizes))
        size = magnitude_beside(sizes, error)
        extent = metric.largest(sizes), metric.largest(size)
        found = Settled(x - dx, error, size, extent, along, aside)
        return found if metric.admits(found.x) and self._is_rounding(dx, found) else None

    def _has_room(self, x: Array) -> bool:
        """Tell whether a further change can be taken up, after factorising afresh if due."""
        return not self._solver.is_full or self._has_renewed(self._jacobian_at(x))

    def _has_renewed(self, jacobian: Matrix) -> bool:
        """Factorise the Jacobian of the cell afresh; False for a singular Jacobian."""
        core = inner(jacobian, self.curve.metric.binary)
        if core is not None:
            self._solver.renew(core)
        return core is not None

    def _jacobian_at(self, x: Array) -> Matrix:
        known = self._jacobian
        return self.curve.selection.lent_jacobian(x) if known is None else known

    def _kink(self, other: Curve, x: Array, test: int, gradient: Array) -> Array | None:
        """Return c of the cell beyond, and take up the curve there."""
        before, jacobian, self.curve = self.curve, self._jacobian, other
        if self._is_told:
            return other.selection.kink(before.selection, test)
        if jacobian is None:
            return kink_by_residuals(before, other, x, gradient)
        self._jacobian = other.selection.jacobian(x)
        return kink_by_columns(jacobian, self._jacobian, gradient, other.metric.scale)

    def _is_rounding(self, dx: Array, found: Settled) -> bool:
        """Tell whether a correction is no more than rounding and error of the corrected point."""
        typical = GUARD * EPS * found.extent[0]
        if found.aside is None and abs(found.along) * self.length <= typical:
            return True  # nearly always
        rounding = typical * self.curve.metric.scale + CONFIDENCE * found.size
        return is_everywhere(np.abs(dx) <= rounding)

    def _is_tame(self) -> bool:
        """Tell whether the direction is finite, and far from vertical."""
        return self.length * self.curve.metric.width < GROWTH

    def _audited(self, x: Array, sizes: Array, residual: Array) -> Array | None:
        """Solve for errors, point and direction afresh; return the correction of the point.

        None if the direction is no direction of this selection.
        """
        n, along, metric = len(x) - 1, self.along, self.curve.metric
        jacobian = self._jacobian_at(x)
        magnitudes, astray = abs(jacobian), jacobian.dot(along)
        self._most = sizes if n < ALWAYS_AUDITED else GROWN * _largest_alike(sizes, metric)
        self._terms = product(magnitudes, self._most + CONVERGED * metric.scale)
        typical = product(magnitudes, metric.scale)
        if not is_everywhere(np.abs(astray) <= (ASTRAY * self.length) * typical):
            return None
        if self._solver.is_full:
            self._has_renewed(jacobian)  # due at the next change, when no Jacobian is at hand
        asked = np.empty((1 + len(self._lines), n))
        asked[0], asked[1] = residual, astray
        np.multiply(self._samples[:, :n], EPS * self._terms, out=asked[2:])
        solved = self._solver.solve_all(asked)
        along[:-1] -= solved[1]
        self._lines[1:, :-1] = solved[2:]
        self.length, self._since = metric.norm(along), 0
        correction: Array = solved[0]
        return correction

    def _bordered(self, rounding: float) -> Array:
        """Return samples of the error of a point that a test of this rounding locates."""
        lines, slopes = self._lines, self._slopes
        last = rounding * self._samples[:, -1] - slopes[1:]
        beside: Array = lines[1:].copy()
        add_multiples(beside, last / slopes[0], lines[0])
        return beside


def _factorised(curve: Curve, x: Array) -> tuple[Matrix, Factor | None]:
    """Return the Jacobian of a curve and the factorisation of the part for z, if regular."""
    jacobian = curve.selection.jacobian(x)
    return jacobian, inner(jacobian, curve.metric.binary)


def _compares_columns(curve: Curve, jacobian: Matrix) -> bool:
    """Tell whether c is read off Jacobians: if cheap, or if unknowns have bounds."""
    is_at_hand = isinstance(jacobian, StructuredJacobian) and jacobian.is_at_hand
    is_small = jacobian.shape[0] < ASKED_FOR_JACOBIANS
    return is_small or is_at_hand or Box.of(curve.selection.system).is_bounded


def _largest_alike(sizes: Array, metric: Metric) -> Array:
    """Return for each unknown the largest of all unknowns of the same typical magnitude.

    Until the next audit an unknown may become as large as another unknown of the same typical
    magnitude is now; all may be far smaller than is typical, such as displacements of a soft body
    that contact holds.
    """
    largest = np.zeros(len(sizes))
    np.maximum.at(largest, metric.kinds, sizes)
    alike: Array = largest[metric.kinds]
    return alike


def kink_by_columns(before: Matrix, after: Matrix, gradient: Array, scale: Array) -> Array:
    """Return c of J' - J = c g^T (F1), shape (n,), from the Jacobians, shape (n, n + 1).

    The column of the unknown along which the test changes most is compared, so that c is no small
    difference of large numbers.

    Parameters
    ----------
    before, after : ndarray, sparse matrix or StructuredJacobian
    gradient : ndarray, shape (n + 1,)
        g, of the test that vanishes on the interface.
    scale : ndarray, shape (n + 1,)
        Typical magnitudes of the unknowns.
    """
    steepest = int(np.abs(gradient * scale).argmax())
    jump: Array = (column(after, steepest) - column(before, steepest)) / gradient[steepest]
    return jump


def kink_by_residuals(before: Curve, after: Curve, x: Array, gradient: Array) -> Array | None:
    """Return c, shape (n,), without Jacobians; None where the test changes with alpha alone.

    The residuals on the two sides are compared far away along the unknown along which the test
    changes most. That unknown is so large there that the rounding of all other terms is less than
    the rounding of the unknown's column. Systems whose unknowns have bounds are not asked for such
    residuals.

    Parameters
    ----------
    before, after : Curve
        The curves of the selections on the two sides, affine in z.
    x : ndarray, shape (n + 1,)
        A point of the interface, up to rounding.
    gradient : ndarray, shape (n + 1,)
        g, of the test that vanishes on the interface.
    """
    scale = after.metric.scale
    weights = np.abs(gradient * scale)[:-1]
    steepest = int(weights.argmax())
    far = x.copy()
    far[steepest] += FAR_AWAY * max(1.0, after.metric.norm(x)) * scale[steepest]
    test = gradient[steepest] * (far[steepest] - x[steepest])
    if weights[steepest] <= abs(gradient[-1] * scale[-1]) / FAR_AWAY or not math.isfinite(test):
        return None
    jump: Array = (after.selection.residual(far) - before.selection.residual(far)) / test
    return jump
