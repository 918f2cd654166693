"""Infinitely many solutions: over stretches of alpha, at single values, in files and in words."""

import math
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from exact_counts import count_of
from pwscont_optimisation import Lasso
from sweeps import swept

from pwscont import (
    LCP,
    BranchGraph,
    Complementarity,
    PiecewiseSystem,
    Switched,
    enumerate_solutions,
    explore,
)

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

INTERVAL = (-1.5, 1.5)
ALPHAS = [
    Fraction(-1),
    Fraction(0),
    Fraction(1),
    Fraction(1, 2),
    Fraction(-7, 16),
    Fraction(13, 32),
]


class DegenerateLCP:
    """0 <= z, 0 <= M z + q + alpha d, z (M z + q + alpha d) = 0 with small integers.

    M is zero, of rank one, has a zero row, a copied unknown, or is a product of a thin matrix.
    """

    def __init__(self, seed):
        rng = np.random.default_rng([seed, 5])
        n, most = int(rng.integers(1, 5)), int(rng.choice([1, 2, 4]))
        M, kind = rng.integers(-most, most + 1, (n, n)), rng.integers(6)
        if kind == 0:
            M[:] = 0
        elif kind == 1:
            M = np.outer(*rng.integers(-2, 3, (2, n)))
        elif kind == 3:
            M[rng.integers(n)] = 0
        elif kind == 4:
            thin = rng.integers(-1, 2, (n, max(1, n - 1)))
            M = thin @ thin.T
        self.M, (self.q, self.d) = M, rng.integers(-most, most + 1, (2, n))
        if kind == 2 and n > 1:
            M[-1], M[:, -1], self.q[-1], self.d[-1] = M[0], M[:, 0], self.q[0], self.d[0]
            M[-1, -1] = M[0, 0]

    def count(self, alpha):
        """Return the number of solutions, in rational numbers by all choices of zeros."""
        n = len(self.q)
        unit = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
        rows = [[Fraction(int(v)) for v in row] for row in self.M]
        rest = [int(q) + alpha * int(d) for q, d in zip(self.q, self.d, strict=True)]
        pairs = [((unit[i], Fraction(0)), (rows[i], rest[i])) for i in range(n)]
        cells = [
            (
                [p[k] for p, k in zip(pairs, zeros, strict=True)],
                [p[1 - k] for p, k in zip(pairs, zeros, strict=True)],
            )
            for zeros in product((0, 1), repeat=n)
        ]
        return count_of(cells)


def held(graph, alpha):
    """Return the numbers in the rows of multiplicity() that have alpha."""
    rows = graph.multiplicity()
    inner = [
        r[2] for r in rows if r[0] < alpha < r[1] and not graph.same(np.array(r[:2]), alpha).any()
    ]
    at_lo = [r[2] for r in rows if graph.same(r[0], alpha) and r.lo_closed]
    return inner + at_lo + [r[2] for r in rows if graph.same(r[1], alpha) and r.hi_closed]


@pytest.mark.parametrize("seed", swept(range(25), range(25, 400)))
@pytest.mark.sweep(24)
def test_degenerate_lcps(seed):
    family = DegenerateLCP(seed)
    system = LCP(family.M, family.q, family.d)
    graph = explore(system, INTERVAL)
    assert "missing" not in graph.guarantee
    for alpha in ALPHAS:
        expected, at = family.count(alpha), float(alpha)
        assert graph.count(at) == expected
        assert set(held(graph, at)) <= {expected}
        assert expected != math.inf or held(graph, at)
    found, expected = enumerate_solutions(system, 0.5), family.count(Fraction(1, 2))
    assert found.guarantee.startswith("complete")
    assert ("infinitely many" in found.guarantee) == (expected == math.inf)
    assert len(found) == expected if expected < math.inf else len(found) > 0


def goods(n):
    """Public goods: every split of alpha among n players is an equilibrium."""
    return LCP(np.ones((n, n)), np.zeros(n), -np.ones(n))


