"""Tubes rechecked in balls of 128 bits: rational ends, rounded outward; nothing of pwscont."""

from fractions import Fraction
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
    rows = f(x, Number(Ball(alpha), [Ball(0)] * n), SWITCHES)
    return [row.value for row in rows], [row.slopes for row in rows]


def _krawczyk(f, z, alpha):
    """Return the image of Krawczyk's operator: all zeros in z; if inside of z, exactly one."""
    n, centre = len(z), [each.middle for each in z]
    start = _value(f, [Ball(c) for c in centre], alpha)[0]
    slopes = _value(f, z, alpha)[1]
    about = np.array([[float(each.middle) for each in row] for row in slopes])
    matrix = [[Fraction(each) for each in row] for row in np.linalg.inv(about).tolist()]
    image = []
    for i in range(n):
        total = Ball(centre[i])
        for k in range(n):
            off = Ball(int(i == k))
            for j in range(n):
                off += -matrix[i][j] * slopes[j][k]
            total += -matrix[i][k] * start[k] + off * (z[k] + -centre[k])
        image.append(total)
    return image


def rechecked(f, tubes, i, alpha):
    """Tell whether a tube holds one zero at alpha, in the image: True, False, None if not known."""
    turn = Fraction(alpha) - Fraction(tubes.middle[i])
    pairs = zip(tubes.centre[:, i], tubes.slope[:, i], strict=True)
    line = [Fraction(c) + Fraction(s) * turn for c, s in pairs]
    tube, image = (
        [Ball(c - Fraction(r), c + Fraction(r)) for c, r in zip(line, radii[:, i], strict=True)]
        for radii in (tubes.radius, tubes.image)
    )
    zero = _krawczyk(f, tube, alpha)
    if not _all(Ball.is_inside, zero, tube):
        return None
    for _ in range(STEPS):
        if _all(Ball.is_inside, zero, image):
            return bool(_all(Ball.is_inside, image, tube))
        if any(map(Ball.is_apart, zero, image)):
            return False
        new = _krawczyk(f, zero, alpha)
        zero = [Ball(max(a.lo, b.lo), min(a.hi, b.hi)) for a, b in zip(zero, new, strict=True)]
    return None


def _all(relation, some, others):
    return all(map(relation, some, others))


def verdicts(f, tubes, every=1):
    """Return how many certificates are true, false and not known, at both ends and the middle."""
    numbers = range(0, len(tubes.first), every)
    places = [(i, end[i]) for i in numbers for end in (tubes.first, tubes.middle, tubes.last)]
    found = [rechecked(f, tubes, i, Fraction(alpha)) for i, alpha in places]
    return tuple(found.count(each) for each in (True, False, None))
