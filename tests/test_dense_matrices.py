"""Dense matrices: factorised in their own room, changed by rank one, handed on from a start."""

import numpy as np
import pytest
import scipy.sparse as sp

from pwscont import PiecewiseLinearSystem, trace
from pwscont.basics.arrays import power_of_two
from pwscont.basics.rounding import EPS
from pwscont.linear.factor import MOST_CHANGES_KEPT, ProductForm
from pwscont.linear.factorise import Rows, bordered, factor, inner

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

SIZES = [1, 2, 5, 31, 32, 33, 120]


def in_units(n, seed):
    """Return a Jacobian (n, n + 1) in units of many magnitudes, and typical magnitudes."""
    rng = np.random.default_rng([n, seed])
    scale, rows = 10.0 ** rng.integers(-8, 9, size=n + 1), 10.0 ** rng.integers(-8, 9, size=n)
    plain = rng.normal(size=(n, n + 1)) + np.sqrt(n) * np.eye(n, n + 1)
    return rows[:, np.newaxis] * plain / scale, power_of_two(scale)


def defect(matrix, solution, rhs):
    """Return how far a solution is off, as a part of the terms of each row."""
    terms = np.abs(matrix) @ np.abs(solution) + np.abs(rhs)
    return float((np.abs(matrix @ solution - rhs) / terms).max())


# -- factorisations --------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("n", SIZES)
def test_the_part_for_z_is_factorised_and_the_jacobian_is_not_written_to(n, order):
    jacobian, scale = in_units(n, 0)
    given = np.asarray(jacobian, order=order)
    core, rhs = inner(given, scale), jacobian @ np.ones(n + 1)
    np.testing.assert_array_equal(given, jacobian)
    assert defect(jacobian[:, :-1], core.solve(rhs), rhs) < 1e-13
    assert core.sign == np.linalg.slogdet(jacobian[:, :-1] * scale[:-1])[0]


@pytest.mark.parametrize("n", SIZES)
def test_a_matrix_is_solved_with_after_it_was_looked_at_as_before(n):
    jacobian, scale = in_units(n, 2)
    row = np.random.default_rng(n).normal(size=n + 1) / scale
    factor, rhs = bordered(jacobian, row, scale), np.append(jacobian @ scale, row @ scale)
    before, sign = factor.solve(rhs), factor.sign
    assert [factor.is_singular() for _ in range(3)] == [False] * 3
    np.testing.assert_array_equal(factor.solve(rhs), before)
    assert factor.sign == sign
    np.testing.assert_allclose(before / scale, np.ones(n + 1), rtol=1e-8)


@pytest.mark.parametrize("n", SIZES)
def test_a_singular_matrix_stays_singular(n):
    jacobian, scale = in_units(n, 3)
    row = 3.0 * jacobian[0] / np.abs(jacobian[0] * scale).max()
    factor = bordered(jacobian, row, scale)
    assert factor.is_singular()
    assert factor.is_singular()


@pytest.mark.parametrize("stored", [np.asarray, sp.csr_array])
@pytest.mark.parametrize("n", SIZES)
def test_a_matrix_in_any_units_and_its_transpose_are_solved_with(n, stored):
    jacobian, scale = in_units(n, 4)
    matrix, rhs = jacobian[:, :-1], np.random.default_rng(n).normal(size=n)
    made = factor(stored(matrix), scale[:-1])
    right, left = np.abs(matrix) @ scale[:-1] * rhs, rhs / scale[:-1]
    assert defect(matrix, made.solve(right), right) < 1e-12
    assert defect(matrix.T, made.solve_transposed(left), left) < 1e-12
    assert made.sign == np.linalg.slogdet(matrix * scale[:-1])[0]
    assert not made.is_singular()


# -- changes of rank one ---------------------------------------------------------------------------


