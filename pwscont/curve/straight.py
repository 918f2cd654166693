"""Straight pieces, cell by cell: one solve from each to the next (docs/theory, F11).

With J' = J + c g^T on the other side of an interface (F1), where g is the gradient of the test that
vanishes, the direction beyond follows from the one before by the solution of J w = c alone. The
same update holds for everything that was solved for: the samples of the error of a point are
carried along. From time to time, in small systems always, an *audit* solves for all of them
afresh, together with corrections of point and direction. Jacobians that are neither small nor at
hand are asked for by audits alone.

Failure modes and answers
-------------------------
- Rounding adds up from cell to cell: the residual of the system itself is asked for at every
  transition, and the point is corrected where it is more than the stated error covers.
- The Jacobians of the cells differ by more than one rank, because the system is wrong, or gives its
  matrices in one array that it writes to: an audit compares the direction with the new Jacobian.
- 1 + g.w is small beside its terms, or the direction is nearly vertical or in the interface: the
  caller is given nothing, and goes the way of :mod:`pwscont.transitions.bounding`.
"""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.curve import Curve
from pwscont.curve.metric import Metric
from pwscont.curve.rank_one import by_columns, by_residuals
from pwscont.curve.uncertainty import magnitude, samples
from pwscont.linear.bordered import GROWTH
from pwscont.linear.inner import column, inner
from pwscont.linear.product_form import ProductForm
from pwscont.linear.structured import StructuredJacobian
from pwscont.system.box import Box

#: Systems of fewer unknowns are audited at every transition, others after so many.
SMALL, AUDIT = 64, 16
#: A residual is corrected from this part on of what the stated error of the point covers.
COVERED = 0.75
#: Errors are estimated afresh where the point has grown by more than this.
GROWN = 2.0
#: A direction is on its selection where its residual is below this part of its terms.
ASTRAY = EPS**0.5


class Settled(NamedTuple):
    """A corrected point.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
    error : ndarray, shape (k, n + 1)
        Samples of its error.
    size : ndarray, shape (n + 1,)
        The estimate of its error.
    """

    x: Array
    error: Array
    size: Array


