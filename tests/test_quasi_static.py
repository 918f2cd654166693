"""Quasi-static Coulomb friction against brute force, closed forms, and other parts of pwscont."""

from dataclasses import replace

import numpy as np
import pytest
from evolution_truth import TooManyError, evolutions, random_problem
from integer_problems import integer_problem
from plain_laws import Plain
from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb
from pwscont_coulomb.quasi_static.active import ActiveInverse
from pwscont_coulomb.quasi_static.scenes import cattaneo, shakedown
from scipy.optimize import linprog
from sweeps import swept

from pwscont import InvalidInputError, Limits, evolve

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

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


@pytest.mark.parametrize("seed", swept(range(80), range(80, 4000)))
@pytest.mark.sweep(18)
def test_all_evolutions_are_those_of_brute_force(seed):
    problem = random_problem(seed)
    try:
        truth = evolutions(problem)
    except TooManyError:
        pytest.skip("too many evolutions for brute force")
    compare(truth, ours(problem), seed)


@pytest.mark.slow
def test_brute_force_meets_branchings_and_losses():
    """The comparison would mean little without."""
    truths = [evolutions(random_problem(seed)) for seed in range(80)]
    assert sum(truth.branchings > 0 for truth in truths) >= 2
    assert sum(bool(truth.losses) for truth in truths) >= 10


@pytest.mark.parametrize("seed", swept(range(12), range(12, 200)))
@pytest.mark.sweep(4)
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


@pytest.mark.parametrize(("length", "force"), [(1.0, 1.0), (1.8e-5, 2.8e-9), (3e7, 4e8)])
def test_a_singular_slip_that_the_load_contradicts_is_a_loss_in_every_unit(length, force):
    """At F = a / b slip has no stiffness: where the load asks for slip there is no rate."""
    body = ContactBody(
        np.array([[3.0, -1.0], [-1.0, 2.0]]) * force / length, N=[[1.0, 0.0]], T=[[0.0, 1.0]]
    )
    loads = force * np.array([[1.0, 2.0], [2.0, -1.0], [-2.0, 0.0], [1.0, -2.0]])
    evolution = evolve(QuasiStaticCoulomb(body, LoadHistory(loads), 2.0), (0.0, 3.0))
    assert evolution.is_complete
    (loss,) = evolution.losses()
    assert loss.t == pytest.approx(10.0 / 7.0, rel=1e-14)


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


# -- ties, units, large bodies ---------------------------------------------------------------------


@pytest.mark.parametrize("seed", swept(range(40), range(40, 1000)))
@pytest.mark.sweep(18)
def test_ties_are_those_of_brute_force(seed):
    problem = integer_problem(seed)
    try:
        truth = evolutions(problem)
    except TooManyError:
        pytest.skip("too many evolutions for brute force")
    evolution = ours(problem)
    if evolution.is_complete:
        compare(truth, evolution, seed)


def test_nothing_happens_while_the_load_rests():
    """Rounding alone would let a node leave the bound, or press a node that only touches."""
    A = [[3.0, -1.0, 1.0, 1.0], [-1.0, 4.0, -2.0, 0.0], [1.0, -2.0, 3.0, 2.0], [1.0, 0.0, 2.0, 5.0]]
    body = ContactBody(A, np.eye(4)[0::2], np.eye(4)[1::2])
    history = LoadHistory([[2, 1, -1, 0], [2, 1, -1, 0], [2, 1, 2, -1]], [0.0, 1.5, 2.5])
    evolution = evolve(QuasiStaticCoulomb(body, history, [0.5, 0.25], -0.5), history.interval)
    assert [event.t for event in evolution.events()] == pytest.approx([0.0, 1.5, 271.5 / 151, 2.5])
    history = LoadHistory([[0, 0], [-2, 4], [-2, 4], [-3, 2]])
    evolution = evolve(QuasiStaticCoulomb(one_node(), history, 0.0), history.interval)
    assert [event.t for event in evolution.events()] == [0.0, 1.0, 2.0, 3.0]


