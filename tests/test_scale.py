"""Bodies with many contact nodes: elimination by hand, updates, and memory."""

import sys
from pathlib import Path

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from pwscont_coulomb.contact_algebra import ContactAlgebra
from pwscont_coulomb.contact_matrix import ContactMatrix
from pwscont_coulomb.modes import SIGNS
from pwscont_coulomb.row_updates import Updating, drifted

from pwscont import Character, check_system
from pwscont.linear.factor import ScaledFactor
from pwscont.linear.factorise import bordered, column

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from scale_parts import plain

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))


pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


P = 40


def random_body(p=P, inner=3, seed=0, unit=1.0):
    """Return a body whose N and T pick displacements in no order, some in no contact."""
    rng = np.random.default_rng(seed)
    n = 2 * p + inner
    root = rng.normal(size=(n, n))
    A = unit * (root @ root.T + n * np.eye(n))
    picks = np.eye(n)[rng.permutation(n)]
    return ContactBody(A, picks[:p], picks[p : 2 * p], rng.integers(0, 2, p) / 4.0)


def in_modes(body, rng):
    return rng.integers(0, 4, body.p)


def systems(body, friction):
    load = AffineLoad(*np.random.default_rng(1).normal(size=(2, body.n)))
    return CoulombLoad(body, load, friction), plain(CoulombLoad(body, load, friction))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
@pytest.mark.sweep(6)
def test_jacobian_is_the_general_one(seed, unit):
    rng = np.random.default_rng(seed)
    body, friction = random_body(seed=seed, unit=unit), rng.choice([0.0, 0.3, 4.0, 1e5], P)
    structured, general = systems(body, friction)
    assert structured.algebra is not None
    z = rng.normal(size=structured.size)
    character = structured.character(z, 0.5)
    J, dense = (system.jacobian(z, 0.5, character) for system in (structured, general))
    tight = {"rtol": 1e-12, "atol": 1e-12 * np.abs(dense).max()}
    np.testing.assert_allclose(J.toarray(), dense, **tight)
    x, y = rng.normal(size=len(z) + 1), rng.normal(size=len(z))
    for got, expected, terms in [
        (J @ x, dense @ x, abs(dense) @ abs(x)),
        (y @ J, y @ dense, abs(y) @ abs(dense)),
        (structured.residual(z, 0.5, character), general.residual(z, 0.5, character), abs(z)),
    ]:
        np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-11 * terms.max())
    np.testing.assert_allclose(abs(J) @ abs(x), abs(dense) @ abs(x), rtol=1e-5)
    gradients = [system.test_jacobian(z, 0.5) for system in (structured, general)]
    np.testing.assert_allclose(gradients[0].toarray(), gradients[1], rtol=1e-14)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.sweep(6)
def test_solves_and_signs(seed):
    """Against numpy: solutions both ways, and the sign of the determinant after each update."""
    rng, body = np.random.default_rng(seed), random_body(seed=seed)
    friction = rng.choice([0.0, 0.5, 3.0], P)
    algebra = ContactAlgebra(body, body.stiffness, Updating())
    _, general = systems(body, friction)
    mode = in_modes(body, rng)
    for _ in range(15):
        mode[rng.integers(P)] = rng.integers(4)
        matrix, dense = ContactMatrix(algebra, mode, friction), general.state_matrix(mode, friction)
        x = rng.normal(size=len(dense))
        error = 1e-14 * np.linalg.cond(dense)
        np.testing.assert_array_equal(matrix.toarray(), dense)
        np.testing.assert_allclose(matrix.solve(dense @ x), x, atol=error)
        np.testing.assert_allclose(matrix.solve_transposed(x @ dense), x, atol=error)
        assert matrix.sign == np.linalg.slogdet(dense)[0]
    assert algebra.solver.updates >= 5


@pytest.mark.parametrize("seed", range(4))
def test_columns_change_as_those_of_the_dense_jacobian(seed):
    """Between cells that differ at one node, at a few, and everywhere."""
    rng, body = np.random.default_rng(seed), random_body(seed=seed)
    system, general = systems(body, rng.choice([0.0, 0.5, 3.0], P))
    mode = in_modes(body, rng)
    for changed in (1, 3, P):
        other = mode.copy()
        other[rng.choice(P, changed, replace=False)] += rng.integers(1, 4, changed)
        other %= 4
        cells = [Character([sign for m in now for sign in SIGNS[m]]) for now in (mode, other)]
        z = rng.normal(size=system.size)
        before, after = (system.jacobian(z, 0.0, cell) for cell in cells)
        expected = np.subtract(*(general.jacobian(z, 0.0, cell) for cell in cells[::-1]))
        for index in range(system.size + 1):
            change = column(after, index) - column(before, index)
            np.testing.assert_allclose(change, expected[:, index], rtol=1e-15)
        assert expected.any() or changed < P


