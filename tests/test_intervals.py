"""Interval arithmetic against exact fractions and balls of 256 bits; mutants are caught."""

from fractions import Fraction

import numpy as np
import pytest
from high_precision import balls, exact
from sweeps import swept

from pwscont.proof.interval import (
    BY_CRIVAL,
    BY_NUMPY,
    ELEMENTARY,
    FUNCTION_ULPS,
    Interval,
    is_positive_definite,
    together,
)
from pwscont.proof.tape import evaluated, traced

QUICK, WHOLE = 2_000, 200_000
SIZES = swept([QUICK], [WHOLE])


def intervals(rng, count, spread=12):
    """Return intervals of all magnitudes, many with simple ends, and a number inside each."""
    ends = rng.normal(size=(2, count)) * 2.0 ** rng.integers(-spread, spread, size=(2, count))
    simple = rng.integers(-3, 4, size=(2, count)).astype(float)
    tiny = rng.normal(size=(2, count)) * 1e-160
    kind = rng.integers(0, 6, size=(2, count))
    ends = np.where(kind == 0, simple, np.where(kind == 1, tiny, ends))
    ends[1] = np.where(rng.integers(0, 3, size=count) == 0, ends[0], ends[1])  # points
    lo, hi = np.sort(ends, axis=0)
    inside = np.clip(lo + (hi - lo) * rng.choice([0.0, 1.0, 0.5, 0.3], size=count), lo, hi)
    return Interval(lo, hi), inside


def escapes(found, truths):
    """Return how many true values are certainly outside their intervals."""
    ends = zip(found.lo, found.hi, truths, strict=True)
    return sum(t is not None and not _low(lo) <= Fraction(t) <= _high(hi) for lo, hi, t in ends)


def _low(x):
    return Fraction(float(x)) if np.isfinite(x) else Fraction(-(10**400))


def _high(x):
    return Fraction(float(x)) if np.isfinite(x) else Fraction(10**400)


def plain(rule):
    """Return a rule between two intervals as floating point has it: without outward rounding."""
    return lambda a, b: Interval(rule(a.lo, b.lo), rule(a.hi, b.hi))


RULES = {
    "add": (Interval.__add__, lambda x, y: x + y),
    "subtract": (Interval.__sub__, lambda x, y: x - y),
    "multiply": (Interval.__mul__, lambda x, y: x * y),
    "divide": (Interval.__truediv__, lambda x, y: x / y if y else None),
    "max": (Interval.maximum, max),
    "min": (Interval.minimum, min),
    "square": (lambda a, b: a**2, lambda x, y: x * x),
    "cube": (lambda a, b: a**3, lambda x, y: x**3),
    "fourth": (lambda a, b: a**4, lambda x, y: x**4),
    "inverse square": (lambda a, b: a**-2, lambda x, y: 1 / x**2 if x else None),
    "magnitude": (lambda a, b: abs(a), lambda x, y: abs(x)),
}
MUTANTS = {
    "add": [plain(np.add)],
    "subtract": [plain(np.subtract), lambda a, b: Interval.rounded(a.lo - b.hi, a.hi - b.hi)],
    "multiply": [
        plain(np.multiply),
        lambda a, b: Interval.rounded(
            np.minimum(a.lo * b.lo, a.hi * b.hi), np.maximum(a.lo * b.lo, a.hi * b.hi)
        ),
        lambda a, b: Interval(Interval.rounded(a.lo * b.hi, a.hi).lo, (a * b).hi),
    ],
    "divide": [
        plain(np.divide),
        lambda a, b: Interval.rounded(np.minimum(a.lo / b.lo, a.hi / b.hi), (a / b).hi),
    ],
    "max": [lambda a, b: Interval(np.maximum(a.lo, b.lo), a.hi)],
    "min": [lambda a, b: Interval(a.lo, np.minimum(a.hi, b.hi))],
    "square": [lambda a, b: Interval.rounded(a.lo**2, a.hi**2)],
    "cube": [lambda a, b: Interval(a.lo**3, a.hi**3)],
    "fourth": [lambda a, b: Interval.rounded(a.lo**4, a.hi**4)],
    "inverse square": [lambda a, b: Interval.rounded(1.0 / a.hi**2, 1.0 / a.lo**2)],
    "magnitude": [lambda a, b: Interval(np.abs(a.lo), np.abs(a.hi))],
}


