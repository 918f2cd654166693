"""The operations of a tape, one table: values of intervals.

Increasing functions take ends to ends; sine and cosine take the value 1 wherever a crest may lie in
the interval, as far as rounding of the argument can tell. Derivatives are those of the notation.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.proof.interval import FUNCTION_ULPS, INF, Interval, chosen

#: Arguments of sine and cosine from here on say nothing but [-1, 1].
FAR = 1e6
#: By how much of a period the place of a crest may be misjudged; rounding of arguments below FAR
#: makes errors smaller by a factor of a thousand.
BLUR = 1e-6
Map = Callable[[Interval], Interval]


def _increasing(name: str, least: float, most: float, first: float, last: float) -> Map:
    """Return the rule of an increasing function, any number where arguments leave the domain."""
    function, ulps = getattr(np, name), 1.0 if name == "sqrt" else FUNCTION_ULPS

    def values(x: Interval) -> Interval:
        y = Interval.rounded(function(x.lo), function(x.hi), ulps)
        y = Interval(np.maximum(y.lo, least), np.minimum(y.hi, most))
        return y.where((x.lo >= first) & (x.hi <= last))

    return values


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


#: Increasing functions by the names of numpy: the least and largest value and argument.
INCREASING = {
    **dict.fromkeys(["arctan", "sinh", "arcsinh"], (-INF, INF, -INF, INF)),
    "sqrt": (0.0, INF, 0.0, INF),
    "exp": (0.0, INF, -INF, INF),
    "expm1": (-1.0, INF, -INF, INF),
    "log": (-INF, INF, 0.0, INF),
    "log1p": (-INF, INF, -1.0, INF),
    "arcsin": (-INF, INF, -1.0, 1.0),
    "tanh": (-1.0, 1.0, -INF, INF),
    "arctanh": (-INF, INF, -1.0, 1.0),
}
RISING_COSH = _increasing("cosh", 1.0, INF, 0.0, INF)


def branch(test: Interval, a: Interval, b: Interval, either: Interval | None = None) -> Interval:
    """Return the branch of a switch in its mode; ``either``, or the hull, if it is not certain."""
    return chosen(test.lo >= 0.0, a, chosen(test.hi < 0.0, b, either or a.hull(b)))


#: Smooth functions of one argument, by the names of numpy.
ELEMENTARY: dict[str, Map] = {
    **{name: _increasing(name, *ends) for name, ends in INCREASING.items()},
    "sin": _wave(np.sin, 0.5 * np.pi),
    "cos": _wave(np.cos, 0.0),
    "cosh": lambda x: RISING_COSH(abs(x)),
}
#: Intervals of results from intervals of arguments; a power takes its exponent last. "slope" and
#: "jump" are the derivatives of switches: of continuous ones, and of ``where``, across whose kinks
#: nothing is known, for f may jump.
OPERATIONS: dict[str, Callable[..., Interval]] = {
    "constant": lambda number: Interval(np.full(1, number)),
    "negative": operator.neg,
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
    "abs": operator.abs,
    "max": Interval.maximum,
    "min": Interval.minimum,
    **dict.fromkeys(["where", "select", "slope"], branch),
    "jump": lambda test, a, b: branch(test, a, b, Interval(np.nan)),
    **ELEMENTARY,
}
#: Operations with kinks: the test, which is linear, and the derivatives of the branches where the
#: test is not negative, and elsewhere.
SWITCHES: dict[str, tuple[Callable[..., Any], Callable[..., tuple[Any, Any]]]] = {
    "abs": (lambda x: x, lambda dx: (dx, -dx)),
    "max": (lambda a, b: a - b, lambda da, db: (da, db)),
    "min": (lambda a, b: b - a, lambda da, db: (da, db)),
    **dict.fromkeys(
        ["where", "select", "slope", "jump"], (lambda s, a, b: s, lambda ds, da, db: (da, db))
    ),
}