def quantile(y):
    n = len(y)

    def rows(z, tau):
        return np.concatenate([[z[1:].sum() - n * (1.0 - tau)], z[0] - np.array(y)])

    return Complementarity(
        rows, np.r_[-np.inf, np.zeros(n)], np.r_[np.inf, np.ones(n)], n=n + 1, linear=True
    )


def latch(z, alpha, sw):
    """Two stages that follow each other, with a gain of one and no leak."""
    return [z[0] - sw.clip(z[1], -1, 1) - 0.0 * alpha, z[1] - sw.clip(z[0], -1, 1)]


def whole_lines(z, alpha, sw):
    """Of two unknowns the sum is known, in two equations: solutions are whole lines."""
    return [z[0] + z[1] - sw.abs(alpha), 2.0 * (z[0] + z[1]) - 2.0 * sw.abs(alpha)]


def at_one_alpha(z, alpha, sw):
    """The second unknown is whatever one likes, but only at alpha = 0."""
    return [z[0] - sw.abs(alpha), 1.0 - z[0] - sw.abs(1.0 + alpha)]


@pytest.mark.parametrize(
    ("system", "interval", "counts"),
    [
        (goods(2), (-1.0, 1.0), {-0.5: 1, 0.0: 1, 0.5: math.inf}),
        (goods(3), (-1.0, 1.0), {-0.5: 1, 0.0: 1, 0.5: math.inf}),
        (quantile([1.0, 2.0, 2.0]), (0.1, 0.9), {0.2: 1, 1 / 3: math.inf, 0.5: math.inf}),
        (quantile([1.0, 2.0, 4.0]), (0.1, 0.9), {0.2: 1, 1 / 3: math.inf, 0.5: 1}),
        (Switched(2, latch, linear=True), (-1.0, 1.0), {-0.5: math.inf, 0.5: math.inf}),
        (Switched(2, whole_lines, linear=True), (-1.0, 1.0), {0.0: math.inf, 0.5: math.inf}),
        (LCP([[0.0]], [-1.0], [-1.0]), (-3.0, 3.0), {-2.0: 1, -1.0: math.inf, 0.0: 0}),
    ],
)
@pytest.mark.sweep(4)
def test_known_sets(system, interval, counts, tmp_path):
    graph = explore(system, interval)
    assert {alpha: graph.count(alpha) for alpha in counts} == counts
    assert "missing" not in graph.guarantee
    for alpha, count in counts.items():
        found = enumerate_solutions(system, alpha)
        assert ("infinitely many" in found.guarantee) == (count == math.inf)
        assert len(found) == count if count < math.inf else len(found) > 0
    graph.save(tmp_path / "graph.zip")
    read = BranchGraph.load(tmp_path / "graph.zip")
    assert read.multiplicity() == graph.multiplicity()
    assert read.guarantee == graph.guarantee


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.sweep(6)
def test_copied_column(unit, sign):
    rng = np.random.default_rng(1)
    X, y = unit * rng.normal(size=(12, 4)), rng.normal(size=12)
    X[:, 3] = sign * X[:, 0]
    size = np.abs(X.T @ y)
    first = float(size.max())
    graph = explore(Lasso(X, y), (0.01 * first, 1.2 * first))
    assert [graph.count(alpha * first) for alpha in (0.02, 1.1)] == [math.inf, 1]
    assert "missing" not in graph.guarantee


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.sweep(4)
def test_a_point_without_a_digit_is_no_solution(seed):
    """In doubles v v^T is regular by rounding only; what is listed must solve the problem."""
    rng = np.random.default_rng(seed)
    v, q, d = rng.normal(size=(3, 3))
    system = LCP(np.outer(v, v), q, d)
    for alpha in rng.uniform(-3.0, 3.0, 4):
        for one in enumerate_solutions(system, alpha):
            w = v * (v @ one.z) + q + alpha * d
            np.testing.assert_allclose(np.minimum(one.z, w), 0.0, atol=1e-9)


