"""H at several points by a single call is H point by point, or is not evaluated so."""

import math

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, trace
from pwscont.basics.character import Character
from pwscont.system.selection import Selection, by_columns, takes_columns

RNG = np.random.default_rng(5)
POINTS = RNG.uniform(0.2, 2.0, (12, 4))  # three unknowns and alpha
MATRIX = RNG.normal(size=(3, 3))
#: Functions of (z, alpha) that only compute with numbers, some of which move or mix the entries.
PASSING = {
    "polynomial": lambda z, a: z**3 - 2 * z * a + 1,
    "power": lambda z, a: 2.0**z + z**a - z ** (-0.5),
    "sum": lambda z, a: z - np.sum(z) / a,
    "method": lambda z, a: z.sum() * z - z.mean() + z.dot(z),
    "flip": lambda z, a: np.flip(z) - a * np.roll(z, 1),
    "matrix": lambda z, a: MATRIX @ z - a * np.arange(3.0),
    "list": lambda z, a: np.array([z[0] * z[1], np.exp(-a) + z[2], 3.0 * np.float64(2.0) / z[0]]),
    "ufuncs": lambda z, a: np.tanh(z) + np.log(a) * np.sqrt(z) - np.arctan(np.square(z)) + abs(z),
    "shift": lambda z, a: z + np.concatenate([[a], z[:-1]]) - np.append(z[1:], 0.0),
    "norm": lambda z, a: z / np.linalg.norm(z) - a,
    "constant": lambda z, a: np.array([1.0, z[1] - a, 2.0]),
}
#: Functions that decide, or that need floats.
FAILING = {
    "compares": lambda z, a: z if z[0] > 1.0 else -z,
    "largest": lambda z, a: z / z.max(),
    "converts": lambda z, a: np.array([float(z[0]), z[1], a]),
    "of math": lambda z, a: z * math.exp(a),
    "fills": lambda z, a: np.full(3, a, dtype=float) + z,
    "where": lambda z, a: np.where(z > 1.0, z, 0.0),
    "rounds": lambda z, a: np.round(z),
    "sorts": lambda z, a: np.sort(z),
    "none": lambda z, a: None,
    "shape": lambda z, a: z[:2],
    "caught": lambda z, a: z if isinstance(a, float) else np.array([z[0], z[1], "text"]),
}


@pytest.mark.parametrize("name", PASSING)
def test_columns_give_h_point_by_point(name):
    function = PASSING[name]
    truth = np.array([function(x[:-1], float(x[-1])) for x in POINTS])
    np.testing.assert_allclose(by_columns(function, POINTS), truth, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", FAILING)
def test_what_decides_or_converts_is_not_evaluated_with_columns(name):
    assert by_columns(FAILING[name], POINTS) is None


class Odd(PiecewiseSystem):
    """z^2 = alpha for numbers; what is asked for otherwise is up to subclasses."""

    size = 1

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return z**2 - alpha


class ByType(Odd):
    def residual(self, z, alpha, character):
        return z**2 - alpha if isinstance(alpha, float) else z - alpha


class Warm(Odd):
    last = np.ones(1)

    def residual(self, z, alpha, character):
        self.last = 0.5 * (self.last + z)
        return z**2 - alpha + 0.0 * self.last


@pytest.mark.parametrize("system", [ByType(), Warm()])
def test_a_system_that_tells_columns_from_numbers_gets_none(system):
    points = np.column_stack([np.linspace(0.5, 1.0, 6), np.linspace(0.2, 1.0, 6)])
    selection = Selection(system, Character(()))
    truth = points[:, 0] ** 2 - points[:, 1]
    np.testing.assert_allclose(selection.residuals(points)[:, 0], truth, atol=1e-15)
    assert not takes_columns(system, lambda z, a: system.residual(z, a, Character(())), points)
    assert type(getattr(system, "last", np.ones(1))[0]) is np.float64


class Given(Odd):
    """H of one unknown as a function of (z, alpha)."""

    def __init__(self, function):
        self.function = function

    def residual(self, z, alpha, character):
        return self.function(z, alpha)


class KeepsInList(Odd):
    """y(z) = alpha with y^3 + y = z, by Newton from the last y."""

    def __init__(self):
        self.kept = [1.0]

    def residual(self, z, alpha, character):
        y = self.kept[0]
        for _ in range(40):
            y = y - (y**3 + y - z[0]) / (3.0 * y**2 + 1.0)
        self.kept[0] = y
        return np.array([y - alpha])


def closure():
    """Return the same from a function of its own."""
    own = KeepsInList()
    return Given(lambda z, alpha: own.residual(z, alpha, None))


@pytest.mark.parametrize("make", [KeepsInList, closure])
def test_what_h_keeps_in_a_list_or_a_closure_stays_a_number(make):
    graph = trace(make(), ([0.0], 0.0), (-2.0, 2.0))
    np.testing.assert_allclose([s.z[0] for s in graph.solutions(1.0)], [2.0], rtol=1e-12)


def test_where_numbers_would_become_complex_there_are_no_columns():
    def h(z, alpha):
        return z**3 + z - abs(alpha**1.5)

    points = np.array([[0.1, -0.4], [0.2, 0.3], [0.3, 0.5], [0.4, 0.6]])
    assert by_columns(h, points) is None
    graph = trace(Given(h), ([1.0], 1.5), (-1.0, 2.0))
    assert [graph.count(alpha) for alpha in (-0.9, -0.1, 0.1, 1.9)] == [1, 1, 1, 1]


@pytest.mark.parametrize("mixes", [np.sum, lambda z: np.flip(z)[0], lambda z: z[0]])
@pytest.mark.sweep(2)
def test_folds_of_a_narrow_bump_are_found_with_columns(mixes):
    """alpha = z + 0.01 exp(-((z - 0.3) / 0.004)^2) has two folds beside the bump."""

    def bump(z, a, sw):
        y = mixes(z)
        return z + 0.01 * np.exp(-(((y - 0.3) / 0.004) ** 2)) - a

    graph = trace(Switched(1, bump), ([-1.0], -1.0), (-1.0, 1.0))
    assert len(graph.special_points("fold")) == 2
    assert graph.count(0.308) == 3


def test_a_switch_that_is_called_twice_takes_columns():
    system = Switched(1, lambda z, a, sw: sw.relu(z) / (1 + sw.relu(z)) - a)
    points = np.array([[2.0, 0.1], [2.1, 0.2], [2.2, 0.3], [2.5, 0.4]])
    character = system.character(points[0, :1], 0.1)
    found = by_columns(lambda z, a: system.residual(z, a, character), points)
    np.testing.assert_allclose(found[:, 0], points[:, 0] / (1 + points[:, 0]) - points[:, 1])
