"""The mean value form on boxes holds every exact value, across kinks too; mutants are caught."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from high_precision import exact
from sweeps import swept

import pwscont.proof.interval
from pwscont.proof.interval import Interval
from pwscont.proof.tape import evaluated, traced, with_slopes

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
    """Return how many exact values lie off the mean value form, and how many forms say something.

    The form is around a point of the box, at which the exact value is known as well.
    """
    box, points = boxes(np.random.default_rng(seed), count)
    tape = traced(lambda z, t, sw: [f(z[0], t, sw, float)], 1)
    with np.errstate(all="ignore"):
        slopes = with_slopes(tape.slopes, box.arranged(np.transpose))[1][:, 0].arranged(
            np.transpose
        )
        start = evaluated(tape, Interval(points.T))[:, 0]
    lost = said = 0
    for k in np.flatnonzero(np.isfinite(slopes.width()).all(axis=0) & np.isfinite(start.width())):
        x, c = ([Fraction(float(y)) for y in each[:, k]] for each in (box.middle(), points))
        at = value(*c)
        lost += not Fraction(float(start.lo[k])) <= at <= Fraction(float(start.hi[k]))
        ends = zip(slopes.lo[:, k].tolist(), slopes.hi[:, k].tolist(), x, c, strict=True)
        parts = [sorted((Fraction(lo) * (a - b), Fraction(hi) * (a - b))) for lo, hi, a, b in ends]
        lost += not sum(p for p, _ in parts) <= value(*x) - at <= sum(p for _, p in parts)
        said += 1
    return lost, said


@pytest.mark.parametrize("count", swept([1_000], [30_000]))
@pytest.mark.parametrize("name", RATIONAL)
@pytest.mark.sweep(3)
def test_mean_values_hold_exact_values(name, count):
    f = RATIONAL[name]
    lost, said = escapes(f, lambda z, t: f(z, t, EXACT, Fraction), count)
    assert lost == 0
    assert said > 0.3 * count


@pytest.mark.parametrize("count", swept([400], [10_000]))
@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.sweep(3)
def test_mean_values_of_functions_hold_sixty_digits(name, count):
    def f(z, t, sw, c):
        return getattr(np, name)(z) - t

    lost, said = escapes(f, lambda z, t: exact(name, z) - t, count)
    assert lost == 0
    assert said > 0.1 * count


def test_one_branch_at_kinks_and_slopes_without_rounding_are_caught(monkeypatch):
    def lost(name):
        f = RATIONAL[name]
        return escapes(f, lambda z, t: f(z, t, EXACT, Fraction), 1_000)[0]

    switches = pwscont.proof.interval.SWITCHES
    for name, first in (("abs", lambda dx: (dx, dx)), ("max", lambda da, db: (da, da))):
        monkeypatch.setitem(switches, name, (switches[name][0], first))
    assert lost("abs") > 0
    assert lost("max and min") > 0
    monkeypatch.undo()
    monkeypatch.setattr(Interval, "rounded", classmethod(lambda cls, lo, hi, ulps=1.0: cls(lo, hi)))
    assert lost("products") > 0
