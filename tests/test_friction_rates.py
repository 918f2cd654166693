"""Rates of bodies with friction: proofs of uniqueness against all modes (docs/theory, F17)."""

import numpy as np
import pytest
from evolution_truth import random_problem, statics
from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb
from pwscont_coulomb.quasi_static.rates import RateProblem
from sweeps import swept

from pwscont import enumerate_solutions, evolve

pytestmark = pytest.mark.sweep(6)  # the others take too long for the README's command


def rate_problem(seed, most=5.0):
    """Return a random rate problem of nodes without force and nodes at the bound, F up to most."""
    rng = np.random.default_rng(seed)
    free, bound = int(rng.integers(0, 3)), int(rng.integers(1, 4))
    p = free + bound
    root = rng.normal(size=(2 * p, 2 * p))
    K, node = root @ root.T + 0.2 * np.eye(2 * p), np.arange(p)
    columns = np.concatenate([node[:free], p + node])
    rows = np.concatenate([columns, node[free:]])
    row = {int(r): k for k, r in enumerate(rows)}
    sign = np.concatenate([np.zeros(free), rng.choice([-1, 1], bound)]).astype(int)
    places = [np.array([row[int(i)] for i in some]) for some in (node, p + node)]
    h = rng.normal(size=len(rows))
    return RateProblem(K[np.ix_(rows, columns)], h, rng.uniform(0.1, most, p), sign, *places)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.sweep(18)
def test_the_two_searches_for_rates_agree(seed):
    """Uniqueness with decided nodes, and linear programs over all modes (docs/theory, F17)."""
    problem = rate_problem(seed)
    one = problem.all_rates(dict.fromkeys(range(problem.count), 1))
    other = problem.listed()
    assert len(one.found) == len(other.found)
    for rates in one.found:
        assert min(np.abs(rates.x - o.x).max() for o in other.found) < 1e-9


@pytest.mark.parametrize("seed", swept(range(60), range(60, 600)))
@pytest.mark.sweep(18)
def test_rates_that_are_called_unique_are_unique(seed):
    """All modes are tried under four loads: never two solutions (docs/theory, F17)."""
    rng = np.random.default_rng([17, seed])
    problem = rate_problem(seed, most=float(rng.choice([0.5, 1.0, 2.0, 5.0])))
    if problem.doubt({}) is not None:
        return
    for _ in range(4):
        problem.h = rng.normal(size=len(problem.h))
        assert len(problem.listed().found) == 1


@pytest.mark.parametrize("seed", swept(range(80), range(80, 1500)))
@pytest.mark.sweep(18)
def test_a_solution_that_is_called_the_only_one_is(seed):
    """All modes are tried; of several solutions none may be called the only one (F17)."""
    rng = np.random.default_rng([18, seed])
    problem = rate_problem(seed, most=float(rng.choice([1.0, 2.0, 5.0, 12.0])))
    found = problem.listed().found
    certain = [problem.others({}, rates.x) is None for rates in found]
    assert len(found) == 1 or not any(certain)


@pytest.mark.slow
def test_a_known_solution_makes_more_rates_certain():
    """Among unique rates at high friction, far more are certain than for every load."""
    known = every = 0
    for seed in range(60):
        problem = rate_problem(seed)
        found = problem.listed().found
        if len(found) == 1:
            known += problem.others({}, found[0].x) is None
            every += problem.doubt({}) is None
    assert known > 1.2 * every > 0


def test_a_weight_makes_more_rates_certain():
    certain = dict.fromkeys(((1.0,), (4.0,), (1.0, 4.0)), 0)
    for seed in range(60):
        for weights in certain:
            problem = rate_problem(seed, most=1.0)
            problem._weights = weights
            certain[weights] += problem.doubt({}) is None
    assert certain[1.0, 4.0] > certain[(1.0,)] > 0


@pytest.mark.parametrize("seed", swept(range(12), range(12, 200)))
def test_states_by_rates_are_those_of_the_enumeration(seed):
    """With displacements that count from gap and slip, states are rates of an unloaded body."""
    rng = np.random.default_rng([21, seed])
    p = int(rng.integers(2, 5))
    root, pick = rng.normal(size=(2 * p, 2 * p)), np.eye(2 * p)
    gap, slip = rng.uniform(0.0, 0.5, p) * rng.integers(0, 2, p), rng.normal(size=p)
    body = ContactBody(root @ root.T + 0.05 * np.eye(2 * p), pick[0::2], pick[1::2], gap)
    history = LoadHistory(2.0 * rng.normal(size=(2, 2 * p)))
    system = QuasiStaticCoulomb(body, history, float(rng.uniform(0.0, 8.0)), slip)
    states, remark = system.evolver(history.interval)._by_rates(slip, 0.0)
    expected = enumerate_solutions(system.remembering(slip), 0.0)
    assert not remark
    assert len(states) == len(expected)
    for solution in expected:
        u, forces = solution.z[: body.n], solution.z[body.n :]
        y = np.concatenate([forces, body.N @ u, body.T @ u])
        assert min(np.abs(y - state).max() for state in states) < 1e-9 * (1.0 + np.abs(y).max())


@pytest.mark.parametrize("seed", [2154, 2770, 7, 2102])
def test_states_of_an_unloaded_body_are_those_of_brute_force(seed):
    """Slip at rest may lock forces in; rounding must not double a state without forces."""
    problem = random_problem(seed, 0.6, 0.5)
    problem.loads = 0.0 * problem.loads
    body = ContactBody(problem.A, problem.N, problem.T, problem.gap)
    history = LoadHistory(problem.loads)
    evolution = evolve(QuasiStaticCoulomb(body, history, problem.F, problem.slip), history.interval)
    assert evolution.is_complete
    expected, found = statics(problem, 0.0), [state.z for state in evolution.states(0.5)]
    assert len(found) == len(expected)
    for z in expected:
        assert min(np.abs(z - other).max() for other in found) < 1e-10
