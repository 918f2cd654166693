"""Quasi-static Coulomb friction against brute force, closed forms, and other parts of pwscont."""

import numpy as np
import pytest
from evolution_truth import TooManyError, evolutions, random_problem
from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb
from pwscont_coulomb.quasi_static.active import ActiveInverse
from sweeps import swept

from pwscont import InvalidInputError, Limits, SystemWithMemory, evolve

#: Times at which histories are compared; those next to an event are left out.
PLACES, BESIDE = 20, 1e-6


def one_node(a=2.0, b=1.0):
    return ContactBody([[a, -b], [-b, a]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])


def ours(problem, kind=lambda system: system):
    body = ContactBody(problem.A, problem.N, problem.T, problem.gap)
    system = QuasiStaticCoulomb(body, LoadHistory(problem.loads), problem.F, problem.slip)
    return evolve(kind(system), (0.0, len(problem.loads) - 1.0))


def compare(truth, evolution, seed):
    """Compare states at random times, and losses."""
    lo, hi = evolution.interval
    events = np.array([t for s in truth.segments for t in (s[0], s[2])])
    for t in np.random.default_rng(seed).uniform(lo, hi, PLACES):
        if np.abs(events - t).min(initial=np.inf) < BESIDE:
            continue
        expected, found = truth.states(t), [state.z for state in evolution.states(t)]
        assert evolution.count(t) == len(expected)
        for z in expected:
            nearest = min(np.abs(z - other).max() for other in found)
            assert nearest < 1e-9 * max(1.0, np.abs(z).max())
    assert len(evolution.losses()) == len(truth.losses)


@pytest.mark.parametrize("seed", swept(range(80), range(80, 10000)))
def test_all_evolutions_are_those_of_brute_force(seed):
    problem = random_problem(seed)
    try:
        truth = evolutions(problem)
    except TooManyError:
        pytest.skip("too many evolutions for brute force")
    compare(truth, ours(problem), seed)


def test_brute_force_meets_branchings_and_losses():
    """The comparison would mean little without."""
    truths = [evolutions(random_problem(seed)) for seed in range(80)]
    assert sum(truth.branchings > 0 for truth in truths) >= 2
    assert sum(bool(truth.losses) for truth in truths) >= 10


class Plain(SystemWithMemory):
    """The same law without the evolver that knows contact."""

    def __init__(self, system):
        self.system = system

    def remembering(self, memory):
        return self.system.remembering(memory)

    def memory(self, z, t):
        return self.system.memory(z, t)

    def initial_memory(self):
        return self.system.initial_memory()


@pytest.mark.parametrize("seed", swept(range(12), range(12, 200)))
def test_the_rays_of_the_restated_law_are_the_rates(seed):
    """docs/theory, F16."""
    problem = random_problem(seed)
    fast, plain = ours(problem), ours(problem, Plain)
    for t in np.random.default_rng(seed).uniform(*fast.interval, PLACES):
        one, other = fast.states(t), plain.states(t)
        assert len(one) == len(other)
        for state in one:
            assert min(np.abs(state.z - z.z).max() for z in other) < 1e-8
    assert len(fast.losses()) == len(plain.losses())


# -- one node in closed form -----------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 0.3, 1.5, 1.9])
def test_one_node_slips_in_closed_form(friction):
    """Pressed by f_nu, pushed by f_t: slip begins at f_t = F f_nu, u_t = (f_t - F lam) / a."""
    load = LoadHistory([[1.0, 0.0], [1.0, 3.0]])
    evolution = evolve(QuasiStaticCoulomb(one_node(), load, friction), (0.0, 1.0))
    (state,) = evolution.states(1.0)
    # slip+ with u_nu = 0: -u_t = 1 + lam_nu, 2 u_t = 3 + F lam_nu
    lam = -5.0 / (2.0 + friction)
    assert state["u_ν"] == pytest.approx(0.0, abs=1e-14)
    if lam < 0.0 and -1.0 - lam > 0.0:
        assert state["λ_ν"] == pytest.approx(lam, rel=1e-13)
        assert state["λ_t"] == pytest.approx(friction * lam, rel=1e-13)
        assert state["u_t"] == pytest.approx(-1.0 - lam, rel=1e-12)


def rates_in_closed_form(friction, slope, direction, a=2.0, b=1.0):
    """Return the number of rates of one node at its bound: 0, 1 or 2."""
    f_nu, f_t = slope
    # slip: a v = f_t + s F lam, -b v = f_nu + lam; stick: lam_nu = -f_nu, lam_t = -f_t
    stiffness = a + direction * friction * b
    v = (f_t - direction * friction * f_nu) / stiffness
    slips = direction * v > 0.0
    sticks = direction * -f_t + friction * f_nu > 0.0
    return int(slips) + int(sticks)


@pytest.mark.parametrize("seed", range(40))
def test_rates_of_one_node_at_its_bound(seed):
    """The count is 0 or 2 where F exceeds a / b against the coupling, else 1."""
    rng = np.random.default_rng(seed)
    friction, direction = rng.uniform(0.2, 6.0), rng.choice([-1.0, 1.0])
    start = np.array([0.0, 0.0, -1.0, -direction * friction])
    f0 = np.array([1.0, direction * friction])
    slope = rng.normal(size=2)
    history = LoadHistory([f0, f0 + 1e-3 * slope])
    system = QuasiStaticCoulomb(one_node(), history, friction)
    evolution = evolve(system, (0.0, 1.0), start)
    expected = rates_in_closed_form(friction, slope, direction)
    assert len(evolution.nodes[0:1]) == 1
    assert len(evolution.out_of[0]) == expected
    assert (evolution.nodes[0].kind == "loss") == (expected == 0)