def changed(seed, smallest):
    """Return a matrix after changes of its rows, its factorisation and changes, and their rounding.

    Some pivots are small. The inverse of a matrix M on the way errs by n EPS cond(M) |M^-1|. All
    changes after M together multiply that error by M, and by the last inverse: what is left of the
    error, beside the last inverse, is at most n EPS cond(M)^2 for every M on the way.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 60))
    first = rng.normal(size=(n, n)) + 2.0 * np.sqrt(n) * np.eye(n)
    made = ProductForm(factor(first.copy(), np.ones(n)), n)
    matrix, undone, units = first.copy(), [], np.eye(n)
    rounding = EPS * np.linalg.cond(first) ** 2
    for _ in range(MOST_CHANGES_KEPT):
        row, difference = int(rng.integers(n)), rng.normal(size=n)
        w = made.solve(units[row])
        if undone and rng.random() < 0.4:
            row, difference = undone.pop()
            w = made.solve(units[row])
        elif not undone and rng.random() < 0.3:  # nearly singular, until that is undone
            pivot = smallest ** rng.random() * rng.choice([-1.0, 1.0])
            difference -= (1.0 + difference @ w - pivot) / (w @ w) * w
            undone.append((row, -difference))
        if made.change(w, difference):
            matrix[row] += difference
            rounding += EPS * np.linalg.cond(matrix) ** 2
    return matrix, made, n * rounding


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.sweep(6)
def test_changes_lead_to_the_matrix_as_it_is(seed):
    matrix, made, bound = changed(seed, 1e-3)
    rng = np.random.default_rng(seed)
    assert made.count > MOST_CHANGES_KEPT // 2
    rhs = rng.normal(size=(3, len(matrix)))
    exact = np.linalg.solve(matrix, rhs.T).T
    for solved in (made.solve_all(rhs), [made.solve(one) for one in rhs]):
        np.testing.assert_allclose(solved, exact, rtol=0.0, atol=bound * np.abs(exact).max())


@pytest.mark.parametrize("seed", range(10))
def test_a_factorisation_and_its_changes_are_one_of_the_changed_matrix(seed):
    rng, n = np.random.default_rng(seed), 12
    matrix = rng.normal(size=(n, n))
    made = ProductForm(factor(matrix, np.ones(n)), n)
    for _ in range(9):
        c, g, rhs = rng.normal(size=(3, n))
        assert made.change(made.solve(c), g)
        matrix += np.outer(c, g)
        bound = 1e-11 * np.linalg.cond(matrix)
        np.testing.assert_allclose(made.solve(matrix @ rhs), rhs, atol=bound)
        assert made.sign == np.linalg.slogdet(matrix)[0]


def test_a_change_that_loses_its_digits_is_not_taken():
    made, w = ProductForm(factor(np.eye(3), np.ones(3)), 3), np.array([1.0, 1e9, 0.0])
    assert made.change(w, np.array([-1.0 + 1e-12, 0.0, 0.0])) == 0.0
    assert made.change(w, np.array([1.0, -1e-9, 0.0])) == pytest.approx(1.0)
    assert made.count == 1


# -- constant rows ---------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [float, int, np.float32])
@pytest.mark.parametrize("part", [0.0, 0.02, 0.5])
@pytest.mark.parametrize("shape", [(20, 30), (300, 200)])
def test_rows_are_kept_as_they_were(shape, part, dtype):
    rng = np.random.default_rng(1)
    given = np.where(rng.random(shape) < part, rng.integers(-9, 10, shape), 0).astype(dtype)
    for matrix in (given.copy(), np.asfortranarray(given)):
        rows = Rows(matrix)
        matrix[:] = 7
        x = rng.normal(size=shape[1])
        np.testing.assert_allclose(rows.matrix.dot(x), given.astype(float) @ x, atol=1e-12)
        np.testing.assert_array_equal(rows.one(shape[0] - 1), given[-1])
        np.testing.assert_array_equal(rows.some(np.array([3, 0])), given[[3, 0]])


# -- starts ----------------------------------------------------------------------------------------


class Absolute(PiecewiseLinearSystem):
    """A z + b |z| = q + alpha q1, written into one array, with a test that bounds nothing."""

    def __init__(self, n, seed):
        rng = np.random.default_rng(seed)
        self.size, self.A = n, rng.normal(size=(n, n)) + 4.0 * np.sqrt(n) * np.eye(n)
        self.b, (self.q, self.q1) = rng.uniform(0.2, 0.8, size=n), rng.normal(size=(2, n))
        self._buffer = np.empty((n, n + 1))

    def test_functions(self, z, alpha):
        return np.append(z, alpha)

    def test_jacobian(self, z, alpha):
        return np.eye(self.size + 1)

    def bounding_tests(self, character):
        return np.arange(self.size)

    def signs(self, character):
        return np.where(character.array[:-1], 1.0, -1.0)

    def residual(self, z, alpha, character):
        return self.A @ z + self.b * self.signs(character) * z - self.q - alpha * self.q1

    def jacobian(self, z, alpha, character):
        self._buffer[:, :-1] = self.A + np.diag(self.b * self.signs(character))
        self._buffer[:, -1] = -self.q1
        return self._buffer

    def scale(self, lo, hi):
        return np.ones(self.size)

    def true(self, alpha):
        """Return the only solution, by a fixed point of its signs."""
        z = np.zeros(self.size)
        for _ in range(100):
            z = np.linalg.solve(self.A + np.diag(self.b * np.sign(z)), self.q + alpha * self.q1)
        return z


@pytest.mark.parametrize("n", [2, 9, 40])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.sweep(6)
def test_pieces_from_rough_starts_are_those_of_the_system(n, seed):
    """Newton crosses cells on its way, and its matrix is one that the system writes to."""
    system = Absolute(n, seed)
    start = 10.0 * np.random.default_rng(seed).normal(size=n)
    graph = trace(system, (start, 0.3), (-2.0, 2.0))
    for alpha in (-2.0, -0.7, 0.3, 1.1, 2.0):
        (found,) = graph.solutions(alpha)
        np.testing.assert_allclose(found.z, system.true(alpha), atol=1e-12)
