"""Finite element bodies against closed forms, other units, other positions and other code."""

import numpy as np
import pytest
import skfem
from elastic_bodies import KINDS, internal_forces, pressed, square, strip
from elastic_parts import body_with
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.elastic import (
    BodyForce,
    ContactBoundary,
    ElasticBody,
    Lame,
    PlaneStrain,
    PlaneStress,
    Support,
    Traction,
    Young,
    recover,
)
from pwscont_coulomb.elastic.scenes import triangle_body

from pwscont import explore, trace

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


every_kind = pytest.mark.parametrize("kind", KINDS)


def only_state(body, alpha=0.0):
    """Return the one solution of a frictionless problem on the whole body."""
    problem = body.condensed()
    system = problem.along_load()
    graph = trace(system, (np.zeros(system.size), alpha), (alpha, alpha + 1.0))
    (solution,) = graph.solutions(alpha)
    return recover(problem, solution)


# -- closed forms --------------------------------------------------------------------------------


@every_kind
@pytest.mark.parametrize("state", [PlaneStrain(), PlaneStress()], ids=["strain", "stress"])
def test_constant_strain_is_exact(kind, state):
    """u = (e x, -d y) on a distorted mesh: exact displacements, stress and contact pressure."""
    family, order = KINDS[kind]
    e, d, material = 0.004, 0.01, Young(200.0, 0.3)
    lam, mu = state.in_plane(*material.lame)

    def exact(x):
        return np.stack([e * x[0], -d * x[1]])

    body = ElasticBody(
        square(family),
        material,
        supports=[Support(side, exact) for side in ("left", "right", "top")],
        contact=ContactBoundary("bottom"),
        state=state,
        order=order,
    )
    found = only_state(body)
    np.testing.assert_allclose(found.displacements.T, exact(body.positions), atol=1e-15)
    pressure = -(lam * (e - d) - 2.0 * mu * d)
    np.testing.assert_allclose(found.pressure, pressure, rtol=1e-11)
    np.testing.assert_allclose(found.stresses[1], -pressure, rtol=1e-11)
    np.testing.assert_allclose(found.stresses[0], lam * (e - d) + 2.0 * mu * e, rtol=1e-9)
    np.testing.assert_allclose(found.stresses[2], 0.0, atol=1e-11 * pressure)


@every_kind
def test_simple_shear_is_exact(kind):
    """u = (g y, 0): in stick, shear stress mu g; the pressure alone comes from a constant part."""
    family, order = KINDS[kind]
    g, d, material = 0.004, 0.01, Lame(0.0, 1.5)

    def down(x):
        return np.stack([np.zeros_like(x[1]), -d * x[1]])

    def sheared(x):
        return np.stack([g * x[1], np.zeros_like(x[1])])

    body = ElasticBody(
        square(family),
        material,
        supports=[Support(side, down, sheared) for side in ("left", "right", "top")],
        contact=ContactBoundary("bottom", friction=0.9),
        order=order,
    )
    found = only_state(body, 1.0)
    # shear stress mu g pulls the bottom of the body to the left
    np.testing.assert_allclose(found.shear, -1.5 * g, rtol=1e-10)
    np.testing.assert_allclose(found.pressure, 3.0 * d, rtol=1e-10)
    np.testing.assert_allclose(found.slip, 0.0, atol=1e-15)


def test_two_layers_in_series():
    """Two materials by subdomain, nu = 0: p = d / (h1 / E1 + h2 / E2) everywhere."""
    mesh = strip(nx=5, ny=4).with_subdomains({"low": lambda x: x[1] < 0.25})
    mesh = mesh.with_subdomains({"high": lambda x: x[1] > 0.25})
    body = ElasticBody(
        mesh,
        {"low": Young(3.0, 0.0), "high": Young(0.7, 0.0)},
        supports=[Support("top", (0.0, -0.02))],
        contact=ContactBoundary("bottom", gap=0.005, friction=0.3),
    )
    found = only_state(body)
    np.testing.assert_allclose(found.pressure, 0.015 / (0.25 / 3.0 + 0.75 / 0.7), rtol=1e-12)


