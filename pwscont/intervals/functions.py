"""Elementary functions of intervals, with slopes and inverses.

Increasing functions take ends to ends. Sine and cosine take the value 1 wherever a crest may lie in
the interval, as far as rounding of the argument can tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.intervals.interval import FUNCTION_ULPS, Interval

#: Arguments of sine and cosine from here on say nothing but [-1, 1].
FAR = 1e6
#: By how much of a period the place of a crest may be misjudged; rounding of arguments below FAR
#: makes errors smaller by a factor of a thousand.
BLUR = 1e-6
Map = Callable[[Interval], Interval]


def increasing(name: str, low: float = -np.inf, high: float = np.inf) -> Map:
    """Return an increasing function of intervals with values in a range."""
    function = getattr(np, name)

    def values(x: Interval) -> Interval:
        found = Interval.rounded(function(x.lo), function(x.hi), FUNCTION_ULPS)
        return Interval(np.maximum(found.lo, low), np.minimum(found.hi, high))

    return values


def within(function: Map, lowest: float, highest: float) -> Map:
    """Return a function that says nothing where the argument may leave a domain."""

    def values(x: Interval) -> Interval:
        return function(x).where((x.lo >= lowest) & (x.hi <= highest))

    return values


def _constant(x: Interval, value: float) -> Interval:
    return Interval.point(np.full_like(x.lo, value))


def _one(x: Interval) -> Interval:
    return _constant(x, 1.0)


def _has_crest(x: Interval, place: float) -> Signs:
    """Tell where a number place + 2 pi k may lie in the interval."""
    first, last = (x.lo - place) / (2.0 * np.pi), (x.hi - place) / (2.0 * np.pi)
    crest: Signs = np.floor(last + BLUR) >= np.ceil(first - BLUR)
    return crest


def _wave(function: Callable[[Array], Array], top: float) -> Map:
    """Return sine or cosine, whose crests are at top + 2 pi k."""

    def values(x: Interval) -> Interval:
        a, b = function(x.lo), function(x.hi)
        found = Interval.rounded(np.minimum(a, b), np.maximum(a, b), FUNCTION_ULPS)
        is_far = ~(x.reach() < FAR)
        lo = np.where(_has_crest(x, top + np.pi) | is_far, -1.0, np.maximum(found.lo, -1.0))
        hi = np.where(_has_crest(x, top) | is_far, 1.0, np.minimum(found.hi, 1.0))
        return Interval(lo, hi).where(x.lo <= x.hi)

    return values


sine, cosine = _wave(np.sin, 0.5 * np.pi), _wave(np.cos, 0.0)
exp, log = increasing("exp", low=0.0), within(increasing("log"), 0.0, np.inf)
expm1, log1p = increasing("expm1", low=-1.0), within(increasing("log1p"), -1.0, np.inf)
arctan, tanh = increasing("arctan"), increasing("tanh", -1.0, 1.0)
sinh, arcsinh = increasing("sinh"), increasing("arcsinh")
arcsin = within(increasing("arcsin"), -1.0, 1.0)
arctanh = within(increasing("arctanh"), -1.0, 1.0)


def cosh(x: Interval) -> Interval:
    """Return the hyperbolic cosine."""
    found = increasing("cosh")(x.magnitude())
    return Interval(np.maximum(found.lo, 1.0), found.hi)


def tangent(x: Interval) -> Interval:
    """Return the tangent; where a pole may lie in the interval, the tangent says nothing."""
    pole = _has_crest(x, 0.5 * np.pi) | _has_crest(x, -0.5 * np.pi)
    return increasing("tan")(x).where(~pole & (x.reach() < FAR))


def _arctanh_of(y: Interval) -> Interval:
    return arctanh(Interval(np.maximum(y.lo, -1.0), np.minimum(y.hi, 1.0)))


@final
@dataclass(frozen=True, slots=True)
class Elementary:
    """A smooth function of one argument.

    Attributes
    ----------
    values : callable
        Interval x -> interval that holds the function of every number in x.
    slope : callable
        Intervals x, y = values(x) -> interval that holds the derivative at every number in x.
    second : callable
        Intervals x, y, slope(x, y) -> interval that holds the second derivative.
    inverse : callable, optional
        Interval y -> interval that holds every x with a value in y.
    """

    values: Map
    slope: Callable[[Interval, Interval], Interval]
    second: Callable[[Interval, Interval, Interval], Interval]
    inverse: Map | None = None


def _cubed(x: Interval) -> Interval:
    return x.power(3)


ELEMENTARY: dict[str, Elementary] = {
    "sqrt": Elementary(
        Interval.sqrt,
        lambda x, y: _constant(x, 0.5) / y,
        lambda x, y, d: -(_constant(x, 0.5) * d / x),
        lambda y: Interval(np.maximum(y.lo, 0.0), y.hi).power_of_magnitude(2),
    ),
    "exp": Elementary(
        exp,
        lambda x, y: y,
        lambda x, y, d: y,
        lambda y: log(Interval(np.maximum(y.lo, 0.0), y.hi)),
    ),
    "expm1": Elementary(expm1, lambda x, y: exp(x), lambda x, y, d: d),
    "log": Elementary(log, lambda x, y: _one(x) / x, lambda x, y, d: -d.square(), exp),
    "log1p": Elementary(
        log1p, lambda x, y: _one(x) / (_one(x) + x), lambda x, y, d: -d.square(), expm1
    ),
    "sin": Elementary(sine, lambda x, y: cosine(x), lambda x, y, d: -y),
    "cos": Elementary(cosine, lambda x, y: -sine(x), lambda x, y, d: -y),
    "tan": Elementary(
        tangent, lambda x, y: _one(x) + y.square(), lambda x, y, d: _constant(x, 2.0) * y * d
    ),
    "arcsin": Elementary(
        arcsin,
        lambda x, y: _one(x) / (_one(x) - x.square()).sqrt(),
        lambda x, y, d: x * _cubed(d),
    ),
    "arctan": Elementary(
        arctan,
        lambda x, y: _one(x) / (_one(x) + x.square()),
        lambda x, y, d: _constant(x, -2.0) * x * d.square(),
    ),
    "sinh": Elementary(sinh, lambda x, y: cosh(x), lambda x, y, d: y, arcsinh),
    "cosh": Elementary(cosh, lambda x, y: sinh(x), lambda x, y, d: y),
    "tanh": Elementary(
        tanh,
        lambda x, y: _one(x) - y.square(),
        lambda x, y, d: _constant(x, -2.0) * y * d,
        _arctanh_of,
    ),
    "arcsinh": Elementary(
        arcsinh,
        lambda x, y: _one(x) / (_one(x) + x.square()).sqrt(),
        lambda x, y, d: -(x * _cubed(d)),
        sinh,
    ),
    "arctanh": Elementary(
        arctanh,
        lambda x, y: _one(x) / (_one(x) - x.square()),
        lambda x, y, d: _constant(x, 2.0) * x * d.square(),
        tanh,
    ),
}
