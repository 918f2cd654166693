"""Branch points of many unknowns: chains, Bratu's problem, banded matrices."""

import math
from decimal import Decimal, getcontext
from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from smooth_parts import LOCATED, Smooth

from pwscont import (
    BandedJacobian,
    PiecewiseSystem,
    Switched,
    check_system,
    explore,
    trace,
)
from pwscont.basics.errors import InvalidSystemError
from pwscont.extending import StructuredJacobian
from pwscont.linear.factorise import bordered

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command

# -- many unknowns -------------------------------------------------------------------------------


class Chain(Smooth):
    """-u'' = mu u - u^3 with mu = pi^2 (1 + alpha), u = 0 at both ends, by differences.

    The discrete eigenvalues 4 (n + 1)^2 sin^2(k pi / (2 n + 2)) are where branches leave u = 0.
    """

    def __init__(self, n, storage):
        self.size, self.storage = n, storage
        self.h2 = 1.0 / (n + 1) ** 2

    def scale(self, lo, hi):
        return np.full(self.size, math.sqrt(self.size))

    def residual(self, z, alpha, character):
        rest = 2.0 * z - self.h2 * (math.pi**2 * (1.0 + alpha) * z - z**3)
        rest[1:] -= z[:-1]
        rest[:-1] -= z[1:]
        return rest

    def jacobian(self, z, alpha, character):
        bands = np.full((3, self.size), -1.0)
        bands[1] = 2.0 - self.h2 * (math.pi**2 * (1.0 + alpha) - 3.0 * z**2)
        banded = BandedJacobian(bands, 1, 1, -self.h2 * math.pi**2 * z)
        kinds = {
            "banded": lambda j: j,
            "sparse": lambda j: j.tocsc(),
            "dense": lambda j: j.toarray(),
        }
        return kinds[self.storage](banded)


STORAGES = pytest.mark.parametrize("storage", ["banded", "sparse", "dense"])


@pytest.mark.slow
@STORAGES
@pytest.mark.parametrize("n", [4, 40])
@pytest.mark.sweep(10)
def test_buckling(storage, n):
    """Three half-waves: pitchforks at the discrete eigenvalues, each mode with its symmetry."""
    graph = trace(Chain(n, storage), (np.zeros(n), -0.5), (-0.5, 9.0))
    eigenvalues = 4.0 * (n + 1) ** 2 * np.sin(np.arange(1, n + 1) * math.pi / (2 * n + 2)) ** 2
    alphas = eigenvalues / math.pi**2 - 1.0
    expected = alphas[alphas < 9.0]
    found = [p.alpha for p in graph.special_points("branch point") if np.abs(p.z).max() < 1e-9]
    np.testing.assert_allclose(sorted(found), expected, rtol=0, atol=1e-10)
    assert not graph.special_points("stopped")
    assert graph.is_balanced()
    for piece in graph.pieces:
        u = piece.z[-1]
        assert min(np.abs(u - u[::-1]).max(), np.abs(u + u[::-1]).max()) < 1e-9


# -- Bratu ---------------------------------------------------------------------------------------


class Bratu(Smooth):
    """u'' + alpha exp(u) = 0, u = 0 at both ends, by differences at n points."""

    def __init__(self, n, storage="banded"):
        self.size, self.storage = n, storage
        self.h2 = 1.0 / (n + 1) ** 2
        self.jacobians = 0

    def scale(self, lo, hi):
        return np.full(self.size, 4.0 * math.sqrt(self.size))

    def residual(self, z, alpha, character):
        rest = alpha * self.h2 * np.exp(z) - 2.0 * z
        rest[1:] += z[:-1]
        rest[:-1] += z[1:]
        return rest

    def jacobian(self, z, alpha, character):
        self.jacobians += 1
        growth = self.h2 * np.exp(z)
        bands = np.ones((3, self.size))
        bands[1] = alpha * growth - 2.0
        banded = BandedJacobian(bands, 1, 1, growth)
        kinds = {
            "banded": lambda j: j,
            "sparse": lambda j: j.tocsc(),
            "dense": lambda j: j.toarray(),
        }
        return kinds[self.storage](banded)


def bratu_graph(n, storage="banded"):
    return trace(Bratu(n, storage), (np.zeros(n), 0.5), (0.5, 4.0))


