"""Length and angle in (z, alpha), independent of units.

The typical magnitude of an unknown is the distance of the unknown from the beginning of the path,
as a mean over alpha. A mean over the points would follow a branch that leaves for infinity, where
there are many points and alpha hardly changes. Magnitudes follow the units of unknowns, equations
and alpha.

On the path (:class:`Gauge`) magnitudes that are far too small lead to thousands of steps, and
magnitudes that are far too large make a fold as sharp as a kink. Magnitudes grow by the distances
from the beginning of each path alone, and shrink only if all paths are close together, too: where
sheets are far apart, smaller magnitudes cost three times the evaluations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import Array, dot, joined, largest, power_of_two, smallest
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.printing import named
from pwscont.basics.rounding import CONVERGED, EPS, GUARD, HALF_DIGITS, SAME_ALPHA, TINY
from pwscont.system.box import Box
from pwscont.system.contract import checked_scale
from pwscont.system.system import PiecewiseSystem

#: Largest magnitude whose squares and products stay far from overflow.
LARGEST = 1e120
#: Smallest magnitude whose squares and products stay far from underflow.
SHORTEST = 1.0 / LARGEST
#: Part of the size of alpha that counts where a correction is compared with CONVERGED.
ROUNDING_OF_ALPHA = GUARD * EPS / CONVERGED
#: Most unknowns of a direction that is sketched whole, and the number of projections of a longer
#: direction.
WHOLE, PROJECTIONS = 64, 16
#: The least and the largest alpha, as of the interval of a run.
Range: TypeAlias = tuple[float, float]
EVERYWHERE: Range = (-math.inf, math.inf)
_NONE = np.zeros(0, dtype=np.intp)
#: A magnitude that is wrong by more than this factor, too small or too large.
TOO_SMALL, TOO_LARGE = 16.0, 64.0
#: A magnitude too small by more than this factor is revised together with wrong magnitudes.
NEARLY_TOO_SMALL = 4.0
#: Number of steps after which the path is looked at first, then whenever the number has doubled.
FIRST_LOOK = 128
#: Before the first look, an unknown this many magnitudes away is larger, by a factor at most.
FAR, AHEAD_OF_FARTHEST = 12.0, 4.0
#: How much of the interval a path must have seen before means over alpha say something.
MUCH = 0.25


@final
class Metric:
    """Euclidean geometry after dividing each unknown by the typical magnitude.

    Parameters
    ----------
    scale : ndarray, shape (n + 1,)
        Positive typical magnitudes of (z, alpha).
    interval : tuple of float
        The values of alpha at which a system may be asked for anything.
    period : ndarray, shape (n,), optional
        The periods of the unknowns, infinite if not periodic; default all infinite.

    Attributes
    ----------
    scale, binary : ndarray, shape (n + 1,)
        The magnitudes, and the next larger powers of two.
    width : float
        The typical magnitude of alpha.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import Metric
    >>> metric = Metric(np.array([1e-3, 2.0]))
    >>> metric.norm(np.array([3e-3, 8.0])), metric.normalised(np.array([0.0, 9.0]))
    (5.0, array([0., 2.]))
    """

    def __init__(
        self, scale: Array, interval: Range = EVERYWHERE, period: Array | None = None
    ) -> None:
        self.scale, self.interval, self.width = scale, interval, float(scale[-1])
        self._turning = np.flatnonzero(np.isfinite(period)) if period is not None else _NONE
        self._period = period[self._turning] if period is not None else _NONE
        self.binary = power_of_two(scale)
        self._weight = 1.0 / scale**2

    def __repr__(self) -> str:
        lo, hi = self.interval
        return named(self, f"{len(self.scale)} magnitudes", f"alpha in [{lo:.6g}, {hi:.6g}]")

    @classmethod
    def of(cls, system: PiecewiseSystem, interval: Range) -> Metric:
        """Return the metric of a system on an interval, in which the interval has length 1."""
        lo, hi = interval
        return cls._checked(system, system.scale(lo, hi), hi - lo, interval)

    @classmethod
    def at(cls, system: PiecewiseSystem, alpha: float, width: float | None = None) -> Metric:
        """Return the metric of a system at a single alpha; ``width`` is the magnitude of alpha."""
        width = width or max(1.0, abs(alpha))
        return cls._checked(system, system.scale(alpha, alpha), width, EVERYWHERE)

    @classmethod
    def _checked(
        cls, system: PiecewiseSystem, magnitudes: Array, width: float, interval: Range
    ) -> Metric:
        everything = joined(checked_scale(system, magnitudes), width)
        least, most = smallest(everything), largest(everything)
        if most > LARGEST or least < SHORTEST:
            raise InvalidSystemError(
                f"typical magnitudes from {least:.3g} to {most:.3g} leave the range "
                f"[{SHORTEST:g}, {LARGEST:g}] in which their squares can be computed; choose "
                "other units"
            )
        box = Box.of(system)
        return cls(everything, interval, box.period if box.is_periodic else None)

    def admits(self, x: Array) -> bool:
        """Tell whether alpha is in the interval; alpha outside by rounding is moved to the end."""
        lo, hi = self.interval
        alpha = float(x[-1])
        if lo <= alpha <= hi:
            return True
        end = lo if alpha < lo else hi
        if not abs(alpha - end) <= SAME_ALPHA * max(abs(end), hi - lo):
            return False
        x[-1] = end
        return True

    def difference(self, x: Array, y: Array) -> Array:
        """Return x - y, up to whole periods: from y to the nearest copy of x.

        The arrays x and y may hold several points, shape (k, n + 1).
        """
        apart: Array = x - y
        if len(self._turning):
            turns = np.round(apart[..., self._turning] / self._period)
            apart[..., self._turning] -= turns * self._period
        return apart

    def norm(self, x: Array) -> float:
        """Return the length of a difference of two points."""
        y = x / self.scale
        return math.sqrt(dot(y, y))

    def relative(self, dx: Array, x: Array) -> float:
        """Return the largest component of ``dx`` relative to the component of ``x`` or the scale.

        Alpha is relative to the interval, wherever that lies; rounding of alpha is converged.
        """
        return largest(np.abs(dx) / self.sizes(x))

    def sizes(self, x: Array) -> Array:
        """Return the sizes that a correction of ``x`` is compared with, shape (n + 1,)."""
        sizes = np.abs(x)
        sizes[-1] *= ROUNDING_OF_ALPHA
        sizes += self.scale
        return sizes

    def sketch(self, t: Array) -> Array:
        """Return a unit vector that tells a unit direction t from other directions.

        A long direction is reduced to a few projections, which agree where directions are equal and
        differ where directions clearly differ.
        """
        rows = self._sketching
        if rows.ndim == 1:
            return rows * t
        seen = rows.dot(t)
        unit: Array = seen / math.sqrt(seen.dot(seen))
        return unit

    @cached_property
    def _sketching(self) -> Array:
        """The factor of a direction: units, for many unknowns random projections, always alike."""
        size, rows = len(self.scale), np.ones(1)
        if size > WHOLE:
            rows = np.random.default_rng(size).normal(size=(PROJECTIONS, size))
        return rows / self.scale

    def slack(self, x: Array, tolerance: float) -> float:
        """Return the length that a tolerance leaves at a point.

        The tolerance is relative to z, and adds no more than rounding of alpha: an interval far
        from zero does not make two values of alpha the same.
        """
        alpha, z = abs(float(x[-1])) / self.width, x[:-1] / self.scale[:-1]
        return tolerance * (1.0 + math.sqrt(z.dot(z))) + GUARD * EPS * alpha

    def covector(self, t: Array) -> Array:
        """Return the row w with ``w @ x`` the inner product of t and x."""
        return self._weight * t

    def normalised(self, t: Array) -> Array:
        """Return t of any length, divided by the length in the metric."""
        length = self.norm(t)
        if not SHORTEST < length < LARGEST:  # squares leave the range of numbers
            t = t / largest(np.abs(t) / self.scale)
            length = self.norm(t)
        unit: Array = t / length
        return unit


class MisjudgedError(Exception):
    """Typical magnitudes, shape (n,), of a path whose own were wrong."""

    def __init__(self, magnitudes: Array) -> None:
        super().__init__()
        self.magnitudes = magnitudes


@final
class Gauge:
    """Adds up how far a path moves, to judge the magnitudes of a metric."""

    def __init__(self, metric: Metric) -> None:
        self._scale, self._width = metric.scale[:-1], metric.width
        self._steps, self._look, self._alpha = 0, FIRST_LOOK, 0.0
        self._away, self._apart, self._farthest, self._size = np.zeros((4, len(self._scale)))
        self._first: Array | None = None
        self._begun: Array | None = None

    def begin(self) -> None:
        """Take the next step for the first step of another path."""
        self._begun = None

    def end(self, steps: int) -> None:
        """Judge a path whose piece of that many steps has an end."""
        if steps >= FIRST_LOOK:
            self._judge(math.inf)

    def see(self, x: Array, y: Array) -> None:
        """Add a step from x to y, each of shape (n + 1,); may raise a MisjudgedError."""
        self._first = x if self._first is None else self._first
        self._begun = x if self._begun is None else self._begun
        change, x, y = abs(float(y[-1] - x[-1])), x[:-1], y[:-1]
        middle = 0.5 * (x + y)
        away = np.abs(middle - self._begun[:-1])
        self._alpha += change
        self._away += change * away
        self._apart += change * np.abs(middle - self._first[:-1])
        self._size = np.maximum(self._size, np.abs(y))
        self._farthest = np.maximum(self._farthest, away)
        self._steps += 1
        if self._steps >= self._look:
            self._look *= 2
            self._judge(math.inf)

    def close(self) -> None:
        """Judge the whole path; may raise a MisjudgedError."""
        if self._steps:
            self._judge(TOO_LARGE)

    def _judge(self, large: float) -> None:
        """Raise a MisjudgedError if a magnitude is too small, or too large by a factor."""
        if self._alpha >= MUCH * self._width:
            typical = 2.0 * self._away / self._alpha
            apart = np.maximum(typical, 2.0 * self._apart / self._alpha)
            wrong = (typical > TOO_SMALL * self._scale) | (large * apart < self._scale)
        else:
            ahead = self._width * self._farthest / max(self._alpha, SHORTEST)
            typical = np.minimum(ahead, AHEAD_OF_FARTHEST * self._farthest)
            wrong = self._farthest > FAR * self._scale
        # unknowns that are rounding of their magnitude do not move either
        moves = (typical > HALF_DIGITS * self._size) & (self._size > EPS * self._scale)
        if (wrong & moves).any():
            wrong |= typical > NEARLY_TOO_SMALL * self._scale  # wrong on the next path
            raise MisjudgedError(np.where(wrong & moves, typical, self._scale))


def deflation(metric: Metric, known: Sequence[Array], x: Array) -> float:
    """Return the product of 1 + 1 / distance^2 over the known solutions."""
    factor = 1.0
    for other in known:
        distance = max(metric.norm(metric.difference(x, other)), EPS)
        factor *= 1.0 + 1.0 / (distance * distance)  # a power would raise an error far away
    return factor


def stretch(metric: Metric, known: Sequence[Array], x: Array, step: Array) -> float:
    """Return the factor by which deflation lengthens, shortens or turns the Newton step.

    With M the deflating factor and d the step, the step of M H is d / (1 - (grad M . d) / M)
    by the formula of Sherman and Morrison (Farrell, Birkisson and Funke 2015).
    """
    slope = 0.0
    for other in known:
        distance = max(metric.norm(metric.difference(x, other)), EPS)
        square = distance * distance  # a power would raise an error far away
        inner = float(metric.covector(metric.difference(x, other)).dot(step))
        slope -= 2.0 * inner / square / (1.0 + square)
    return 1.0 / (1.0 - slope) if slope != 1.0 else 1.0


def nearest_on_chords(points: Array, x: Array, metric: Metric) -> tuple[float, Array, Array]:
    """Return how far a polygon is as a part of the chord's length, the nearest point, the chord."""
    starts, chords = points[:-1] / metric.scale, np.diff(points, axis=0) / metric.scale
    away = metric.difference(x, points[:-1]) / metric.scale
    lengths = np.maximum((chords**2).sum(axis=1), TINY)
    parts = np.clip((away * chords).sum(axis=1) / lengths, 0.0, 1.0)
    distances = np.linalg.norm(away - parts[:, np.newaxis] * chords, axis=1) / np.sqrt(lengths)
    i = int(np.argmin(distances))
    nearest = (starts[i] + parts[i] * chords[i]) * metric.scale
    return float(distances[i]), nearest, chords[i] * metric.scale
