"""Corners with too many cells: the ways on by perturbation, against all rays by brute force."""

from itertools import product

import numpy as np
import pytest
from sweeps import swept

from pwscont import Block, Character, PiecewiseLinearSystem, Switched, trace
from pwscont.curve.metric import Metric
from pwscont.system.selection import Selection
from pwscont.transitions.cone import rays_cell_by_cell
from pwscont.transitions.corner import Corner
from pwscont.transitions.corner_paths import rays_by_perturbation


class Cone(PiecewiseLinearSystem):
    """A z + B |T z| = alpha b, in which all tests T z vanish at zero."""

    def __init__(self, A, B, b, T=None):
        self.A, self.B, self.b = A, B, b
        self.T = np.eye(len(A)) if T is None else T
        self.size = len(A)

    def test_functions(self, z, alpha):
        return self.T @ z

    def matrix(self, signs):
        side = np.where(signs, 1.0, -1.0)
        return np.column_stack([self.A + self.B @ (side[:, None] * self.T), -self.b])

    def residual(self, z, alpha, character):
        return self.matrix(character.array) @ np.append(z, alpha)

    def jacobian(self, z, alpha, character):
        return self.matrix(character.array)

    def off(self, d):
        """Return the residual of a unit direction."""
        return np.abs(self.matrix(self.T @ d[:-1] >= 0.0) @ d).max()

    def rays(self):
        """Return all rays, and their orientations, by brute force; None at degenerate corners."""
        found = []
        for signs in product((True, False), repeat=len(self.T)):
            matrix = self.matrix(signs)
            _, sizes, V = np.linalg.svd(matrix)
            slopes = np.where(signs, 1.0, -1.0) * (self.T @ V[-1, :-1])
            if sizes[-1] < 1e-9 or np.abs(slopes).min() < 1e-9:
                return None
            if (slopes > 0.0).all() or (slopes < 0.0).all():
                d = V[-1] * np.sign(slopes[0])
                found.append((d, np.sign(np.linalg.det(np.vstack([matrix, d])))))
        return found


def random_cone(seed, k, strength):
    rng = np.random.default_rng([seed, k])
    A, B, b = rng.normal(size=(k, k)), strength * rng.normal(size=(k, k)), rng.normal(size=k)
    return Cone(A, B, b)


def apex(system):
    """Return the corner at zero."""
    x, metric = np.zeros(system.size + 1), Metric(np.ones(system.size + 1))
    return Corner.at(system, metric, x, x[np.newaxis], frozenset(range(len(system.T))))


def found_from(system, back=None):
    """Return the directions that the perturbation finds, of unit length."""
    along = None if back is None else (back, (system.character(back[:-1], 0.0),))
    return [d for d, _ in rays_by_perturbation(apex(system), along)]


def place(d, among):
    (where,) = np.flatnonzero([np.abs(d - other).max() < 1e-8 for other in among])
    return int(where)


@pytest.mark.parametrize("strength", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("k", [1, 2, 3, 5, 7])
@pytest.mark.sweep(21)
def test_ways_on_are_among_the_rays_of_brute_force(k, strength):
    """From each ray another is found; without one a path has two ends, or is closed."""
    several = 0
    for seed in range(24):
        system = random_cone(seed, k, strength)
        rays = system.rays()
        assert sum(sign for _, sign in rays) == 0
        directions = [d for d, _ in rays]
        several += len(rays) > 2
        for back in directions:
            found = {place(d, directions) for d in found_from(system, back)}
            assert place(back, directions) in found
            assert len(found) > 1
        assert len({place(d, directions) for d in found_from(system)}) != 1
    assert several or k < 3 or strength < 1.0


@pytest.mark.parametrize("k", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (3, 4, 6))])
def test_degenerate_cones(k):
    """Small integers make faces, ties and rays along interfaces: what is found solves H' = 0."""
    degenerate = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, k])
        A, B = rng.integers(-1, 2, size=(2, k, k)).astype(float)
        system = Cone(A, B, rng.integers(-1, 2, size=k).astype(float))
        rays = system.rays()
        degenerate += rays is None
        for d in found_from(system):
            assert system.off(d) < 1e-12
            if rays is not None:
                place(d, [ray for ray, _ in rays])
    assert degenerate > 10