@pytest.mark.parametrize("seed", range(4))
def test_bordered_systems(seed):
    rng, body = np.random.default_rng(seed), random_body(seed=seed)
    structured, general = systems(body, 0.7)
    z, row = rng.normal(size=(2, structured.size))
    row = np.append(row, 1.0)
    scale = np.ldexp(1.0, rng.integers(-3, 4, len(row)))
    character = structured.character(z, 0.0)
    rhs = rng.normal(size=(3, len(row)))
    factors = [bordered(s.jacobian(z, 0.0, character), row, scale) for s in (structured, general)]
    assert isinstance(factors[1], ScaledFactor)
    for vector in rhs:
        solutions = [factor.solve(vector) for factor in factors]
        np.testing.assert_allclose(*solutions, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(factors[0].solve_all(rhs), factors[1].solve_all(rhs), atol=1e-9)
    assert factors[0].sign == factors[1].sign
    assert not factors[0].is_singular()


@pytest.mark.slow
def test_contract():
    rng = np.random.default_rng(1)
    load = AffineLoad(*rng.normal(size=(2, 2 * P + 3)))
    for system in (
        CoulombLoad(random_body(), load, 0.4),
        CoulombFriction(random_body(), load.f0),
    ):
        report = check_system(system, [(rng.normal(size=system.size), 0.5)])
        assert report, str(report)


class Table:
    """Every row is one of a few of a table."""

    def __init__(self, table, choice):
        self.table, self.keys = table, choice.astype(float)

    def rows(self, which):
        return self.table[self.keys[which].astype(int), which]

    def dense(self):
        return np.asfortranarray(self.rows(np.arange(len(self.keys))))


def random_table(m, kinds=3, seed=0):
    rng = np.random.default_rng(seed)
    return 0.5 * rng.normal(size=(kinds, m, m)) / np.sqrt(m) + np.eye(m)


def test_a_long_run_of_updates_does_not_drift():
    """Solutions after thousands of updates are as good as those by numpy; signs are right."""
    m, rng, table = 60, np.random.default_rng(1), random_table(60)
    solver, choice, checked = Updating(), np.zeros(m, int), 0
    for step in range(4000):
        which = rng.integers(0, m, rng.integers(1, 3))
        choice[which] = rng.integers(0, 3, len(which))
        matrix = Table(table, choice)
        if step % 50 == 0:
            dense, x = matrix.dense(), rng.normal(size=m)
            bound = 1e-12 * np.linalg.cond(dense)
            np.testing.assert_allclose(solver.solve(matrix, dense @ x), x, atol=bound)
            np.testing.assert_allclose(solver.solve_transposed(matrix, x @ dense), x, atol=bound)
            assert solver.sign(matrix) == np.linalg.slogdet(dense)[0]
            checked += 1
        else:
            solver.sign(matrix)
    assert checked == 80
    assert solver.updates > 10 * solver.factorisations


@pytest.mark.parametrize("solves", [1, 8])
def test_many_rows_at_once_are_one_update(solves):
    """Up to a third of the matrix, with changes made one by one before."""
    m, rng, table = 60, np.random.default_rng(2), random_table(60)
    solver, choice = Updating(), np.zeros(m, int)
    for changed in (1, 2, 20, 3, 9, 20):
        choice[rng.choice(m, changed, replace=False)] += 1
        matrix = Table(table, choice := choice % 3)
        dense, x = matrix.dense(), rng.normal(size=m)
        bound = 1e-12 * np.linalg.cond(dense)
        for _ in range(solves):
            np.testing.assert_allclose(solver.solve(matrix, dense @ x), x, atol=bound)
        np.testing.assert_allclose(solver.solve_transposed(matrix, x @ dense), x, atol=bound)
        assert solver.sign(matrix) == np.linalg.slogdet(dense)[0]
    assert (solver.factorisations, solver.updates) == (1, 5)


def test_rows_that_become_equal_together_are_factorised_afresh():
    m, table = 60, random_table(60)
    table[1, :12] = table[1, 12:24]
    solver, choice = Updating(), np.zeros(m, int)
    solver.solve(Table(table, choice), np.ones(m))
    choice[:24] = 1
    assert np.isfinite(solver.solve(Table(table, choice), np.ones(m))).all()
    assert (solver.factorisations, solver.updates) == (2, 0)


def test_a_nearly_singular_matrix_on_the_way():
    """Two equal rows, then others again: factorised, never updated through infinity."""
    m, table = 20, random_table(20)
    table[1, 0] = table[0, 1]
    table[1, 0, 0] += 1e-15
    solver, choice = Updating(), np.zeros(m, int)
    for singular in (0, 1, 0, 1, 0):
        choice[0] = singular
        matrix, x = Table(table, choice), np.ones(m)
        solution = solver.solve(matrix, matrix.dense() @ x)
        assert np.isfinite(solution).all()
        if not singular:
            np.testing.assert_allclose(solution, x, rtol=1e-11)
    assert solver.factorisations >= 3


def test_an_older_matrix_is_still_solved_with():
    table, rhs = random_table(20), np.ones(20)
    solver, one, two = Updating(), np.zeros(20, int), np.zeros(20, int)
    two[3] = 1
    first, second = Table(table, one), Table(table, two)
    for matrix in (first, second, first, second):
        expected = np.linalg.solve(matrix.dense(), rhs)
        np.testing.assert_allclose(solver.solve(matrix, rhs), expected, rtol=1e-12)


def test_drift_is_seen_and_removed():
    matrix, rhs = Table(random_table(20), np.zeros(20, int)), np.ones(20)
    solver, other = Updating(), np.zeros(20, int)
    other[0] = 1
    solver.solve(Table(matrix.table, other), rhs)
    solver.solve(matrix, rhs)  # an update
    solver._inverse[3, 4] += 1e-5
    solution = solver.solve(matrix, rhs)
    assert drifted(rhs, solution, matrix.dense() @ solution)
    assert solver.renew(matrix)
    solution = solver.solve(matrix, rhs)
    assert not drifted(rhs, solution, matrix.dense() @ solution)
    assert not solver.renew(matrix)
