"""Bodies condensed onto their contact unknowns, and matrices from files."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp
from pwscont_coulomb import (
    AffineLoad,
    ContactBody,
    CoulombFriction,
    CoulombLoad,
    read_matrices,
)
from scipy.io import mmwrite

from pwscont import InvalidInputError, enumerate_solutions, explore, trace


def random_body(seed, n=12, p=2, kind=np.asarray):
    """Return a body whose N and T are no unit vectors, and two loads."""
    rng = np.random.default_rng(seed)
    root, picks = rng.normal(size=(n, n)), rng.normal(size=(2 * p, n))
    gap = 0.3 * rng.random(p)
    body = ContactBody(kind(root @ root.T + np.eye(n)), kind(picks[:p]), kind(picks[p:]), gap)
    return body, rng.normal(size=(2, n))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix])
@pytest.mark.sweep(6)
def test_a_condensed_body_has_the_same_solutions(seed, kind):
    body, (f0, f1) = random_body(seed, kind=kind)
    small = body.condensed()
    load = AffineLoad(small.reduced(f0), small.reduced(f1))
    whole = explore(CoulombLoad(body, AffineLoad(f0, f1), 0.7), (-3.0, 3.0))
    graph = explore(CoulombLoad(small, load, 0.7), (-3.0, 3.0))
    assert [s[2] for s in graph.multiplicity()] == [s[2] for s in whole.multiplicity()]
    for alpha in (-2.1, -0.4, 0.9, 2.3):
        states = graph.solutions(alpha)
        recovered = [small.recover(state.z, f0 + alpha * f1) for state in states]
        for other in whole.solutions(alpha):
            nearest = min(np.abs(u - other.z[: body.n]).max() for u in recovered)
            assert nearest < 1e-10 * max(1.0, np.abs(other.z).max())


def test_what_was_not_condensed_recovers_nothing():
    body, (f0, _) = random_body(0)
    with pytest.raises(InvalidInputError, match="not condensed"):
        body.recover(np.zeros(16), f0)
    with pytest.raises(InvalidInputError, match="load has shape"):
        body.condensed().reduced(f0[:-1])
    with pytest.raises(InvalidInputError, match="z has shape"):
        body.condensed().recover(np.zeros(3), f0)
    with pytest.raises(InvalidInputError, match="elimination must be an object"):
        body.condensed(pytest.importorskip("pwscont_coulomb.elastic").SuperLU)


def eliminations():
    elastic = pytest.importorskip("pwscont_coulomb.elastic")
    return elastic.Multifrontal(), elastic.SuperLU()


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix])
def test_every_elimination_gives_the_same_body(kind):
    """With picks of several unknowns, and with fewer nodes of a body that travels."""
    rng = np.random.default_rng(3)
    n, p = 60, 3
    chain = np.diag(3.0 * np.ones(n)) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    picks = np.zeros((2 * p, n))
    picks[:, rng.choice(n, 9, replace=False)] = rng.normal(size=(2 * p, 9))
    body = ContactBody(kind(chain), kind(picks[:p]), kind(picks[p:]))
    small, load, forces = body.condensed(), rng.normal(size=n), rng.normal(size=(2, 2 * p))
    for elimination in eliminations():
        other = body.condensed(elimination)
        assert np.abs(other.A - small.A).max() < 1e-12 * np.abs(small.A).max()
        assert np.abs(other.reduced(load) - small.reduced(load)).max() < 1e-12
        z = np.append(np.zeros(2 * p), forces[0])
        assert np.abs(other.recover(z, load) - small.recover(z, load)).max() < 1e-12
        twin = pickle.loads(pickle.dumps(other))
        assert np.abs(twin.displacements_by(forces) - small.displacements_by(forces)).max() < 1e-12


def test_a_block_condensed_by_fronts_is_the_block():
    full = pytest.importorskip("pwscont_coulomb.elastic.scenes").block_body(21).full()
    small, loads = full.body.condensed(), np.stack([full.load.f0, full.load.f1], axis=1)
    for elimination in eliminations():
        other = full.body.condensed(elimination)
        assert np.abs(other.A - small.A).max() < 1e-11 * np.abs(small.A).max()
        assert np.abs(other.reduced(loads) - small.reduced(loads)).max() < 1e-12
    with pytest.raises(InvalidInputError, match="elimination must be"):
        full.body.condensed("Mumps")


def test_condensed_bodies_travel_to_other_processes():
    body, (f0, _) = random_body(1)
    small = body.condensed()
    twin = pickle.loads(pickle.dumps(small))
    assert np.array_equal(twin.reduced(f0), small.reduced(f0))


def test_a_large_body_is_traced_when_condensed():
    """The curve is that of the elimination by fronts, to rounding."""
    elastic = pytest.importorskip("pwscont_coulomb.elastic.scenes").block_body(41)
    full, fronts = elastic.full(), elastic.condensed()
    small = full.body.condensed()
    assert np.abs(small.A - fronts.body.A).max() < 1e-12 * np.abs(small.A).max()
    load = AffineLoad(small.reduced(full.load.f0), small.reduced(full.load.f1))
    system = CoulombLoad(small, load, 0.3)
    one = trace(system, (np.zeros(system.size), 0.0), (0.0, 1.0))
    system = fronts.along_load()
    other = trace(system, (np.zeros(system.size), 0.0), (0.0, 1.0))
    assert [piece.label for piece in one.pieces] == [piece.label for piece in other.pieces]


@pytest.fixture
def always(monkeypatch):
    """Condense bodies of every size."""
    monkeypatch.setattr("pwscont_coulomb.condensed.LARGE", 1)
    monkeypatch.setattr("pwscont_coulomb.condensed.PER_NODE", 1)


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix])
@pytest.mark.parametrize("along", ["load", "curved load", "friction"])
@pytest.mark.sweep(12)
def test_static_problems_condense_by_themselves(seed, kind, along):
    """Each solution is one of the enumeration of the whole problem, and no solution is missing."""
    body, (f0, f1) = random_body(seed, kind=kind)
    if along == "friction":
        system, interval = CoulombFriction(body, f0), (0.0, 2.0)
    else:
        curved = (lambda t: f0 + np.sin(t) * f1) if along == "curved load" else AffineLoad(f0, f1)
        system, interval = CoulombLoad(body, curved, 0.7), (-1.0, 1.0)
    reduction = system.reduction(*interval)
    assert reduction.system.size == 4 * body.p
    assert "eliminated" in reduction.reasons[0]
    graph = explore(system, interval)
    for alpha in (0.1, 0.45, 0.93):
        expected, found = enumerate_solutions(system, alpha), graph.solutions(alpha)
        assert len(expected) == len(found)
        for state in expected:
            nearest = min(np.abs(state.z - other.z).max() for other in found)
            assert nearest < 1e-8 * max(1.0, np.abs(state.z).max())


@pytest.mark.usefixtures("always")
def test_a_condensed_body_leaves_out_far_nodes_too():
    body, (f0, f1) = random_body(3, p=3)
    far = ContactBody(body.A, body.N, body.T, [0.0, 1e6, 0.1])
    system = CoulombLoad(far, AffineLoad(f0, f1), 0.7)
    reduction = system.reduction(-1.0, 1.0)
    assert len(reduction.reasons) == 2
    assert reduction.system.size == 8
    graph = explore(system, (-1.0, 1.0))
    for state in enumerate_solutions(system, 0.3):
        nearest = min(np.abs(state.z - other.z).max() for other in graph.solutions(0.3))
        assert nearest < 1e-9 * max(1.0, np.abs(state.z).max())


@pytest.mark.usefixtures("always")
def test_a_trace_of_a_condensed_body_begins_where_the_user_says():
    body, (f0, f1) = random_body(5)
    system = CoulombLoad(body, AffineLoad(f0, f1), 0.7)
    (start, *_) = enumerate_solutions(system, 0.2)
    graph = trace(system, (start.z, 0.2), (-1.0, 1.0))
    nearest = min(np.abs(start.z - other.z).max() for other in graph.solutions(0.2))
    assert nearest < 1e-10
    for point in graph.special_points():
        rest = body.A @ point.z[:12] - f0 - point.alpha * f1
        rest -= body.N.T @ point.z[12:14] + body.T.T @ point.z[14:]
        assert np.abs(rest).max() < 1e-11 * np.abs(body.A).max()


def test_matrices_are_read_from_files(tmp_path):
    body, (f0, _) = random_body(2, kind=sp.csr_matrix)
    for name in ("A", "N", "T"):
        mmwrite(tmp_path / f"{name}.mtx", getattr(body, name), precision=17)
    mmwrite(tmp_path / "load.mtx", f0[:, np.newaxis], precision=17)
    found = read_matrices(tmp_path)
    assert set(found) == {"A", "N", "T", "load"}
    assert np.abs((found["A"] - body.A).toarray()).max() < 1e-14 * np.abs(body.A).max()
    assert np.allclose(found["load"], f0, rtol=1e-15)
    assert list(read_matrices(tmp_path / "N.mtx")) == ["N"]


HEAD = "%%MatrixMarket matrix coordinate real general\n"


def test_a_comment_with_the_letter_d_is_no_number(tmp_path):
    (tmp_path / "A.mtx").write_text(f"{HEAD}% of 2D1 elements\n1 1 1\n1 1 2.5E+3\n")
    assert read_matrices(tmp_path)["A"].toarray() == [[2500.0]]


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (lambda file: None, "no file with the ending"),
        (lambda file: file.write_text("no matrix"), "cannot read"),
        (lambda file: mmwrite(file, sp.csr_matrix([[1.0j]])), "complex"),
        (lambda file: file.write_text(f"{HEAD}% 2D1\n1 1 1\n1 1 2.5D+3\n"), "write E for D"),
        (lambda file: file.write_text(f"{HEAD}1 1 1\n1 1 2,5\n"), "holds 2,5, which is no number"),
        (lambda file: file.write_text(f"{HEAD}1 1 1\n1 1 2.5kN\n"), "holds 2.5kN"),
        (lambda file: file.write_text(f"{HEAD}1 1 1\n1 1 nan\n"), "holds nan"),
    ],
)
def test_files_that_hold_no_matrix_are_refused(tmp_path, write, words):
    write(tmp_path / "A.mtx")
    with pytest.raises(InvalidInputError, match=words):
        read_matrices(tmp_path)