@every_kind
def test_loads_add_up_to_force_and_moment(kind):
    """Body force and traction as functions of position: sum and first moment are the integrals."""
    family, order = KINDS[kind]
    body = ElasticBody(
        square(family),
        Lame(1.0, 1.0),
        supports=[Support("top")],
        contact=ContactBoundary("bottom"),
        loads=[
            BodyForce(lambda x: np.stack([x[0], 0.0 * x[0]])),
            Traction("left", growing=lambda x: np.stack([0.0 * x[0], x[1]])),
        ],
        order=order,
    )
    nodal = np.zeros((2, 2 * body.space.count))
    everywhere = np.arange(body.space.mesh.nelements)
    nodal[0] = body.space.body_force("f", lambda x: np.stack([x[0], 0.0 * x[0]]), everywhere)
    np.testing.assert_allclose(body.f0, nodal[0][body.free], atol=1e-16)
    fx, fy = nodal[0].reshape(-1, 2).T
    assert fx.sum() == pytest.approx(0.5, rel=1e-13)
    assert fx @ body.positions[0] == pytest.approx(1.0 / 3.0, rel=1e-13)
    assert not fy.any()
    left = body.positions[:, body.free // 2]
    assert body.f1.sum() + _held_share(body) == pytest.approx(0.5, rel=1e-13)
    assert not body.f1[left[0] > 1e-12].any()


def _held_share(body):
    """Return the part of the traction on the left that the held corner takes."""
    facets = body.space.mesh.boundaries["left"]
    forces = body.space.traction("t", lambda x: np.stack([0.0 * x[0], x[1]]), facets)
    return forces[body.held].sum()


def manufactured(kind, k, w=2.5):
    """Return the relative error in the pressure of a smooth solution with a known one.

    u = (d cos(w x) + b y^2, -c y (1 + a sin(w x))) has no shear stress and no normal
    displacement on y = 0; its body force follows from the equations of equilibrium.
    """
    family, order = KINDS[kind]
    a, b, c, d = 0.4, 0.02, 0.03, 0.01

    def exact(x):
        return np.stack(
            [d * np.cos(w * x[0]) + b * x[1] ** 2, -c * x[1] * (1 + a * np.sin(w * x[0]))]
        )

    def force(x):  # lam = mu = 1: -(3 u1_xx + u1_yy + 2 u2_xy), -(3 u2_yy + u2_xx + 2 u1_xy)
        cos, sin = np.cos(w * x[0]), np.sin(w * x[0])
        first = 3 * d * w**2 * cos - 2 * b + 2 * c * a * w * cos
        return np.stack([first, -c * x[1] * a * w**2 * sin])

    body = ElasticBody(
        square(family, k, distort=0.0),
        Lame(1.0, 1.0),
        supports=[Support(side, exact) for side in ("left", "right", "top")],
        contact=ContactBoundary("bottom"),
        loads=[BodyForce(force)],
        order=order,
    )
    sin = np.sin(w * body.contact.positions[0])
    pressure = 3 * c * (1 + a * sin) + d * w * sin
    error = only_state(body).pressure - pressure
    area = body.contact.areas
    return np.sqrt(area @ error**2 / (area @ pressure**2))


@pytest.mark.parametrize(("kind", "rate"), [("P1", 1.4), ("Q1", 1.8), ("P2", 1.8), ("Q2", 1.8)])
def test_pressure_converges(kind, rate):
    errors = [manufactured(kind, k) for k in (6, 12, 24)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 5e-3
    assert rates[-1] > rate, (errors, rates)


@pytest.mark.slow
@pytest.mark.parametrize("k", [6, 12, 18])
def test_nothing_moves_and_a_symmetric_node_stays_on_its_interface(k):
    """By symmetry u_t = 0 in the middle: with rounding only in it, and in the tangent."""
    assert manufactured("Q2", k, w=np.pi) < 0.25 / k**2


def test_the_triangle_is_the_paper_s_one_node_problem():
    """One P1 element: a = (lam + 3 mu) / 2 and b = (lam + mu) / 2, and the curve of the paper."""
    for lam, mu in ((1.0, 1.0), (0.3, 2.0)):
        A = triangle_body(Lame(lam, mu)).condensed().body.A
        a, b = 0.5 * (lam + 3.0 * mu), 0.5 * (lam + mu)
        np.testing.assert_allclose(A, [[a, -b], [-b, a]], rtol=1e-15)
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])
    paper = explore(CoulombLoad(body, AffineLoad([0.25, 0.0], [0.0, 1.0]), 4.0), (-2.0, 2.0))
    graph = explore(triangle_body().condensed().along_load(), (-2.0, 2.0))
    assert len(graph.pieces) == len(paper.pieces) == 4
    for found, expected in zip(graph.pieces, paper.pieces, strict=True):
        assert found.label == expected.label
        np.testing.assert_allclose(found.points, expected.points, rtol=1e-10, atol=1e-10)


