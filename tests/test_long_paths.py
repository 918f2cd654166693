"""Paths of many contact nodes: straight and curved pieces, corners, memory."""

import pickle
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from pwscont_coulomb.rows import FEW, GradientRows

from pwscont import Character, PseudoArclength, trace
from pwscont.basics.arrays import dense, power_of_two
from pwscont.graph.records import Place, first_digits, from_first_digits
from pwscont.linear.factor import DenseLU
from pwscont.linear.factorise import factor
from pwscont.linear.jacobian import BandLU, SparseLU

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from scale_parts import plain
from strip import strip


class Afresh:
    """Solves with every matrix from the beginning, as numpy does."""

    def solve(self, matrix, rhs):
        return np.linalg.solve(matrix.dense(), np.transpose(rhs)).T

    def solve_transposed(self, matrix, rhs):
        return np.linalg.solve(matrix.dense().T, np.transpose(rhs)).T

    def sign(self, matrix):
        return int(np.linalg.slogdet(matrix.dense())[0])

    def renew(self, matrix):
        return False


def strip_system(p, friction=0.3, solver=None):
    body, load = strip(p)
    system = CoulombLoad(body, load, friction)
    if solver is not None:
        system.algebra.solver = solver
    return system


def traced(system, hi=1.0):
    return trace(system, (np.zeros(system.size), 0.0), (0.0, hi))


def violations(system, z, alpha):
    """Return how far a state is from equilibrium, contact and friction, relative to the terms."""
    body, F = system.body, system.friction
    n, p, A = body.n, body.p, body.A
    u, normal, tangential = z[:n], z[n : n + p], z[n + p :]
    N, T = (sp.csr_matrix(rows) for rows in (body.N, body.T))
    rest = A @ u - system.load(alpha) - N.T @ normal - T.T @ tangential
    force = max(np.abs(A).max(axis=1) @ np.abs(u) / n, np.abs(system.load(alpha)).max())
    gap, shear, length = body.gap - N @ u, T @ u, np.abs(u).max()
    return [
        np.abs(rest).max() / force,
        max(0.0, -gap.min()) / length,
        max(0.0, normal.max()) / force,
        np.abs(normal * gap).max() / (force * length),
        max(0.0, (np.abs(tangential) - F * np.abs(normal)).max()) / force,
        np.abs((tangential - F * normal * np.sign(shear)) * shear).max() / (force * length),
    ]


@pytest.fixture(scope="module")
def long_path():
    system = strip_system(200)
    return system, traced(system)


@pytest.mark.slow
def test_updates_on_and_off_agree(long_path):
    system, updated = long_path
    fresh = traced(strip_system(200, solver=Afresh()), hi=0.3)
    count = len(fresh.pieces) - 1  # the last is cut off
    assert count > 60
    # the inverse takes up 48 changes at a time, and is hardly ever factorised afresh
    solver = system.algebra.solver
    assert 5 <= solver.updates <= len(updated.pieces) / 16
    assert solver.factorisations <= 3
    for a, b in zip(fresh.pieces[:count], updated.pieces[:count], strict=True):
        assert a.character == b.character
        assert a.det_sign == b.det_sign
        np.testing.assert_allclose(a.points, b.points, rtol=1e-9, atol=1e-9 * abs(b.points).max())


@pytest.mark.slow
def test_transitions_solve_the_problem(long_path):
    system, graph = long_path
    assert len(graph.pieces) > 300
    for point in graph.special_points():
        assert max(violations(system, point.z, point.alpha)) < 1e-9
    assert graph.is_balanced()


def test_signs_along_the_path(long_path):
    """With much friction det(dH/dz) is not positive everywhere; signs are those of numpy."""
    _, graph = long_path
    general = plain(strip_system(200))
    for piece in graph.pieces[::60]:
        middle = piece.points.mean(axis=0)
        jacobian = general.jacobian(middle[:-1], middle[-1], piece.character)
        assert piece.det_sign == np.linalg.slogdet(jacobian[:, :-1])[0]


# -- curved pieces ---------------------------------------------------------------------------------


