"""Side paths, on which H = mu d at fixed alpha, lead to solutions that are known in closed form."""

from itertools import product

import numpy as np
import pytest
from pwscont_power import Branch, Generator, Network, PowerFlow

from pwscont import Switched, explore
from pwscont.curve.metric import Metric
from pwscont.search.pursuit import Pursuit
from pwscont.search.search import KnownBranches
from pwscont.search.side_paths import SidePaths


def turned(size):
    return np.linalg.qr(np.random.default_rng(size).normal(size=(size, size)))[0]


#: A function of one unknown, and where the function is zero.
LAWS = {
    "kinks": (lambda w, sw: sw.abs(w) + w**2 - 2.0, (-1.0, 1.0)),
    "smooth": (lambda w, sw: w**3 - w, (-1.0, 0.0, 1.0)),
}


def from_a_solution(system, z, directions):
    """Return the states to which side paths lead from a solution at alpha = 0.5."""
    interval, known, found = (0.0, 1.0), KnownBranches(), [np.append(z, 0.5)]
    metric = Metric(np.ones(len(z) + 1), interval)
    pursuit = Pursuit(system, metric, known, np.ones(len(z)))
    pursuit.solutions = lambda alpha: found
    for number in range(directions):
        paths = SidePaths(pursuit, steps=2000)
        found += [x for x, _ in paths.at(0.5, number)]
    return np.array(found)[:, :-1]


@pytest.mark.sweep(1)
@pytest.mark.parametrize("law", LAWS)
def test_side_paths_lead_to_solutions_each_once(law):
    """Equations of a single unknown each, turned: the solutions are all combinations."""
    (f, zeros), Q = LAWS[law], turned(4)
    system = Switched(4, lambda z, t, sw: [f(row @ z, sw) for row in Q])
    true = np.array(list(product(zeros, repeat=4))) @ Q
    found = from_a_solution(system, true[-1], directions=2)
    apart = np.linalg.norm(found[:, np.newaxis] - true, axis=2)
    assert apart.min(axis=1).max() < 1e-9  # nothing but solutions
    assert len(np.unique(apart.argmin(axis=1))) == len(found)  # each once
    assert len(found) > 3


def star(buses, seed):
    """Return a grid of loads, each on a line of its own from the slack, and the first nose.

    V^4 + (2 a Q x - 1) V^2 + (a x |S|)^2 = 0 at loading a: two voltages below the nose of a bus.
    """
    rng = np.random.default_rng(seed)
    x, P, Q = (rng.uniform(*ends, buses) for ends in ((0.1, 0.6), (0.1, 0.6), (0.0, 0.3)))
    lines = tuple(Branch(1, i + 2, 0.0, x[i]) for i in range(buses))
    load = [0.0, *(P + 1j * Q)]
    network = Network(tuple(range(1, buses + 2)), lines, (Generator(1, 1.0),), slack=1, load=load)
    return PowerFlow(network), float((0.5 / (x * (np.hypot(P, Q) + Q))).min())


@pytest.mark.slow
@pytest.mark.parametrize(("buses", "seed"), [(3, 0), (4, 1), (5, 1)])
def test_every_bus_has_a_high_and_a_low_voltage(buses, seed):
    system, nose = star(buses, seed)
    graph = explore(system, (0.1, 0.9 * nose))
    assert [graph.count(part * nose) for part in (0.2, 0.5, 0.8)] == [2**buses] * 3
