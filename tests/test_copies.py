"""Copies and pickles of everything that a user holds, and runs in other processes."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
from elastic_bodies import jammed
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from pwscont_coulomb.kept import Kept
from pwscont_coulomb.modes import SIGNS, Mode
from pwscont_coulomb.plane_scenes import critical_friction
from pwscont_coulomb.scenes import example1, example3, fig7, fig10
from sweeps import swept

import pwscont
from pwscont import (
    AllTransitions,
    BranchGraph,
    Character,
    Complementarity,
    EndPoints,
    FoldLocus,
    InvalidInputError,
    MultiStart,
    PiecewiseSystem,
    PseudoArclength,
    Slices,
    StepSize,
    Switched,
    TransitionLocus,
    explore,
)
from pwscont.scenes.registry import load_scene, scene_names

pytestmark = pytest.mark.sweep(4)  # the others take too long for the README's command


def through_pickle(thing):
    return pickle.loads(pickle.dumps(thing))


EVERY_WAY = pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, through_pickle])


def waves(alpha):
    return np.array([1.0 + 0.5 * np.sin(alpha), np.cos(alpha)])


class Arch(PiecewiseSystem):
    """A curved system with one fold and a kink."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        stop = 5.0 * (z - 1.0) if character.signs[0] else 0.0
        return z * (z - 1.0) * (z - 2.0) + stop - alpha


def many_nodes(p=33):
    """Return a body with so many nodes that its factorisation is updated."""
    rng = np.random.default_rng(2)
    root, picks = rng.normal(size=(2 * p, 2 * p)), np.eye(2 * p)
    body = ContactBody(root @ root.T + 2 * p * np.eye(2 * p), picks[0::2], picks[1::2])
    path = AffineLoad(rng.normal(size=2 * p) + np.tile([2.0, 0.0], p), rng.normal(size=2 * p))
    return CoulombLoad(body, path, 0.5)


def traced(system, interval):
    start = np.zeros(system.size), interval[0]
    return pwscont.trace(system, start, interval)


def snapping(z, alpha, sw):
    return [z[0] ** 3 - z[0] + sw.abs(z[1]) - alpha, z[1] - sw.relu(z[0])]


def snap(z, alpha, sw):
    return z - 2.0 * sw.clip(z - 0.2, 0.0, 1.0) - alpha


def twice(z, alpha):
    return 2.0 * z + z**3 - alpha


CASES = {
    "switched linear": lambda: (Switched(1, snap, linear=True), (-2.0, 2.0), explore),
    "switched": lambda: (Switched(2, snapping), (-1.0, 1.0), explore),
    "complementarity": lambda: (Complementarity(twice, [0.0], [1.0]), (-1.0, 5.0), explore),
    "affine load": lambda: (fig7().system, (-2.0, 2.0), explore),
    "curved load": lambda: (fig10().system, (0.0, 1.0), explore),
    "friction": lambda: (example3().system, (0.001, 15.0), explore),
    "gaps": lambda: (with_gaps(), (0.0, 1.0), explore),
    "updated": lambda: (many_nodes(), (0.0, 0.3), traced),
    "own system": lambda: (Arch(), (-0.5, 1.0), explore),
    "elastic": lambda: (jammed().condensed().along_load(), (-1.0, 1.0), explore),
    "sparse": lambda: (jammed().full().along_load(), (-1.0, 1.0), traced),
}
EVERY_CASE = pytest.mark.parametrize("case", CASES)


def with_gaps():
    """Return a system of which one node is left out: it cannot touch."""
    A = np.diag([2.0, 2.0, 2.0, 2.0]) - np.eye(4, k=1) - np.eye(4, k=-1)
    body = ContactBody(A, np.eye(4)[0::2], np.eye(4)[1::2], gap=[0.0, 1e3])
    return CoulombLoad(body, AffineLoad([1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]), 0.5)


def same(a, b):
    assert len(a.pieces) == len(b.pieces) > 0
    for one, other in zip(a.pieces, b.pieces, strict=True):
        assert (one.start, one.end, one.label, one.det_sign, one.character) == (
            other.start,
            other.end,
            other.label,
            other.det_sign,
            other.character,
        )
        np.testing.assert_array_equal(one.points, other.points)
    for one, other in zip(a.special_points(), b.special_points(), strict=True):
        assert (one.id, one.kind, one.message) == (other.id, other.kind, other.message)
        np.testing.assert_array_equal(one.z, other.z)
        np.testing.assert_array_equal(one.error, other.error)
    assert (a.guarantee, a.multiplicity()) == (b.guarantee, b.multiplicity())