def assert_same_path(a, b):
    assert [piece.character for piece in a.pieces] == [piece.character for piece in b.pieces]
    assert [piece.det_sign for piece in a.pieces] == [piece.det_sign for piece in b.pieces]
    for one, other in zip(a.special_points(), b.special_points(), strict=True):
        assert one.kind == other.kind
        size = np.abs(other.place.x).max()
        np.testing.assert_allclose(one.place.x, other.place.x, rtol=1e-9, atol=1e-10 * size)


@pytest.mark.slow
def test_friction_as_parameter():
    body, load = strip(40)
    graphs = [
        trace(system, (np.zeros(system.size), 0.1), (0.1, 2.0))
        for system in (
            CoulombFriction(body, load(0.6)),
            plain(CoulombFriction(body, load(0.6))),
        )
    ]
    assert len(graphs[0].pieces) > 25
    assert_same_path(*graphs)


def test_arclength_agrees_with_the_exact_path():
    system = strip_system(32)
    exact = traced(system)
    start = np.zeros(system.size), 0.0
    curved = trace(system, start, (0.0, 1.0), stepper=PseudoArclength())
    assert len(exact.pieces) > 40
    assert_same_path(curved, exact)


# -- corners ----------------------------------------------------------------------------------


def symmetric_system(p):
    """Return a body that is its own mirror image, pressed straight down: nodes move in pairs."""
    body, load = strip(p)
    mirrored = body.gap[::-1]
    flip = np.r_[np.arange(p)[::-1], p + np.arange(p)[::-1]]
    sign = np.repeat([1.0, -1.0], p)
    A = 0.5 * (body.A + sign[:, None] * body.A[np.ix_(flip, flip)] * sign)
    body = ContactBody(A, body.N, body.T, 0.5 * (body.gap + mirrored))
    down = 0.5 * (load.f0 + sign * load.f0[flip])
    return CoulombLoad(body, AffineLoad(down, 30.0 * down), 0.3)


@pytest.mark.parametrize("p", [20, 40])
@pytest.mark.sweep(2)
def test_symmetric_bodies_pass_their_corners(p):
    system = symmetric_system(p)
    graph = traced(system)
    kinds = {str(point.kind) for point in graph.special_points()}
    assert "corner" in kinds
    assert "stopped" not in kinds
    assert max(piece.interval[1] for piece in graph.pieces) == 1.0
    for point in graph.special_points():
        assert max(violations(system, point.z, point.alpha)) < 1e-9
        pressure = point.z[2 * p : 3 * p]
        np.testing.assert_allclose(pressure, pressure[::-1], atol=1e-9 * np.abs(pressure).max())


def test_symmetric_bodies_are_the_limit_of_bodies_nearly_symmetric():
    """Gaps that differ a little make two transitions of each corner, and the same states."""
    system = symmetric_system(24)
    body = system.body
    shifts = 1e-7 * np.random.default_rng(1).normal(size=24)
    apart = ContactBody(body.A, body.N, body.T, body.gap * (1.0 + shifts))
    pairs, singles = traced(system), traced(CoulombLoad(apart, system.load, 0.3))
    assert len(singles.pieces) > 1.5 * len(pairs.pieces)
    for alpha in (0.13, 0.5, 0.77, 1.0):
        (pair,), (single,) = pairs.solutions(alpha), singles.solutions(alpha)
        size = np.abs(single.z).max()
        np.testing.assert_allclose(pair.z, single.z, rtol=0, atol=1e-5 * size)


# -- memory -----------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [0, 1, FEW, FEW + 1, 40])
def test_rows_of_gradients_are_those_of_the_sparse_matrix(count):
    rng = np.random.default_rng(count)
    whole = sp.random_array((50, 30), density=0.1, rng=rng, format="csr")
    which = rng.permutation(50)[:count]
    rows = GradientRows(whole)[which]
    assert sp.issparse(rows) == (count > FEW)
    np.testing.assert_array_equal(dense(rows), whole.toarray()[which])
    np.testing.assert_array_equal(dense(abs(rows)), np.abs(whole.toarray()[which]))
    np.testing.assert_array_equal(GradientRows(whole)[:, :-1].toarray(), whole.toarray()[:, :-1])


