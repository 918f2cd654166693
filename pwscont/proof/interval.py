"""Intervals of real numbers, thousands at a time, with outward rounding, and operations of tapes.

An end that is not a number says nothing: every comparison with such an end is false (NaN is
everything). The bounds on rounding are those of docs/theory, F21.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import reduce
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Signs

try:
    import ival  # of the package crival, the extra "proof": functions that are rounded correctly
except ImportError:
    ival = None

#: Twice the unit roundoff: a bound of the relative error of + - * / sqrt with room for a rounding.
ULP = 2.0**-52
#: Far above what products and quotients err by near zero: sums with the smallest numbers of all
#: take a hundred times as long.
TINY = 1e-150
#: The least radius of an enclosure of solutions, far above sums of so tiny numbers.
LEAST = 1e-140
#: How many units in the last place an elementary function of numpy may err: an assumption that
#: the extra ``proof`` spares, see docs/theory, F21.
FUNCTION_ULPS = 4.0
INF = np.inf
Ends = Callable[[Array, Array], Array]


def upper(x: Array, terms: int) -> Array:
    """Return upper bounds of rounded sums of products that are not negative."""
    bound: Array = x * (1.0 + 4.0 * (terms + 4) * ULP) + (terms + 4) * TINY
    return bound


def _error(x: Array, ulps: float) -> Array:
    """Return a bound of the error of rounded numbers, in place: most of the time goes here."""
    error = np.abs(x)
    error *= ulps * ULP
    error += ulps * TINY
    return error


def _paired(of_lower: Ends, of_upper: Ends) -> Callable[[Interval, Interval], Interval]:
    return lambda x, y: Interval(of_lower(x.lo, y.lo), of_upper(x.hi, y.hi))


@final
class Interval:
    """Arrays of intervals [lo, hi], or of single numbers; operations broadcast."""

    __slots__ = ("hi", "lo")
    __array_ufunc__ = None  # arrays leave operators to intervals

    def __init__(self, lo: Any, hi: Any = None) -> None:
        self.lo: Array = lo
        self.hi: Array = lo if hi is None else hi

    @classmethod
    def rounded(cls, lo: Array, hi: Array, ulps: float = 1.0) -> Interval:
        """Return intervals that certainly hold the true values of rounded ends."""
        return cls(lo - _error(lo, ulps), hi + _error(hi, ulps))

    def __getitem__(self, key: Any) -> Interval:
        return Interval(self.lo[key], None if self.lo is self.hi else self.hi[key])

    def __neg__(self) -> Interval:
        return Interval(-self.hi, None if self.lo is self.hi else -self.lo)

    def __add__(self, other: Any) -> Interval:
        other = _interval(other)
        return Interval.rounded(self.lo + other.lo, self.hi + other.hi)

    def __sub__(self, other: Any) -> Interval:
        return self + -_interval(other)

    def __mul__(self, other: Any) -> Interval:
        return self._over(_interval(other), np.multiply)

    def __truediv__(self, other: Any) -> Interval:
        """Divide; where the divisor may be zero, the quotient says nothing."""
        other = _interval(other)
        return self._over(other, np.divide).where(other.excludes_zero())

    def _over(self, other: Interval, operation: Ends) -> Interval:
        found = [operation(x, y) for x in self._ends() for y in other._ends()]
        return Interval.rounded(reduce(np.minimum, found), reduce(np.maximum, found))

    def _ends(self) -> list[Array]:
        return [self.lo] if self.lo is self.hi else [self.lo, self.hi]

    __radd__, __rmul__ = __add__, __mul__

    def __pow__(self, power: float) -> Interval:
        """Return the powers, of a whole number that is not zero."""
        k = int(power)
        if k < 0:
            return Interval(np.ones(1)) / self**-k
        x = self if k % 2 else abs(self)  # what is left increases
        lo, hi = (reduce(operator.mul, [Interval(end)] * k) for end in (x.lo, x.hi))
        return Interval(lo.lo if k % 2 else np.maximum(lo.lo, 0.0), hi.hi)

    def __matmul__(self, other: Interval) -> Interval:
        """Return products of matrices, as products of midpoints with bounds of all errors."""
        a, r = self.balls(0)
        b, width = other.balls(int(np.count_nonzero(a, axis=-1).max(initial=0)))
        far = np.abs(a) @ width
        if self.lo is not self.hi:
            far = far + r @ (np.abs(b) + width)
        mid, terms = a @ b, a.shape[-1]
        far = upper(far, terms) + terms * TINY
        return Interval.rounded(mid - far, mid + far)

    def balls(self, terms: int) -> tuple[Array, Array]:
        """Return midpoints, and radii with room for the rounding of sums of so many products."""
        mid = self.lo if self.lo is self.hi else self.middle()
        radius = np.abs(mid) * ((terms + 2) * ULP) + (terms + 2) * TINY
        if self.lo is self.hi:
            return mid, radius
        return mid, radius + (1.0 + 4.0 * ULP) * np.maximum(self.hi - mid, mid - self.lo)

    def __abs__(self) -> Interval:
        lo = np.maximum(np.maximum(self.lo, -self.hi), 0.0)
        return Interval(lo, np.maximum(-self.lo, self.hi))

    maximum, minimum = _paired(np.maximum, np.maximum), _paired(np.minimum, np.minimum)
    #: The smallest intervals that hold both intervals.
    hull = _paired(np.minimum, np.maximum)
    #: What both intervals hold; empty where lo > hi. An end without a number is left.
    meet = _paired(np.fmax, np.fmin)

    def where(self, keeps: Signs, other: Interval | None = None) -> Interval:
        """Return others, or intervals that say nothing, where a condition does not hold."""
        lo, hi = (np.nan, np.nan) if other is None else (other.lo, other.hi)
        return Interval(np.where(keeps, self.lo, lo), np.where(keeps, self.hi, hi))

    def excludes_zero(self) -> Signs:
        """Tell which intervals certainly do not hold zero."""
        return (self.lo > 0.0) | (self.hi < 0.0)

    def is_within(self, other: Interval) -> Signs:
        """Tell which intervals lie strictly inside other ones."""
        return (self.lo > other.lo) & (self.hi < other.hi)

    def reach(self) -> Array:
        """Return the largest magnitude in each interval; not a number where nothing is known."""
        return np.maximum(-self.lo, self.hi)

    def middle(self) -> Array:
        """Return a number in each interval, near the middle."""
        return 0.5 * self.lo + 0.5 * self.hi

    def width(self) -> Array:
        """Return about how wide each interval is."""
        return self.hi - self.lo

    def total(self) -> Interval:
        """Return the sums along the last axis."""
        return reduce(operator.add, (self[..., i] for i in range(self.lo.shape[-1])))

    def arranged(self, arrange: Callable[[Array], Array]) -> Interval:
        """Return the same intervals in another shape or order."""
        return Interval(arrange(self.lo), arrange(self.hi))


def _interval(thing: Any) -> Interval:
    return thing if isinstance(thing, Interval) else Interval(thing)


def together(function: Callable[[list[Array]], Array], *parts: Interval) -> Interval:
    """Return one interval from several, put together by np.hstack, np.vstack or the like."""
    return Interval(function([x.lo for x in parts]), function([x.hi for x in parts]))


def inverses(matrices: Array) -> Array:
    """Return the inverses of matrices (B, n, n) to rounding, nan for singular matrices."""
    regular = np.linalg.slogdet(matrices)[0][:, np.newaxis, np.newaxis] != 0.0
    inverse: Array = np.linalg.inv(np.where(regular, matrices, np.eye(matrices.shape[-1])))
    return np.where(regular, inverse, np.nan)


def departure(inverse: Array, matrix: tuple[Array, Array]) -> Callable[[Array], Array]:
    """Return the map of v, not negative, to upper bounds of |I - R K| v for balls of matrices K."""
    (middle, width), size, n = matrix, np.abs(inverse), inverse.shape[-1]
    off = np.abs(inverse @ middle - np.eye(n)) + (n + 2) * TINY
    return lambda v: upper(off @ v + size @ (width @ v), 3 * n)


def solved(matrix: Interval, right: Interval) -> Interval:
    """Return x with matrix x + right = 0 for B systems, shapes (B, n, n) and (B, n, m).

    With R about the inverse, a radius v with |R (K x + k)| + |I - R K| v < v bounds the error of x,
    and K is regular (Rump 2010, section 10). Else nothing is said.
    """
    n = matrix.lo.shape[-1]
    if matrix.lo.shape[-2] != n:
        return Interval(np.full((len(matrix.lo), n, right.lo.shape[-1]), np.nan))
    (K, width), (k, far) = matrix.balls(n), right.balls(n)
    R = inverses(K)
    off, x = departure(R, (K, width)), -(R @ k)
    x = x - R @ (K @ x + k)
    rest = K @ x + k
    far = far + width @ np.abs(x) + (n + 2) * (ULP * np.abs(rest) + TINY)
    start = upper(np.abs(R @ rest) + np.abs(R) @ far, 3 * n)
    radius = 2.0 * (start + off(2.0 * start)) + LEAST
    image = upper(start + off(radius), 1)
    holds: Signs = np.all(image < radius, axis=(-2, -1), keepdims=True)
    return Interval.rounded(x - image, x + image).where(holds)


def are_regular(matrices: Interval, size: Array) -> Signs:
    """Tell which intervals of matrices (B, n, n) hold regular matrices only.

    With any R, they do if |I - R K| v < v for some v > 0; ``size`` are typical unknowns (n,).
    """
    balls = matrices.balls(len(size))
    off = departure(inverses(balls[0]), balls)
    v = size[:, np.newaxis] + off(size[:, np.newaxis])
    regular: Signs = np.all(off(v) < v, axis=(-2, -1))
    return regular


@np.errstate(all="ignore")
def is_positive_definite(form: Interval) -> bool:
    """Tell whether the symmetric parts of all matrices K between two are positive definite.

    With any R they are if R (K + K') R' is, and so if the rows of R (K + K') R' / 2 - I have
    absolute sums below 1 (Gershgorin).
    """
    both = form + form.arranged(np.transpose)
    try:
        R = np.linalg.inv(np.linalg.cholesky(0.5 * both.middle()))
    except np.linalg.LinAlgError:
        return False
    off = departure(0.5 * R, (both @ Interval(R.T)).balls(len(R)))
    return bool((off(np.ones((len(R), 1))) < 1.0).all())


#: Arguments of sine and cosine from here on say nothing but [-1, 1].
FAR = 1e6
#: By how much of a period the place of a crest may be misjudged; rounding of arguments below FAR
#: makes errors smaller by a factor of a thousand.
BLUR = 1e-6
#: The product of so large a number and any coefficient does not overflow.
HUGE = 1e150
Map = Callable[[Interval], Interval]


def _finite(lo: Array, hi: Array) -> tuple[Array, Array]:
    """Return bounds, the lower bound no more and the upper bound no less than a huge number.

    The exponential function overflows far out in a box: further sums and products have ends all
    the same.
    """
    return np.minimum(lo, HUGE), np.maximum(hi, -HUGE)


def _increasing(name: str, least: float, most: float, first: float, last: float) -> Map:
    """Return the rule of an increasing function, any number where arguments leave the domain."""
    function, ulps = getattr(np, name), 1.0 if name == "sqrt" else FUNCTION_ULPS

    def values(x: Interval) -> Interval:
        y = Interval.rounded(*_finite(function(x.lo), function(x.hi)), ulps)
        y = Interval(np.maximum(y.lo, least), np.minimum(y.hi, most))
        return y.where((x.lo >= first) & (x.hi <= last))

    return values


def _has_crest(x: Interval, place: float) -> Signs:
    """Tell where a number place + 2 pi k may lie in the interval, or the interval is far out."""
    first, last = (x.lo - place) / (2.0 * np.pi), (x.hi - place) / (2.0 * np.pi)
    crest: Signs = np.floor(last + BLUR) >= np.ceil(first - BLUR)
    return crest | ~(x.reach() < FAR)


def _wave(function: Callable[[Array], Array], top: float) -> Map:
    """Return sine or cosine, whose crests are at top + 2 pi k."""

    def values(x: Interval) -> Interval:
        a, b = function(x.lo), function(x.hi)
        found = Interval.rounded(np.minimum(a, b), np.maximum(a, b), FUNCTION_ULPS)
        lo = np.where(_has_crest(x, top + np.pi), -1.0, np.maximum(found.lo, -1.0))
        hi = np.where(_has_crest(x, top), 1.0, np.minimum(found.hi, 1.0))
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
    """Return the branch that a test's sign chooses; ``either``, or the hull, without a sign."""
    return a.where(test.lo >= 0.0, b.where(test.hi < 0.0, either or a.hull(b)))


def _correctly_rounded(name: str) -> Map:
    """Return the rule of a function of crival, any number where arguments leave the domain."""
    function = getattr(ival, name.replace("arc", "a"))
    _, _, first, last = INCREASING.get(name, (-INF, INF, -INF, INF))

    def values(x: Interval) -> Interval:
        y = function(ival.Interval(x.lo, x.hi))
        return Interval(*_finite(y.inf, y.sup)).where((x.lo >= first) & (x.hi <= last))

    return values


#: Smooth functions of one argument, by the names of numpy.
BY_NUMPY: dict[str, Map] = {
    **{name: _increasing(name, *ends) for name, ends in INCREASING.items()},
    "sin": _wave(np.sin, 0.5 * np.pi),
    "cos": _wave(np.cos, 0.0),
    "cosh": lambda x: RISING_COSH(abs(x)),
}
#: The same functions by crival, if the package is installed.
BY_CRIVAL = {name: _correctly_rounded(name) for name in BY_NUMPY} if ival else {}
ELEMENTARY = BY_CRIVAL or BY_NUMPY
OF_NUMPY = f"; elementary functions of numpy within {FUNCTION_ULPS:g} units in the last place"
ASSUMED = (
    "assumed: a formula without state, the same for numbers and for the tape; arithmetic of "
    "IEEE 754 to nearest" + OF_NUMPY * (not BY_CRIVAL)
)
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
#: The rules with which an undecided switch has the derivatives of both branches, or of one.
MODES = [
    OPERATIONS,
    {**OPERATIONS, "slope": lambda test, a, b: branch(test, a, b, a)},
    {**OPERATIONS, "slope": lambda test, a, b: branch(test, a, b, b)},
]
