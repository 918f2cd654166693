"""Boxes and enclosures rechecked in balls of 128 bits: rational ends; nothing of pwscont."""

from fractions import Fraction
from itertools import product
from operator import mul
from types import SimpleNamespace

import numpy as np

BITS = 128
#: Steps of Krawczyk's operator after the first; kinks make the steps contract slowly.
STEPS = 200


def _rounded(x, way):
    """Return a number of so many bits, not below x (way 1) or not above x (way -1)."""
    shift = max(BITS + x.denominator.bit_length() - abs(x.numerator).bit_length(), 0)
    return Fraction(way * -(-way * x.numerator * 2**shift // x.denominator), 2**shift)


class Ball:
    """All numbers between two ends."""

    def __init__(self, lo, hi=None):
        lo, hi = Fraction(lo), Fraction(lo if hi is None else hi)
        self.lo, self.hi = _rounded(lo, -1), _rounded(hi, 1)

    def __add__(self, other):
        other = ball(other)
        return Ball(self.lo + other.lo, self.hi + other.hi)

    def __mul__(self, other):
        other = ball(other)
        ends = [a * b for a in (self.lo, self.hi) for b in (other.lo, other.hi)]
        return Ball(min(ends), max(ends))

    __radd__, __rmul__ = __add__, __mul__

    @property
    def middle(self):
        return (self.lo + self.hi) / 2

    def hull(self, other):
        return Ball(min(self.lo, other.lo), max(self.hi, other.hi))

    def is_inside(self, other):
        return other.lo < self.lo and self.hi < other.hi

    def is_apart(self, other):
        return self.hi < other.lo or other.hi < self.lo


def ball(thing):
    return thing if isinstance(thing, Ball) else Ball(thing)


class Number:
    """A ball with the derivatives by the unknowns."""

    def __init__(self, value, slopes):
        self.value, self.slopes = value, slopes

    def _with(self, other):
        return (
            other
            if isinstance(other, Number)
            else Number(ball(other), [Ball(0)] * len(self.slopes))
        )

    def __add__(self, other):
        if isinstance(other, np.ndarray):
            return NotImplemented
        other = self._with(other)
        slopes = [a + b for a, b in zip(self.slopes, other.slopes, strict=True)]
        return Number(self.value + other.value, slopes)

    def __mul__(self, other):
        if isinstance(other, np.ndarray):
            return NotImplemented
        other = self._with(other)
        pairs = zip(self.slopes, other.slopes, strict=True)
        slopes = [a * other.value + self.value * b for a, b in pairs]
        return Number(self.value * other.value, slopes)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return self * -1

    def __sub__(self, other):
        return self + -1 * other

    def __rsub__(self, other):
        return -self + other

    def __pow__(self, k):
        return self if k == 1 else self * self ** (k - 1)


def _relu(x):
    """Return max(x, 0): where the sign of x is open, the hull of both branches."""
    if not isinstance(x, Number):
        return max(x, 0.0)
    if x.value.lo >= 0 or x.value.hi < 0:
        return x if x.value.lo >= 0 else 0 * x
    return Number(Ball(0, x.value.hi), [slope.hull(Ball(0)) for slope in x.slopes])


def _max(x, y):
    return y + _relu(x - y)


def _min(x, y):
    return -_max(-x, -y)


RULES = {
    "relu": _relu,
    "abs": lambda x: _relu(x) + _relu(-x),
    "max": _max,
    "min": _min,
    "clip": lambda x, lo, hi: _min(_max(x, lo), hi),
}
SWITCHES = SimpleNamespace(
    **{name: np.frompyfunc(f, f.__code__.co_argcount, 1) for name, f in RULES.items()}
)


def _value(f, z, alpha):
    """Return f and the derivatives by z on balls z, at one alpha."""
    n = len(z)
    unit = [[Ball(int(i == j)) for j in range(n)] for i in range(n)]
    x = np.array([Number(each, row) for each, row in zip(z, unit, strict=True)])
    rows = f(x, Number(ball(alpha), [Ball(0)] * n), SWITCHES)
    return [row.value for row in rows], [row.slopes for row in rows]


def _matrix(f, z, alpha):
    """Return about the inverse of the derivatives by z on balls, and I - the inverse times these.

    None where the middle is singular.
    """
    slopes = _value(f, z, alpha)[1]
    about = np.array([[float(each.middle) for each in row] for row in slopes])
    if not np.linalg.det(about):
        return None
    inverse = [[Fraction(each) for each in row] for row in np.linalg.inv(about).tolist()]
    off = [
        [
            sum((-r * slopes[j][k] for j, r in enumerate(row)), Ball(int(i == k)))
            for k in range(len(z))
        ]
        for i, row in enumerate(inverse)
    ]
    return inverse, off


def _krawczyk(f, z, alpha):
    """Return the image of Krawczyk's operator: all zeros in z; if inside of z, exactly one."""
    centre = [each.middle for each in z]
    start = _value(f, [Ball(c) for c in centre], alpha)[0]
    inverse, off = _matrix(f, z, alpha)
    return [
        sum((o * (x + -c) for o, x, c in zip(row, z, centre, strict=True)), Ball(centre[i]))
        + sum((-r * value for r, value in zip(inverse[i], start, strict=True)), Ball(0))
        for i, row in enumerate(off)
    ]


def is_injective(f, box):
    """Tell whether H(., alpha) is injective in a box (least, largest) of (z, alpha).

    False where the determinant has both signs, None where that is not known.
    """
    *z, alpha = (Ball(lo, hi) for lo, hi in zip(*box, strict=True))
    if found := _matrix(f, z, alpha):
        off = [[max(abs(each.lo), abs(each.hi)) for each in row] for row in found[1]]
        v = [1 + sum(row) for row in off]
        if all(sum(map(mul, row, v)) < each for row, each in zip(off, v, strict=True)):
            return True
    signs = {_sign_of_det(f, point) for point in product(*(_inside(each) for each in (*z, alpha)))}
    return False if {-1.0, 1.0} <= signs else None


def _inside(ball):
    return [Ball(ball.lo + (ball.hi - ball.lo) * Fraction(k, 31)) for k in (1, 6, 15, 25, 30)]


def _sign_of_det(f, point):
    rows = _value(f, point[:-1], point[-1])[1]
    matrix = np.array([[float(each.middle) for each in row] for row in rows])
    return np.sign(np.linalg.det(matrix)) if abs(np.linalg.det(matrix)) > 1e-9 else 0.0


def holds_a_zero(f, box, alpha):
    """Tell whether a box (least, largest) of z holds exactly one zero: True, False, None unknown.

    The zero is looked for a little around the box, so that a zero outside of the box shows.
    """
    image = [Ball(lo, hi) for lo, hi in zip(*box, strict=True)]
    zero = [Ball(b.lo - 9 * (b.hi - b.lo), b.hi + 9 * (b.hi - b.lo)) for b in image]
    if not _all(Ball.is_inside, _krawczyk(f, zero, alpha), zero):
        return None
    for _ in range(STEPS):
        if _all(lambda a, b: b.lo <= a.lo and a.hi <= b.hi, zero, image):
            return True
        if any(map(Ball.is_apart, zero, image)):
            return False
        new = _krawczyk(f, zero, alpha)
        zero = [Ball(max(a.lo, b.lo), min(a.hi, b.hi)) for a, b in zip(zero, new, strict=True)]
    return None


def _all(relation, some, others):
    return all(map(relation, some, others))


def verdicts(found):
    """Return how many answers are true, false and not known."""
    found = list(found)
    return tuple(found.count(each) for each in (True, False, None))
