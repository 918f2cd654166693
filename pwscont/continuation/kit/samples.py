"""Known curves, on which a user's own steppers, detectors and searches are tried."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.curve.corrector import BorderedNewton, Corrected
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.check import Report
from pwscont.system.inspection import Defect
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem

#: A point is on a curve if its correction is below the first number, a slope is right if it agrees
#: with differences to the second.
ON_CURVE, AGREES = 1e-8, 1e-3
#: Steps that are tried on each curve.
STEPS = 40


@final
@dataclass(frozen=True, slots=True)
class StateSample:
    """A system, an interval, and a point of its curve."""

    system: PiecewiseSystem
    interval: tuple[float, float]
    x: Array

    @property
    def curve(self) -> Curve:
        """The curve through the point, in the metric of a run."""
        system = self.system.within(*self.interval)
        character = system.character(self.x[:-1], float(self.x[-1]))
        return Curve(Selection(system, character), Metric.of(system, self.interval))

    def state(self, direction: float) -> State:
        """Return the state at the point, travelling up or down in alpha."""
        found = BorderedNewton().correct(self.curve, self.x, direction * last_unit(len(self.x)))
        assert isinstance(found, Corrected)  # the points are on regular curves
        return found.state


@final
class _Circle(PiecewiseSystem):
    size = 1

    def test_functions(self, z: Array, alpha: float) -> Array:
        return z - 0.5

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        return z**2 + alpha**2 - 1.0


@final
class _Cubic(PiecewiseSystem):
    size = 2

    def test_functions(self, z: Array, alpha: float) -> Array:
        return np.array([z[1] - 900.0])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        return np.array([z[0] ** 3 + z[0] - alpha, z[1] - 1e3 * z[0] ** 2])

    def scale(self, lo: float, hi: float) -> Array:
        return np.array([1.0, 1e3])


@final
class _Line(PiecewiseSystem):
    size = 1

    def test_functions(self, z: Array, alpha: float) -> Array:
        return z - 0.25

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        return z - 0.5 * alpha


def samples() -> tuple[StateSample, ...]:
    """Return the curves on which an implementation is tried."""
    return (
        StateSample(_Circle(), (-0.9, 0.9), np.array([0.8, 0.6])),
        StateSample(_Cubic(), (-1.0, 1.5), np.array([0.0, 0.0, 0.0])),
        StateSample(_Line(), (-1.0, 1.0), np.array([0.0, 0.0])),
    )


def report(defects: Iterable[Defect], tried: int) -> Report:
    """Return a report in which each defect stands once."""
    return Report(tuple({defect.what: defect for defect in defects}.values()), tried)


def off_curve(curve: Curve, x: Array, row: Array) -> float:
    """Return how far a point is off a curve, within the hyperplane of a row."""
    factor = bordered(curve.selection.jacobian(x), row, curve.metric.binary)
    return curve.metric.norm(factor.solve(curve.selection.residual_and(x, 0.0)))


def defect(what: str, x: Array) -> Defect:
    """Return a broken promise and where it was seen."""
    return Defect(what, x[:-1], float(x[-1]), np.nan)