def test_hertz():
    """A block pressed on a rigid parabola x^2 / 2 R: Hertz's peak pressure and contact width.

    The half-plane of Hertz is a block much larger than the contact (E* = E / (1 - nu^2),
    a^2 = 4 P R / (pi E*), p0 = 2 P / (pi a)); the force P is taken from the solution.
    """
    E, nu, R, size = 1.0, 0.3, 4.0, 16.0
    fine = np.linspace(-1.0, 1.0, 33)
    coarse = np.geomspace(1.0, 0.5 * size, 14)[1:]
    x = np.concatenate([-coarse[::-1], fine, coarse])
    y = np.concatenate([[0.0], np.geomspace(0.03, size, 20)])
    mesh = skfem.MeshQuad.init_tensor(x, y).with_defaults()
    body = ElasticBody(
        mesh,
        Young(E, nu),
        supports=[Support("top", (0.0, -0.09))],
        contact=ContactBoundary(
            lambda x: (x[1] < 1e-9) & (np.abs(x[0]) < 1.0), gap=lambda x: x[0] ** 2 / (2.0 * R)
        ),
    )
    found = only_state(body)
    force = -found.normal_force.sum()
    a = np.sqrt(4.0 * force * R * (1.0 - nu**2) / (np.pi * E))
    touching = body.contact.areas[found.pressure > 0.0].sum()
    assert 0.3 < a < 0.8
    assert found.pressure.max() == pytest.approx(2.0 * force / (np.pi * a), rel=0.03)
    assert 0.5 * touching == pytest.approx(a, abs=1.0 / 16.0)


# -- invariance ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_units():
    """N-mm-MPa and N-m-Pa: the same curve, scaled, to 1e-9."""
    mm = pressed(strip(), material=Young(2.1e5, 0.3), friction=0.7)
    mesh = strip(length=2e-3, height=1e-3)
    m = pressed(mesh, material=Young(2.1e11, 0.3), friction=0.7, down=1e-5)
    graphs = [explore(body.condensed().along_load(), (0.0, 3.0)) for body in (mm, m)]
    n, p = 2 * mm.contact.count, mm.contact.count
    # per thickness: 1 N/mm = 1000 N/m
    scale = np.concatenate([np.full(n, 1e-3), np.full(2 * p, 1e3), [1.0]])
    assert len(graphs[0].pieces) == len(graphs[1].pieces)
    size = np.abs(np.vstack([piece.points for piece in graphs[0].pieces])).max(axis=0) * scale
    unit = np.concatenate([np.full(n, size[:n].max()), np.full(2 * p, size[n:-1].max()), [1.0]])
    for first, second in zip(graphs[0].pieces, graphs[1].pieces, strict=True):
        assert first.label == second.label
        assert np.abs((first.points * scale - second.points) / unit).max() < 1e-9


