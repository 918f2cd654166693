"""Bodies that nothing but the contact holds: A is positive semidefinite and singular.

The truth is the enumeration of all modes, and equilibrium by hand.
"""

import numpy as np
import pytest
import scipy.sparse as sp
from helpers.reference_enumeration import Body, enumerate_solutions
from pwscont_coulomb import (
    AffineLoad,
    ContactBody,
    CoulombFriction,
    CoulombLoad,
    LoadHistory,
    QuasiStaticCoulomb,
)

from pwscont import InvalidInputError, explore
from pwscont import enumerate_solutions as enumerate_all

#: Solutions farther out are rounding of modes without any solution.
FAR = 1e6
#: Solutions that miss a cell, or lie inside, by less are not compared.
CLOSE = 1e-6


def masses_on_springs(rng):
    """Return masses in a plane, each spring a matrix of rank one; the first masses may touch."""
    p, others = int(rng.integers(1, 4)), int(rng.integers(0, 3))
    count = p + others
    A = np.zeros((2 * count, 2 * count))

    def add(ways, stiffness):
        v = np.zeros(2 * count)
        for mass, way in ways:
            v[2 * mass : 2 * mass + 2] = way
        A[:] += stiffness * np.outer(v, v)

    for i in range(count):
        for j in range(i):
            angle, (one, other) = rng.uniform(0.0, np.pi), rng.uniform(0.3, 3.0, 2)
            way = np.array([np.cos(angle), np.sin(angle)])
            add([(i, way), (j, -way)], one)
            if rng.random() < 0.7:
                add([(i, way[::-1] * [-1.0, 1.0]), (j, way[::-1] * [1.0, -1.0])], other)
    if rng.random() < 0.6:
        add([(0, np.array([1.0, 0.0]))], rng.uniform(0.3, 3.0))  # held sideways
    picks = np.eye(2 * count)
    gap = rng.choice([0.0, 0.2], size=p) * rng.uniform(size=p)
    return Body(A, picks[1 : 2 * p : 2], picks[0 : 2 * p : 2], gap)


def loads_on(body, rng):
    f0, f1 = rng.normal(size=(2, body.n)) * [[0.5], [1.0]]
    f0[1::2] += rng.uniform(-0.2, 1.2)  # weight
    return f0, f1


def is_free(body):
    """Tell whether a mass can move without force even if all nodes stick."""
    held = body.A + body.N.T @ body.N + body.T.T @ body.T
    return np.linalg.eigvalsh(held)[0] < CLOSE


def truth(body, load, friction):
    """Return all solutions, None where one lies close to another cell."""
    found = enumerate_solutions(body, load, friction, CLOSE)
    near = [each for each in found if np.abs(each.z).max() < FAR]
    return None if any(abs(each.margin) < CLOSE for each in near) else near


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix], ids=["dense", "sparse"])
@pytest.mark.parametrize("seed", range(30))
@pytest.mark.sweep(6)
def test_counts_are_those_of_all_modes(kind, seed):
    rng = np.random.default_rng([77, seed])
    body = masses_on_springs(rng)
    (f0, f1), friction = loads_on(body, rng), rng.uniform(0.0, 2.0)
    if is_free(body):
        with pytest.raises(InvalidInputError, match="A is not positive definite"):
            ContactBody(kind(body.A), body.N, body.T)
        return
    given = ContactBody(kind(body.A), body.N, body.T, body.gap)
    assert given.is_clamped == (np.linalg.eigvalsh(body.A)[0] > CLOSE)
    graph = explore(CoulombLoad(given, AffineLoad(f0, f1), friction), (-1.0, 1.0))
    for alpha in rng.uniform(-1.0, 1.0, 5):
        wanted = truth(body, f0 + alpha * f1, friction)
        if wanted is not None and "not balanced" not in graph.guarantee:
            assert graph.count(alpha) == len(wanted), graph.guarantee


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.sweep(4)
def test_counts_while_friction_grows(seed):
    rng = np.random.default_rng([78, seed])
    body = masses_on_springs(rng)
    f, _ = loads_on(body, rng)
    if is_free(body):
        return  # refused, as above
    given = ContactBody(body.A, body.N, body.T, body.gap)
    graph = explore(CoulombFriction(given, f), (0.05, 3.0))
    for friction in rng.uniform(0.05, 3.0, 5):
        wanted = truth(body, f, friction)
        if wanted is not None and "not balanced" not in graph.guarantee:
            assert graph.count(friction) == len(wanted), graph.guarantee