@pytest.mark.parametrize("others", [0, 2])
def test_a_vertical_ray_is_no_imbalance(others):
    """Of w_0 = -1 - alpha any z_0 >= 0 is a solution at alpha = -1, and none is above."""
    n = 1 + others
    M, q = np.diag([0.0] + [1.0] * others), np.array([-1.0] + [2.0] * others)
    graph = explore(LCP(M, q, -np.eye(n)[0]), (-3.0, 3.0))
    assert [graph.count(alpha) for alpha in (-2.0, -1.0, 0.0)] == [1, math.inf, 0]
    assert graph.is_balanced()
    assert "infinitely many solutions at alpha = -1 (the branch runs to infinity" in graph.guarantee


class LevelsOff(PiecewiseSystem):
    """A function of z, alpha and relu as a class without derivatives."""

    def __init__(self, size, function):
        self.size, self._function = size, function

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return self._function(z, alpha, _Relu(character.signs[0]))


class _Relu:
    def __init__(self, is_on):
        self._is_on = is_on

    def relu(self, z):
        return z if self._is_on else 0.0 * z


@pytest.mark.parametrize("kind", [Switched, LevelsOff])
@pytest.mark.slow
def test_a_function_that_levels_off_has_magnitudes_where_it_bends(kind):
    """relu(z) / (1 + relu(z)) = alpha: half of the interval is reached by rounding alone.

    A magnitude of 1e16 would make z = -1/3, a zero of the other side, a point of the interface.
    """
    graph = explore(kind(1, lambda z, a, sw: sw.relu(z) / (1 + sw.relu(z)) - a), (-0.5, 1.5))
    assert [graph.count(alpha) for alpha in (-0.4, -0.1, 0.0, 0.2, 0.9)] == [0, 0, math.inf, 1, 1]
    np.testing.assert_allclose(graph.solutions(0.5)[0].z, [1.0], rtol=1e-9)


@pytest.mark.slow
def test_a_step_that_goes_nowhere_is_no_step():
    """(1 + z^2)^-0.05 = alpha begins at |z| = 1e10."""
    system = LevelsOff(1, lambda z, a, sw: (1 + z**2) ** -0.05 - a)
    graph = explore(system, (0.1, 1.1))
    assert "a piece was stopped" in graph.guarantee
    assert graph.count(0.5) == 2


@pytest.mark.parametrize("hi", [1.5, 2.0, 3.0])
def test_an_area_with_a_corner_at_an_end_of_the_interval(hi):
    """max(z, 2 z + 1) - z + min(-2 z - alpha, 0) = 0: all z <= -1 with 2 z <= -alpha, and more.

    At alpha = 2 a line of solutions reaches the corner of the area.
    """

    def equation(z, alpha, sw):
        return [sw.max(z[0], 2.0 * z[0] + 1.0) - z[0] + sw.min(-2.0 * z[0] - alpha, 0.0)]

    graph = explore(Switched(1, equation, linear=True), (-2.0, hi))
    assert [graph.count(alpha) for alpha in (-2.0, -1.0, 0.5, hi)] == [math.inf] * 4
    assert "infinitely many solutions" in graph.guarantee


@pytest.mark.slow
def test_a_search_ends_soon_where_solutions_fill_an_area():
    calls = []

    def dead_zones(z, t, sw):  # a square of solutions until t = 0, then its corner moves
        calls.append(t)
        return z - sw.clip(z, -1.0, 1.0) - np.array([1.0, 2.0]) * sw.relu(t)

    graph = explore(Switched(2, dead_zones), (-1.0, 1.0))
    assert [graph.count(t) for t in (-0.7, 0.1, 0.8)] == [math.inf, 1, 1]
    assert "infinitely many solutions for alpha in [-1, 0]" in graph.guarantee
    assert len(calls) <= 12_000
