"""A sparse body gives the graph of the same body stored densely."""

import numpy as np
import pytest
import scipy.sparse as sp
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from random_bodies import contact_body, random_body, random_vector

from pwscont import ExactLinear, PiecewiseLinearSystem, PseudoArclength, explore, trace

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

FORMATS = [sp.csr_matrix, sp.csc_matrix, sp.coo_matrix]
CASES = [(2, 1), (2, 8), (3, 3), (3, 5)]
BODIES = pytest.mark.parametrize(("p", "seed"), CASES)


def sparse_body(body, kind=sp.csr_matrix):
    return ContactBody(kind(body.A), kind(body.N), kind(body.T), body.gap)


def assert_same_graph(sparse, dense):
    assert [p.label for p in sparse.pieces] == [p.label for p in dense.pieces]
    assert [p.det_sign for p in sparse.pieces] == [p.det_sign for p in dense.pieces]
    assert [(p.start, p.end) for p in sparse.pieces] == [(p.start, p.end) for p in dense.pieces]
    for a, b in zip(sparse.pieces, dense.pieces, strict=True):
        np.testing.assert_allclose(a.points[[0, -1]], b.points[[0, -1]], rtol=1e-9, atol=1e-11)
    kinds = [[str(point.kind) for point in g.special_points()] for g in (sparse, dense)]
    assert kinds[0] == kinds[1]


@BODIES
@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arc"])
@pytest.mark.sweep(4)
def test_affine_load(p, seed, stepper):
    body = random_body(p, seed, inner=4, gap=True)
    load = AffineLoad(random_vector(body.n, seed), random_vector(body.n, seed + 1))
    systems = (CoulombLoad(make(body), load, 4.0) for make in (sparse_body, contact_body))
    sparse, dense = (explore(system, (-2.0, 2.0), stepper=stepper) for system in systems)
    assert len(dense.pieces) > 1
    assert_same_graph(sparse, dense)


@BODIES
@pytest.mark.sweep(6)
def test_friction(p, seed):
    body = random_body(p, seed, inner=4)
    force = 2.0 * random_vector(body.n, seed)
    systems = (CoulombFriction(make(body), force) for make in (sparse_body, contact_body))
    sparse, dense = (explore(system, (0.0, 10.0)) for system in systems)
    assert_same_graph(sparse, dense)


@BODIES
def test_jacobians(p, seed):
    body = random_body(p, seed, gap=True)
    force = random_vector(body.n, seed)
    systems = [CoulombFriction(make(body), force) for make in (sparse_body, contact_body)]
    z = np.random.default_rng(seed).normal(size=systems[0].size)
    character = systems[1].character(z, 0.5)
    assert systems[0].character(z, 0.5) == character
    sparse, dense = (system.jacobian(z, 0.5, character) for system in systems)
    assert sp.issparse(sparse)
    np.testing.assert_allclose(sparse.toarray(), dense, rtol=1e-13, atol=1e-13)
    sparse, dense = (system.test_jacobian(z, 0.5) for system in systems)
    assert sp.issparse(sparse)
    np.testing.assert_allclose(sparse.toarray(), dense, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("kind", FORMATS)
def test_any_sparse_format(kind):
    body = random_body(2, 1)
    load = AffineLoad(random_vector(body.n, 1), random_vector(body.n, 2))
    systems = [CoulombLoad(b, load, 2.0) for b in (sparse_body(body, kind), contact_body(body))]
    assert_same_graph(*(explore(system, (-1.0, 1.0)) for system in systems))


def test_a_sparse_matrix_with_dense_operators():
    body = random_body(2, 1)
    load = AffineLoad(random_vector(body.n, 1), random_vector(body.n, 2))
    mixed = ContactBody(sp.csr_matrix(body.A), body.N, body.T, body.gap)
    systems = [CoulombLoad(b, load, 2.0) for b in (mixed, contact_body(body))]
    assert_same_graph(*(explore(system, (-1.0, 1.0)) for system in systems))


def test_rough_start():
    body = random_body(3, 3, inner=4)
    load = AffineLoad(random_vector(body.n, 1), random_vector(body.n, 2))
    start = (np.ones(body.n + 6), 0.3)
    systems = [CoulombLoad(make(body), load, 0.5) for make in (sparse_body, contact_body)]
    assert_same_graph(*(trace(system, start, (-1.0, 1.0)) for system in systems))


class Corner(PiecewiseLinearSystem):
    """2 z + |z| / 2 = alpha for two unknowns, whose tests both vanish at the start."""

    size = 2

    def __init__(self, kind):
        self.kind = kind

    def test_functions(self, z, alpha):
        return z.copy()

    def test_jacobian(self, z, alpha):
        return self.kind(np.eye(2, 3))

    def slopes(self, character):
        return 2.0 + 0.5 * np.where(character.array, 1.0, -1.0)

    def residual(self, z, alpha, character):
        return self.slopes(character) * z - alpha

    def jacobian(self, z, alpha, character):
        return self.kind(np.column_stack([np.diag(self.slopes(character)), -np.ones(2)]))


KINDS = ["csr", "csc", "coo", "bsr", "dia", "dok", "lil"]


@pytest.mark.parametrize(
    "kind", [f"{kind}_{what}" for kind in KINDS for what in ("matrix", "array")]
)
@pytest.mark.sweep(4)
def test_starts_in_a_corner_with_any_storage(kind):
    system = Corner(getattr(sp, kind))
    for graph in (
        explore(system, (-1.0, 1.0), starts=[(np.zeros(2), 0.0)]),
        trace(system, (np.zeros(2), 0.0), (-1.0, 1.0)),
    ):
        for alpha, slope in ((-1.0, 1.5), (1.0, 2.5)):
            (found,) = graph.solutions(alpha)
            np.testing.assert_allclose(found.z, alpha / slope, rtol=1e-14)