def test_rates_next_to_the_critical_friction_are_one_rate_or_uncertain():
    """At F = 3 (1 +- small) slip is steep: its errors make no second rate, and no other state."""
    body = ContactBody([[1.0, 1.0], [1.0, 3.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    history = LoadHistory([[0, 0], [1, 3], [1, 1], [1, 1]])
    evolution = evolve(QuasiStaticCoulomb(body, history, 2.999997, -0.5), history.interval)
    assert [evolution.count(t) for t in (0.5, 1.5, 2.5)] == [1, 1, 1]
    body = ContactBody([[3.0, 1.0], [1.0, 3.0]], [[1.0, 0.0]], [[0.0, 1.0]], gap=[0.5])
    system = QuasiStaticCoulomb(body, LoadHistory([[2, 2], [2, 2], [2, 1]]), 3.0 + 3e-10)
    evolution = evolve(system, (0.0, 2.0), start=[0.5, 0.0, -0.5, -1.5])
    assert "slip hardly determine the state" in evolution.guarantee


@pytest.mark.parametrize("seed", range(20))
def test_a_node_without_load_and_force_stays(seed):
    """All other nodes stick: nothing but rounding acts on node 1, at high friction as well."""
    rng = np.random.default_rng([3, seed])
    root, pick = rng.normal(size=(6, 6)), np.eye(6)
    body = ContactBody(root @ root.T + 0.05 * np.eye(6), pick[0::2], pick[1::2])
    loads = np.zeros((5, 6))
    loads[:, 2::2] = rng.uniform(4.0, 6.0, (5, 2))
    loads[:, 3::2] = rng.uniform(-1.0, 1.0, (5, 2))
    history = LoadHistory(loads, [0.0, 0.3, 1.0, 2.1, 3.0])
    start = np.concatenate([np.zeros(6), -loads[0, 0::2], -loads[0, 1::2]])
    friction = [rng.uniform(1.0, 8.0), 3.0, 3.0]
    evolution = evolve(QuasiStaticCoulomb(body, history, friction), history.interval, start)
    assert [evolution.count(t) for t in history.times] == [1] * 5
    assert not evolution.branchings()
    assert np.abs(evolution.states(3.0)[0].z[:6]).max() < 1e-10


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("length", "force"), [(1e-6, 1e9), (1e5, 1e-7)])
@pytest.mark.sweep(4)
def test_units_change_nothing(seed, length, force):
    problem = random_problem(seed)
    scaled = replace(
        problem,
        A=problem.A * force / length,
        gap=problem.gap * length,
        slip=problem.slip * length,
        loads=problem.loads * force,
    )
    one, other = ours(problem), ours(scaled)
    assert [node.kind for node in one.nodes] == [node.kind for node in other.nodes]
    unit = np.repeat([length, force], [len(problem.A), 2 * problem.p])
    for a, b in zip(one.events(), other.events(), strict=True):
        assert a.t == pytest.approx(b.t, abs=1e-10)
        assert np.abs(a.z - b.z / unit).max() < 1e-8 * max(1.0, np.abs(a.z).max())


@pytest.mark.parametrize("nodes", swept([60], [200]))
def test_a_round_body_slips_as_cattaneo_and_mindlin_say(nodes):
    """Stick zone sqrt(1 - Q / (F P)) on loading, sqrt(1 - dQ / (2 F P)) after the reversal."""
    scene = cattaneo(nodes)
    evolution = scene.run()
    assert evolution.is_complete
    (cycle,) = evolution.cycle(2.0)
    assert (cycle.kind, cycle.periods) == ("cyclic slip", 1)
    before, after = evolution.states(4.0)[0].z, evolution.states(6.0)[0].z
    assert np.abs(before - after).max() < 1e-12 * np.abs(before).max()
    friction, largest = 0.5, evolution.states(2.0)[0]["force"]
    for t, amplitude in ((1.3, 1.0), (1.7, 1.0), (2.0, 1.0), (2.4, 2.0), (2.8, 2.0)):
        (state,) = evolution.states(t)
        normal, tangential = -state.z[-2 * nodes : -nodes], state.z[-nodes:]
        in_contact = normal > 0.0
        slips = np.abs(tangential) > friction * normal * (1.0 - 1e-10)
        change = state["force"] if amplitude == 1.0 else largest - state["force"]
        part = np.sqrt(1.0 - change / (amplitude * friction * normal.sum()))
        expected = part * in_contact.sum()
        assert abs((in_contact & ~slips).sum() - expected) <= 2.0  # one node at either end


@pytest.mark.parametrize("nodes", swept([12], [50, 200]))
def test_a_block_is_certain_at_every_event(nodes):
    problem = pytest.importorskip("pwscont_coulomb.elastic.scenes").block_body(nodes).condensed()
    press, side = problem.load.f0, 0.6 * problem.load.f1
    history = LoadHistory([press, press + side, press - side, press + side])
    system = QuasiStaticCoulomb(problem.body, history, 0.3)
    evolution = evolve(system, history.interval)
    assert not [node.remark for node in evolution.nodes if node.remark]
    assert evolution.paths().number == 1
    assert len(evolution.nodes) > nodes / 2
    for state in evolution.events():
        check_equilibrium(problem.body, history, 0.3, state)


@pytest.mark.parametrize("nodes", swept([50], [200]))
@pytest.mark.parametrize("friction", [0.3, 1.0])
def test_an_unloaded_and_a_pressed_block_are_certain(nodes, friction):
    """All nodes touch without force at first; of a block that is pressed all states are known."""
    problem = pytest.importorskip("pwscont_coulomb.elastic.scenes").block_body(nodes).condensed()
    press, side = problem.load.f0, problem.load.f1
    for loads in ([0.0 * press, press, press + side], [press, press + side, press - side]):
        history = LoadHistory(loads)
        evolution = evolve(QuasiStaticCoulomb(problem.body, history, friction), history.interval)
        assert evolution.guarantee == "all evolutions with finitely many events"


def check_equilibrium(body, history, friction, state):
    n, p = body.n, body.p
    u, normal, tangential = state.z[:n], state.z[n : n + p], state.z[n + p :]
    rest = body.A @ u - history(state.t) - body.N.T @ normal - body.T.T @ tangential
    size = np.abs(history.loads).max()
    assert np.abs(rest).max() < 1e-11 * size
    assert (normal <= 1e-11 * size).all()
    assert (np.abs(tangential) <= friction * np.abs(normal) + 1e-11 * size).all()
    assert (body.N @ u <= body.gap + 1e-11 * np.abs(u).max()).all()


@pytest.mark.parametrize("elements", [4, 8])
def test_the_unloaded_wedge_has_all_its_ways_on(elements):
    """All nodes touch without force: the modes are searched by linear programs."""
    scenes = pytest.importorskip("pwscont_coulomb.elastic.scenes")
    problem = scenes.wedge_body(elements).condensed()
    history = LoadHistory([0.0 * problem.load.f0, problem.load.f0])
    evolution = evolve(QuasiStaticCoulomb(problem.body, history, 0.5), (0.0, 1.0))
    assert evolution.guarantee == "all evolutions with finitely many events"


# -- shakedown -------------------------------------------------------------------------------------


def two_nodes(seed):
    """Return a random two-node body with its load between two states, both pressing the nodes."""
    rng = np.random.default_rng([2008, seed])
    root = rng.normal(size=(4, 4))
    pick = np.eye(4)
    body = ContactBody(root @ root.T + np.eye(4), pick[0::2], pick[1::2])
    middle = np.array([3.0, 0.0, 3.0, 0.0]) + rng.normal(size=4)
    return body, middle, 1.2 * rng.normal(size=4), float(rng.uniform(0.2, 0.9))


def safe_slip_exists(body, loads, friction):
    """Tell by a linear program whether a slip exists with which no node slips (Ahn et al. 2008).

    With both nodes held, lam = A u - f with u_nu = 0: abs(lam_t) <= -F lam_nu for all loads.
    """
    held = body.A @ body.T.T  # forces by slip
    rows, right = [], []
    for f in loads:
        for i in range(body.p):
            n, t = body.N[i], body.T[i]
            rows += [s * t @ held + friction * n @ held for s in (1.0, -1.0)]
            right += [s * t @ f + friction * n @ f for s in (1.0, -1.0)]
            rows.append(n @ held)
            right.append(n @ f)
    found = linprog(np.zeros(body.p), rows, right, bounds=[(None, None)] * body.p)
    return found.status == 0


def outcomes(seed):
    """Return the cycles of a random body from some slips, and whether a safe slip exists."""
    body, middle, amplitude, friction = two_nodes(seed)
    loads = [middle + amplitude, middle - amplitude]
    history, found = LoadHistory([middle, *loads * 6]), []
    for slip in ([0.0, 0.0], [0.5, 0.0], [0.0, -0.5]):
        evolution = evolve(QuasiStaticCoulomb(body, history, friction, slip), history.interval)
        touches = all("no contact" not in piece.label for piece in evolution.pieces)
        if touches and evolution.paths().number == 1 and not evolution.losses():
            found.append(evolution.cycle(2.0)[0].kind)
    return found, safe_slip_exists(body, loads, friction)


@pytest.mark.parametrize("seed", swept(range(15), range(15, 400)))
@pytest.mark.sweep(12)
def test_no_shakedown_without_a_safe_slip(seed):
    kinds, is_safe = outcomes(seed)
    assert is_safe or "shakedown" not in kinds


def test_the_outcome_may_depend_on_the_initial_slip():
    """Both outcomes of one coupled body under one load: Melan's theorem does not hold."""
    ends = [shakedown(slip).run().cycle(2.0)[0].kind for slip in (0.0, 1.0)]
    assert ends == ["cyclic slip", "shakedown"]


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
        (lambda: QuasiStaticCoulomb(None, LoadHistory(np.ones((2, 2))), 0.5), "be a ContactBody"),
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
        (lambda: cattaneo(nodes=0), "nodes must be at least 1, got 0"),
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


@pytest.mark.parametrize(("begin", "length"), [(1e9, 1.0), (-1e6, 1e-3), (0.0, 1e-200), (3.0, 1e9)])
def test_clocks_change_nothing(begin, length):
    """Times far from zero have fewer digits, and no other events."""
    loads = [[1.0, 0.0], [1.0, 3.0], [1.0, -3.0]]
    times = [begin, begin + length, begin + 2.0 * length]
    system = QuasiStaticCoulomb(one_node(), LoadHistory(loads, times), 0.5)
    plain = evolve(QuasiStaticCoulomb(one_node(), LoadHistory(loads), 0.5), (0.0, 2.0))
    evolution = evolve(system, (times[0], times[-1]))
    assert evolution.is_complete
    for one, other in zip(evolution.events(), plain.events(), strict=True):
        assert (one.t - begin) / length == pytest.approx(other.t, abs=1e-5)
        assert one.z == pytest.approx(other.z, abs=1e-5)


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