def tried(rule, truth, count, seed=1):
    """Return how often a rule loses the exact result of numbers in the intervals."""
    rng = np.random.default_rng(seed)
    (a, x), (b, y) = intervals(rng, count), intervals(rng, count)
    with np.errstate(all="ignore"):
        found = rule(a, b)
    return escapes(found, [truth(Fraction(p), Fraction(q)) for p, q in zip(x, y, strict=True)])


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("name", RULES)
def test_a_rule_holds_every_exact_result(name, count):
    assert tried(*RULES[name], count) == 0


@pytest.mark.parametrize("name", RULES)
def test_mutants_of_a_rule_are_caught(name):
    for mutant in MUTANTS[name]:
        assert tried(mutant, RULES[name][1], QUICK) > 0


def test_rounding_near_the_smallest_numbers():
    x = np.array([5e-324, 1e-323, 2.2e-308, 4.4e-308, 1.0, 1e308])
    truth = [Fraction(float(v)) * Fraction(1, 3) for v in x]
    with np.errstate(all="ignore"):
        third = Interval(x) / 3.0
    assert escapes(third, truth) == 0
    assert (Interval.rounded(x, x).lo < x).all()
    assert (Interval.rounded(x, x).hi > x).all()


def test_what_is_no_number_says_nothing():
    with np.errstate(all="ignore"):
        unknown = ELEMENTARY["sqrt"](Interval(np.array([-1.0])))
        for found in (unknown + unknown, unknown * unknown, unknown**2, unknown / unknown):
            assert not found.excludes_zero()[0]
            assert not found.is_within(Interval(-np.inf, np.inf))[0]
        partly = ELEMENTARY["log"](Interval(np.array([-1.0]), np.array([0.5])))
        assert not partly.excludes_zero()[0]


#: Arguments that a function is tried with: least and largest.
DOMAINS = {
    "sqrt": (0.0, 1e3),
    "exp": (-50.0, 50.0),
    "expm1": (-5.0, 5.0),
    "log": (1e-9, 1e3),
    "log1p": (-0.9, 1e3),
    "arcsin": (-0.999, 0.999),
    "arctanh": (-0.999, 0.999),
    "sinh": (-20.0, 20.0),
    "cosh": (-20.0, 20.0),
}


def arguments(name, count, seed=3):
    """Return intervals within the domain of a function, narrow and wide, and numbers inside."""
    rng, (low, high) = np.random.default_rng(seed), DOMAINS.get(name, (-30.0, 30.0))
    lo = rng.uniform(low, high, count)
    hi = np.minimum(lo + rng.uniform(0.0, 8.0, count) * 10.0 ** -rng.integers(0, 17, count), high)
    x = np.clip(lo + (hi - lo) * rng.choice([0.0, 1.0, 0.5, 0.7], size=count), lo, hi)
    return Interval(lo, hi), x


def escaped(function, name, count):
    """Return how often a function of intervals loses the value of a number inside."""
    box, x = arguments(name, count)
    with np.errstate(all="ignore"):
        found = function(box)
    pairs = zip(balls(name, x), found.lo.tolist(), found.hi.tolist(), strict=True)
    return sum(value < lo or value > hi for value, lo, hi in pairs)


@pytest.mark.parametrize("count", swept([1_500], [70_000]))
@pytest.mark.parametrize("name", ELEMENTARY)
def test_an_elementary_function_holds_every_value(name, count):
    assert escaped(BY_NUMPY[name], name, count) == 0


