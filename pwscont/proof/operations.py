"""The operations of a tape: values, derivatives and inverses, of intervals.

Derivatives are written so that a tape takes them, too: a second derivative is the derivative of a
tape that was written for the first.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.proof.interval import INF, Interval, chosen

Known = list[Interval]
#: Derivatives by which nothing need be multiplied.
PLUS, MINUS = 1.0, -1.0


@final
@dataclass(frozen=True, slots=True)
class Rule:
    """What is known of an operation y of arguments x; a power takes its exponent last.

    ``values``: intervals x -> y; ``slopes``: y, x -> the derivatives by each argument, PLUS and
    MINUS for 1 and -1; ``inverse``: y, x -> for each argument what holds it.
    """

    values: Callable[..., Interval]
    slopes: Callable[..., tuple[Any, ...]] | None = None
    inverse: Callable[..., Known] | None = None


def _of_max(y: Interval, a: Interval, b: Interval) -> Known:
    """Return y for an argument if the other argument is certainly smaller, else its upper end."""
    top = Interval(np.full_like(y.lo, -INF), y.hi)
    return _of_defined([a, b], [chosen(b.hi < y.lo, y, top), chosen(a.hi < y.lo, y, top)])


def _of_min(y: Interval, a: Interval, b: Interval) -> Known:
    low = Interval(y.lo, np.full_like(y.hi, INF))
    return _of_defined([a, b], [chosen(b.lo > y.hi, y, low), chosen(a.lo > y.hi, y, low)])


def _of_defined(x: Known, known: Known) -> Known:
    """Return nothing of arguments that may have no value: a switch may take the other argument."""
    return [each.where(own.lo <= own.hi) for own, each in zip(x, known, strict=True)]


def _of_abs(y: Interval, x: Interval) -> Known:
    """Return the numbers of magnitude y: on one side of zero if x is certainly on one side."""
    return [Interval(np.where(x.lo > -y.lo, y.lo, -y.hi), np.where(x.hi < y.lo, -y.lo, y.hi))]


def _of_power(y: Interval, x: Interval, k: float) -> Known:
    return _of_abs(Interval(np.maximum(y.lo, 0.0), y.hi).sqrt(), x) if k == 2.0 else []


def _within(y: Interval, least: float, most: float) -> Interval:
    return Interval(np.maximum(y.lo, least), np.minimum(y.hi, most))


def branch(test: Interval, above: Interval, below: Interval, both: Interval) -> Interval:
    """Return the branch of a switch in its mode, or ``both`` where the mode is not certain."""
    return chosen(test.lo >= 0.0, above, chosen(test.hi < 0.0, below, both))


def _of_where(s: Interval, a: Interval, b: Interval) -> Interval:
    return branch(s, a, b, a.hull(b))


#: Smooth functions of one argument, by the names of numpy.
ELEMENTARY = {
    "sqrt": Rule(Interval.sqrt, lambda y, x: (0.5 / y,), lambda y, x: [_within(y, 0.0, INF) ** 2]),
    "exp": Rule(Interval.exp, lambda y, x: (y,), lambda y, x: [_within(y, 0.0, INF).log()]),
    "expm1": Rule(Interval.expm1, lambda y, x: (x.exp(),)),
    "log": Rule(Interval.log, lambda y, x: (1.0 / x,), lambda y, x: [y.exp()]),
    "log1p": Rule(Interval.log1p, lambda y, x: (1.0 / (1.0 + x),), lambda y, x: [y.expm1()]),
    "sin": Rule(Interval.sin, lambda y, x: (x.cos(),)),
    "cos": Rule(Interval.cos, lambda y, x: (-x.sin(),)),
    "tan": Rule(Interval.tan, lambda y, x: (1.0 + y**2,)),
    "arcsin": Rule(Interval.arcsin, lambda y, x: (1.0 / (1.0 - x**2).sqrt(),)),
    "arctan": Rule(Interval.arctan, lambda y, x: (1.0 / (1.0 + x**2),)),
    "sinh": Rule(Interval.sinh, lambda y, x: (x.cosh(),), lambda y, x: [y.arcsinh()]),
    "cosh": Rule(Interval.cosh, lambda y, x: (x.sinh(),)),
    "tanh": Rule(
        Interval.tanh, lambda y, x: (1.0 - y**2,), lambda y, x: [_within(y, -1.0, 1.0).arctanh()]
    ),
    "arcsinh": Rule(
        Interval.arcsinh, lambda y, x: (1.0 / (1.0 + x**2).sqrt(),), lambda y, x: [y.sinh()]
    ),
    "arctanh": Rule(Interval.arctanh, lambda y, x: (1.0 / (1.0 - x**2),), lambda y, x: [y.tanh()]),
}
OPERATIONS = {
    "constant": Rule(lambda number: Interval(np.full(1, number))),
    "negative": Rule(operator.neg, lambda y, x: (MINUS,), lambda y, x: [-y]),
    "add": Rule(operator.add, lambda y, a, b: (PLUS, PLUS), lambda y, a, b: [y - b, y - a]),
    "subtract": Rule(operator.sub, lambda y, a, b: (PLUS, MINUS), lambda y, a, b: [y + b, a - y]),
    "multiply": Rule(operator.mul, lambda y, a, b: (b, a), lambda y, a, b: [y / b, y / a]),
    "divide": Rule(
        operator.truediv, lambda y, a, b: (1.0 / b, -(y / b)), lambda y, a, b: [y * b, a / y]
    ),
    "power": Rule(operator.pow, lambda y, x, k: (k * x ** (k - 1.0),), _of_power),
    "abs": Rule(operator.abs, None, _of_abs),
    "max": Rule(Interval.maximum, None, _of_max),
    "min": Rule(Interval.minimum, None, _of_min),
    "where": Rule(_of_where),
    "select": Rule(_of_where),
    **ELEMENTARY,
}
#: Operations with kinks: the test, which is linear, and the derivatives of the branches where the
#: test is not negative, and elsewhere.
SWITCHES: dict[str, tuple[Callable[..., Any], Callable[..., tuple[Any, Any]]]] = {
    "abs": (lambda x: x, lambda dx: (dx, -dx)),
    "max": (lambda a, b: a - b, lambda da, db: (da, db)),
    "min": (lambda a, b: b - a, lambda da, db: (da, db)),
    "where": (lambda s, a, b: s, lambda ds, da, db: (da, db)),
    "select": (lambda s, a, b: s, lambda ds, da, db: (da, db)),
}