@every_kind
def test_turning_body_and_load_turns_the_solution(kind):
    """Normal and tangential forces do not depend on where the body lies."""
    family, order = KINDS[kind]
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mesh = square(family, 3)
    turned = type(mesh)(turn @ mesh.p, mesh.t, _boundaries=mesh.boundaries)
    graphs = []
    for m, rotation in ((mesh, np.eye(2)), (turned, turn)):
        body = ElasticBody(
            m,
            Lame(1.0, 1.0),
            supports=[Support("top", rotation @ [0.0, -0.01], rotation @ [0.01, 0.0])],
            contact=ContactBoundary("bottom", friction=0.6),
            order=order,
        )
        expected = (rotation @ [0.0, -1.0])[:, np.newaxis]
        np.testing.assert_allclose(body.contact.normals, expected + 0 * body.contact.normals)
        np.testing.assert_allclose(body.contact.arc, np.linspace(0, 1, body.contact.count))
        system = body.condensed().along_load()
        graphs.append(trace(system, (np.zeros(system.size), 0.0), (0.0, 2.0)))
    one, other = (graph.solutions(1.3) for graph in graphs)
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert a.label == b.label
        np.testing.assert_allclose(a.z, b.z, rtol=1e-9, atol=1e-13)


def test_normals_and_areas_of_a_curved_boundary():
    """Quadratic elements on a circle: normals are radial, areas add up to the perimeter."""
    straight, curved = skfem.MeshTri.init_circle(3), skfem.MeshTri2.init_circle(3)
    for mesh, order, tolerance in ((straight, 1, 2e-2), (curved, 2, 1e-4)):
        half = mesh.with_boundaries({"held": lambda x: x[1] > 0.0})
        body = ElasticBody(
            half,
            Lame(1.0, 1.0),
            supports=[Support("held")],
            contact=ContactBoundary(lambda x: x[1] < 0.0),
            order=order,
        )
        x = body.contact.positions
        np.testing.assert_allclose(body.contact.normals, x / np.hypot(*x), atol=10 * tolerance)
        along = np.diff(np.unwrap(np.arctan2(x[1], x[0])))
        assert (along > 0.0).all()  # counter-clockwise: the body on the left
        edges = body.space.edges(half.boundary_facets())
        assert edges.lengths.sum() == pytest.approx(2.0 * np.pi, rel=tolerance)


def test_a_closed_contact_boundary_and_two_parts():
    """A ring clamped inside: its outside is one closed part; two sides of a block are two."""
    angle, radius = (c.ravel() for c in np.meshgrid(np.arange(12) * np.pi / 6, [1.0, 2.0]))
    i = np.arange(12)
    quads = np.stack([i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i])
    ring = skfem.MeshQuad(radius * np.stack([np.cos(angle), np.sin(angle)]), quads)
    nodes = ElasticBody(
        ring,
        Lame(1.0, 1.0),
        supports=[Support(lambda x: np.hypot(*x) < 1.5)],
        contact=ContactBoundary(lambda x: np.hypot(*x) > 1.5),
    ).contact
    side = 4.0 * np.sin(np.pi / 12)
    np.testing.assert_allclose(nodes.arc, side * np.arange(12))
    np.testing.assert_allclose(nodes.areas, side)
    np.testing.assert_allclose(nodes.normals, nodes.positions / 2.0, atol=1e-15)
    assert not nodes.part.any()
    both = body_with(contact=ContactBoundary(lambda x: (x[0] < 1e-9) | (x[0] > 2 - 1e-9))).contact
    assert both.part.tolist() == [0, 0, 0, 1, 1, 1]
    # down on the left, up on the right; the clamped corners are none
    np.testing.assert_allclose(both.positions[1], [2 / 3, 1 / 3, 0, 0, 1 / 3, 2 / 3], atol=1e-15)


def test_stiffness_against_element_by_element_assembly():
    for kind in ("P1", "Q1"):
        mesh = square(KINDS[kind][0], 3)
        body = pressed(mesh)
        u = np.random.default_rng(1).standard_normal((mesh.nvertices, 2))
        u[body.held // 2] = 0.0
        expected = internal_forces(mesh, 1.2, 0.8, u).ravel()[body.free]
        np.testing.assert_allclose(body.A @ u.ravel()[body.free], expected, atol=1e-13)