@EVERY_WAY
@EVERY_CASE
@pytest.mark.sweep(33)
def test_systems_before_and_after_use(case, way):
    """A copy gives the same graph, whatever the original remembers, and so does the original."""
    system, interval, find = CASES[case]()
    fresh = way(system)
    graph = find(system, interval)
    same(find(fresh, interval), graph)
    same(find(way(system), interval), graph)
    same(find(system, interval), graph)


@EVERY_WAY
@EVERY_CASE
@pytest.mark.sweep(7)
def test_graphs_with_all_they_hold(case, way):
    system, interval, find = CASES[case]()
    graph = find(system, interval)
    same(way(graph), graph)
    middle = 0.45 * interval[0] + 0.55 * interval[1]
    found = graph.solutions(middle)  # the graph remembers more from now on
    again = way(graph).solutions(middle)
    assert len(again) == len(found) > 0
    for one, other in zip(again, found, strict=True):
        # arrays of a copy may lie elsewhere in memory, and BLAS may add in another order
        np.testing.assert_allclose(one.z, other.z, rtol=1e-14)
        np.testing.assert_array_equal(way(other).z, other.z)
        assert (one.label, one.kind, one.character) == (other.label, other.kind, other.character)
    for piece in graph.pieces[:3]:
        assert way(piece).label == piece.label
        np.testing.assert_array_equal(way(piece).points, piece.points)
    for point in graph.special_points()[:3]:
        np.testing.assert_array_equal(way(point).z, point.z)
        assert way(point).kind is point.kind
    for stretch in graph.multiplicity():
        assert (way(stretch), way(stretch).ends) == (stretch, stretch.ends)


@EVERY_WAY
@pytest.mark.parametrize("with_system", [True, False])
def test_graphs_from_files(way, with_system, tmp_path):
    graph = fig7().run()
    graph.save(tmp_path / "graph.npz")
    loaded = BranchGraph.load(tmp_path / "graph.npz", graph.system if with_system else None)
    same(way(loaded), loaded)


def test_deep_copies_share_nothing_that_changes():
    graph = fig7().run()
    other = copy.deepcopy(graph)
    other.nx.remove_node(0)
    assert 0 in graph.nx
    assert other.system is not graph.system


@EVERY_WAY
@pytest.mark.parametrize("kind", [TransitionLocus, FoldLocus])
def test_loci(way, kind):
    """What a family remembers is its own: copies build their systems again."""
    scene = critical_friction()
    more = {"test": 1} if kind is TransitionLocus else {}
    locus = kind(scene.family, mu=3.0, **more)
    other = way(locus)
    mu, y = 2.5, np.linspace(0.3, 1.7, locus.size)
    chi = locus.character(y, mu)
    assert other.character(y, mu) == chi
    np.testing.assert_array_equal(other.residual(y, mu, chi), locus.residual(y, mu, chi))


@EVERY_WAY
@pytest.mark.parametrize("name", scene_names())
def test_scenes(name, way):
    """Those of elastic bodies have rules for their boundaries that only copies can take."""
    scene = load_scene(name)
    assert way(scene).title == scene.title


@EVERY_WAY
@pytest.mark.parametrize(
    "part",
    [
        ContactBody(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]]),
        AffineLoad([1.0], [2.0]),
        CoulombFriction(ContactBody(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]]), [1.0, 2.0]),
        PseudoArclength(step_size=StepSize(largest=0.1)),
        EndPoints() + MultiStart(),
        Slices([0.5]),
        AllTransitions(),
    ],
    ids=lambda part: type(part).__name__,
)
def test_parts(part, way):
    assert type(way(part)) is type(part)


def circle(friction):
    return CoulombLoad(
        ContactBody([[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]]), waves, friction
    )


@pytest.mark.slow
@pytest.mark.parametrize("method", swept(["spawn"], ["forkserver"]))
def test_explore_in_other_processes(method):
    """Systems go there, graphs come back, bit by bit those of this process."""
    systems = [fig7().system, example1().system, circle(0.7)]
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        found = list(pool.map(explore, systems, [(-1.0, 1.0)] * 3))
    for graph, system in zip(found, systems, strict=True):
        same(graph, explore(system, (-1.0, 1.0)))


