"""Contact nodes that cannot reach the obstacle are left out with a proof, and put back."""

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from random_bodies import random_body, random_vector
from reference_enumeration import Body, enumerate_solutions, modes_of

from pwscont import explore, trace

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


def with_far_nodes(p, seed, far):
    """Return a body whose nodes in ``far`` have a gap that no load of the tests closes."""
    body = random_body(p, seed)
    gaps = np.zeros(p)
    gaps[list(far)] = 1e3
    return Body(body.A, body.N, body.T, gaps)


def affine(body, seed, friction=1.5):
    load = AffineLoad(random_vector(body.n, seed), random_vector(body.n, [seed, 1]))
    return CoulombLoad(ContactBody(body.A, body.N, body.T, body.gap), load, friction)


@pytest.mark.parametrize(("p", "far"), [(2, (1,)), (3, (0, 2)), (3, (1,))])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(4)
def test_the_graph_is_that_of_the_whole_body(p, far, seed):
    body = with_far_nodes(p, seed, far)
    system = affine(body, seed)
    assert system.reduction(-3.0, 3.0).system.body.p == p - len(far)
    graph = explore(system, (-3.0, 3.0))
    for alpha in np.linspace(-2.9, 2.9, 7):
        expected = enumerate_solutions(body, system.load_at(alpha), 1.5)
        found = graph.solutions(alpha)
        assert len(found) == len(expected)
        for solution in found:
            assert any(np.allclose(solution.z, e.z, rtol=1e-9, atol=1e-9) for e in expected)
            assert all(modes_of(solution.label)[i] == "no contact" for i in far)


def test_messages_keep_the_numbers_of_the_nodes():
    graph = explore(affine(with_far_nodes(2, 3, (0,)), 3, friction=4.0), (-5.0, 5.0))
    messages = [node.message for node in graph.special_points() if "→" in node.message]
    assert messages
    assert all(message.startswith("node 2: ") for message in messages)


@pytest.mark.parametrize("seed", range(20))
def test_the_bound_holds_for_every_solution(seed):
    """No solution of the unreduced problem moves a node further than its bound."""
    body = random_body(2, seed, gap=True)
    force = 3.0 * random_vector(body.n, seed)
    contact = ContactBody(body.A, body.N, body.T, body.gap)
    reach = contact.reach(force[:, np.newaxis])
    for solution in enumerate_solutions(body, force, 2.0):
        assert (body.N @ solution.z[: body.n] <= reach * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("unit", [1e-150, 1.0, 1e120])
@pytest.mark.parametrize("seed", range(20))
def test_the_lower_bound_is_below_the_bound(seed, unit):
    body, rng = random_body(3, seed), np.random.default_rng(seed)
    contact = ContactBody(body.A, body.N, body.T, np.zeros(3))
    loads = unit * np.column_stack([np.zeros(body.n), *rng.normal(size=(2, body.n))])
    least, reach = contact.least_reach(loads), contact.reach(loads)
    assert (least > 0.0).all()
    assert (least <= reach * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("soft", 2.0 ** -np.arange(20.0, 45.0, 4.0))
def test_the_lower_bound_of_a_soft_body(soft):
    """A ring of springs h that hardly holds still: under equal forces its energy is 12 / soft."""
    for h in 1.0 + np.arange(64.0) / 64.0:
        ring, eye = np.eye(16), np.eye(16)
        neighbours = np.roll(np.eye(12), 1, axis=0)
        ring[4:, 4:] = (2.0 * h + soft) * np.eye(12) - h * (neighbours + neighbours.T)
        assert (ring.sum(axis=1)[4:] == soft).all()  # without rounding
        body = ContactBody(ring, eye[:2], eye[2:4])
        least = body.least_reach(np.repeat([0.0, 1.0], [4, 12])[:, np.newaxis])
        assert (least <= np.sqrt(12.0 / soft)).all()


def test_friction_as_parameter_and_trace():
    body = with_far_nodes(2, 5, (1,))
    force = random_vector(body.n, 5) + np.array([3.0, 0.0, 0.0, 0.0, 0.0])
    system = CoulombFriction(ContactBody(body.A, body.N, body.T, body.gap), force)
    assert len(system.reduction(0.0, 2.0).reasons) == 1
    graph = trace(system, (np.zeros(system.size), 1.0), (0.0, 2.0))
    (solution,) = graph.solutions(0.5)
    (expected,) = enumerate_solutions(body, force, 0.5)
    np.testing.assert_allclose(solution.z, expected.z, rtol=1e-9, atol=1e-9)
    assert len(solution.error) == system.size + 1


def test_nothing_is_left_out_without_a_proof():
    body = with_far_nodes(2, 1, (1,))
    contact = ContactBody(body.A, body.N, body.T, body.gap)

    def curved(alpha):
        return np.cos(alpha) * np.ones(body.n)

    assert CoulombLoad(contact, curved, 1.0).reduction(0.0, 1.0) is None
    near = ContactBody(body.A, body.N, body.T, [0.0, 1e-3])
    load = AffineLoad(np.ones(body.n), np.ones(body.n))
    assert CoulombLoad(near, load, 1.0).reduction(0.0, 1.0) is None
