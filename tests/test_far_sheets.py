"""Solution sheets whose magnitudes lie far apart, against exact changes of sign."""

from fractions import Fraction

import numpy as np
import pytest
from helpers.sweeps import swept

from pwscont import PiecewiseSystem, Switched, explore
from pwscont.curve.metric import Metric
from pwscont.enumeration.continua import is_one_of_many, underflows

INTERVAL, ALPHAS = (-1.0, 1.0), (-0.7, 0.1, 0.83)
SHEETS = [
    (1.0, 1e3, 1e5),
    (1.0, 1e3, 1e6),
    (1e-3, 1.0, 1e3),
    (-1.0, 1e3, -1e5),
    (1.0, 2.0, 1e5),
    (1e-2, 1e-5, 1e3),
    (1.0, 1e2, 1e4, 1e6),
]

QUICK = [(roots, 1e-3) for roots in SHEETS[:3]]
SLOW = [(roots, load) for roots in SHEETS for load in (1e-6, 1e-3, 0.1)]


def product(roots, x):
    """Return the product of x - root, divided by the roots that are larger than 1."""
    value = 1
    for root in roots:
        value = value * ((x - root) / max(1, abs(root)))
    return value


class Sheets(PiecewiseSystem):
    """Sheets of z_0, turned with an unknown that follows; the load bends at a middle sheet."""

    def __init__(self, roots, load, turned):
        self.size, self.roots, self.load = 2 if turned else 1, roots, load

    def own(self, z):
        """Return the unknown that the sheets belong to, and the other unknown."""
        return (0.8 * z[0] + 0.6 * z[1], 0.8 * z[1] - 0.6 * z[0]) if self.size == 2 else (z[0], 0.0)

    def test_functions(self, z, alpha):
        return np.array([self.own(z)[0] / self.roots[1] - 1.0])

    def residual(self, z, alpha, character):
        x, other = self.own(z)
        bend = (x / self.roots[1] - 1.0) * (1.0 if character.signs[0] else -1.0)
        rows = [product(self.roots, x) - self.load * (alpha - 0.01 * bend), other - x - alpha]
        return np.array(rows[: self.size])


def number(roots, load, alpha):
    """Return the number of solutions: exact changes of sign close to roots, kink and all sizes."""
    exact = [Fraction(root) for root in roots]

    def is_positive(x):
        bend = abs(x / exact[1] - 1) / 100
        return product(exact, x) > Fraction(load) * (Fraction(alpha) - bend)

    near = [Fraction(float(part)) for part in np.logspace(-9.0, -0.5, 60)]
    sizes = [Fraction(float(size)) for size in np.logspace(-8.0, 9.0, 500)]
    beside = [r * (1 + sign * part) for r in exact for part in near for sign in (1, -1)]
    places = sorted([*sizes, *(-size for size in sizes), *beside, *exact, Fraction(0)])
    return int(np.count_nonzero(np.diff([is_positive(x) for x in places])))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("roots", "load"), swept(QUICK, SLOW))
def test_sheets_far_apart_are_found_by_a_class(roots, load, turned):
    graph = explore(Sheets(roots, load, turned), INTERVAL)
    assert [graph.count(a) for a in ALPHAS] == [number(roots, load, a) for a in ALPHAS]


@pytest.mark.sweep(2)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_sheets_far_apart_are_found_by_a_formula(unit):
    roots = (1e-2, 1e-5, 1e3)  # the sheet at 1e3 lies outside of the box of the proof

    def equations(z, a, sw):
        return [product(roots, z[0] / unit) - 1e-6 * a, z[1] - sw.abs(z[0] - 3e-4 * unit)]

    graph = explore(Switched(2, equations), INTERVAL)
    assert [graph.count(a) for a in ALPHAS] == [3, 3, 3]


HEAT, LOSS, COOLING, BEGINS = (
    10.431643943211506,
    1.3624727599982767,
    1.5593903390534833,
    2.2484058201629167,
)


def rate(temperature, alpha):
    """Return the rate of a reaction, which has a pole at the temperature -20."""
    return alpha * np.exp(temperature / (1.0 + temperature / 20.0))


class Reactors(PiecewiseSystem):
    """Two reactors in a row: conversion and temperature of each; a cooler begins to cool."""

    size = 4

    def test_functions(self, z, alpha):
        return z[[1, 3]] - BEGINS

    def residual(self, z, alpha, character):
        x, t = z[[0, 2]], z[[1, 3]]
        reacted = (1.0 - x) * rate(t, alpha)
        cooled = LOSS * t + COOLING * np.where(character.signs, t - BEGINS, 0.0)
        before, inflow = np.array([0.0, z[0]]), np.array([0.0, z[1]])
        rows = [before - x + reacted, inflow - t + HEAT * reacted - cooled]
        return np.column_stack(rows).ravel()


def states(before, inflow, alpha):
    """Return the states (x, t) of a reactor: changes of sign of the balance of heat."""
    t = np.linspace(-1.0, 30.0, 300_001)
    x = (before + rate(t, alpha)) / (1.0 + rate(t, alpha))
    heat = HEAT * (x - before) - LOSS * t - COOLING * np.maximum(t - BEGINS, 0.0)
    at = np.flatnonzero(np.diff(np.sign(inflow - t + heat)))
    return list(zip(x[at], t[at], strict=True))


@pytest.mark.slow
def test_rounding_beside_a_pole_is_no_continuum():
    temperature = 66.0 / (1.0 - 66.0 / 20.0)  # the rate is exp(66), and no heat is balanced
    x = np.array([1.0, temperature, 1.0, temperature / (1.0 + LOSS), 0.1])
    metric = Metric(np.ones(5), (1e-3, 0.3))
    assert is_one_of_many(Reactors(), metric, x)
    assert underflows(Reactors(), metric, x)
    graph = explore(Reactors(), (1e-3, 0.3))
    for alpha in (0.04, 0.12, 0.28):
        first = states(0.0, 0.0, alpha)
        assert graph.count(alpha) == sum(len(states(*each, alpha)) for each in first)