def shot(n, c, alpha):
    """Return u at the boundary, shooting from the middle value c, and its derivatives.

    For n odd, by the recurrence in 30 digits: a computation of another kind.
    """
    h2 = 1 / Decimal(n + 1) ** 2
    growth = h2 * c.exp()
    now, by_alpha, by_c = c, Decimal(0), Decimal(1)
    steps = [-alpha * growth / 2, -growth / 2, -alpha * growth / 2]
    for _ in range((n + 1) // 2):
        now, by_alpha, by_c = now + steps[0], by_alpha + steps[1], by_c + steps[2]
        growth = h2 * now.exp()
        steps[0] -= alpha * growth
        steps[1] -= growth * (1 + alpha * by_alpha)
        steps[2] -= alpha * growth * by_c
    return now, by_alpha, by_c


def discrete_fold(n):
    """Return alpha and the middle value where alpha(c) of the discrete equation is largest."""
    getcontext().prec = 30

    def alpha_and_slope(c):
        alpha = Decimal("3.51")
        for _ in range(7):
            end, by_alpha, by_c = shot(n, c, alpha)
            alpha -= end / by_alpha
        return alpha, -by_c / by_alpha

    before, c = Decimal("1.18"), Decimal("1.19")
    slope_before = alpha_and_slope(before)[1]
    for _ in range(6):  # the secant method
        alpha, slope = alpha_and_slope(c)
        before, c, slope_before = c, c - slope * (c - before) / (slope - slope_before), slope
    return float(alpha), float(c)


@pytest.mark.parametrize("n", [5, 101, 301])
@STORAGES
@pytest.mark.sweep(4)
def test_bratu_fold(n, storage):
    if storage == "dense" and n > 200:
        pytest.skip("dense matrices of this size only take time")
    (fold,) = bratu_graph(n, storage).special_points("fold")
    alpha, middle = discrete_fold(n)
    assert fold.alpha == pytest.approx(alpha, abs=LOCATED)
    assert fold.z[n // 2] == pytest.approx(middle, abs=1e-6)


def test_bratu_fold_approaches_that_of_the_differential_equation():
    """The fold is at 8 x^2 / cosh(x)^2 with x tanh(x) = 1; the error falls like h^2."""
    x = 1.2
    for _ in range(60):
        x = 1.0 / math.tanh(x)
    exact = 8.0 * x * x / math.cosh(x) ** 2
    assert exact == pytest.approx(3.513830719, abs=1e-9)
    errors = [exact - bratu_graph(n).special_points("fold")[0].alpha for n in (49, 99, 199, 999)]
    scaled = [error * (n + 1) ** 2 for error, n in zip(errors, (49, 99, 199, 999), strict=True)]
    np.testing.assert_allclose(scaled, scaled[-1], rtol=2e-3)


def test_bratu_at_a_thousand_points():
    system = Bratu(999)
    graph = trace(system, (np.zeros(999), 0.5), (0.5, 4.0))
    assert [count for _, _, count in graph.multiplicity()] == [2, 0]
    assert not graph.special_points("branch point")
    assert graph.balance(1.0) == 0
    for piece in graph.pieces:
        np.testing.assert_allclose(piece.z, piece.z[:, ::-1], rtol=0, atol=1e-8)
    points = sum(len(piece.points) for piece in graph.pieces)
    assert system.jacobians < 6 * points  # location of the fold included


def test_storages_give_one_graph():
    graphs = [bratu_graph(30, storage) for storage in ("banded", "sparse", "dense")]
    for graph in graphs[1:]:
        assert len(graph.pieces) == 2
        for a, b in zip(graph.pieces, graphs[0].pieces, strict=True):
            assert a.det_sign == b.det_sign
            np.testing.assert_allclose(a.points[[0, -1]], b.points[[0, -1]], rtol=0, atol=1e-7)


# -- banded matrices -----------------------------------------------------------------------------


def random_banded(n, lower, upper, seed):
    rng = np.random.default_rng(seed)
    return BandedJacobian(rng.normal(size=(lower + upper + 1, n)), lower, upper, rng.normal(size=n))


WIDTHS = [(1, 1, 1), (2, 1, 1), (3, 1, 1), (9, 1, 1), (8, 0, 0), (8, 2, 1), (8, 0, 3), (8, 3, 0)]


@pytest.mark.parametrize(("n", "lower", "upper"), WIDTHS)
def test_banded_jacobian_is_the_matrix_that_it_stands_for(n, lower, upper):
    banded = random_banded(n, lower, upper, seed=n)
    dense = banded.toarray()
    assert dense.shape == banded.shape == (n, n + 1)
    for i in range(n):
        for j in range(n):
            inside = -upper <= i - j <= lower
            assert dense[i, j] == (banded.bands[upper + i - j, j] if inside else 0.0)
    x = np.random.default_rng(1).normal(size=n + 1)
    np.testing.assert_allclose(banded @ x, dense @ x, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(abs(banded).toarray(), np.abs(dense))
    np.testing.assert_array_equal(np.asarray(banded), dense)
    np.testing.assert_array_equal(banded.tocsc().toarray(), dense)


@pytest.mark.parametrize(("n", "lower", "upper"), WIDTHS)
@pytest.mark.parametrize("storage", ["banded", "sparse"])
@pytest.mark.parametrize("seed", range(3))
def test_bordered_factors(n, lower, upper, storage, seed):
    rng = np.random.default_rng(seed)
    banded, row = random_banded(n, lower, upper, seed), rng.normal(size=n + 1)
    units = 10.0 ** rng.integers(-6, 7, size=n + 1)
    jacobian = BandedJacobian(banded.bands / units[:-1], lower, upper, banded.column / units[-1])
    matrix = np.vstack([banded.toarray(), row])
    given = jacobian if storage == "banded" else jacobian.tocsc()
    found = bordered(given, row / units, 2.0 ** np.ceil(np.log2(units)))
    rhs = rng.normal(size=n + 1)
    expected = np.linalg.solve(matrix, rhs) * units
    bound = 1e-14 * np.linalg.cond(matrix) * np.abs(expected / units).max()
    assert np.abs((found.solve(rhs) - expected) / units).max() <= bound
    assert found.sign == np.sign(np.linalg.det(matrix))
    assert not found.failed
    assert not found.is_singular()


@pytest.mark.parametrize("storage", ["banded", "sparse"])
@pytest.mark.parametrize("shift", [0.0, 1e-15, 1e-12, 1e-9, 1e-4])
@pytest.mark.parametrize("n", [2, 7, 200])
def test_bordered_factor_at_and_near_a_fold(storage, shift, n):
    """The banded part is singular but for the shift, the bordered matrix is not."""
    bands = np.ones((3, n))
    bands[1] = -2.0
    bands[1, [0, -1]] = -1.0  # the constants are its null space
    bands[1] += shift
    jacobian = BandedJacobian(bands, 1, 1, np.linspace(1.0, 2.0, n))
    row = np.append(np.linspace(1.0, 0.5, n), 0.3)
    matrix = np.vstack([jacobian.toarray(), row])
    found = bordered(jacobian if storage == "banded" else jacobian.tocsc(), row, np.ones(n + 1))
    exact = np.random.default_rng(n).normal(size=n + 1)
    error = np.abs(found.solve(matrix @ exact) - exact).max()
    assert error <= 1e-15 * np.linalg.cond(matrix) + 1e-14
    assert found.sign == np.linalg.slogdet(matrix)[0]
    assert not found.is_singular()


@pytest.mark.parametrize("storage", ["banded", "sparse"])
def test_singular_bordered_matrices_are_told(storage):
    n = 6
    bands = np.ones((3, n))
    bands[1] = -2.0
    bands[1, [0, -1]] = -1.0
    column = np.arange(n) - 2.5  # orthogonal to the null space: still singular
    jacobian = BandedJacobian(bands, 1, 1, column)
    given = jacobian if storage == "banded" else jacobian.tocsc()
    assert bordered(given, np.append(np.ones(n), 1.0), np.ones(n + 1)).is_singular()
    zero = BandedJacobian(np.zeros((3, n)), 1, 1, np.zeros(n))
    given = zero if storage == "banded" else zero.tocsc()
    assert bordered(given, np.ones(n + 1), np.ones(n + 1)).is_singular()


def test_bands_of_the_wrong_shape_are_told():
    with pytest.raises(InvalidSystemError, match=r"bands has shape \(2, 4\).*\(3, 4\)"):
        BandedJacobian(np.ones((2, 4)), 1, 1, np.ones(4))


@STORAGES
def test_check_system_reads_every_storage(storage):
    points = [(np.linspace(0.1, 0.4, 5), 1.0), (np.zeros(5), 2.0)]
    assert check_system(Bratu(5, storage), points)
    wrong = Bratu(5, storage)
    wrong.h2 *= 1.5
    wrong.residual = Bratu(5).residual
    assert not check_system(wrong, points)


@STORAGES
def test_a_rough_start_is_corrected_in_every_storage(storage):
    graph = trace(Bratu(20, storage), (np.full(20, 0.6), 3.0), (2.0, 4.0))
    assert [count for _, _, count in graph.multiplicity()] == [2, 0]


def test_sparse_duplicates_are_added_up():
    """A matrix assembled from elements holds entries in parts."""
    parts = sp.coo_matrix(([1.0, 1.0, 3.0, 1.0], ([0, 0, 1, 0], [0, 0, 1, 2])), shape=(2, 3))
    row = np.array([0.0, 0.0, 1.0])
    found = bordered(parts, row, np.ones(3)).solve(np.array([3.0, 6.0, 1.0]))
    np.testing.assert_allclose(found, [1.0, 2.0, 1.0], rtol=1e-15)


class Hysteresis(PiecewiseSystem):
    """z^3 - 3 d z = alpha: folds at z = -+sqrt(d), alpha = +-2 d sqrt(d)."""

    size = 1

    def __init__(self, d):
        self.d = d

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return z**3 - 3.0 * self.d * z - alpha

    def jacobian(self, z, alpha, character):
        return np.array([[3.0 * z[0] ** 2 - 3.0 * self.d, -1.0]])


@pytest.mark.parametrize("d", [1e-1, 1e-2, 2.25e-4, 1e-5, 5e-6])
@pytest.mark.parametrize("z", [-0.99, -0.93, -0.87])
@pytest.mark.sweep(6)
def test_two_folds_within_one_step(d, z):
    """The default step is 0.1; the folds are apart by 0.6 down to 0.005."""
    graph = trace(Hysteresis(d), ([z], z**3 - 3.0 * d * z), (-1.0, 1.0))
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    np.testing.assert_allclose(folds, [-2.0 * d**1.5, 2.0 * d**1.5], rtol=0, atol=1e-12)
    assert graph.count(0.0) == 3
    assert graph.balances() == [1, 1, 1]


@pytest.mark.parametrize("d", [0.0, -1e-6])
def test_an_inflection_is_no_fold(d):
    graph = trace(Hysteresis(d), ([-0.93], (-0.93) ** 3 + 2.79 * d), (-1.0, 1.0))
    assert graph.special_points("fold") == []
    assert len(graph.pieces) == 1


def competing_species(size: int, seed: int, member: int):
    """Species with constant effects on each other; each may be extinct (Lotka and Volterra)."""
    rng = np.random.default_rng([seed, member, size])
    signs = rng.uniform(-1, 1, (size, size)), rng.choice([1, 1, -1], size)
    effects = signs[0] + 1.5 * np.eye(size) * signs[1]
    rate, change = rng.uniform(-1, 1, size), rng.uniform(-1, 1, size)

    def solutions(alpha):
        for alive in product([False, True], repeat=size):
            z, some = np.zeros(size), np.array(alive)
            z[some] = np.linalg.solve(effects[np.ix_(some, some)], (rate + alpha * change)[some])
            yield z

    return Switched(size, lambda z, a, sw: z * (rate + a * change - effects @ z)), solutions


@pytest.mark.slow
@pytest.mark.parametrize(("size", "seed", "member"), [(2, 2, 10), (2, 3, 15), (3, 3, 7)])
def test_branch_points_within_one_step_divide_the_piece_that_passed_over_them(size, seed, member):
    """One step passes over two branch points, or Newton leads to the third of three."""
    system, solutions = competing_species(size, seed, member)
    graph = explore(system, (-1.0, 1.0))
    assert graph.guarantee == "balanced"
    for alpha in (-0.83, -0.61, -0.27, -0.05, 0.21, 0.48, 0.77):
        found = [solution.z for solution in graph.solutions(alpha)]
        assert len(found) == graph.count(alpha) == 2**size
        for z in solutions(alpha):
            assert any(np.allclose(z, other, rtol=1e-7, atol=1e-9) for other in found)


class OwnKind(StructuredJacobian):
    """A dense matrix in a class of its own, whose columns are multiplied in that class."""

    def __init__(self, matrix):
        self.matrix, self.shape = matrix, matrix.shape

    def __matmul__(self, x):
        return self.matrix @ x

    def __rmatmul__(self, y):
        return y @ self.matrix

    def __abs__(self):
        return np.abs(self.matrix)

    def toarray(self):
        return self.matrix

    def bordered(self, row, scale):
        return None

    def scaled(self, columns):
        return OwnKind(self.matrix * columns)


class CrossedLines(PiecewiseSystem):
    """z (z - alpha) = 0: two lines, which cross at zero."""

    size = 1

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return z * (z - alpha)

    def jacobian(self, z, alpha, character):
        return OwnKind(np.array([[2.0 * z[0] - alpha, -z[0]]]))


def test_a_jacobian_of_a_users_own_kind_at_a_branch_point():
    graph = explore(CrossedLines(), (-1.0, 1.0))
    (point,) = graph.special_points("branch point")
    assert abs(point.alpha) < 1e-12
    assert [graph.count(alpha) for alpha in (-0.5, 0.0, 0.5)] == [2, 1, 2]


# -- matrices whose eigenvectors are smooth, or belong to one eigenvalue ---------------------------


class Graph(Smooth):
    """L z = alpha (z - z^3): branches leave z = 0 where alpha is an eigenvalue of L."""

    def __init__(self, laplacian):
        self.laplacian, self.size = laplacian, len(laplacian)

    def residual(self, z, alpha, character):
        return self.laplacian @ z - alpha * (z - z**3)

    def jacobian(self, z, alpha, character):
        by_z = self.laplacian - alpha * np.diag(1.0 - 3.0 * z**2)
        return np.column_stack([by_z, z**3 - z])

    def followed(self, interval):
        return trace(self, (np.zeros(self.size), interval[0]), interval)


def grid(rows, columns, weight):
    """Return the matrix of a grid with zero beyond; eigenvalues are sums of those of two chains."""
    across, along = (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1) for n in (rows, columns))
    return np.kron(across, np.eye(columns)) + weight * np.kron(np.eye(rows), along)


@pytest.mark.parametrize(("side", "weight"), [(6, 0.999), (7, 0.9999), (7, 0.99)])
def test_smooth_modes_of_a_grid_within_a_step(side, weight):
    """Nearly square: the second and the third eigenvalue are close, with no other nearby."""
    one, two = 2.0 - 2.0 * np.cos(np.pi * np.array([1.0, 2.0]) / (side + 1))
    second, third = weight * two + one, two + weight * one
    gap, apart = two - one, third - second
    second, third, apart = min(second, third), max(second, third), abs(apart)
    graph = Graph(grid(side, side, weight)).followed((second - 0.4 * gap, third + 0.4 * gap))
    places = second - 0.1 * gap, second + 0.5 * apart, third + 0.2 * apart
    assert [graph.count(alpha) for alpha in places] == [1, 3, 5]


@pytest.mark.parametrize(("leaves", "side"), [(29, 0), (0, 7)])
def test_an_eigenvalue_of_even_multiplicity_is_marked(leaves, side):
    """A star, 1 of multiplicity 28; a square grid, its second eigenvalue of multiplicity 2."""
    if side:
        matrix = grid(side, side, 1.0)
    else:
        matrix = np.eye(leaves + 1)
        matrix[0, 0], matrix[0, 1:], matrix[1:, 0] = leaves, -1.0, -1.0
    values = np.linalg.eigvalsh(matrix)
    graph = Graph(matrix).followed((values[1] - 0.4, values[1] + 0.3 * (values[3] - values[0])))
    assert f"curves touch, or more than two cross, at alpha = {values[1]:.3g}" in graph.guarantee
