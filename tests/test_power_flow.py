"""Power flow with reactive limits, against equations written out by hand and a plain power flow."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from power_parts import from_flat
from pwscont_power import Branch, Generator, Network, PowerFlow, from_pandapower
from pwscont_power.networks import ieee14 as ieee14_network
from pwscont_power.scenes import ieee14, ieee118, three_bus, three_bus_flow
from scipy.optimize import brentq, fsolve
from sweeps import swept

from pwscont import Complementarity, check_system, explore, trace

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


REFERENCE = json.loads((Path(__file__).parent / "reference" / "ieee14.json").read_text())


# -- three buses, the equations written out ------------------------------------------------------


Y12, Y23, Y13 = 1 / (0.02 + 0.2j), 1 / (0.02 + 0.15j), 1 / (0.04 + 0.4j)


Y3 = np.array([[Y12 + Y13, -Y12, -Y13], [-Y12, Y12 + Y23, -Y23], [-Y13, -Y23, Y13 + Y23]])


def powers(angle2, angle3, V2, V3):
    V = np.array([1.03, V2 * np.exp(1j * angle2), V3 * np.exp(1j * angle3)])
    return V * (Y3 @ V).conj()


def mismatches(x, loading, Q2, V2=None):
    """Return the equations of a generator at Q2 and, if V2 is None, of free voltage x[2]."""
    angle2, angle3, free, V3 = x
    S = powers(angle2, angle3, free if V2 is None else V2, V3)
    Q2 = Q2 if V2 is None else free
    return [S[1].real - 0.4, S[1].imag - Q2, S[2].real + loading, S[2].imag + 0.35 * loading]


def solved(f, start):
    """Return the root of a function near a start."""
    x, info, _, _ = fsolve(f, start, xtol=1e-14, full_output=True)
    assert np.abs(info["fvec"]).max() < 1e-11
    return x


def limit_by_hand(Q_max):
    """Return the loading at which bus 2 needs Q_max for V2 = 1.02."""
    f = lambda x: mismatches([x[0], x[1], Q_max, x[2]], x[3], None, 1.02)  # noqa: E731
    return solved(f, [-0.1, -0.3, 0.9, 1.7])[-1]


def nose_by_hand(Q_max, near):
    """Return the largest loading at reactive power Q_max: its slope along V3 is zero there."""

    def loading(V3):
        f = lambda x: mismatches([*x[:3], V3], x[3], Q_max)  # noqa: E731
        return solved(f, [*near[:3], near[4]])[3]

    slope = lambda V3: loading(V3 + 1e-5) - loading(V3 - 1e-5)  # noqa: E731
    return loading(brentq(slope, near[3] - 0.05, near[3] + 0.05, xtol=1e-10))


KNOWN = {0.3: (0.98741, 2.064), 0.6: (1.47617, 2.19535), 0.8: (1.7382094, 2.2789692),
         1.2: (2.15699, 2.43852), 2.0: (2.70527, 2.73403)}  # fmt: skip


@pytest.mark.parametrize("Q_max", swept([0.8], [0.3, 0.6, 1.2, 2.0]))
def test_limit_and_nose_of_three_buses(Q_max):
    graph = from_flat(three_bus_flow(Q_max), 0.2, 3.2)
    (limit,), (nose,) = graph.special_points("transition"), graph.special_points("fold")
    assert limit.message == "G2 reaches Q max"
    assert limit.alpha == pytest.approx(limit_by_hand(Q_max), rel=1e-11)
    near = [*nose.z[:4], nose.alpha]
    assert nose.alpha == pytest.approx(nose_by_hand(Q_max, near), rel=1e-9)
    assert (limit.alpha, nose.alpha) == pytest.approx(KNOWN[Q_max], abs=1.1e-5)
    assert [n for _, _, n in graph.multiplicity()] == [2, 0]


def test_three_buses_without_a_limit():
    graph = from_flat(three_bus_flow(np.inf), 0.2, 3.2)
    assert not graph.special_points("transition")
    assert max(p.alpha for p in graph.special_points("fold")) == pytest.approx(3.04506, abs=1e-5)


def test_the_lower_branch_ends_with_the_model():
    graph = from_flat(three_bus_flow(0.8), 0.0, 3.2)
    ends = [p for p in graph.special_points("end") if "V3" in p.message]
    assert len(ends) == 1
    for end in ends:
        assert end.message == "V3 reaches its lower bound 0.001"
        assert 0.0 < end.alpha < 0.01


def test_quantities_have_the_names_of_the_field():
    system = three_bus_flow(0.8)
    assert system.names() == ("theta2", "theta3", "V2", "V3", "Q2")
    (start,) = from_flat(system, 0.2, 1.0).special_points("start")
    assert start["V2"] == pytest.approx(1.02)
    words = list(map(system.describe, system.cells()))
    assert words == ["G2 at Q min", "G2 voltage held", "G2 at Q max"]


# -- IEEE 14 -------------------------------------------------------------------------------------


LIMITS = [
    (0.595824, "G6 leaves Q min"),
    (0.641513, "G3 leaves Q min"),
    (1.07692, "G2 reaches Q max"),
    (1.16903, "G3 reaches Q max"),
    (1.193921, "G6 reaches Q max"),
    (1.2234, "G8 reaches Q max"),
]


@cache
def graph14():
    return from_flat(PowerFlow(ieee14_network()), 0.3, 2.0)


def check_limits_of_ieee14(graph):
    limits = graph.special_points("transition")
    assert [p.message for p in limits] == [words for _, words in LIMITS]
    np.testing.assert_allclose([p.alpha for p in limits], [a for a, _ in LIMITS], atol=1e-5)
    nose = max(p.alpha for p in graph.special_points("fold"))
    assert nose == pytest.approx(1.777995, abs=1e-6)


def test_ieee14_from_a_flat_start():
    check_limits_of_ieee14(graph14())
    assert graph14().count(1.0) == 2
    upper = max(graph14().solutions(1.0), key=lambda s: s["V14"])
    found = [upper[f"V{bus}"] for bus in range(2, 15)]
    np.testing.assert_allclose(found, REFERENCE["V"][1:], atol=1e-9)
    np.testing.assert_allclose([upper[f"Q{b}"] for b in (2, 3, 6, 8)], REFERENCE["qg"], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("Q_max", KNOWN)
def test_three_buses_as_a_scene(Q_max):
    graph = three_bus(Q_max).run()
    found = [graph.special_points(kind)[0].alpha for kind in ("transition", "fold")]
    assert found == pytest.approx(KNOWN[Q_max], abs=1.1e-5)
    assert [n for _, _, n in graph.multiplicity()] == [2, 0]


@pytest.mark.slow
def test_ieee14_as_a_scene():
    """At loading 1, two solutions more have low voltages at a few buses: four at least."""
    graph = ieee14().run()
    check_limits_of_ieee14(graph)
    system = PowerFlow(ieee14_network())
    V = np.array([system.voltages(solution.z) for solution in graph.solutions(1.0)])
    Y = np.array(REFERENCE["Y"]["re"]) + 1j * np.array(REFERENCE["Y"]["im"])
    S = V * (V @ Y.T).conj() + np.array(REFERENCE["P"]) + 1j * np.array(REFERENCE["Q"])
    at, loads = [1, 2, 5, 7], [3, 4, 6, *range(8, 14)]
    np.testing.assert_allclose(S[:, loads], 0.0, atol=1e-9)
    np.testing.assert_allclose(S[:, at], S[:, at].imag * 1j + REFERENCE["gp"], atol=1e-9)
    at_limit = np.abs(S[:, at].imag - REFERENCE["qhi"]) < 1e-9
    np.testing.assert_array_equal(at_limit, np.abs(V[:, at]) < np.array(REFERENCE["gv"]) - 1e-9)
    assert len(V) >= 4


def test_the_reader_gives_the_reference_matrix():
    network = ieee14_network()
    Y = np.array(REFERENCE["Y"]["re"]) + 1j * np.array(REFERENCE["Y"]["im"])
    np.testing.assert_allclose(network.admittance.toarray(), Y, atol=1e-12)
    np.testing.assert_allclose(
        network.load, np.array(REFERENCE["P"]) + 1j * np.array(REFERENCE["Q"])
    )


# -- random networks, against a plain power flow -----------------------------------------------


def random_network(seed):
    """Return a meshed network of 3 to 8 buses with one to three generators besides the slack."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    pairs = {(int(rng.integers(i)), i) for i in range(1, n)}
    pairs |= {tuple(sorted(rng.choice(n, 2, replace=False).tolist())) for _ in range(n // 2)}
    branches = [
        Branch(
            i + 1,
            j + 1,
            x * rng.uniform(0.05, 0.3),
            x,
            rng.uniform(0.0, 0.05),
            rng.choice([1.0, 0.97]),
        )
        for i, j in sorted(pairs)
        for x in rng.uniform(0.1, 0.4, 1)
    ]
    at = rng.choice(np.arange(2, n + 1), min(n - 2, int(rng.integers(1, 4))), replace=False)
    generators = [
        Generator(int(b), rng.uniform(0.98, 1.05), -0.2, rng.uniform(0.1, 0.6)) for b in at
    ]
    load = rng.uniform(0.0, 0.6, n) * (1.0 + 1j * rng.uniform(0.1, 0.6, n))
    generation = np.zeros(n)
    generation[at - 1] = rng.uniform(0.0, 0.5, len(at))
    numbers = tuple(range(1, n + 1))
    return Network(numbers, tuple(branches), (Generator(1, 1.03), *generators), 1, load, generation)


def plain_power_flow(network, loading, rounds=30):
    """Return complex voltages by Newton's method with switching between PV and PQ buses.

    The textbook loop: solve; a generator beyond a limit is fixed there, one at a limit whose
    voltage is on the wrong side holds it again. None where Newton or the loop does not settle.
    """
    n = len(network.buses)
    Y, S = network.admittance.toarray(), loading * (network.generation - network.load)
    held = {g.bus - 1: g for g in network.generators if g.bus != network.slack}
    fixed = {}
    V = np.ones(n)
    V[0], angle = network.generators[0].V, np.zeros(n)
    for _ in range(rounds):
        pq = [i for i in range(1, n) if i not in held or i in fixed]
        for i, g in held.items():
            V[i] = V[i] if i in fixed else g.V
        Q = S.imag.copy()
        for i, q in fixed.items():
            Q[i] += q

        def f(x, pq=pq, Q=Q, V=V):
            size, turned = V.copy(), np.append(0.0, x[: n - 1])
            size[pq] = x[n - 1 :]
            U = size * np.exp(1j * turned)
            T = U * (Y @ U).conj()
            return np.concatenate([(T.real - S.real)[1:], (T.imag - Q)[pq]])

        x, _, ok, _ = fsolve(f, np.concatenate([angle[1:], V[pq]]), xtol=1e-13, full_output=True)
        if ok != 1 and np.abs(f(x)).max() > 1e-9:
            return None
        angle[1:], V[pq] = x[: n - 1], x[n - 1 :]
        U = V * np.exp(1j * angle)
        given = (U * (Y @ U).conj()).imag - S.imag
        changes = {}
        for i, g in held.items():
            if i not in fixed and not g.Q_min <= given[i] <= g.Q_max:
                changes[i] = float(np.clip(given[i], g.Q_min, g.Q_max))
            elif i in fixed and (V[i] - g.V) * (1 if fixed[i] == g.Q_max else -1) > 1e-12:
                changes[i] = None
        if not changes:
            return U
        for i, q in changes.items():
            fixed.pop(i) if q is None else fixed.update({i: q})
    return None


def is_solution(network, loading, U):
    """Tell whether voltages solve the power flow with limits, by its definition."""
    S = U * (network.admittance @ U).conj() - loading * (network.generation - network.load)
    slack = network.places([network.slack])[0]
    at = network.places([g.bus for g in network.generators])
    loads = np.setdiff1d(np.arange(len(U)), at)
    if np.abs(S[loads]).max(initial=0.0) > 1e-9 or (abs(S[at[at != slack]].real) > 1e-9).any():
        return False
    for g, i in zip(network.generators, at, strict=True):
        V, Q = abs(U[i]), S[i].imag
        held = abs(V - g.V) <= 1e-9 and g.Q_min - 1e-9 <= Q <= g.Q_max + 1e-9
        at_max = abs(Q - g.Q_max) <= 1e-9 and V <= g.V + 1e-9
        at_min = abs(Q - g.Q_min) <= 1e-9 and V >= g.V - 1e-9
        if i != slack and not (held or at_max or at_min):
            return False
    return True


@pytest.mark.parametrize("seed", swept(range(4), range(4, 300)))
@pytest.mark.sweep(4)
def test_random_networks(seed):
    network = random_network(seed)
    system = PowerFlow(network)
    graph = from_flat(system, 0.1, 4.0)
    assert not graph.special_points("stopped")
    noses = [p.alpha for kind in ("fold", "nonsmooth fold") for p in graph.special_points(kind)]
    nose = max(noses, default=4.0)  # some networks carry more than four times their load
    compared = 0
    for loading in np.linspace(0.1, nose, 8)[:-1].tolist():
        found = graph.solutions(loading)
        assert all(is_solution(network, loading, system.voltages(s.z)) for s in found)
        U = plain_power_flow(network, loading)
        if U is not None and is_solution(network, loading, U) and np.abs(U).min() > 0.6:
            upper = max(found, key=lambda s: np.abs(system.voltages(s.z)).min())
            np.testing.assert_allclose(system.voltages(upper.z), U, atol=1e-7)
            compared += 1
    assert compared >= 2


# -- against pandapower, the notation, and check_system --------------------------------------------


PANDAPOWER = json.loads(
    (Path(__file__).parent / "reference" / "pandapower_ieee14.json").read_text()
)


@pytest.mark.parametrize("loading", PANDAPOWER["V"])
def test_ieee14_against_pandapower(loading):
    found = graph14().solutions(float(loading))
    upper = max(found, key=lambda s: min(s[f"V{bus}"] for bus in range(2, 15)))
    voltages = [upper[f"V{bus}"] for bus in range(2, 15)]
    np.testing.assert_allclose(voltages, PANDAPOWER["V"][loading][1:], atol=1e-9)


REFERENCE_118 = Path(__file__).parent / "reference" / "pandapower_ieee118.json"


PANDAPOWER_118 = json.loads(REFERENCE_118.read_text())


@pytest.mark.slow
def test_ieee118_against_pandapower():
    """54 generators, about 50 of which reach a limit before the fold, where one more does."""
    graph = ieee118().run()
    (fold,) = graph.special_points("nonsmooth fold")
    assert fold.message == "G10 reaches Q max"
    assert graph.count(1.0) == graph.count(fold.alpha - 1e-6) == 2
    assert graph.count(fold.alpha + 1e-6) == 0
    for loading, voltages in PANDAPOWER_118["V"].items():
        found = graph.solutions(float(loading))
        upper = max(found, key=lambda s: s["V10"])
        named = [upper[f"V{bus}"] for bus in range(1, 119) if bus != 69]
        np.testing.assert_allclose(named, np.delete(voltages, 68), atol=1e-9)
        system = ieee118().system
        for solution in found:
            assert is_solution(system.network, float(loading), system.voltages(solution.z))


def test_a_pandapower_net_is_the_same_network():
    networks = pytest.importorskip("pandapower.networks")
    found, network = from_pandapower(networks.case14()), ieee14_network()
    np.testing.assert_allclose(found.admittance.toarray(), network.admittance.toarray(), atol=1e-9)
    np.testing.assert_allclose(found.load, network.load, atol=1e-12)


def as_complementarity(network):
    """Return the same problem in the notation: Q between its limits, perpendicular to V - V_set."""
    n = len(network.buses)
    Y, S = network.admittance.toarray(), network.generation - network.load
    held = network.generators[1:]
    at = [generator.bus - 1 for generator in held]

    def f(z, loading):
        angle = np.concatenate([[0.0], z[: n - 1]])
        size = np.concatenate([[network.generators[0].V], z[n - 1 : 2 * n - 2]])
        a, b = size * np.cos(angle), size * np.sin(angle)
        c, d = Y.real @ a - Y.imag @ b, Y.imag @ a + Y.real @ b
        given = np.eye(n)[:, at] @ z[2 * n - 2 :]
        P = a * c + b * d - loading * S.real
        Q = b * c - a * d - loading * S.imag - given
        return np.concatenate([P[1:], Q[1:], size[at] - [g.V for g in held]])

    free = [np.inf] * (2 * n - 2)
    lower = [-x for x in free] + [g.Q_min for g in held]
    return Complementarity(f, lower, free + [g.Q_max for g in held])


@pytest.mark.parametrize("seed", range(60))
@pytest.mark.slow
def test_random_networks_are_those_of_the_notation(seed):
    network = random_network(seed)
    ours = from_flat(PowerFlow(network), 0.1, 0.6)
    start = min(ours.solutions(0.1), key=lambda s: -min(np.abs(PowerFlow(network).voltages(s.z))))
    theirs = trace(as_complementarity(network), (start.z, 0.1), (0.1, 0.6))
    one = ours.special_points("transition")
    other = theirs.special_points("transition")
    np.testing.assert_allclose(
        sorted(p.alpha for p in one), sorted(p.alpha for p in other), rtol=1e-9
    )


@pytest.mark.parametrize("seed", swept(range(2), range(2, 100)))
def test_check_system_finds_nothing(seed):
    system = PowerFlow(random_network(seed))
    points = [(s.z, 0.3) for s in from_flat(system, 0.1, 0.5).solutions(0.3)]
    assert check_system(system, points)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.sweep(4)
def test_generators_start_at_the_voltages_that_they_hold(seed):
    """Also where these are far from one, as in other units."""
    network = random_network(seed)
    system = PowerFlow(network)
    start = dict(zip(system.names(), system.start(), strict=True))
    assert all(start[f"V{g.bus}"] == g.V for g in network.generators if g.bus != network.slack)
    assert all(g.Q_min <= start.get(f"Q{g.bus}", 0.0) <= g.Q_max for g in network.generators)
    (found,) = trace(system, (system.start(), 0.1), (0.1, 0.1 + 1e-6)).solutions(0.1)
    assert is_solution(network, 0.1, system.voltages(found.z))


def test_explore_starts_from_the_voltages_that_generators_hold():
    """A long line between two generators: from zero, or from equal voltages, Newton goes astray."""
    system = PowerFlow(ieee14_network())
    graph = explore(system, (1.0, 1.01), search=system.searches()[0])
    upper = max(graph.solutions(1.0), key=lambda s: s["V14"])
    found = [upper[f"V{bus}"] for bus in range(2, 15)]
    np.testing.assert_allclose(found, REFERENCE["V"][1:], atol=1e-9)


def test_large_networks_have_sparse_derivatives():
    """A line of 120 buses: sparse and dense derivatives are those of differences."""
    size = 120
    line = tuple(Branch(i, i + 1, 0.001, 0.01) for i in range(1, size))
    held = (Generator(1, 1.0), Generator(60, 1.0, -0.5, 0.5))
    network = Network(tuple(range(1, size + 1)), line, held, 1, load=0.002 + 0.001j)
    system = PowerFlow(network)
    z = np.random.default_rng(0).uniform(0.5, 1.0, system.size)
    character = system.character(z, 0.7)
    matrix = system.jacobian(z, 0.7, character)
    assert matrix.nnz < 10 * system.size
    direction = np.random.default_rng(1).normal(size=system.size + 1)
    x, h = np.append(z, 0.7), 1e-6 * direction
    ends = [system.residual(y[:-1], y[-1], character) for y in (x + h, x - h)]
    np.testing.assert_allclose(matrix @ direction, (ends[0] - ends[1]) / 2e-6, atol=1e-6)
