"""Results do not depend on the units of length, force and the parameter."""

from functools import cache

import numpy as np
import pytest
from paper_systems import CASES, ONE_NODE, TWO_NODES
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from reference_enumeration import Body

from pwscont import ExactLinear, PiecewiseSystem, PseudoArclength, explore, trace

# stiffness and force of one unit of the paper's data: soft tissue to steel, micro to mega
UNITS = [(1.0, 1.0), (1e3, 1e-3), (2.1e11, 1e3), (2.1e11, 1e6), (1e-6, 1e-9), (1e12, 1.0)]
ALL_UNITS = pytest.mark.parametrize(("stiffness", "force"), UNITS)
STEPPERS = pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()])


def scaled_body(body: Body, stiffness):
    return ContactBody(stiffness * body.A, body.N, body.T)


def natural(z, body, stiffness, force):
    """Return z in the paper's units."""
    scale = np.repeat([force / stiffness, force], [body.n, 2 * body.p])
    return z / scale


def assert_same(graph, reference, body, stiffness, force, per_alpha):
    assert [p.label for p in graph.pieces] == [p.label for p in reference.pieces]
    for found, expected in zip(graph.pieces, reference.pieces, strict=True):
        assert found.det_sign == expected.det_sign
        ends = np.array(found.interval) / per_alpha
        np.testing.assert_allclose(ends, expected.interval, rtol=1e-11, atol=1e-11)
        z = [natural(z, body, stiffness, force) for z in found.z[[0, -1]]]
        np.testing.assert_allclose(z, expected.z[[0, -1]], rtol=1e-9, atol=1e-11)


@cache
def reference_of(name):
    return explore(CASES[name].system, CASES[name].interval)


@ALL_UNITS
@STEPPERS
@pytest.mark.parametrize("name", ["fig7", "example1"])
def test_affine_load(stiffness, force, stepper, name):
    case, body = CASES[name], CASES[name].body
    load = AffineLoad(force * case.load.f0, case.load.f1)
    system = CoulombLoad(scaled_body(body, stiffness), load, 4.0)
    interval = tuple(force * end for end in case.interval)
    graph = explore(system, interval, stepper=stepper)
    reference = reference_of(name)
    assert_same(graph, reference, body, stiffness, force, per_alpha=force)


@ALL_UNITS
def test_friction(stiffness, force):
    name = "example3"
    case = CASES[name]
    load = force * np.array([0.4, -1.4, 1.5, -1.5])
    system = CoulombFriction(scaled_body(TWO_NODES, stiffness), load)
    graph = explore(system, case.interval)
    reference = reference_of(name)
    assert_same(graph, reference, TWO_NODES, stiffness, force, per_alpha=1.0)


@ALL_UNITS
def test_trace_from_a_rough_start(stiffness, force):
    """Semismooth Newton, too, measures in the units of the system."""
    load = AffineLoad([0.25 * force, 0.0], [0.0, force])
    system = CoulombLoad(scaled_body(ONE_NODE, stiffness), load, 4.0)
    graph = trace(system, (np.zeros(4), 1.5), (-2.0, 2.0))
    assert [count for _, _, count in graph.multiplicity()] == [1, 3, 1]
    alphas = [node.alpha for node in graph.special_points("nonsmooth fold")]
    np.testing.assert_allclose(alphas, [-0.5, -1.0], rtol=1e-11)


@pytest.mark.parametrize("r", [1e-4, 0.1, 10.0, 1e4])
@pytest.mark.parametrize("name", ["fig7", "example1"])
def test_the_scale_of_the_augmented_multipliers_does_not_matter(r, name):
    case = CASES[name]
    system = CoulombLoad(scaled_body(case.body, 1.0), case.load, 4.0, r=r)
    graph = explore(system, case.interval)
    assert_same(graph, reference_of(name), case.body, 1.0, 1.0, 1.0)


class Bend(PiecewiseSystem):
    """A fold and two transitions within 0.02 of alpha, wherever the interval lies."""

    size = 1

    def __init__(self, size_of_z, begin):
        self.unit, self.begin = size_of_z, begin

    def test_functions(self, z, alpha):
        return (z / self.unit + 0.46) ** 2 - 0.009**2

    def residual(self, z, alpha, character):
        w = z / self.unit
        smooth = 0.2357 * w - 0.4617 * np.tanh(w / 0.087) - (alpha - self.begin)
        return smooth - 0.8 * self.test_functions(z, alpha) * character.signs[0]


@pytest.mark.parametrize("unit", [1.0, 0.00425])
@pytest.mark.parametrize("begin", [0.0, 1e3, 1e6])
def test_where_the_interval_lies_does_not_make_two_points_one(unit, begin):
    system, w = Bend(unit, begin), -0.0289
    alpha = float(0.2357 * w - 0.4617 * np.tanh(w / 0.087) - 0.8 * ((w + 0.46) ** 2 - 0.009**2))
    interval = (begin - 1.424, begin + 1.327)
    graph = trace(system, ([unit * w], begin + alpha), interval)
    found = {kind: graph.special_points(kind) for kind in ("transition", "fold")}
    places = {kind: sorted(p.z[0] / unit for p in points) for kind, points in found.items()}
    np.testing.assert_allclose(places["transition"], [-0.469, -0.451], rtol=1e-6)
    np.testing.assert_allclose(places["fold"], [-0.320964554], rtol=1e-4)
