"""Corners of static friction with one ray to either side, proved without enumeration (F17)."""

import numpy as np
import pytest
from integer_problems import integer_problem
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from sweeps import swept

from pwscont import explore, trace
from pwscont.curve.metric import Metric
from pwscont.transitions.cone import rays_of_slices
from pwscont.transitions.corner import Corner

INTERVAL = (-2.0, 2.0)


def corners(seed):
    """Yield corners of a static problem of small integers, and what the system says of each."""
    problem = integer_problem(seed)
    body = ContactBody(problem.A, problem.N, problem.T, problem.gap)
    friction = problem.F * (0.3 if seed % 2 else 1.0)
    f0 = problem.loads[0] * (seed % 3 > 0)
    system = CoulombLoad(body, AffineLoad(f0, problem.loads[1]), friction).within(*INTERVAL)
    metric = Metric.of(system, INTERVAL)
    for point in explore(system, INTERVAL).special_points():
        x, error = np.append(point.z, point.alpha), np.maximum(point.error, 1e-15)[np.newaxis]
        corner = Corner.at(system, metric, x, error)
        if corner.zero:
            yield corner, system.has_one_ray(point.z, point.alpha, corner.zero)


@pytest.mark.parametrize("seed", [*swept(range(12), range(12, 400)), 320])
@pytest.mark.sweep(6)
def test_what_is_called_unique_is(seed):
    for corner, is_unique in corners(seed):
        found = rays_of_slices(corner)
        if is_unique and found is not None:
            slopes = np.array([direction[-1] for direction, _ in found[0]])
            assert found[1] == 1
            assert np.count_nonzero(slopes > 1e-12) <= 1
            assert np.count_nonzero(slopes < -1e-12) <= 1
            assert not (np.abs(slopes) <= 1e-12).any()


def test_many_corners_are_unique():
    answers = [is_unique for seed in range(12) for _, is_unique in corners(seed)]
    assert sum(answers) > len(answers) / 3


def test_the_unloaded_block_is_no_corner_searched_in_part():
    scenes = pytest.importorskip("pwscont_coulomb.elastic.scenes")
    problem = scenes.block_body(12, 0.3).condensed()
    load = AffineLoad(np.zeros(24), problem.load.f0 + 0.3 * problem.load.f1)
    system = CoulombLoad(problem.body, load, problem.friction)
    graph = trace(system, (np.zeros(system.size), 0.0), (-1.0, 1.0))
    assert graph.special_points("corner")
    assert not graph.special_points("corner searched in part")