GIVEN = ("body", "r", "load", "friction")


@pytest.mark.parametrize("way", [lambda part: part, copy.copy, copy.deepcopy, through_pickle])
@pytest.mark.parametrize("scene", [fig7, fig10])
def test_what_a_contact_problem_is_made_of_cannot_be_changed(scene, way):
    """Matrices, gradients of tests and cells are kept: they would be those of another problem."""
    system = way(scene().system)
    for name in GIVEN:
        with pytest.raises(InvalidInputError, match=rf"\.{name} cannot be changed: make a new"):
            setattr(system, name, getattr(system, name))
    with pytest.raises(InvalidInputError, match=r"ContactBody\.A cannot be changed"):
        system.body.A = 2.0 * system.body.A
    body = system.body
    for array in (system.friction, system.r, body.A, body.N, body.T, body.gap, body.stiffness):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    assert len(explore(system, (-1.0, 1.0)).pieces) > 1


@pytest.mark.parametrize("nodes", [1, 40])
def test_what_a_contact_problem_keeps_cannot_be_written_to(nodes):
    """Loads, magnitudes and gradients of tests, small and sparse ones."""
    pairs = np.eye(2 * nodes)
    body = ContactBody(2.0 * pairs, pairs[:nodes], pairs[nodes:])
    system = CoulombLoad(body, AffineLoad(-pairs[0], pairs[0]), 0.5)
    gradients = system.test_jacobian(np.zeros(system.size), 0.0)
    entries = gradients if isinstance(gradients, np.ndarray) else gradients.data
    assert isinstance(gradients, np.ndarray) == (nodes == 1)
    for array in (system.load.f0, system.load.derivative(0.5), system.scale(0.0, 1.0), entries):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    with pytest.raises(InvalidInputError, match=r"AffineLoad\.f1 cannot be changed"):
        system.load.f1 = np.ones(2 * nodes)


class Rough(CoulombLoad):
    """Nodes in contact stick."""

    def modes(self, character):
        return np.minimum(super().modes(character), Mode.STICK)


def test_cells_are_those_of_the_modes_of_a_subclass():
    given = fig7().system
    system = Rough(given.body, given.load.__call__, given.friction)
    slip, stick, free = (Character(SIGNS[Mode(mode)]) for mode in (2, 1, 0))
    assert system.bounding_tests(slip).tolist() == system.bounding_tests(stick).tolist() == [1, 2]
    assert system.bounding_tests(free).tolist() == [0]


@pytest.mark.parametrize("alpha", [0.5, np.float32(0.5), np.array([[0.0], [2.0]]), 1j])
def test_an_affine_load_is_one_for_all_that_numpy_computes_with(alpha):
    load = AffineLoad([1, 2], [10, 20])
    np.testing.assert_array_equal(load(alpha), np.array([1, 2]) + alpha * np.array([10, 20]))


class Lubricated(CoulombLoad):
    """Friction that is set later, which matrices of cells follow, but not the tests."""

    mu = 1.0

    def friction_at(self, alpha):
        return self.mu * np.ones(self.body.p)


def test_matrices_of_cells_are_those_of_the_friction_that_there_is():
    given = fig7().system
    system = Lubricated(given.body, given.load.__call__, 1.0)
    z, cells = np.arange(1.0, system.size + 1.0), list(system.cells())
    for system.mu in (0.7, 0.1):
        new = CoulombLoad(system.body, system.load, system.mu)
        for cell in cells:
            kept, made = (each.jacobian(z, 0.5, cell) for each in (system, new))
            np.testing.assert_allclose(kept, made, rtol=1e-7, atol=1e-7)


def test_what_is_kept_of_cells_is_little_and_stays_behind_in_copies():
    kept = Kept(3)
    for number in (0, 0, *range(8)):
        assert kept.of(number, lambda number: -number) == -number
        assert len(kept) <= 3
    assert kept.of(7, abs) == -7  # not made anew
    for copied in (copy.copy(kept), copy.deepcopy(kept), through_pickle(kept)):
        assert not copied
        assert copied.of(7, abs) == 7
