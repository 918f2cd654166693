"""Enumeration of ill-conditioned systems against rational arithmetic, and what it guarantees."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import (
    Block,
    InvalidSystemError,
    PiecewiseLinearSystem,
    Switched,
    enumerate_solutions,
    explore,
)
from pwscont.bench.truth.rational import solve
from pwscont.curve.metric import Metric
from pwscont.enumeration.exact import solve_exactly


class Complementarity(PiecewiseLinearSystem):
    """min(z, M z + q) = 0, one block per row or all cells in one block."""

    def __init__(self, M, q, degree=None, split=True):
        self.M, self.q, self.size = M, q, len(q)
        self.degree, self.split = degree, split

    def test_functions(self, z, alpha):
        return z - (self.M @ z + self.q)

    def residual(self, z, alpha, character):
        return np.where(character.signs, self.M @ z + self.q, z)

    def jacobian(self, z, alpha, character):
        rows = np.where(np.array(character.signs)[:, np.newaxis], self.M, np.eye(self.size))
        return np.column_stack([rows, np.zeros(self.size)])

    def test_jacobian(self, z, alpha):
        return np.column_stack([np.eye(self.size) - self.M, np.zeros(self.size)])

    def blocks(self):
        if not self.split:
            return super().blocks()
        return tuple(Block((i,), (i,), ((True,), (False,))) for i in range(self.size))


def rational(M, q):
    """Return all solutions, by every choice of complementary rows in rational arithmetic."""
    n, found = len(q), set()
    for choice in product((True, False), repeat=n):
        rows = np.where(np.array(choice)[:, np.newaxis], M, np.eye(n))
        z, sign = solve(rows, -np.where(choice, q, 0.0)[:, np.newaxis])
        if not sign:
            continue
        z = [value for (value,) in z]
        terms = [[Fraction(float(m)) * value for m, value in zip(row, z, strict=True)] for row in M]
        w = [sum(row, Fraction(float(constant))) for row, constant in zip(terms, q, strict=True)]
        if min(*z, *w) >= 0:
            found.add(tuple(z))
    return [np.array([float(value) for value in z]) for z in found]


def ill_conditioned(rng, n, condition):
    """Return a matrix with this condition, every other one symmetric and positive definite."""
    U, V = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    singular = np.diag(np.geomspace(1.0, 1.0 / condition, n))
    if rng.uniform() < 0.5:
        return U @ singular @ V.T
    M = U @ singular @ U.T
    return 0.5 * (M + M.T)


def assert_same(found, expected):
    assert len(found) == len(expected)
    for z in expected:
        size = np.abs(z).max() or 1.0
        assert min(np.abs(one.z - z).max() for one in found) <= 1e-5 * size


@pytest.mark.parametrize("split", [True, False])
@pytest.mark.parametrize("decades", [(0, 6), (6, 12), (12, 14), (14, 15)])
@pytest.mark.sweep(12)
def test_against_rational_arithmetic(decades, split):
    rng = np.random.default_rng([*decades, split])
    certain, empty = 0, 0
    for _ in range(40):
        n = int(rng.integers(2, 6 if split else 4))
        M = ill_conditioned(rng, n, 10.0 ** rng.uniform(*decades))
        q, expected = rng.normal(size=n), None
        found = enumerate_solutions(Complementarity(M, q, split=split), 0.0)
        expected = rational(M, q)
        if found.guarantee.startswith("complete"):
            assert_same(found, expected)
            certain += 1
            empty += not expected
    assert certain >= 36
    assert empty  # there were systems without a solution, too


def test_solutions_without_digits_are_found_in_exact_arithmetic():
    """Condition 1e13: rounding alone leaves three digits, and finds other numbers of solutions."""
    rng = np.random.default_rng(8)
    exact = 0
    for _ in range(20):
        M = ill_conditioned(rng, 3, 1e13)
        found = enumerate_solutions(Complementarity(M, -np.ones(3)), 0.0)
        assert_same(found, rational(M, -np.ones(3)))
        exact += found.guarantee == "complete (in exact arithmetic)"
    assert exact > 5


def test_signs_of_exact_solutions():
    """Against the signs of determinants in rational arithmetic, in all orders of blocks."""
    rng = np.random.default_rng(3)
    for _ in range(30):
        n = int(rng.integers(1, 5))
        system = Complementarity(rng.normal(size=(n, n)), rng.normal(size=n))
        for point in solve_exactly(system, Metric.at(system, 0.0), 0.0).points:
            rows = system.jacobian(point.x[:-1], 0.0, point.characters[0])[:, :-1]
            assert point.det_sign == solve(rows, np.zeros((n, 1)))[1]


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("condition", [1e12, 1e13, 1e14, 1e15])
@pytest.mark.sweep(6)
def test_ill_conditioned_bodies_balance(p, condition):
    """For Coulomb friction the signs sum to +1: never an empty list."""
    rng = np.random.default_rng([p, int(np.log10(condition))])
    for _ in range(6):
        U = np.linalg.qr(rng.normal(size=(2 * p, 2 * p)))[0]
        A = U @ np.diag(np.geomspace(1.0, 1.0 / condition, 2 * p)) @ U.T
        A = 0.5 * (A + A.T)
        if np.linalg.eigvalsh(A)[0] <= 0.0:
            continue
        body = ContactBody(A, np.eye(2 * p)[:p], np.eye(2 * p)[p:])
        load = rng.normal(size=2 * p)
        system = CoulombLoad(body, AffineLoad(load, 0.0 * load), float(rng.uniform(0.0, 3.0)))
        found = enumerate_solutions(system, 0.0)
        assert found.guarantee.startswith(("complete", "not certain: 1 more"))
        assert sum(one.det_sign for one in found) == 1


def test_a_wrong_degree_is_said():
    system = Complementarity(np.eye(2), -np.ones(2), degree=3)
    found = enumerate_solutions(system, 0.0)
    assert found.guarantee.startswith("not complete: the signs of det(dH/dz) sum to +1, not to +3")


def test_too_many_cells_for_exact_arithmetic_are_said(monkeypatch):
    """A solution without digits that cannot be verified is no certain one, nor a start."""
    monkeypatch.setattr("pwscont.enumeration.exact.MOST_WORK", 0)
    M = ill_conditioned(np.random.default_rng(1), 3, 1e15)
    system = Complementarity(M @ M.T, -np.ones(3))
    assert enumerate_solutions(system, 0.0).guarantee.startswith("not certain: too ill conditioned")


def test_faces_are_said():
    """z >= 0 and w = 0 for all z: a whole half line of solutions."""
    found = enumerate_solutions(Complementarity(np.zeros((1, 1)), np.zeros(1)), 0.0)
    assert "infinitely many" in found.guarantee


def test_a_list_with_a_guarantee():
    found = enumerate_solutions(Complementarity(np.eye(2), -np.ones(2)), 0.0)
    assert isinstance(found, list)
    assert found.guarantee == "complete"
    assert found[0].z.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("size", [1e200, 1e-200])
def test_extreme_loads_are_refused_as_explore_does(size):
    body = ContactBody(np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)[:1], np.eye(2)[1:])
    load = size * np.array([1.0, -10.0])
    system = CoulombLoad(body, AffineLoad(load, 0.0 * load), 1.0)
    for find in (lambda: enumerate_solutions(system, 0.0), lambda: explore(system, (0.0, 1.0))):
        with pytest.raises(InvalidSystemError, match="choose other units"):
            find()


def lower_bound(switches, periods):
    """Perfect foresight, the interest rate bounded in the first periods; alpha is a shock."""
    T, n = switches, periods
    lag, lead, first = np.eye(n, k=-1), np.eye(n, k=1), np.eye(n)[0]

    def f(z, shock, sw):
        y, p, i = z[:n], z[n : 2 * n], z[2 * n :]
        rule = 0.01 + 1.5 * p + 1.6 * (y - lag @ y)
        euler = y - lead @ y + i - lead @ p - 0.01 + first * shock
        bound = i[:T] - sw.relu(rule[:T])
        return np.concatenate([euler, p - 0.99 * (lead @ p) - 0.1 * y, bound, i[T:] - rule[T:]])

    return Switched(3 * n, f, linear=True)


@pytest.mark.parametrize(("switches", "periods"), [(3, 8), (6, 20), (12, 16)])
def test_unknowns_that_no_switch_touches_are_eliminated_once(switches, periods):
    """Without that, 2^12 cells of 48 unknowns are too many to be sure that none has a solution."""
    found = enumerate_solutions(lower_bound(switches, periods), 0.02)
    assert (len(found), found.guarantee) == (0, "complete (in exact arithmetic)")


def test_regimes_of_a_lower_bound_one_by_one():
    """At a smaller shock, against all regimes solved in floating point."""
    T, n, shock = 3, 8, 0.005
    lag, lead, eye = np.eye(n, k=-1), np.eye(n, k=1), np.eye(n)
    rule = np.hstack([1.6 * (eye - lag), 1.5 * eye])
    expected = 0
    for bound in product((False, True), repeat=T):
        free = np.array([not b for b in bound] + [True] * (n - T))
        A = np.block(
            [
                [eye - lead, -lead, eye],
                [-0.1 * eye, eye - 0.99 * lead, 0.0 * eye],
                [-1.0 * free[:, np.newaxis] * rule, eye],
            ]
        )
        z = np.linalg.solve(A, np.concatenate([0.01 - eye[0] * shock, 0.0 * eye[0], 0.01 * free]))
        values = 0.01 + rule @ z[: 2 * n]
        expected += all(values[:T][free[:T]] >= 0.0) and all(values[:T][~free[:T]] <= 0.0)
    assert len(enumerate_solutions(lower_bound(T, n), shock)) == expected > 0
