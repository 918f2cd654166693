"""Rough starts: corrected to a true solution, or refused; never a wrong point."""

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, CoulombFriction, CoulombLoad
from pwscont_coulomb.scenes import fig7
from random_bodies import (
    contact_body,
    load_with_several_solutions,
    random_body,
    random_vector,
)
from reference_enumeration import enumerate_solutions

from pwscont import PiecewiseSystem, trace
from pwscont.basics.errors import StartNotFoundError
from pwscont.basics.outcome import Failure
from pwscont.bench.calls import counted
from pwscont.curve.metric import Metric
from pwscont.curve.semismooth import semismooth_newton

TRIES = 40


def rough_starts(size, seed, spread):
    return spread * np.random.default_rng([seed, 7]).normal(size=(TRIES, size))


def corrected(system, z, alpha):
    """Return the solutions at the start's alpha on the component found, None if refused."""
    try:
        graph = trace(system, (z, alpha), (alpha - 1e-3, alpha + 1e-3))
    except StartNotFoundError:
        return None
    return graph


def distance_to(known, z):
    return min(np.abs(found.z - z).max() / (1.0 + np.abs(found.z).max()) for found in known)


def start_of(graph, alpha):
    """Return the corrected start: within a piece it is listed as such."""
    return [p.z for p in graph.special_points("start") if p.alpha == alpha]


def run(system, known, alpha, spread, seed):
    """Return how many starts were corrected; fail on any point that is no solution."""
    count = 0
    for z in rough_starts(system.size, seed, spread):
        graph = corrected(system, z, alpha)
        if graph is None:
            continue
        found = start_of(graph, alpha)
        assert len(found) == 1
        assert distance_to(known, found[0]) < 1e-9
        assert all(distance_to(known, s.z) < 1e-9 for s in graph.solutions(alpha))
        count += 1
    return count


@pytest.mark.parametrize("spread", [0.1, 1.0, 100.0])
@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("friction", [0.3, 2.0])
@pytest.mark.sweep(24)
def test_load_path(p, spread, friction):
    body = random_body(p, seed=11 + p, gap=True)
    load = AffineLoad(*(random_vector(body.n, seed) for seed in (1, 2)))
    system = CoulombLoad(contact_body(body), load, friction)
    known = enumerate_solutions(body, load(0.5), friction)
    assert run(system, known, 0.5, spread, seed=p) > 0.8 * TRIES


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.sweep(4)
def test_friction(p):
    body = random_body(p, seed=21 + p)
    force = random_vector(body.n, 3)
    system = CoulombFriction(contact_body(body), force)
    known = enumerate_solutions(body, force, 1.5)
    assert run(system, known, 1.5, 1.0, seed=p) > 0.8 * TRIES


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(4)
def test_strong_friction_with_several_solutions(seed):
    """With F = 10 Newton may fail; what it finds must still be a solution."""
    body = random_body(2, seed=31 + seed)
    middle, f1 = load_with_several_solutions(body, 10.0, seed), random_vector(body.n, seed)
    load = AffineLoad(middle - 0.5 * f1, f1)
    system = CoulombLoad(contact_body(body), load, 10.0)
    known = enumerate_solutions(body, load(0.5), 10.0)
    assert len(known) > 1
    assert run(system, known, 0.5, 3.0, seed=seed) > 0.5 * TRIES


def test_a_solution_as_start_is_kept():
    body = random_body(2, seed=5)
    load = AffineLoad(*(random_vector(body.n, seed) for seed in (6, 7)))
    system = CoulombLoad(contact_body(body), load, 1.0)
    for found in enumerate_solutions(body, load(0.5), 1.0):
        (start,) = start_of(trace(system, (found.z, 0.5), (0.4, 0.6)), 0.5)
        np.testing.assert_allclose(start, found.z, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("seed", "p"), [(5, 6), (92, 3), (230, 3), (268, 5), (299, 6)])
