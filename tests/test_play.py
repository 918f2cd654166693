"""Networks of elastic-plastic springs against play and stop operators."""

import numpy as np
import pytest
from play_operators import springs, stops
from pwscont_coulomb import ContactBody, QuasiStaticCoulomb
from pwscont_structures import PlasticTruss
from pwscont_structures.scenes import play
from sweeps import swept

from pwscont import InvalidInputError, LoadHistory, Switched, SystemWithMemory, evolve


@pytest.mark.parametrize("seed", swept(range(25), range(25, 200)))
@pytest.mark.sweep(9)
def test_springs_follow_the_stop_operators(seed):
    truss = springs(seed)
    evolution = evolve(truss, truss.history.interval)
    assert evolution.is_complete
    for t, expected in zip(truss.history.times, stops(truss), strict=True):
        (state,) = evolution.states(t)
        assert np.abs(state.z - expected).max() < 1e-12 * max(1.0, np.abs(expected).max())


class Stops(SystemWithMemory):
    """The springs of a truss with one displacement, written with switches: z = (u, forces)."""

    def __init__(self, truss, plastic):
        self.truss, self.plastic, history = truss, plastic, truss.history
        times, loads = history.times, history.loads[:, 0]
        self.times, self.slopes = times, np.diff(loads) / np.diff(times)

    def load(self, t, sw):
        slopes = self.slopes
        load = self.truss.history.loads[0, 0] + slopes[0] * t
        for change, corner in zip(np.diff(slopes), self.times[1:-1], strict=True):
            load += change * sw.relu(t - corner)
        return load

    def remembering(self, memory):
        truss, m = self.truss, len(self.plastic)

        def law(z, t, sw):
            forces = [
                sw.clip(k * (z[0] - stretch), -y, y)
                for k, stretch, y in zip(truss.stiffness, memory, truss.strength, strict=True)
            ]
            hard = truss.hardening.sum() * z[0]
            balance = hard + sum(z[1 + i] for i in range(m)) - self.load(t, sw)
            return [balance, *(z[1 + i] - forces[i] for i in range(m))]

        return Switched(m + 1, law, linear=True)

    def memory(self, z, t):
        return z[0] - z[1:] / self.truss.stiffness

    def initial_memory(self):
        return self.plastic


@pytest.mark.parametrize("seed", swept(range(3), range(3, 100)))
@pytest.mark.sweep(2)
def test_equal_stops_in_one_law_follow_the_stop_operators(seed):
    """Some stops are equal and yield together; some differ by their memory alone, and meet."""
    rng = np.random.default_rng([9, seed])
    m, history = int(rng.integers(2, 5)), springs(seed).history
    kinds = rng.integers(0, 2, m)  # two kinds of springs
    k, y = rng.uniform(0.5, 2.0, 2)[kinds], rng.uniform(0.2, 1.5, 2)[kinds]
    plastic = np.where(rng.random(m) < 0.3, rng.uniform(-0.1, 0.1), 0.0)
    truss = PlasticTruss(np.ones((m, 1)), history, k, y, rng.uniform(0.1, 1.0, m))
    evolution = evolve(Stops(truss, plastic), history.interval)
    assert evolution.is_complete
    assert evolution.paths().number == 1
    for t, expected in zip(history.times, stops(truss, plastic), strict=True):
        (state,) = evolution.states(t)
        assert np.abs(state.z - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())


def test_a_load_that_rests_at_yield_has_one_state():
    """Rounding alone may leave and meet the yield force again a moment later."""
    top = 0.00019516036824067859
    load = LoadHistory([[0.0], [top], [top], [-top]], [1e4, 10009.999999999998, 20010.0, 70010.0])
    truss = PlasticTruss([[1.0]], load, 0.63192298, 0.00011887, 0.30193672)
    evolution = evolve(truss, load.interval)
    assert [evolution.count(t) for t in load.times] == [1, 1, 1, 1]
    assert evolution.multiplicity() == [(*load.interval, 1)]


@pytest.mark.parametrize("interval", [(0.0, 9.0), (-1.0, 1.0)])
@pytest.mark.parametrize("kind", ["truss", "body"])
def test_an_evolution_does_not_go_on_beyond_its_history(kind, interval):
    history = LoadHistory([[3.0, 0.0], [3.0, 1.0]])
    body = ContactBody([[2, -1], [-1, 2]], [[1, 0]], [[0, 1]])
    systems = {
        "truss": PlasticTruss(np.eye(2), history, 1.0, 1.0, 1.0),
        "body": QuasiStaticCoulomb(body, history, 0.5),
    }
    with pytest.raises(InvalidInputError, match=r"leaves the times \[0, 1\] of the load history"):
        evolve(systems[kind], interval)


@pytest.mark.parametrize("seed", range(12))
def test_a_cycle_is_what_the_swing_of_its_springs_says(seed):
    """A spring yields in each cycle if its force would swing by more than twice its strength."""
    rng = np.random.default_rng([3, seed])
    m, (length, force) = int(rng.integers(1, 5)), 10.0 ** rng.integers(-9, 10, 2)
    k, y, H = rng.uniform(0.5, 2.0, m), rng.uniform(0.3, 1.0, m), rng.uniform(0.1, 1.0, m)
    mean, swing = rng.uniform(-1.0, 1.0), rng.uniform(0.2, 3.0)
    loads = LoadHistory(force * np.array([[0.0], *[[mean + swing], [mean - swing]] * 4]))
    truss = PlasticTruss(np.ones((m, 1)), loads, k * force / length, y * force, H * force / length)
    evolution = evolve(truss, loads.interval)
    (high,), (low,) = evolution.states(7.0), evolution.states(8.0)
    yields = (k * abs(high.z[0] - low.z[0]) > 2.000001 * y * length).any()
    assert [cycle.kind for cycle in evolution.cycle(2.0)] == [
        "cyclic slip" if yields else "shakedown"
    ]


def test_settings_of_the_scene_are_refused_by_their_own_numbers():
    for setting in ({"hardening": -1.0}, {"springs": 0}):
        with pytest.raises(InvalidInputError, match=r"^(hardening .* got -1.0|springs .* got 0)$"):
            play(**setting)