@pytest.mark.slow
def test_memory_of_a_long_path():
    """Scaled up from the pieces of this path to 1,000, it stays far below 50 MB."""
    system, reached = strip_system(200), []
    tracemalloc.start()
    trace(
        system,
        (np.zeros(system.size), 0.0),
        (0.0, 0.4),
        report=lambda *_: reached.append(tracemalloc.get_traced_memory()[0]),
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(reached) > 100
    each = (reached[-1] - reached[10]) / (len(reached) - 11)
    assert peak + 1000 * each < 50e6
    assert each < 16 * 2 * 200 + 8e3  # two numbers per node, and what does not depend on p


def test_errors_are_stored_by_their_first_digits():
    error = np.r_[0.0, np.ldexp(np.random.default_rng(0).random(1000), np.arange(-1020, 980, 2))]
    kept = from_first_digits(first_digits(error))
    assert kept[0] == 0.0
    assert (kept >= error).all()
    assert (kept <= 1.0625 * error + 1e-300).all()
    np.testing.assert_array_equal(from_first_digits(first_digits(kept)), kept)


@pytest.mark.parametrize("size", [1, 64, 65])
@pytest.mark.parametrize("kind", [float, np.longdouble, np.float32])
def test_places_tell_the_first_digits_of_few_errors_and_of_many(size, kind):
    error = np.random.default_rng(size).uniform(1e-16, 1e-15, size).astype(kind)
    told = Place(np.zeros(size), error).error
    np.testing.assert_array_equal(told, from_first_digits(first_digits(error)))
    assert (told >= error).all()
    assert (told <= 1.0625 * error).all()


def test_ends_of_pieces_are_their_special_points(long_path):
    graph = long_path[1]
    for piece in graph.pieces:
        np.testing.assert_array_equal(piece.points[0], graph.point(piece.start).place.x)
        np.testing.assert_array_equal(piece.points[-1], graph.point(piece.end).place.x)


@pytest.mark.parametrize("kind", ["tridiagonal", "banded", "sparse", "dense"])
def test_several_right_hand_sides_are_solved_for_together(kind):
    rng, n, width = np.random.default_rng(3), 120, 2 if kind == "banded" else 1
    bands = rng.normal(size=(2 * width + 1, n))
    bands[width] += 5.0
    matrix = sp.dia_matrix((bands, range(width, -width - 1, -1)), shape=(n, n)).toarray()
    core = {
        "tridiagonal": lambda: BandLU(bands, 1, 1),
        "banded": lambda: BandLU(bands, 2, 2),
        "sparse": lambda: SparseLU(sp.csc_matrix(matrix)),
        "dense": lambda: DenseLU(matrix),
    }[kind]()
    rhs = rng.normal(size=(5, n))
    np.testing.assert_allclose(core.solve_all(rhs) @ matrix.T, rhs, atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 5, 40])
def test_a_dense_factorisation_solves_for_several_as_for_each(n):
    rng = np.random.default_rng(n)
    scale = 10.0 ** rng.integers(-6, 7, size=n)
    matrix, rhs = rng.normal(size=(n, n)) / scale, rng.normal(size=(3, n))
    made = factor(matrix, power_of_two(scale))
    assert not made.is_singular()
    together = made.solve_all(rhs.copy())
    np.testing.assert_allclose(together, [made.solve(one) for one in rhs], rtol=1e-9)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_dense_matrix_that_is_not_finite_is_singular(value):
    matrix = np.eye(3)
    matrix[1, 2] = value
    assert factor(matrix, np.ones(3)).is_singular()


@pytest.mark.parametrize("m", [0, 1, 63, 64, 65, 301])
def test_characters_are_the_signs_they_were_made_of(m):
    signs = tuple(bool(s) for s in np.random.default_rng(m).integers(0, 2, m))
    character = Character(signs)
    assert character.array.tolist() == list(signs)
    assert not character.array.flags.writeable
    assert bytes(character) == bytes(signs)
    assert character.signs == signs
    assert character == Character(list(signs))
    assert hash(character) == hash(Character(list(signs)))
    assert character == pickle.loads(pickle.dumps(character))
    assert str(character) == "".join("+" if sign else "-" for sign in signs)
    for i in range(m):
        flipped = character.flip(i)
        assert flipped != character
        assert flipped.signs == (*signs[:i], not signs[i], *signs[i + 1 :])
    assert character != Character((*signs, False))
    with pytest.raises(AttributeError):
        character.signs = ()