@pytest.mark.parametrize("seeds", swept([range(10)], [range(10, 40)]))
def test_tests_that_vanish_together_everywhere(seeds):
    """Twins of each test, with other factors, change sign together: tied data."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        k = 4
        A, B, b = rng.normal(size=(k, k)), rng.normal(size=(k, k)), rng.normal(size=k)
        alone = Cone(A, B, b)
        factors = np.array([1.0, -2.0, 0.5, 3.0])
        T = np.vstack([np.eye(k), np.diag(factors)])
        twins = Cone(A, np.hstack([0.25 * B, 0.75 * B / np.abs(factors)]), b, T)
        directions = [d for d, _ in alone.rays()]
        for back in directions:
            found = {place(d, directions) for d in found_from(twins, back)}
            assert len(found) > 1


class Switches(Cone):
    """Each test switches a row of its own."""

    def blocks(self):
        return tuple(Block((k,), (k,), ((True,), (False,))) for k in range(self.size))


@pytest.mark.parametrize("k", [2, 3, 4, 5])
@pytest.mark.sweep(2)
def test_switches_have_the_rays_of_brute_force(k):
    """Cell by cell; several rays, and folds, among them."""
    several = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, k])
        A, b = rng.normal(size=(k, k)), rng.normal(size=k)
        system = Switches(A, np.diag(rng.normal(size=k) * 2.0), b)
        rays, found = system.rays(), rays_cell_by_cell(apex(system))
        assert found is not None
        assert len(found) == len(rays)
        several += len(rays) > 2
        directions = [d for d, _ in rays]
        assert len({place(d, directions) for d, _ in found}) == len(rays)
        for d, (character,) in found:
            assert (character.array == (d[:-1] > 0.0)).all()
    assert several > 3


class Chain(PiecewiseLinearSystem):
    """z + max(z, 0) = coupling (left + right) + alpha b: diodes with equal thresholds."""

    def __init__(self, n, coupling, b):
        self.size, self.b = n, b
        self.couplings = coupling * (np.eye(n, k=1) + np.eye(n, k=-1))

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return z + character.array * z - self.couplings @ z - alpha * self.b

    def state(self, alpha):
        """Return the only solution, by iteration: the coupling contracts."""
        z = np.zeros(self.size)
        for _ in range(200):
            right = self.couplings @ z + alpha * self.b
            z = np.where(right > 0.0, 0.5 * right, right)
        return z


@pytest.mark.parametrize("n", [16, *(pytest.param(n, marks=pytest.mark.slow) for n in (50, 200))])
def test_chains_of_diodes_coupled_in_both_directions(n):
    chain = Chain(n, 0.2, np.random.default_rng(n).normal(size=n))
    graph = trace(chain, (np.zeros(n), -1.0), (-1.0, 1.0))
    for alpha in (-0.5, 0.5, 1.0):
        (solution,) = graph.solutions(alpha)
        np.testing.assert_allclose(solution.z, chain.state(alpha), rtol=0, atol=1e-12)
    (corner,) = graph.special_points("corner searched in part")
    assert "one way on, possibly of several" in corner.message
    assert "complete" not in graph.guarantee
    assert "a corner was searched in part" in graph.guarantee


def test_a_start_at_a_corner_with_many_cells():
    chain = Chain(30, 0.2, np.random.default_rng(0).normal(size=30))
    graph = trace(chain, (np.zeros(30), 0.0), (-1.0, 1.0))
    for alpha in (-0.7, 0.7):
        (solution,) = graph.solutions(alpha)
        np.testing.assert_allclose(solution.z, chain.state(alpha), rtol=0, atol=1e-12)


def test_a_promise_of_uniqueness_makes_two_ways_all_there_are():
    chain = Chain(20, 0.2, np.random.default_rng(1).normal(size=20))
    chain.unique = True
    graph = trace(chain, (np.zeros(20), -1.0), (-1.0, 1.0))
    assert graph.special_points("corner")
    assert graph.guarantee.startswith("complete")


@pytest.mark.slow
def test_curved_formula_whose_many_kinks_meet_at_one_point():
    n = 24
    weights = 0.3 * np.cos(np.arange(n * n).reshape(n, n)) / np.sqrt(n)

    def residual(z, alpha, sw):
        return z + 0.1 * z**3 - sw.max(weights @ z + alpha, 0.0)

    # 1 > |W| makes z -> max(W z + alpha, 0) a contraction: one solution at each alpha
    assert np.linalg.norm(weights, 2) < 1.0
    graph = trace(Switched(n, residual), (np.zeros(n), -1.0), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.5, 0.5)] == [1, 1]
    assert "a corner was searched in part" in str(graph.guarantee)


@pytest.mark.parametrize("seed", swept(range(20), range(20, 400)))
@pytest.mark.sweep(4)
def test_slopes_that_are_zero_in_integers_are_level_whatever_the_rounding(seed):
    """Rows are mixed, or entries of 1e-17 stand where symmetry makes zero."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    ray = np.append(rng.choice([-3.0, -2.0, -1.0, 0.0, 0.0, 1.0, 2.0], n), 1.0)
    matrix = rng.integers(-4, 5, (n, n + 1)) * (rng.random((n, n + 1)) < 0.5) + 6.0 * np.eye(
        n, n + 1
    )
    matrix[:, -1] = -matrix[:, :-1] @ ray[:-1]
    if seed % 2:
        matrix = matrix + 1e-17 * rng.normal(size=matrix.shape)
    else:
        matrix = rng.uniform(0.5, 2.0, (n, 1)) * matrix
    system = Cone(matrix[:, :-1], np.zeros((n, n)), -matrix[:, -1]).within(-1.0, 1.0)
    metric = Metric.of(system, (-1.0, 1.0))
    corner = Corner.at(system, metric, np.zeros(n + 1), np.zeros((1, n + 1)), frozenset(range(n)))
    found = corner.ray_in(Selection(system, Character([True] * n)))
    if np.linalg.cond(matrix[:, :-1]) < 50.0:
        assert found is not None
        np.testing.assert_array_equal(found[1] == 0.0, ray[:-1] == 0.0)
