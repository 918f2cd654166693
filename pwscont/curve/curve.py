"""The curve of one selection, a state on it, and its tangents.

Failure modes and answers
-------------------------
- A function changes within the longer steps of fourth order: with errors d of second order, those
  of fourth order are RATIO d^2, and are taken only where that is less.
- Along a vertical piece the slope of alpha is nothing but the errors of differences, and its signs
  would be folds. What these errors are depends on the units of alpha and on how long the interval
  is: they are estimated from the terms of which the derivatives consist.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Matrix, is_everywhere, joined
from pwscont.basics.character import Character
from pwscont.basics.looks import at, named
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD
from pwscont.curve.error_samples import magnitude, samples
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import Factor, bordered, last_unit
from pwscont.system.contract import Sample
from pwscont.system.differences import FINE_STEP, STEP
from pwscont.system.selection import Selection

#: What differences of second and of fourth order are off by at least, relative to derivatives.
CENTRAL, FINE = EPS / STEP, EPS / FINE_STEP
#: Errors of both are (STEP / w)^2 and (FINE_STEP / w)^4 for a function that changes over a width w.
RATIO = (FINE_STEP / STEP) ** 4


class Finer(NamedTuple):
    """A tangent by differences of fourth order.

    Attributes
    ----------
    tangent : ndarray, shape (n + 1,)
        Of length one in the metric.
    rounding : ndarray, shape (k, n + 1)
        Samples of what rounding of the differences makes of it.
    """

    tangent: Array
    rounding: Array


def finer(selection: Selection, metric: Metric, x: Array, tangent: Array) -> Finer | None:
    """Return the tangent next to one by differences of second order, None where there is none."""
    differences = selection.system.differences(float(x[-1]))
    jacobian = differences.to_fourth_order(selection.residual, x)
    factor = bordered(jacobian, metric.covector(tangent), metric.binary)
    if factor.is_singular():
        return None
    terms = np.abs(jacobian).dot(np.abs(x) + metric.scale)
    rounding = FINE * samples(len(x)) * joined(terms, 0.0)
    along, *errors = factor.solve_all(np.vstack([last_unit(len(x)), rounding]))
    return Finer(metric.normalised(along), np.array(errors))


def fine_slope(selection: Selection, metric: Metric, x: Array, tangent: Array) -> float:
    """Return d alpha / d arc length of a tangent by differences, zero where it may be zero."""
    slope, found = float(tangent[-1]) / metric.width, finer(selection, metric, x, tangent)
    if found is None:
        return slope
    fine = float(found.tangent[-1]) / metric.width
    rounding = float(np.linalg.norm(found.rounding[:, -1])) / metric.width
    relative = abs(fine - slope) * FINE / rounding if rounding else 0.0
    off = CONFIDENCE * rounding + min(1.0, RATIO * relative) * abs(fine - slope)
    return fine if abs(fine) > off else 0.0


#: Along a direction in which alpha changes by less than this part of the interval it may not change
#: at all: neither differences nor a factorisation from next to the point tell.
LEAN = GUARD * CONVERGED


class Held(NamedTuple):
    """A Jacobian, the unit row that borders it to a regular matrix, and the factorisation."""

    jacobian: Matrix
    row: Array
    factor: Factor


@final
@dataclass(slots=True, eq=False)
class Curve:
    """The solutions of H_chi(x) = 0 for one frozen character, measured in a metric.

    Attributes
    ----------
    selection : Selection
    metric : Metric
    held : Held, optional
        The Jacobian where the curve was entered, for the piece that begins there.
    """

    selection: Selection
    metric: Metric
    held: Held | None = field(default=None, repr=False)

    def handed_on(self) -> Held | None:
        """Return the Jacobian where the curve was entered, and let go of it."""
        held, self.held = self.held, None
        return held

    def slope(self, state: State) -> float:
        """Return d alpha / d arc length, exactly zero where it is zero to rounding.

        It is proportional to det(dH/dz): zero at a fold and all along a vertical piece.
        """
        slope = float(state.tangent[-1]) / self.metric.width
        if abs(slope) > LEAN:
            return slope  # nearly always
        if not self.selection.knows_jacobian:
            slope = fine_slope(self.selection, self.metric, state.x, state.tangent)
        return slope if abs(slope) > GUARD * EPS else 0.0


@final
class LastHeld:
    """The last Jacobian of a straight cell that Newton's method factorised, with alpha held.

    The piece through the solution that was found begins with it. Newton's method itself begins with
    what the system returned when it was checked, if that was at the start.
    """

    def __init__(self) -> None:
        self._last: tuple[Character, Held] | None = None
        self._sample: Sample | None = None

    def begin(self, sample: Sample) -> None:
        """Remember what the system returned when it was checked."""
        self._sample = sample

    def begun(self, x: Array) -> Sample | None:
        """Return what it returned, if that was at this point, and forget it."""
        sample, self._sample = self._sample, None
        return sample if sample and is_everywhere(sample.x == x) else None

    def keep(self, character: Character, held: Held) -> None:
        """Remember what belongs to a cell, and nothing else."""
        self._last = character, held

    def handed_on(self, curve: Curve) -> Held | None:
        """Return what is remembered, if it belongs to the cell of a curve, and forget it."""
        last, self._last = self._last, None
        return last[1] if last and last[0] == curve.selection.character else None


@final
@dataclass(slots=True, eq=False)  # a frozen one takes several times as long to make
class State:
    """A point on a curve and the direction in which it is followed.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
        The point (z, alpha).
    tangent : ndarray, shape (n + 1,)
        Direction in which the curve is followed, of length one in the metric.
    error : ndarray, shape (k, n + 1)
        Samples of the error of ``x``: at a located point estimates, on the way the last
        correction.
    orientation : int
        Sign of det[J; tangent^T] (Janovsky and Ligursky 2012, Definition 1).
    located_by : Factor, optional
        Where a function vanishes: a factorisation of [J; its gradient], which has nearly
        everything that the piece beyond begins with. It is not kept with the way back.
    behind : State, optional
        Where the step that led here began, and ``arc``, the length of the curve from there, in the
        metric; what predictors extrapolate. No more than two states back are kept.
    """

    x: Array
    tangent: Array
    error: Array
    orientation: int
    _size: Array | None = field(default=None, repr=False)
    located_by: Factor | None = field(default=None, repr=False)
    behind: State | None = field(default=None, repr=False)
    arc: float = field(default=0.0, repr=False)

    def comes_from(self, behind: State, arc: float) -> None:
        """Remember the step that led here; what was two steps before it is let go."""
        self.behind, self.arc = behind, arc
        if behind.behind is not None:
            behind.behind.behind = None

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
        return State(self.x, -self.tangent, self.error, -self.orientation, self._size)

    def __repr__(self) -> str:
        return named(self, at(self.x), f"orientation {self.orientation:+d}")