@final
class StraightCell:
    """The linear algebra of the cell in which a straight piece lies.

    Attributes
    ----------
    curve : Curve
    along : ndarray, shape (n + 1,)
        Direction of the piece, with an alpha of one.
    turn : int
        The sign of 1 + g.w where the cell was entered: -1 at a fold.
    """

    def __init__(self, curve: Curve, solver: ProductForm, along: Array) -> None:
        self.curve, self.along, self.turn = curve, along, 1
        self._solver = solver
        self._jacobian: Matrix | None = None
        self._samples, self._bound = np.empty(0), np.empty(0)
        self._size, self._since = 0.0, AUDIT

    @classmethod
    def at(cls, curve: Curve, x: Array) -> StraightCell | None:
        """Return the cell of a curve, factorised; None where it is next to singular."""
        jacobian = curve.selection.jacobian(x)
        solver, n = _factorised(jacobian, curve.metric), len(x) - 1
        if solver is None:
            return None
        cell = cls(curve, solver, np.append(-solver.solve(column(jacobian, n)), 1.0))
        is_at_hand = isinstance(jacobian, StructuredJacobian) and jacobian.is_at_hand
        if n < SMALL or is_at_hand or Box.of(curve.selection.system).is_bounded:
            cell._jacobian = jacobian
        return cell if _is_tame(cell.along, curve.metric) else None

    def beyond(self, curve: Curve, x: Array, gradient: Array) -> StraightCell | None:
        """Return the cell on the other side of the interface; this one is of no use any more.

        Parameters
        ----------
        curve : Curve
            Of the selection on the other side.
        x : ndarray, shape (n + 1,)
            A point of the interface, but for rounding.
        gradient : ndarray, shape (n + 1,)
            Of the test that vanishes there.

        Returns
        -------
        StraightCell or None
        """
        solver = self._refreshed(x)
        jacobian, jump = self._jump(curve, x, gradient)
        if solver is None or jump is None:
            return None
        w = solver.solve(jump)
        pivot = solver.change(w, gradient[:-1])
        if pivot == 0.0:
            return None
        cell = StraightCell(curve, solver, self.along.copy())
        cell.along[:-1] -= (float(gradient.dot(self.along)) / pivot) * w
        cell.turn, cell._jacobian = 1 if pivot > 0.0 else -1, jacobian
        if len(self._samples):
            carried = self._samples - np.outer(self._samples @ (gradient[:-1] / pivot), w)
            cell._samples, cell._bound = carried, self._bound
            cell._size, cell._since = self._size, self._since + 1
        return cell if _is_tame(cell.along, curve.metric) else None

    def settled(self, x: Array, gradient: Array, value: float) -> Settled | None:
        """Return a point of the piece on an interface, corrected.

        Parameters
        ----------
        x : ndarray, shape (n + 1,)
            Nearly that point.
        gradient, value
            Of the test of the interface.

        Returns
        -------
        Settled or None
            None where the correction is more than rounding, or cannot be computed.
        """
        correction = self._correction(x, self.curve.selection.residual(x))
        if correction is None:
            return None
        slope = float(gradient.dot(self.along))
        if not slope:
            return None  # along the interface
        steep = 1.0 / slope
        dx = (value - float(gradient[:-1].dot(correction))) * steep * self.along
        dx[:-1] += correction
        error = self._bordered(x, gradient, steep)
        found = Settled(x - dx, error, magnitude(x, error))
        inside = self.curve.metric.admits(found.x)
        return found if inside and self._is_rounding(dx, found) else None

    def _correction(self, x: Array, residual: Array) -> Array | None:
        """Return the solution for a residual; zero where it is rounding, None where it is none."""
        size = self.curve.metric.norm(x)
        if len(residual) < SMALL or self._since >= AUDIT or size > GROWN * self._size:
            return self._audited(x, residual, size)
        is_rounding = (np.abs(residual) <= self._bound).all()
        return np.zeros(len(residual)) if is_rounding else self._solver.solve(residual)

    def _refreshed(self, x: Array) -> ProductForm | None:
        """Return what solves with this cell's Jacobian, with room for one more change."""
        if not self._solver.is_full:
            return self._solver
        return _factorised(self._jacobian_at(x), self.curve.metric)

    def _jacobian_at(self, x: Array) -> Matrix:
        return self.curve.selection.jacobian(x) if self._jacobian is None else self._jacobian

    def _jump(self, curve: Curve, x: Array, gradient: Array) -> tuple[Matrix | None, Array | None]:
        """Return c of the cell beyond, and the Jacobian there if this cell has its own at hand."""
        if self._jacobian is None:
            return None, by_residuals(self.curve, curve, x, gradient)
        jacobian = curve.selection.jacobian(x)
        return jacobian, by_columns(self._jacobian, jacobian, gradient, curve.metric.scale)

    def _is_rounding(self, dx: Array, found: Settled) -> bool:
        """Tell whether a correction is no more than rounding of unknowns as large as these are."""
        scale = self.curve.metric.scale
        typical = GUARD * EPS * float(np.abs(found.x / scale).max()) * scale
        return bool((np.abs(dx) <= typical + CONFIDENCE * found.size).all())

    def _audited(self, x: Array, residual: Array, size: float) -> Array | None:
        """Solve for errors, point and direction afresh; return the correction of the point.

        None where the direction is not one of this selection.
        """
        n, along, scale = len(x) - 1, self.along, self.curve.metric.scale
        jacobian = self._jacobian_at(x)
        magnitudes, astray = abs(jacobian), jacobian @ along
        now = np.abs(x) if n < SMALL else GROWN * _largest_alike(x, scale)
        terms, typical = magnitudes @ (now + CONVERGED * scale), magnitudes @ scale
        if not (np.abs(astray) <= ASTRAY * np.abs(along / scale).max() * typical).all():
            return None
        rounding = EPS * terms * samples(n + 1)[:, :n]
        self._bound = COVERED * CONFIDENCE * EPS * terms
        solved = self._solver.solve_all(np.vstack([residual, astray, rounding]))
        along[:-1] -= solved[1]
        self._samples, self._size, self._since = solved[2:], size, 0
        correction: Array = solved[0]
        return correction

    def _bordered(self, x: Array, gradient: Array, steep: float) -> Array:
        """Return samples of the error of a point that the test of an interface locates."""
        rounding = EPS * float(np.abs(gradient).dot(np.abs(x)))
        last = rounding * samples(len(x))[:, -1] - self._samples @ gradient[:-1]
        error = np.outer(steep * last, self.along)
        error[:, :-1] += self._samples
        return error


def _largest_alike(x: Array, scale: Array) -> Array:
    """Return the largest magnitude of the unknowns with the same typical one, for each unknown.

    Until the next audit each may become as large as others of its kind are now; all of a kind may
    be far smaller than is typical, as displacements of a soft body are that its contact holds.
    """
    kinds, kind = np.unique(scale, return_inverse=True)
    largest = np.zeros(len(kinds))
    np.maximum.at(largest, kind, np.abs(x))
    alike: Array = largest[kind]
    return alike


def _factorised(jacobian: Matrix, metric: Metric) -> ProductForm | None:
    """Return the part of a Jacobian for z, factorised; None where it has no factorisation."""
    core = inner(jacobian, metric.binary)
    return ProductForm(core, jacobian.shape[0]) if core is not None else None


def _is_tame(along: Array, metric: Metric) -> bool:
    """Tell whether a direction is finite, and far from vertical."""
    steepness = np.abs(along / metric.scale).max() * metric.scale[-1]
    return bool(steepness < GROWTH)