@pytest.mark.sweep(2)
def test_from_the_body_at_rest_where_no_step_reduces_the_residual(seed, p, monkeypatch):
    """At z = 0 every test vanishes, and the step of one cell need not lead downhill."""
    body = contact_body(random_body(p, seed))
    force = 3.0 * random_vector(body.n, [seed, 7])
    system = CoulombLoad(body, AffineLoad(force, 0.0 * force), [0.3, 1.0, 4.0][seed % 3])
    metric, rest = Metric.of(system, (0.0, 1.0)), np.zeros(system.size)
    x, _ = semismooth_newton(system, metric, rest, 0.0)
    z = x[:-1]
    residual = system.residual(z, 0.0, system.character(z, 0.0))
    assert np.abs(residual).max() < 1e-12 * np.abs(force).max() * p
    monkeypatch.setattr("pwscont.curve.semismooth.MOST_LEAPS", 0)
    assert isinstance(semismooth_newton(system, metric, rest, 0.0), Failure)


class WithoutSolution(PiecewiseSystem):
    """Equations without a solution, whose Jacobian fades away or is zero from the beginning."""

    size = 1
    residuals = (
        lambda z, alpha: np.exp(-z) + 1.0 + alpha**2,
        lambda z, alpha: 1.0 / (1.0 + z**2) + alpha**2,
        lambda z, alpha: z**2 + 1.0 + alpha,
        lambda z, alpha: 1.0 + 0.0 * z,
    )

    def __init__(self, which):
        self.which = which

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return type(self).residuals[self.which](z, alpha)


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize("which", range(len(WithoutSolution.residuals)))
@pytest.mark.parametrize("z", [1.0, -3.0, 20.0])
@pytest.mark.sweep(3)
def test_no_solution_is_no_start(which, z):
    """The regularised step vanishes where the Jacobian does: that is no convergence."""
    with pytest.raises(StartNotFoundError, match="residual is not zero"):
        trace(WithoutSolution(which), ([z], 0.5), (0.0, 1.0))


def test_one_factorisation_is_enough_in_one_affine_cell():
    """Tests that do not bound the cell have other signs at the start than at the solution."""
    system, interval = fig7().system, fig7().interval
    metric, start = Metric.of(system, interval), np.zeros(system.size)
    with counted(system) as calls:
        x, _ = semismooth_newton(system, metric, start, interval[0])
    first, last = system.character(start, interval[0]), system.character(x[:-1], interval[0])
    assert first != last
    assert system.cell(first) == system.cell(last)
    assert (calls["factorisations"], calls["jacobian"], calls["residual"]) == (1, 1, 2)


class StirredReactor(PiecewiseSystem):
    """Conversion z_0 and temperature z_1 satisfy (1 + loss) z_1 = heat z_0, whatever alpha is."""

    size = 2

    def __init__(self, heat, loss):
        self.heat, self.loss = heat, loss

    def test_functions(self, z, alpha):
        return z[1:] - 100.0

    def residual(self, z, alpha, character):
        rate = alpha * (1.0 - z[0]) * np.exp(z[1])
        return np.array([rate - z[0], self.heat * rate - (1.0 + self.loss) * z[1]])

    def jacobian(self, z, alpha, character):
        arrhenius, rest = np.exp(z[1]), 1.0 - z[0]
        rate = arrhenius * np.array([-alpha, alpha * rest, rest])
        own = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 + self.loss, 0.0]])
        return np.array([rate, self.heat * rate]) - own


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize(("heat", "loss"), [(8.0, 0.08), (11.0, 0.1), (14.0, 0.05)])
@pytest.mark.sweep(3)
def test_an_exponential_that_hides_the_residual_is_no_solution(heat, loss):
    """At z_1 = 40 both rows are e^40 times the same: a step of rounding leaves a residual of 30."""
    system, rng = StirredReactor(heat, loss), np.random.default_rng(int(heat))
    metric, found = Metric.of(system, (0.01, 0.3)), 0
    for _ in range(100):
        z, alpha = rng.uniform([-0.5, -5.0], [1.5, 45.0]), rng.uniform(0.01, 0.3)
        if isinstance(root := semismooth_newton(system, metric, z, alpha), Failure):
            continue
        found += 1
        assert (1.0 + loss) * root[0][1] == pytest.approx(heat * root[0][0], abs=1e-6)
    assert found
