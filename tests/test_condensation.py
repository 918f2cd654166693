"""The interior eliminated: the same graph, fields that satisfy everything, each elimination."""

import tracemalloc

import numpy as np
import pytest
import skfem
from condensations import check_refusal, check_schur_complement, grid
from elastic_bodies import jammed, pressed, square, strip, violations
from pwscont_coulomb.elastic import (
    ContactBoundary,
    ElasticBody,
    Lame,
    Multifrontal,
    SuperLU,
    Support,
    Young,
    recover,
)
from pwscont_coulomb.elastic import dissection as dissection_module
from pwscont_coulomb.elastic.dissection import dissect
from pwscont_coulomb.elastic.scenes import block_body
from sweeps import swept

from pwscont import explore

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

ELIMINATIONS = [Multifrontal(), SuperLU()]
every_elimination = pytest.mark.parametrize(
    "elimination", ELIMINATIONS, ids=["Multifrontal", "SuperLU"]
)


@every_elimination
@pytest.mark.parametrize("case", ["bottom", "one", "scattered", "all"])
@pytest.mark.parametrize("size", [(4, 3), (31, 17), (90, 3)])
@pytest.mark.sweep(6)
def test_schur_complement_load_and_recovery(elimination, case, size):
    check_schur_complement(elimination, case, size)


@every_elimination
def test_what_is_not_positive_definite_is_refused(elimination):
    check_refusal(elimination)


@pytest.mark.parametrize("place", ["grid", "same", "random"])
def test_dissection_separates_whatever_the_positions(place, monkeypatch):
    """Every unknown once; a front is coupled with nothing but its ancestors and descendants."""
    monkeypatch.setattr(dissection_module, "LEAF", 12)
    A, positions = grid(23, 11)
    if place == "same":
        positions = np.zeros_like(positions)
    if place == "random":
        positions = np.random.default_rng(0).uniform(size=positions.shape)
    unknowns = np.arange(40, A.shape[0])
    plan = dissect(A, unknowns, positions)
    np.testing.assert_array_equal(np.sort(plan.order), unknowns)
    front = np.zeros(A.shape[0], dtype=int)
    for number, start, end in zip(plan.tree, plan.bounds[:-1], plan.bounds[1:], strict=True):
        front[plan.order[start:end]] = number
    for i, j in zip(*A.nonzero(), strict=True):
        low, high = sorted((front[i], front[j]))
        if low:
            assert high >> (int(high).bit_length() - int(low).bit_length()) == low
    parents = [
        int(np.flatnonzero(plan.tree == t // 2)[0]) for t in plan.tree if t // 2 in plan.tree
    ]
    assert all(parent > i for i, parent in enumerate(parents[:-1]) if parent >= 0) or not parents


@pytest.mark.slow
def test_dissection_of_a_grid_is_sparse():
    """Factors of a 2-d grid stay near 31/4 n log2 n entries (George), far below a band's."""
    A, positions = grid(40, 40)
    kept = np.arange(2)
    found = Multifrontal().eliminate(A, kept, positions)
    n = A.shape[0]
    assert found.stored < 31.0 / 4.0 * 2.0 * n * np.log2(n)


# -- graphs --------------------------------------------------------------------------------------

BODIES = {
    "Q1": lambda: pressed(strip(nx=7, ny=4), friction=0.5),
    "P1": lambda: pressed(strip("tri", nx=6, ny=3), friction=0.3),
    "Q2": lambda: pressed(strip(nx=3, ny=1), friction=0.6, order=2),
    "P2": lambda: pressed(square("tri", 3), friction=0.4, order=2),
    "gap": lambda: pressed(
        strip(nx=7, ny=3), friction=1.5, gap=lambda x: 0.004 * (x[0] - 0.9) ** 2, down=0.006
    ),
    "jammed": jammed,
}


SMALL = ("Q2", "jammed")


def reach(body):
    return (0.0, 2.5 if body.contact.friction.max() < 1.0 else 4.0)


@pytest.mark.parametrize("name", swept(SMALL, [name for name in BODIES if name not in SMALL]))
@pytest.mark.slow
def test_condensed_and_full_give_the_same_graph(name):
    body = BODIES[name]()
    full, condensed = body.full(), body.condensed()
    graphs = [explore(problem.along_load(), reach(body)) for problem in (full, condensed)]
    assert [p.label for p in graphs[0].pieces] == [p.label for p in graphs[1].pieces]
    assert len(graphs[0].pieces) > 4
    for first, second in zip(graphs[0].pieces, graphs[1].pieces, strict=True):
        np.testing.assert_allclose(first.alpha, second.alpha, rtol=1e-9, atol=1e-9)
        for z, reduced, alpha in zip(first.z, second.z, second.alpha, strict=True):
            u = full.displacements(z, float(alpha))
            size = np.abs(u).max()
            np.testing.assert_allclose(
                condensed.displacements(reduced, float(alpha)) / size, u / size, atol=1e-9
            )
            forces, expected = condensed.multipliers(reduced), full.multipliers(z)
            size = np.abs(expected).max()
            np.testing.assert_allclose(
                np.array(forces) / size, np.array(expected) / size, atol=1e-9
            )


def worst(mesh, state, held, nodes, contact=None):
    """Return the largest violation of a state on the full mesh."""
    where = nodes.nodes if contact is None else contact
    forces = state.normal_force, state.tangential_force
    return max(
        violations(
            mesh, 1.2, 0.8, state.displacements, held, where, nodes.friction, nodes.gap, *forces
        ).values()
    )


@pytest.mark.parametrize("name", swept(["P1"], ["Q1", "gap"]))
def test_every_solution_holds_on_the_full_mesh(name):
    """Equilibrium, contact and friction to 1e-9, by an element loop that shares no code."""
    body = BODIES[name]()
    problem = body.condensed()
    lo, hi = reach(body)
    graph = explore(problem.along_load(), (lo, hi))
    alphas = np.random.default_rng(0).uniform(lo, hi, 12)
    mesh, held = body.space.mesh, np.flatnonzero(body.positions[1] == 1.0)
    contact = np.flatnonzero(body.positions[1] == 0.0)
    contact = contact[np.argsort(body.positions[0, contact])]
    checked = 0
    for alpha in alphas:
        for solution in graph.solutions(alpha):
            state = recover(problem, solution)
            u = state.displacements
            down = 0.006 if name == "gap" else 0.01
            np.testing.assert_allclose(u[held], np.tile([alpha * down, -down], (len(held), 1)))
            assert worst(mesh, state, held, body.contact, contact) < 1e-9
            checked += 1
    assert checked >= 12


@pytest.mark.parametrize(("height", "nu"), [(1e-4, 0.3), (1e4, 0.3), (1.0, 0.4999999)])
@pytest.mark.sweep(4)
def test_ill_shaped_and_nearly_incompressible_bodies(height, nu):
    """Aspect ratio 1e4 and a bulk modulus 5e6 times the shear modulus: still 1e-9 relative."""
    lam, mu = Young(1.0, nu).lame
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0.0, 2.0, 9), np.linspace(0.0, height, 5))
    body = ElasticBody(
        mesh,
        Lame(lam, mu),
        supports=[
            Support(lambda x: x[1] > 0.99 * height, (0.0, -0.01 * height), (0.01 * height, 0.0))
        ],
        contact=ContactBoundary(lambda x: x[1] < 0.01 * height, friction=0.3),
    )
    problem = body.condensed()
    graph = explore(problem.along_load(), (0.0, 3.0))
    held, nodes = np.flatnonzero(body.positions[1] == height), body.contact
    for alpha in np.random.default_rng(0).uniform(0.0, 3.0, 5):
        found = graph.solutions(alpha)
        assert sum(solution.det_sign for solution in found) == 1
        for solution in found:
            state = recover(problem, solution)
            forces = state.normal_force, state.tangential_force
            u, where = state.displacements, nodes.nodes
            broken = violations(mesh, lam, mu, u, held, where, nodes.friction, nodes.gap, *forces)
            assert max(broken.values()) < 1e-9


