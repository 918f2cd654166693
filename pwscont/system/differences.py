"""Derivatives by differences, with steps in the units of the problem.

Nothing is evaluated beyond the interval of alpha, where a function may be undefined: next to an
end, differences are one-sided, with the same order of accuracy. x + h is rounded: values are
divided by the difference of the rounded arguments. A function may change within less than a step,
as in a thin cell: a caller who sees slow convergence asks for finer steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias, TypeVar, final

import numpy as np

from pwscont.basics.arrays import GOLDEN, Array, power_of_two
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.rounding import EPS, HALF_DIGITS

#: Step of differences of second order, in typical magnitudes: truncation (h^2) balances
#: cancellation (EPS / h).
STEP = EPS ** (1.0 / 3.0)
#: Step of differences of fourth order, in typical magnitudes: h^4 balances EPS / h.
FINE_STEP = EPS**0.2
#: A finer step, as a part of the step before, and the finest step, as a part of the usual step: the
#: finest step leaves seven digits.
REFINEMENT, FINEST_PART = 1.0 / 16.0, 1.0 / 16.0**3
#: Largest change that is rounding, as a part of the value.
ROUNDED = 4.0 * EPS
#: Length of a long chord of an affine function, in typical magnitudes, a power of two: longer than
#: the solutions of systems whose magnitudes are not known. Chords are longer next to larger
#: constants, up to the largest constant: the values must not overflow.
LONG_CHORD, LARGEST_CONSTANT = 2.0**100, 1e100
#: Difference of two slopes, as a part of a slope, from which on both are rounding: errors of a few
#: units in the last place are never so close to each other along uneven chords.
ROUNDING_APART = 1e-3
#: Multiple of a step -> weight of the value, of fourth order: on two sides, and on a single side.
CENTRAL = {-2.0: 1.0 / 12.0, -1.0: -2.0 / 3.0, 1.0: 2.0 / 3.0, 2.0: -1.0 / 12.0}
ONE_SIDED = {0.0: -25.0 / 12.0, 1.0: 4.0, 2.0: -3.0, 3.0: 4.0 / 3.0, 4.0: -0.25}

Function: TypeAlias = Callable[[Array], Array]
T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Differences:
    """Differences for functions of x = (z, alpha).

    ``scale`` has typical magnitudes of z, then the length of the interval of alpha; nothing is
    evaluated outside [lo, hi]. ``part`` of the usual steps is taken.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import Differences
    >>> square = Differences(np.ones(2)).jacobian(lambda x: x[:1] ** 2, np.array([3.0, 0.0]))
    >>> [float(slope) for slope in square.round(6)[0]]
    [6.0, 0.0]
    """

    scale: Array
    lo: float = -np.inf
    hi: float = np.inf
    part: float = 1.0

    @property
    def base(self) -> float:
        """A value of alpha in the interval: the lower end, or the finite end nearest to zero."""
        return self.lo if np.isfinite(self.lo) else min(0.0, self.hi)

    @property
    def far(self) -> float:
        """Another value of alpha in the interval, as far from the first as possible."""
        if np.isfinite(self.hi - self.lo):
            return self.hi
        return self.base + (1.0 if self.base + 1.0 <= self.hi else -1.0)

    def contains(self, alpha: float) -> bool:
        """Tell whether a value of alpha lies in the interval."""
        return self.lo <= alpha <= self.hi

    def jacobian(self, function: Function, x: Array) -> Array:
        """Return the Jacobian of ``function`` at ``x``, shape (k, n + 1), about 10 digits right."""
        *z, alpha = x.tolist()
        with np.errstate(invalid="ignore"):  # inf - inf gives nan, which callers refuse
            columns = [_slope(_of(function, x, j), v, self._step(v, j)) for j, v in enumerate(z)]
            return np.array([*columns, self.by_parameter(_of(function, x, -1), alpha)]).T

    def by_parameter(self, function: Callable[[float], Array], alpha: float) -> Array:
        """Return the derivative at ``alpha`` of a function of the parameter alone.

        The derivative is one-sided near an end that central differences would cross.
        """
        h = min(self._step(alpha, -1), 0.5 * (self.hi - self.lo))
        if self.contains(alpha - h) and self.contains(alpha + h):
            return _slope(function, alpha, h)
        h *= self._inward(alpha, h)
        near, far = alpha + h, min(max(alpha + 2.0 * h, self.lo), self.hi)
        a, b, here = near - alpha, far - alpha, _value(function, alpha)
        # the slope at alpha of the parabola through three points
        first, second = (_value(function, other) - here for other in (near, far))
        return (first * (b / a) - second * (a / b)) / (b - a)

    def exact(self, function: Function) -> Array:
        """Return the Jacobian of an affine ``function``, shape (k, n + 1), right to rounding."""
        x = np.zeros_like(self.scale)
        x[-1] = self.base
        return _chords(function, x, self.scale[:-1], self.far).T

    def exact_in_z(self, function: Function, x: Array) -> Array:
        """Return the Jacobian at ``x`` of a ``function`` that is affine in z at every alpha."""
        start = np.append(np.zeros(len(x) - 1), x[-1])
        columns = _chords(function, start, self.scale[:-1])
        return np.array([*columns, self.by_parameter(_of(function, x, -1), float(x[-1]))]).T

    def along(self, function: Function, x: Array, direction: Array) -> Array:
        """Return the derivative along a direction, of any length but zero, to fourth order."""
        fine = self.part * FINE_STEP / float(np.abs(direction / self.scale).max())
        step = fine * direction
        reach = 2.0 * abs(float(step[-1]))
        weights, sign = CENTRAL, 1.0
        if not (self.contains(x[-1] - reach) and self.contains(x[-1] + reach)):
            weights = ONE_SIDED
            sign = np.copysign(1.0, step[-1]) * self._inward(float(x[-1]), reach)
        terms = [w * _value(function, x + sign * k * step) for k, w in weights.items()]
        return np.sum(terms, axis=0) / (sign * fine)

    def to_fourth_order(self, function: Function, x: Array) -> Array:
        """Return the Jacobian of ``function`` at ``x``, shape (k, n + 1), about 12 digits right."""
        columns = [self.along(function, x, direction) for direction in np.diag(self.scale)]
        return np.array(columns).T / self.scale

    def _inward(self, alpha: float, reach: float) -> float:
        """Return the sign of the steps of alpha that lead away from a close end of the interval."""
        return 1.0 if alpha - reach < self.lo else -1.0

    def _step(self, value: float, j: int) -> float:
        """Return the step in x_j, longer where x_j is large: there larger terms cancel."""
        scale = float(self.scale[j])
        larger: float = max(abs(value) / scale, 1.0) ** (1.0 / 3.0)
        return float(self.part * STEP * scale * larger)


def _of(function: Function, x: Array, j: int) -> Callable[[float], Array]:
    """Return a function of x as a function of the component x_j alone."""

    def at(value: float) -> Array:
        y = x.copy()
        y[j] = value
        return function(y)

    return at


def _slope(function: Callable[[float], Array], x: float, h: float) -> Array:
    """Return the central difference with step h; x + h is rounded, so not by 2 h."""
    forth, back = x + h, x - h
    return np.asarray(_change(_value(function, back), _value(function, forth)) / (forth - back))


def _change(before: Array, after: Array) -> Array:
    """Return the difference of two values, or raise an error if the shapes differ."""
    if before.shape != after.shape:
        raise InvalidSystemError(
            f"arrays of shape {before.shape} and of shape {after.shape} were returned at different "
            "(z, alpha): the number of test functions must not change"
        )
    return after - before


def _value(function: Callable[[T], Array], x: T) -> Array:
    """Return a copy of a value, as a function may return the same buffer at every call."""
    return np.array(function(x), dtype=float)


def _chords(function: Function, x: Array, scale: Array, *far: float) -> Array:
    """Return the slopes, shape (l, k), of an affine ``function`` as one x_j at a time is moved.

    Unknowns move by typical magnitudes, and alpha to the value ``far``, if given. A slope that is
    small in its equation may be lost in rounding there, though solutions are far larger than 1, or
    be nothing but rounding: the slope is read again along long chords.
    """
    origin, ends = _value(function, x), np.append(power_of_two(scale), far)
    slopes = np.array([_chord(function, x, j, end, origin) for j, end in enumerate(ends)])
    changes, sizes = np.abs(slopes.T * (ends - x[: len(ends)])).T, np.nan_to_num(np.abs(origin))
    rest = np.where(changes > 0.0, np.maximum(sizes, changes.max(axis=0)), sizes)
    small = changes < HALF_DIGITS * rest
    longer = LONG_CHORD * power_of_two(np.clip(sizes.max(initial=1.0), 1.0, LARGEST_CONSTANT))
    for j in np.flatnonzero(small[: len(scale)].any(axis=1)).tolist():
        far_ends = (longer * ends[j], GOLDEN * longer * ends[j])
        one, other = (_chord(function, x, j, end, origin) for end in far_ends)
        off = np.abs(one - other)
        agreed = np.where(off <= HALF_DIGITS * np.abs(one), one, slopes[j])
        # where terms cancel, rounding differs between chords of uneven lengths
        agreed[off > ROUNDING_APART * np.abs(one)] = 0.0
        slopes[j, small[j]] = agreed[small[j]]
    return slopes


def _chord(function: Function, x: Array, j: int, end: float, origin: Array) -> Array:
    """Return the slope from ``x``, where the value is ``origin``, as x_j moves to ``end``."""
    value = _value(_of(function, x, j), end)
    change = _change(origin, value)
    # rounding of the values is no slope: a singular matrix stays singular
    change[np.abs(change) <= ROUNDED * np.maximum(np.abs(origin), np.abs(value))] = 0.0
    return np.asarray(change / (end - x[j]))
