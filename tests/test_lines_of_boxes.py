"""Linear enclosures on boxes hold every exact value; enclosures without a term are caught."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from high_precision import exact
from sweeps import swept

import pwscont.proof.enclosures
from pwscont.proof.enclosures import lines_of
from pwscont.proof.formulas import traced
from pwscont.proof.interval import Interval

EXACT = SimpleNamespace(
    max=max, min=min, abs=abs, relu=lambda x: max(x, 0), where=lambda s, a, b: a if s >= 0 else b
)
#: Formulas, with their constants made numbers of some kind by c.
RATIONAL = {
    "sums": lambda z, t, sw, c: z * c(0.1) - t + (t + c(0.3)) * c(7.0),
    "products": lambda z, t, sw, c: z * t * (z - t) - z**2,
    "powers": lambda z, t, sw, c: z**3 - c(0.1) * t**5 + (z - t) ** 4,
    "quotients": lambda z, t, sw, c: z / t + 1 / (z - c(0.3)) + t**-2,
    "abs": lambda z, t, sw, c: sw.abs(z - c(0.1)) - c(0.1) * sw.abs(t),
    "max and min": lambda z, t, sw, c: sw.max(z * t, c(0.3) * z) - c(0.1) * sw.min(z, t**2),
    "nested": lambda z, t, sw, c: (
        sw.abs(sw.max(z, sw.abs(t) - c(0.1))) - sw.min(c(0.3), sw.relu(z - t))
    ),
    "where": lambda z, t, sw, c: sw.where(z - t, z * c(0.1), sw.where(t, c(3.0), z)) + t,
}
SMOOTH = ["exp", "sqrt", "log", "sin", "cos", "tanh", "arctan", "sinh", "cosh", "arctanh", "tan"]


def boxes(rng, count):
    """Return boxes (2, count) of all sizes, many with simple ends, and a point in each."""
    centre = rng.normal(size=(2, count)) * 2.0 ** rng.integers(-6, 4, size=(2, count))
    centre = np.where(rng.integers(0, 4, size=(2, count)) == 0, np.round(centre), centre)
    half = 2.0 ** rng.integers(-60, 3, size=count) * rng.integers(0, 5, size=(2, count))
    lo, hi = centre - half, centre + half * rng.integers(0, 2, size=(2, count))
    part = rng.choice([0.0, 0.2, 0.5, 0.9, 1.0], size=(2, count))
    return Interval(lo, hi), np.clip(lo + (hi - lo) * part, lo, hi)


def escapes(f, value, count, seed=3):
    """Return how many exact values lie off their lines, and how many lines say something."""
    box, points = boxes(np.random.default_rng(seed), count)
    with np.errstate(all="ignore"):
        slopes, rest = lines_of(traced(lambda z, t, sw: [f(z[0], t, sw, float)], 1), box)
    lost = said = 0
    for k in np.flatnonzero(np.isfinite(rest.width()[0])):
        x, middle = ([Fraction(float(y)) for y in each[:, k]] for each in (points, box.middle()))
        terms = zip(slopes[0, :, k].tolist(), x, middle, strict=True)
        away = Fraction(value(*x)) - sum(Fraction(a) * (b - c) for a, b, c in terms)
        lost += not Fraction(float(rest.lo[0, k])) <= away <= Fraction(float(rest.hi[0, k]))
        said += 1
    return lost, said


@pytest.mark.parametrize("count", swept([1_000], [30_000]))
@pytest.mark.parametrize("name", RATIONAL)
def test_lines_hold_exact_values(name, count):
    f = RATIONAL[name]
    lost, said = escapes(f, lambda z, t: f(z, t, EXACT, Fraction), count)
    assert lost == 0
    assert said > 0.3 * count


@pytest.mark.parametrize("count", swept([400], [10_000]))
@pytest.mark.parametrize("name", SMOOTH)
def test_lines_of_functions_hold_sixty_digits(name, count):
    def f(z, t, sw, c):
        return getattr(np, name)(z) - t

    lost, said = escapes(f, lambda z, t: Fraction(exact(name, float(z))) - t, count)
    assert lost == 0
    assert said > 0.1 * count


def test_lines_hold_products_of_the_smallest_numbers():
    """The slope 1e-324 is rounded to zero, though the box is a thousand wide."""
    tape = traced(lambda z, t, sw: 1e-200 * (1e-124 * z) - 1e-322 + 0.0 * t, 1)
    slopes, rest = lines_of(tape, Interval(np.array([[0.0], [-1.0]]), np.array([[1e3], [1.0]])))
    away = -float(slopes[0, 0, 0]) * (100.0 - 500.0)  # the solution is 100
    assert rest.lo[0, 0] <= away <= rest.hi[0, 0]


def test_lines_without_a_term_are_caught(monkeypatch):
    def lost(name):
        f = RATIONAL[name]
        return escapes(f, lambda z, t: f(z, t, EXACT, Fraction), 1_000)[0]

    def chord(x):
        slope, rest = magnitude(x)
        return slope, Interval(rest.hi)

    magnitude = pwscont.proof.enclosures._magnitude
    monkeypatch.setattr(pwscont.proof.enclosures, "_magnitude", chord)
    assert lost("abs") > 0
    assert lost("max and min") > 0
    monkeypatch.undo()
    monkeypatch.setattr(pwscont.proof.enclosures, "upper", lambda x, terms: 0.0 * x)
    assert lost("products") > 0