def test_several_solutions_hold_on_the_full_mesh():
    """A friction so large that solutions are several: all of them are true ones."""
    body = jammed()
    problem = body.condensed()
    graph = explore(problem.along_load(), (3.0, 4.0))
    mesh, held = body.space.mesh, np.flatnonzero(body.positions[0] == 0.0)
    most = 0
    for lo, hi, _ in graph.multiplicity():
        found = graph.solutions(0.5 * (lo + hi))
        assert sum(solution.det_sign for solution in found) == 1
        states = [recover(problem, solution) for solution in found]
        assert all(worst(mesh, state, held, body.contact) < 1e-9 for state in states)
        most = max(most, len(found))
    assert most == 7


def test_block_scales_with_its_argument():
    for nodes in (2, 5, 20):
        body = block_body(nodes)
        assert body.contact.count == nodes
        assert body.condensed().body.n == 2 * nodes


@pytest.mark.slow
def test_peak_memory_is_at_most_one_and_a_half_times_the_factor():
    body = block_body(200)
    positions = body.positions[:, body.free // 2]
    tracemalloc.start()
    found = Multifrontal().eliminate(body.A, body.contact_unknowns, positions)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5 * 8 * found.stored


@pytest.mark.slow
def test_friction_as_the_parameter():
    """At the friction coefficient of the contact boundary both systems have the same solution."""
    problem = BODIES["P1"]().condensed()
    by_load = explore(problem.along_load(), (0.0, 2.5)).solutions(1.3)
    by_friction = explore(problem.along_friction(1.3), (0.1, 1.0)).solutions(0.3)
    assert len(by_load) == len(by_friction) == 1
    first = recover(problem, by_load[0])
    second = recover(problem, by_friction[0])
    assert (first.modes == second.modes).all()
    np.testing.assert_allclose(second.displacements, first.displacements, atol=1e-12)
    np.testing.assert_allclose(second.pressure, first.pressure, rtol=1e-9, atol=1e-12)
    assert (first.alpha, second.alpha) == (1.3, 0.3)