def test_slip_of_undetermined_speed_is_no_certain_answer():
    """At F = a / b a node that slips against the coupling has a singular rate problem."""
    start, f0 = [0.0, 0.0, -1.0, 2.0], np.array([1.0, -2.0])
    history = LoadHistory([f0, 2.0 * f0])
    evolution = evolve(QuasiStaticCoulomb(one_node(), history, 2.0), (0.0, 1.0), start)
    assert not evolution.is_complete
    assert "infinitely many" in evolution.guarantee


def test_a_loss_is_an_answer_and_jumps_are_marked():
    start, f0 = np.array([0.0, 0.0, -1.0, 4.0]), np.array([1.0, -4.0])
    history = LoadHistory([f0, [0.5, -4.0]])
    system = QuasiStaticCoulomb(one_node(), history, 4.0)
    lost = evolve(system, (0.0, 1.0), start)
    (loss,) = lost.losses()
    assert loss.t == 0.0
    assert lost.is_complete
    jumped = evolve(system, (0.0, 1.0), start, jumps="nearest")
    assert [state.kind for state in jumped.events()][:2] == ["loss", "jump"]
    assert "jumps by the rule 'nearest'" in jumped.guarantee
    assert jumped.count(0.5) == 1
    with pytest.raises(InvalidInputError, match="jumps must be"):
        evolve(system, (0.0, 1.0), start, jumps="far")


# -- the inverse of the active part ----------------------------------------------------------------


def test_the_active_inverse_follows_changes():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(8, 8))
    C = root @ root.T + np.eye(8)
    inverse = ActiveInverse(C)
    for _ in range(60):
        active = rng.random(8) < 0.6
        K, which = inverse.at(active), np.flatnonzero(active)
        assert np.allclose(K[np.ix_(which, which)], np.linalg.inv(C[np.ix_(which, which)]))
        assert not K[~active].any()
        assert not K[:, ~active].any()


# -- bad input -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: LoadHistory([[1.0, 0.0]]), "at least two loads"),
        (lambda: LoadHistory([[1.0, 0.0]] * 3, times=[0.0, 2.0, 1.0]), "times must grow"),
        (lambda: LoadHistory([[1.0, 0.0]] * 2, times=[0.0]), "times has shape"),
        (lambda: QuasiStaticCoulomb(one_node(), [[0.0, 1.0]] * 2, 0.5), "must be a LoadHistory"),
        (lambda: QuasiStaticCoulomb(one_node(), LoadHistory(np.ones((2, 3))), 0.5), "3 components"),
        (
            lambda: QuasiStaticCoulomb(one_node(), LoadHistory(np.ones((2, 2))), lambda t: t),
            "cannot change in time",
        ),
        (
            lambda: QuasiStaticCoulomb(one_node(), LoadHistory(np.ones((2, 2))), -1.0),
            "must not be negative",
        ),
    ],
)
def test_bad_input_is_refused_in_words(make, words):
    with pytest.raises(InvalidInputError, match=words):
        make()


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ([0.0, 0.0, 0.0, 0.0], "no equilibrium"),
        ([0.0, 0.0, -1.0, -0.9], "exceeds the bound of friction"),
        ([0.0, 0.0, 1.0, 0.0], "pulls on the obstacle"),
        ([1.0, 0.0, 1.0, -1.0], "beyond the obstacle"),
        ([0.0, 0.0], "shape"),
    ],
)
def test_a_start_that_is_no_state_is_refused(start, words):
    given = np.array(start)
    load = [1.0, 0.0]
    if words != "no equilibrium" and len(given) == 4:
        load = [2.0 * given[0] - given[1] - given[2], 2.0 * given[1] - given[0] - given[3]]
    system = QuasiStaticCoulomb(one_node(), LoadHistory([load, [1.0, 1.0]]), 0.5)
    with pytest.raises(InvalidInputError, match=words):
        evolve(system, (0.0, 1.0), given)


@pytest.mark.parametrize("interval", [(0.0, 2.0), (1.0, 0.0), (-1.0, 1.0), (0.0, np.nan), 3.0])
def test_an_interval_must_fit_the_history(interval):
    system = QuasiStaticCoulomb(one_node(), LoadHistory(np.ones((2, 2))), 0.5)
    with pytest.raises(InvalidInputError, match="interval"):
        evolve(system, interval)


def test_limits_keep_what_was_found():
    load = LoadHistory([[1.0, 0.0], [1.0, 3.0], [1.0, -3.0]])
    system = QuasiStaticCoulomb(one_node(), load, 0.5)
    whole = evolve(system, (0.0, 2.0))
    part = evolve(system, (0.0, 2.0), limits=Limits(pieces=2))
    assert len(part.pieces) == 2 < len(whole.pieces)
    assert "limit of 2 pieces was reached" in part.guarantee
    assert part.events("undecided")
