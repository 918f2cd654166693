"""Symmetric halves with contact up to the axis: they are their wholes, and rails hold as rails do.

A node on the axis is guided: held along its tangent, free to touch. Truth is the whole body, of
which no node is held, and a check of solutions that shares no code.
"""

import numpy as np
import pytest
import skfem
from elastic_bodies import internal_forces, strip, violations
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from pwscont_coulomb.elastic import (
    BodyForce,
    ContactBoundary,
    ElasticBody,
    Lame,
    Support,
    Young,
    recover,
)

from pwscont import check_system, enumerate_solutions, explore, trace
from pwscont.basics.errors import InvalidInputError

SUPPORT = {"left": Support("left", directions="x")}


def half_mesh(kind, nx=3, depth=0.0):
    """Return 0 < x < 1; its lower side sinks by ``depth`` from the axis to the right: it is round.

    Middle nodes stay in the middle of straight edges.
    """
    family = skfem.MeshTri if kind == "tri" else skfem.MeshQuad
    mesh = family.init_tensor(np.linspace(0.0, 1.0, nx + 1), np.linspace(0.0, 0.7, 4))
    x, y = mesh.p
    return family(np.stack([x, y + depth * x**2 * (1.0 - y / 0.7)]), mesh.t)


def whole_mesh(kind, nx=3, depth=0.0):
    """Return the half and its mirror image, which share the nodes on the axis."""
    half = half_mesh(kind, nx, depth)
    x, count = half.p[0], half.p.shape[1]
    image = np.where(x == 0.0, np.arange(count), count + np.cumsum(x != 0.0) - 1)
    points = np.hstack([half.p, half.p[:, x != 0.0] * [[-1.0], [1.0]]])
    return type(half)(points, np.hstack([half.t, image[half.t]]))


def body(mesh, order=None, size=1.0, force=1.0, held=(), **contact):
    """Return a body clamped on top that is pressed down by alpha, with a load that spreads it.

    ``size`` and ``force`` are the units of length and of force per area.
    """
    scaled = type(mesh)(mesh.p * size, mesh.t)
    left, edge = scaled.p[0].min(), 1e-9 * size
    named = scaled.with_boundaries(
        {
            "top": lambda x: x[1] > 0.7 * size - edge,
            "left": lambda x: x[0] < left + edge,
            "bottom": lambda x: x[1] < 0.09 * size,
        }
    )
    given = {"friction": 0.4, "gap": lambda x: 0.02 * x[0] ** 2 / size} | contact
    return ElasticBody(
        named,
        Young(force, 0.3),
        supports=[Support("top", growing=(0.0, -0.01 * size)), *held],
        contact=ContactBoundary("bottom", **given),
        loads=[
            BodyForce(growing=lambda x: force * np.stack([0.01 * x[0], -0.02 * size + 0 * x[1]]))
        ]
        if size == 1.0
        else [],
        order=order,
    )


def on_the_right(found, half):
    """Return where the contact nodes of the half stand among those of the whole."""
    x = found.contact.positions
    away = [np.abs(x - at[:, np.newaxis]).max(axis=0) for at in half.contact.positions.T]
    assert max(a.min() for a in away) < 1e-12
    return [int(a.argmin()) for a in away]


def assert_same(half, whole, alpha, halves, wholes):
    """Assert that all solutions are those of the whole, on the axis too."""
    at = on_the_right(whole, half)
    assert len(halves) == len(wholes) == 1
    one, other = recover(half.condensed(), halves[0]), recover(whole.condensed(), wholes[0])
    strongest, axis = other.pressure.max(), half.contact.guided
    np.testing.assert_allclose(one.pressure, other.pressure[at], atol=1e-11 * strongest)
    np.testing.assert_allclose(one.shear, other.shear[at], atol=1e-11 * strongest)
    np.testing.assert_array_equal(one.modes, other.modes[at])
    assert np.abs(one.shear[axis]).max() == 0.0
    assert np.abs(one.slip[axis]).max() == 0.0
    for k, x in enumerate(half.positions.T):
        j = int(np.abs(whole.positions - x[:, np.newaxis]).max(axis=0).argmin())
        np.testing.assert_allclose(one.displacements[k], other.displacements[j], atol=1e-13)


