"""The operations of a tape, one table: values of intervals, and inverses that contract arguments.

Increasing functions take ends to ends; sine and cosine take the value 1 wherever a crest may lie in
the interval, as far as rounding of the argument can tell. Derivatives are those of the notation.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.proof.interval import FUNCTION_ULPS, INF, Interval, chosen

#: Arguments of sine and cosine from here on say nothing but [-1, 1].
FAR = 1e6
#: By how much of a period the place of a crest may be misjudged; rounding of arguments below FAR
#: makes errors smaller by a factor of a thousand.
BLUR = 1e-6
Known = list[Interval]
Map = Callable[[Interval], Interval]


class Rule(NamedTuple):
    """What is known of an operation y of arguments x; a power takes its exponent last.

    ``values``: intervals x -> y; ``inverse``: intervals y, x -> for each argument what holds it.
    """

    values: Callable[..., Interval]
    inverse: Callable[..., Known] | None = None


def _increasing(name: str, least: float, most: float, first: float, last: float) -> Map:
    """Return the rule of an increasing function, any number where arguments leave the domain."""
    function, ulps = getattr(np, name), 1.0 if name == "sqrt" else FUNCTION_ULPS

    def values(x: Interval) -> Interval:
        found = _within(Interval.rounded(function(x.lo), function(x.hi), ulps), least, most)
        return found.where((x.lo >= first) & (x.hi <= last))

    return values


def _within(y: Interval, least: float, most: float) -> Interval:
    return Interval(np.maximum(y.lo, least), np.minimum(y.hi, most))


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


#: Increasing functions by the names of numpy: the least and largest value, the least and largest
#: argument, and the name of the inverse, if that is increasing everywhere.
INCREASING = {
    "sqrt": (0.0, INF, 0.0, INF, "square"),
    "exp": (0.0, INF, -INF, INF, "log"),
    "expm1": (-1.0, INF, -INF, INF, "log1p"),
    "log": (-INF, INF, 0.0, INF, "exp"),
    "log1p": (-INF, INF, -1.0, INF, "expm1"),
    "arcsin": (-INF, INF, -1.0, 1.0, ""),
    "arctan": (-INF, INF, -INF, INF, ""),
    "sinh": (-INF, INF, -INF, INF, "arcsinh"),
    "tanh": (-1.0, 1.0, -INF, INF, "arctanh"),
    "arcsinh": (-INF, INF, -INF, INF, "sinh"),
    "arctanh": (-INF, INF, -1.0, 1.0, "tanh"),
}
VALUES: dict[str, Map] = {name: _increasing(name, *ends) for name, (*ends, _) in INCREASING.items()}
VALUES["square"] = lambda x: x**2
RISING_COSH = _increasing("cosh", 1.0, INF, 0.0, INF)
TAN_BETWEEN_POLES = _increasing("tan", -INF, INF, -FAR, FAR)


def _tan(x: Interval) -> Interval:
    pole = _has_crest(x, 0.5 * np.pi) | _has_crest(x, -0.5 * np.pi)
    return TAN_BETWEEN_POLES(x).where(~pole)


def branch(test: Interval, a: Interval, b: Interval, either: Interval | None = None) -> Interval:
    """Return the branch of a switch in its mode; ``either``, or the hull, if it is not certain."""
    return chosen(test.lo >= 0.0, a, chosen(test.hi < 0.0, b, either or a.hull(b)))


def _of_increasing(name: str) -> Callable[[Interval, Interval], Known] | None:
    least, most, *_, inverse = INCREASING[name]
    return (lambda y, x: [VALUES[inverse](_within(y, least, most))]) if inverse else None


def _of_max(y: Interval, a: Interval, b: Interval) -> Known:
    """Return y for an argument if the other argument is certainly smaller, else its upper end."""
    top = Interval(np.full_like(y.lo, -INF), y.hi)
    return _of_defined([a, b], [chosen(b.hi < y.lo, y, top), chosen(a.hi < y.lo, y, top)])


def _of_min(y: Interval, a: Interval, b: Interval) -> Known:
    return [-each for each in _of_max(-y, -a, -b)]


def _of_defined(x: Known, known: Known) -> Known:
    """Return nothing of arguments that may have no value: a switch may take the other argument."""
    return [each.where(own.lo <= own.hi) for own, each in zip(x, known, strict=True)]


def _of_abs(y: Interval, x: Interval) -> Known:
    """Return the numbers of magnitude y: on one side of zero if x is certainly on one side."""
    return [Interval(np.where(x.lo > -y.lo, y.lo, -y.hi), np.where(x.hi < y.lo, -y.lo, y.hi))]


def _of_power(y: Interval, x: Interval, k: float) -> Known:
    return _of_abs(VALUES["sqrt"](_within(y, 0.0, INF)), x) if k == 2.0 else []


#: Smooth functions of one argument, by the names of numpy.
ELEMENTARY = {
    **{name: Rule(VALUES[name], _of_increasing(name)) for name in INCREASING},
    "sin": Rule(_wave(np.sin, 0.5 * np.pi)),
    "cos": Rule(_wave(np.cos, 0.0)),
    "tan": Rule(_tan),
    "cosh": Rule(lambda x: RISING_COSH(abs(x))),
}
#: "slope" and "jump" are the derivatives of switches: of continuous ones, and of ``where``, across
#: whose kinks nothing is known, for f may jump.
OPERATIONS = {
    "constant": Rule(lambda number: Interval(np.full(1, number))),
    "negative": Rule(operator.neg, lambda y, x: [-y]),
    "add": Rule(operator.add, lambda y, a, b: [y - b, y - a]),
    "subtract": Rule(operator.sub, lambda y, a, b: [y + b, a - y]),
    "multiply": Rule(operator.mul, lambda y, a, b: [y / b, y / a]),
    "divide": Rule(operator.truediv, lambda y, a, b: [y * b, a / y]),
    "power": Rule(operator.pow, _of_power),
    "abs": Rule(operator.abs, _of_abs),
    "max": Rule(Interval.maximum, _of_max),
    "min": Rule(Interval.minimum, _of_min),
    **dict.fromkeys(["where", "select", "slope"], Rule(branch)),
    "jump": Rule(lambda test, a, b: branch(test, a, b, Interval(np.nan))),
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
