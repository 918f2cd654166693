"""The curve of a selection, a state on a curve, and the tangents of a curve.

Where Jacobians are differences, a tangent is computed again by differences of fourth order. If
differences of second order err by d, those of fourth order err by RATIO d^2, and are taken only if
RATIO d^2 is less than d. Along a vertical piece the slope of alpha is only the error of
differences: the errors are estimated from the terms of the derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, joined
from pwscont.basics.printing import at, named
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.error_samples import magnitude, samples
from pwscont.curve.metric import Metric
from pwscont.linear.factor import Factor
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.differences import FINE_STEP, STEP
from pwscont.system.selection import Selection

#: Least relative errors of derivatives by differences of second and of fourth order.
ERROR_OF_DIFFERENCES, ERROR_OF_FINE = EPS / STEP, EPS / FINE_STEP
#: Ratio of an error of fourth order to the square of an error of second order: the errors are
#: (FINE_STEP / w)^4 and (STEP / w)^2 for a function that changes over a width w.
RATIO = (FINE_STEP / STEP) ** 4


def finer_tangent(
    selection: Selection, metric: Metric, x: Array, tangent: Array
) -> tuple[Array, Array] | None:
    """Return the tangent by differences of fourth order, and samples of its rounding.

    Shapes (n + 1,) and (k, n + 1); None if the bordered matrix is singular. ``tangent``: the
    tangent by differences of second order.
    """
    differences = selection.system.differences(float(x[-1]))
    jacobian = differences.to_fourth_order(selection.residual, x)
    factor = bordered(jacobian, metric.covector(tangent), metric.binary)
    if factor.is_singular():
        return None
    terms = np.abs(jacobian).dot(np.abs(x) + metric.scale)
    rounding = ERROR_OF_FINE * samples(len(x)) * joined(terms, 0.0)
    along, *errors = factor.solve_all(np.vstack([last_unit(len(x)), rounding]))
    return metric.normalised(along), np.array(errors)


#: Slope of alpha, in intervals per arc length, below which alpha may not change at all: differences
#: and a factorisation from next to the point do not tell.
LEAN = GUARD * CONVERGED


@final
@dataclass(slots=True, eq=False)
class Curve:
    """The solutions of H_chi(x) = 0 for a frozen character, measured in a metric.

    Attributes
    ----------
    selection : Selection
    metric : Metric

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import LCP
    >>> from pwscont.extending import Curve, Metric, Selection
    >>> problem = LCP([[2.0]], q=[0.0], d=[-1.0])  # z = alpha / 2 where alpha is positive
    >>> above = Selection(problem, problem.character(np.array([0.5]), 1.0))
    >>> Curve(above, Metric.of(problem, (-1.0, 1.0))).selection.residual(np.array([0.5, 1.0]))
    array([0.])
    """

    selection: Selection
    metric: Metric

    def slope(self, state: State) -> float:
        """Return d alpha / d arc length, exactly zero for a slope that is zero to rounding.

        The slope is proportional to det(dH/dz): zero at a fold and all along a vertical piece.
        """
        width = self.metric.width
        slope = float(state.tangent[-1]) / width
        if abs(slope) > LEAN or not slope:
            return slope  # nearly always; exactly zero at a fold that has been located
        found = None
        if not self.selection.system.knows_jacobian:
            found = finer_tangent(self.selection, self.metric, state.x, state.tangent)
        if found is None:
            return slope if abs(slope) > GUARD * EPS else 0.0
        fine = float(found[0][-1]) / width
        rounding = float(np.linalg.norm(found[1][:, -1])) / width
        relative = abs(fine - slope) * ERROR_OF_FINE / rounding if rounding else 0.0
        off = CONFIDENCE * rounding + min(1.0, RATIO * relative) * abs(fine - slope)
        return fine if abs(fine) > max(off, GUARD * EPS) else 0.0


@final
@dataclass(slots=True, eq=False)  # making a frozen object takes several times as long
class State:
    """A point on a curve and the direction in which the curve is followed.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
        The point (z, alpha).
    tangent : ndarray, shape (n + 1,)
        Direction in which the curve is followed, of unit length in the metric.
    error : ndarray, shape (k, n + 1)
        Samples of the error of ``x``: at a located point estimates, on the way the last
        correction.
    orientation : int
        Sign of det[J; tangent^T] (Janovsky and Ligursky 2012, Definition 1).
    located_by : Factor, optional
        A factorisation of [J; gradient of the function], for a state at which a function vanishes;
        corrects points of the curve close by. A reversed state has none.
    jacobian : Matrix, optional
        The Jacobian here or right beside, as from before the last correction, where known.
    is_singular : bool
        Whether det[J; tangent^T] is known to vanish here, as at a branch point; the orientation is
        that of the way ahead, or of the way that led here.
    """

    x: Array
    tangent: Array
    error: Array
    orientation: int
    _size: Array | None = field(default=None, repr=False)
    located_by: Factor | None = field(default=None, repr=False)
    jacobian: Matrix | None = field(default=None, repr=False)
    is_singular: bool = field(default=False, repr=False)

    @property
    def size(self) -> Array:
        """The estimated error of every component of the point, shape (n + 1,)."""
        if self._size is None:
            self._size = magnitude(self.x, self.error)
        return self._size

    @property
    def alpha(self) -> float:
        """The parameter value."""
        return float(self.x[-1])

    def reversed(self) -> State:
        """Return the same place with the opposite direction."""
        back = State(self.x, -self.tangent, self.error, -self.orientation, self._size)
        back.jacobian, back.is_singular = self.jacobian, self.is_singular
        return back

    def __repr__(self) -> str:
        return named(self, at(self.x), f"orientation {self.orientation:+d}")