@pytest.mark.parametrize("kind", ["quad", "tri"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("depth", [0.0, 0.1])
@pytest.mark.sweep(6)
def test_half_is_whole(kind, order, depth):
    """Flat and round bodies: the normal on the axis is that of the whole, not of its right side."""
    half = body(half_mesh(kind, 3, depth), order, held=SUPPORT.values())
    whole = body(whole_mesh(kind, 3, depth), order)
    assert half.contact.guided.tolist() == [True] + [False] * (half.contact.count - 1)
    at = on_the_right(whole, half)
    np.testing.assert_allclose(half.contact.normals, whole.contact.normals[:, at], atol=1e-12)
    first, second = half.condensed().along_load(), whole.condensed().along_load()
    graph = explore(first, (0.0, 2.0))
    for alpha in (0.2, 1.9):
        start = np.zeros(second.size)
        wholes = trace(second, (start, alpha), (alpha, alpha + 1e-3)).solutions(alpha)
        assert_same(half, whole, alpha, graph.solutions(alpha), wholes)
    assert graph.guarantee.startswith("complete")


def test_the_axis_opens_and_closes_by_ordinary_transitions():
    """kappa1 alone bounds a guided node: no corner where node 1 touches, away from alpha = 0."""
    half = body(half_mesh("quad"), held=SUPPORT.values(), gap=lambda x: 0.002 + 0.001 * x[0])
    graph = explore(half.condensed().along_load(), (0.0, 2.0))
    first = min((p for p in graph.special_points() if p.alpha > 0.0), key=lambda p: p.alpha)
    assert (first.kind, first.message) == ("transition", "node 1: no contact → contact-stick")
    assert not [p for p in graph.special_points("corner") if p.alpha > 0.0]


def test_full_and_condensed_and_friction_as_parameter():
    half = body(half_mesh("tri"), held=SUPPORT.values())
    problems = half.condensed(), half.full()
    (a,), (b,) = (explore(p.along_load(), (0.0, 2.0)).solutions(1.7) for p in problems)
    (c,) = explore(problems[0].along_friction(1.7), (0.1, 0.8)).solutions(0.4)
    first, *others = (
        recover(p, s) for p, s in zip((*problems, problems[0]), (a, b, c), strict=True)
    )
    for other in others:
        assert (other.modes == first.modes).all()
        np.testing.assert_allclose(other.displacements, first.displacements, atol=1e-13)
        np.testing.assert_allclose(other.pressure, first.pressure, atol=1e-12)


def test_the_contract_and_brute_force():
    """check_system, and all solutions at one alpha by every combination of modes."""
    half = body(half_mesh("quad", 2), held=SUPPORT.values(), friction=3.0)
    system = half.condensed().along_load()
    rng = np.random.default_rng(0)
    assert len(list(system.cells())) == 2 * 4 ** (system.body.p - 1)
    points = [(1e-3 * rng.standard_normal(system.size), 0.7) for _ in range(5)]
    report = check_system(system, points)
    assert report, report
    graph = explore(system, (0.0, 2.0))
    for alpha in (0.3, 1.1, 1.8):
        found, all_of_them = graph.solutions(alpha), enumerate_solutions(system, alpha)
        assert len(found) == len(all_of_them)
        for one, other in zip(found, all_of_them, strict=True):
            np.testing.assert_allclose(one.z, other.z, atol=1e-12)


def test_many_nodes_take_the_fast_algebra():
    half = body(half_mesh("quad", 34), held=SUPPORT.values(), gap=0.0)
    whole = body(whole_mesh("quad", 34), gap=0.0)
    system = half.condensed().along_load()
    assert system.algebra is not None
    solutions = trace(system, (np.zeros(system.size), 1.0), (1.0, 1.001)).solutions(1.0)
    other = whole.condensed().along_load()
    wholes = trace(other, (np.zeros(other.size), 1.0), (1.0, 1.001)).solutions(1.0)
    assert_same(half, whole, 1.0, solutions, wholes)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1e6])
@pytest.mark.parametrize("force", [1e-9, 2.1e11])
@pytest.mark.sweep(3)
def test_units(size, force):
    """A nanometre or a megametre, soft or hard: the same transitions at the same alpha."""
    flat = {"gap": lambda x: 0.004 * x[0] + 0.002 * size, "held": SUPPORT.values()}
    same = body(half_mesh("quad"), size=size, force=force, **flat)
    graph = explore(same.condensed().along_load(), (0.0, 2.0))
    unit = body(half_mesh("quad"), size=2.0, **flat | {"gap": lambda x: 0.004 * x[0] + 0.004})
    expected = explore(unit.condensed().along_load(), (0.0, 2.0))
    assert [p.label for p in graph.pieces] == [p.label for p in expected.pieces]
    ends = [np.sort([p.alpha for p in g.special_points()]) for g in (graph, expected)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9)
    assert len(graph.pieces) > 3


