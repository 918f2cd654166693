"""Evolutions of a block against small increments of the load, which share no line with pwscont."""

import numpy as np
import pytest
from increments import increments
from pwscont_coulomb import LoadHistory, QuasiStaticCoulomb

from pwscont import evolve


def against_increments(nodes, loads, steps):
    """Return the largest difference of contact forces at the corners of the load."""
    problem = pytest.importorskip("pwscont_coulomb.elastic.scenes").block_body(nodes).condensed()
    body, friction = problem.body, np.full(nodes, 0.3)
    history = LoadHistory([a * problem.load.f0 + b * problem.load.f1 for a, b in loads])
    path = evolve(QuasiStaticCoulomb(body, history, friction), history.interval).paths()[0]
    exact = np.array([path.state(t).z[-2 * nodes :] for t in history.times])
    arguments = body.A, body.N, body.T, body.gap, friction, history.loads
    found = np.array([forces for forces, _ in increments(*arguments, steps)])
    return np.abs(found - exact).max() / np.abs(exact).max()


TO_AND_FRO = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
MIXED = [(0.0, 0.0), (1.0, 0.5), (0.6, 1.0), (1.5, -1.0), (0.5, -0.2)]


def test_few_increments_agree_where_slip_goes_one_way_on_each_line():
    """The scheme of increments shares no line with pwscont."""
    assert against_increments(12, MIXED, 20) < 1e-12


@pytest.mark.slow
def test_increments_come_closer_to_the_evolution():
    errors = [against_increments(50, MIXED, steps) for steps in (5, 50, 100)]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-6


@pytest.mark.slow
def test_increments_refined_until_they_agree():
    assert against_increments(50, TO_AND_FRO, 4000) < 1e-5