@pytest.mark.parametrize(
    ("seed", "alpha"), [(951, 0.139), (1292, 0.036), (1401, 0.776), (1454, -0.5), (1671, 0.608)]
)
def test_a_solution_without_digits_hides_no_other(seed, alpha):
    """Rounding gives modes without a solution one at 1e17, within whose error all others lie."""
    rng = np.random.default_rng([77, seed])
    body = masses_on_springs(rng)
    (f0, f1), friction = loads_on(body, rng), rng.uniform(0.0, 2.0)
    given = ContactBody(body.A, body.N, body.T, body.gap)
    found = enumerate_all(CoulombLoad(given, AffineLoad(f0, f1), friction), alpha)
    wanted = truth(body, f0 + alpha * f1, friction)
    assert len(found) == len(wanted) > 0, found.guarantee
    for each in wanted:
        assert min(np.abs(each.z - other.z).max() for other in found) < CLOSE


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_two_masses_on_the_floor(unit):
    """The spring between two masses carries the weight of the upper mass down to the floor."""
    A = unit * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0], [0.0, -1.0, 1.0]])
    body = ContactBody(A, N=[[0.0, 1.0, 0.0]], T=[[1.0, 0.0, 0.0]])
    load = AffineLoad([0.0, 0.0, unit], [unit, 0.0, 0.0])
    graph = explore(CoulombLoad(body, load, 0.3), (-1.0, 1.0))
    assert graph.guarantee == "complete"
    for alpha in (-0.5, 0.1, 0.5):
        (found,) = graph.solutions(alpha)
        u = np.sign(alpha) * max(abs(alpha) - 0.3, 0.0)
        shear = -unit * np.clip(alpha, -0.3, 0.3)
        np.testing.assert_allclose(found.z[:3], [u, 0.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(found.z[3:], [-unit, shear], atol=1e-12 * unit)


def test_a_body_that_is_lifted_has_no_solution():
    """The load alpha presses the body on the floor where alpha is positive."""
    body = ContactBody([[1.0, 0.0], [0.0, 0.0]], N=[[0.0, 1.0]], T=[[1.0, 0.0]])
    graph = explore(CoulombLoad(body, AffineLoad([0.0, 0.0], [0.0, 1.0]), 0.5), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.5, 0.5)] == [0, 1]
    assert graph.count(0.0) == np.inf  # at any height


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix], ids=["dense", "sparse"])
def test_what_nothing_holds_is_refused(kind):
    N, T = np.eye(3)[[0]], np.eye(3)[[1]]
    free = np.diag([1.0, 1.0, 0.0])  # the third displacement is free, even if the node sticks
    weak = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0], [2.0, 0.0, 1.0]])  # gives energy away
    idle = np.array([[0.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.1, 0.0, 1.0]])
    for A in (free, weak, idle):
        with pytest.raises(InvalidInputError, match="A is not positive definite"):
            ContactBody(kind(A), N, T)


def test_what_needs_a_clamped_body_says_so():
    body = ContactBody([[1.0, 0.0], [0.0, 0.0]], N=[[0.0, 1.0]], T=[[1.0, 0.0]])
    for ask in (body.condensed, lambda: QuasiStaticCoulomb(body, LoadHistory([[0, 1], [1, 1]]), 1)):
        with pytest.raises(InvalidInputError, match="needs a body that is clamped"):
            ask()