def test_a_rail_without_symmetry():
    """A block sheared beside a smooth wall: equilibrium, contact and friction by other code."""
    mesh = strip(nx=5, ny=3)
    rail = ElasticBody(
        mesh,
        Lame(1.2, 0.8),
        supports=[Support("top", (0, 0), (0.01, -0.01)), Support(_lower_left, directions="x")],
        contact=ContactBoundary("bottom", friction=0.5, gap=lambda x: 0.002 + 0.001 * x[0]),
    )
    problem, nodes = rail.condensed(), rail.contact
    graph = explore(problem.along_load(), (0.0, 2.0))
    seen = set()
    for alpha in np.linspace(0.05, 1.95, 9):
        for solution in graph.solutions(alpha):
            state = recover(problem, solution)
            u, forces = state.displacements, (state.normal_force, state.tangential_force)
            held = np.unique(rail.held // 2)
            held = held[(rail.positions[1, held] > 0.99)]
            assert not u[_wall(rail), 0].any()
            broken = _broken(mesh, u, held, nodes, forces)
            assert max(broken.values()) < 1e-10
            seen.add(int(state.modes[0]))
    assert seen == {0, 1}


def _lower_left(x):
    return (x[0] < 1e-9) & (x[1] < 0.6)


def _wall(rail):
    x, y = rail.positions
    return np.flatnonzero((x < 1e-9) & (y < 0.7))


def _broken(mesh, u, held, nodes, forces):
    """Return the violations, with the wall's reaction in x taken off."""
    wall = np.flatnonzero((mesh.p[0] < 1e-9) & (mesh.p[1] < 0.7))
    residual = internal_forces(mesh, 1.2, 0.8, u)
    residual[nodes.nodes] -= np.column_stack([forces[1], -forces[0]])
    off_wall = np.setdiff1d(np.arange(len(u)), np.union1d(held, wall))
    size = np.abs(u).max()
    y_on_wall = np.abs(residual[np.setdiff1d(wall, held), 1]).max() / size
    rest = violations(
        mesh, 1.2, 0.8, u, np.union1d(held, wall), nodes.nodes, nodes.friction, nodes.gap, *forces
    )
    return rest | {"wall": y_on_wall, "inside": np.abs(residual[off_wall]).max() / size}


# -- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("supports", "contact", "words"),
    [
        (
            [Support("bottom", directions="y")],
            {},
            r"contact node at \(0, 0\) is held in direction y, which is not tangential: its normal",
        ),
        (
            [Support(_lower_left, (0.001, 0.0), directions="x")],
            {},
            r"a support moves the contact node at \(0, 0\) along its tangent",
        ),
        (
            [Support(_lower_left, growing=(0.001, 0.0), directions="x")],
            {},
            "end the support or the contact boundary before this node",
        ),
        (
            [Support(_lower_left, directions="x")],
            {"normal": (0.1, -1.0)},
            r"is held in direction x, which is not tangential: its normal is \(0.0995037, -0.9950",
        ),
    ],
)
def test_other_rollers_are_refused(supports, contact, words):
    with pytest.raises(InvalidInputError, match=words):
        ElasticBody(
            strip(),
            Lame(1.0, 1.0),
            supports=[Support("top"), *supports],
            contact=ContactBoundary("bottom", **contact),
        )


def test_a_slope_held_along_x_in_the_middle_is_refused():
    """No mirror image explains a tilted normal where the boundary goes on at both sides."""
    mesh = strip("tri", 4, 2)
    tilted = type(mesh)(np.stack([mesh.p[0], mesh.p[1] + 0.2 * mesh.p[0]]), mesh.t)
    named = tilted.with_boundaries(mesh.boundaries)
    supports = [Support("top"), Support("bottom", directions="x")]
    with pytest.raises(InvalidInputError, match="held in direction x, which is not tangential"):
        ElasticBody(named, Lame(1, 1), supports=supports, contact=ContactBoundary("bottom"))


TWO = {"A": np.diag([2.0, 3.0]), "N": [[1.0, 0.0]], "T": [[0.0, 1.0]]}


def test_one_guided_node_is_a_spring_and_a_stop():
    """2 u_nu = f + lam_nu, u_nu <= 1/2: contact from f = 1 on, whatever F."""
    node = ContactBody(**TWO, gap=[0.5], guided=[True])
    graph = explore(CoulombLoad(node, AffineLoad([0.0, 0.0], [1.0, 0.0]), 7.0), (-1.0, 3.0))
    assert [p.label for p in graph.pieces] == ["no contact", "stick"]
    assert graph.multiplicity() == [(-1.0, 3.0, 1)]
    np.testing.assert_allclose(graph.solutions(0.4)[0].z, [0.2, 0.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(graph.solutions(2.5)[0].z, [0.5, 0.0, -1.5, 0.0], atol=1e-15)
    along = explore(CoulombFriction(node, [2.5, 0.0]), (0.0, 5.0))
    np.testing.assert_allclose(along.solutions(3.0)[0].z, [0.5, 0.0, -1.5, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: ContactBody(
                [[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]], None, [True]
            ),
            "node 1 is guided, but A or N couples",
        ),
        (lambda: ContactBody(**TWO, guided=[1.0]), "guided must be 1 truth values"),
        (lambda: ContactBody(**TWO, guided=[True, False]), "guided must be 1 truth values"),
        (
            lambda: CoulombFriction(ContactBody(**TWO, guided=[True]), [1.0, 1.0]),
            "load acts on the tangential displacement of node 1, which is guided",
        ),
        (
            lambda: explore(
                CoulombLoad(
                    ContactBody(**TWO, guided=[True]), AffineLoad([1.0, 0.0], [0.0, 1.0]), 1.0
                ),
                (0.0, 1.0),
            ),
            "load acts on the tangential displacement of node 1",
        ),
    ],
)
def test_guided_nodes_that_are_none(make, words):
    with pytest.raises(InvalidInputError, match=words):
        make()