@pytest.mark.skipif(not BY_CRIVAL, reason="needs the extra proof")
@pytest.mark.parametrize("count", swept([150], [5_000]))
@pytest.mark.parametrize("name", ELEMENTARY)
def test_a_function_of_crival_is_between_neighbours_of_the_value(name, count):
    """Correctly rounded ends are at most a unit from the least and largest value of a function."""
    assert escaped(BY_CRIVAL[name], name, count) == 0
    _, x = arguments(name, count)
    point = BY_CRIVAL[name](Interval(x))
    assert (point.hi <= np.nextafter(point.lo, np.inf)).all()
    outside = Interval(np.array([np.nan, -2.0, -2.0]), np.array([1.0, 0.5, 2.0]))
    with np.errstate(all="ignore"):
        found, usual = BY_CRIVAL[name](outside), BY_NUMPY[name](outside)
    assert (np.isnan(found.lo) == np.isnan(usual.lo)).all()


@pytest.mark.parametrize("name", ELEMENTARY)
def test_mutants_of_elementary_functions_are_caught(name):
    """Without outward rounding, values escape; a wave without crests loses its crests."""
    function = getattr(np, name)

    def unrounded(x):
        a, b = function(x.lo), function(x.hi)
        return Interval(np.minimum(a, b), np.maximum(a, b))

    assert escaped(unrounded, name, 150) > 0


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_functions_err_by_less_than_assumed(name):
    """The assumption that proofs print, measured here on every machine."""
    _, x = arguments(name, 300, seed=5)
    with np.errstate(all="ignore"):
        y = getattr(np, name)(x)
    errors = [
        abs(exact(name, a) - Fraction(float(b))) / Fraction(float(np.spacing(abs(b))))
        for a, b in zip(x, y, strict=True)
    ]
    assert max(errors) < FUNCTION_ULPS / 2


def derivatives(name, box):
    """Return a function of z, its slope, and its bend as folds take the bend."""
    tape, zero, one = (
        traced(lambda z, t, sw: getattr(np, name)(z), 1),
        0.0 * box.lo,
        1.0 + 0.0 * box.lo,
    )
    point = together(np.column_stack, box, Interval(zero))
    way = together(np.column_stack, Interval(one), Interval(zero))
    bend = evaluated(tape.bent, together(np.column_stack, point, way))
    found = evaluated(tape.slopes, point)
    return found[:, 0], found[:, 1], bend[:, 0]


def bad_chords(name, order, sign=1.0):
    """Return how many chords of the function, or of the slope, lie outside of the derivative."""
    rng = np.random.default_rng(8)
    box, _ = arguments(name, 400)
    box = box[(box.hi - box.lo > 1e-3) & (np.abs(box.hi) < 20.0) & (np.abs(box.lo) < 20.0)]
    x, y = np.sort(box.lo + (box.hi - box.lo) * rng.uniform(size=(2, len(box.lo))), axis=0)
    with np.errstate(all="ignore"):
        known = sign * derivatives(name, box)[order]
        first, last = (derivatives(name, Interval(each))[order - 1].middle() for each in (x, y))
        chord = (last - first) / (y - x)
        slack = 1e-6 * (1.0 + np.abs(chord)) + 1e-12 * np.abs(last) / (y - x)
        return int(((chord < known.lo - slack) | (chord > known.hi + slack)).sum())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", ELEMENTARY)
def test_derivatives_hold_differences(name, order):
    """The mean value theorem: every chord within an interval has a slope in the derivative."""
    assert bad_chords(name, order) == 0
    assert bad_chords(name, order, -1.0) > 0


def test_positive_definite_matrices_are_told_to_rounding():
    """A matrix with an eigenvalue of 1e-9, -1e-9 or zero: only the first is proved."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        q = np.linalg.qr(rng.normal(size=(6, 6)))[0]
        for least in (1e-9, -1e-9, 0.0):
            values = np.array([least, *rng.uniform(0.5, 2.0, 5)])
            matrix = (q * values) @ q.T
            known = Interval(matrix - 1e-14, matrix + 1e-14)
            assert is_positive_definite(known) == (least > 0.0)


def test_an_error_of_the_matrix_counts():
    assert is_positive_definite(Interval(np.eye(3) - 0.04, np.eye(3) + 0.04))
    assert not is_positive_definite(Interval(np.eye(3) - 0.4, np.eye(3) + 0.4))  # -0.4 off 0.6
