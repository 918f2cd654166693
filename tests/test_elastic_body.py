"""Finite element bodies against closed forms, other units, other positions and other code."""

import json
import subprocess
import sys

import numpy as np
import pytest
import skfem
from elastic_bodies import KINDS, internal_forces, pressed, square, strip
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
from pwscont_coulomb.elastic.scenes import press_body, triangle_body

from pwscont import MissingPackageError, explore, trace
from pwscont.basics.errors import InvalidInputError

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


# -- files ---------------------------------------------------------------------------------------


GMSH_41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "bottom"
1 2 "top"
2 3 "body"
$EndPhysicalNames
$Entities
0 2 1 0
1 0 0 0 1 0 0 1 1 0
2 0 1 0 1 1 0 1 2 0
1 0 0 0 1 1 0 1 3 2 1 2
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
3 4 1 4
1 1 1 1
1 1 2
1 2 1 1
2 3 4
2 1 2 2
3 1 2 3
4 1 3 4
$EndElements
"""

GMSH_22 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "bottom"
1 2 "top"
2 3 "body"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
4
1 1 2 1 1 1 2
2 1 2 2 2 3 4
3 2 2 3 1 1 2 3
4 2 2 3 1 1 3 4
$EndElements
"""


@pytest.mark.parametrize("text", [GMSH_41, GMSH_22], ids=["4.1", "2.2"])
def test_a_gmsh_file_with_physical_groups(tmp_path, text):
    """Two triangles: physical groups are boundaries and subdomains of the same names."""
    file = tmp_path / "square.msh"
    file.write_text(text)
    read = pressed(file, material={"body": Lame(1.2, 0.8)})
    corners, triangles = (
        np.array([[0, 1, 1, 0], [0, 0, 1, 1.0]]),
        np.array([[0, 0], [1, 2], [2, 3]]),
    )
    same = pressed(skfem.MeshTri(corners, triangles).with_defaults())
    np.testing.assert_allclose(read.condensed().body.A, same.condensed().body.A, rtol=1e-14)
    np.testing.assert_allclose(read.contact.positions, [[0, 1], [0, 0]])
    with pytest.raises(InvalidInputError, match="no boundary 'botom'; it has 'bottom', 'top'"):
        ElasticBody(file, Lame(1, 1), supports=[Support("top")], contact=ContactBoundary("botom"))


LOOSE = ("1 4 1 4\n2 1 0 4\n1\n2\n3\n4\n", "1 5 1 5\n2 1 0 5\n1\n2\n3\n4\n5\n")


def test_points_of_no_element_are_left_out(tmp_path):
    """Gmsh files hold points such as centres of circles."""
    file = tmp_path / "loose.msh"
    text = GMSH_41.replace(*LOOSE).replace("0 1 0\n$EndNodes", "0 1 0\n5 5 0\n$EndNodes")
    file.write_text(text)
    assert pressed(file).space.count == 4


@pytest.mark.parametrize("length", range(0, len(GMSH_41) - 15, 23))
def test_a_damaged_file(length, tmp_path):
    file = tmp_path / "square.msh"
    file.write_text(GMSH_41[:length])
    with pytest.raises(InvalidInputError, match=r"square\.msh|no boundary|empty"):
        pressed(file)


@pytest.mark.parametrize(
    ("cells", "z", "words"),
    [
        ([("triangle", [[0, 1, 2]]), ("quad", [[0, 1, 2, 3]])], 0.0, r"2 kinds \(quad, triangle\)"),
        ([("line", [[0, 1]])], 0.0, r"0 kinds \(no surface\)"),
        (
            [("tetra", [[0, 1, 2, 3]])],
            0.0,
            "has tetra elements; a body needs triangle, triangle6, quad, quad9",
        ),
        ([("quad8", [[0, 1, 2, 3, 0, 1, 2, 3]])], 0.0, "has quad8 elements"),
        ([("triangle", [[0, 1, 2], [0, 2, 3]])], 0.5, "z coordinates differ"),
    ],
)
def test_files_with_other_meshes(cells, z, words, tmp_path):
    import meshio  # noqa: PLC0415

    points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, z]]
    file = tmp_path / "other.vtu"
    meshio.write(file, meshio.Mesh(points, [(kind, np.array(t)) for kind, t in cells]))
    with pytest.raises(InvalidInputError, match=words):
        pressed(file)


def test_finite_element_libraries_are_loaded_only_for_a_body():
    code = (
        "import sys, json, pwscont_coulomb, pwscont_coulomb.elastic\n"
        "from pwscont_coulomb.elastic import scenes\n"
        "scenes.block(), scenes.triangle()\n"
        "print(json.dumps([m for m in ('skfem', 'meshio', 'matplotlib') if m in sys.modules]))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == []


# -- errors --------------------------------------------------------------------------------------


def body_with(**changes):
    given = {
        "mesh": strip(),
        "material": Lame(1.0, 1.0),
        "supports": [Support("top")],
        "contact": ContactBoundary("bottom", friction=0.5),
    }
    given |= changes
    return ElasticBody(given.pop("mesh"), given.pop("material"), **given)


def nowhere(x):
    return x[0] > 10.0


def moved(kind, vertex, where, **more):
    mesh = strip(kind)
    points = mesh.p.copy()
    points[:, vertex] = where
    return type(mesh)(points, mesh.t, _boundaries=mesh.boundaries, **more)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contact": ContactBoundary(nowhere)}, "contact boundary is empty"),
        ({"contact": ContactBoundary("top")}, "contact boundary overlaps a clamped one on 6 of 6"),
        (
            {"contact": ContactBoundary("floor")},
            "contact boundary: the mesh has no boundary 'floor'; "
            "it has 'bottom', 'left', 'right', 'top'",
        ),
        ({"contact": ContactBoundary(3)}, "must be a name or a predicate, got 3"),
        ({"contact": ContactBoundary("bottom", gap=-1.0)}, "gap of contact node 1 is negative"),
        ({"contact": ContactBoundary("bottom", gap=[0.0] * 3)}, "gap must be a number, 7 numbers"),
        ({"contact": ContactBoundary("bottom", friction=np.nan)}, "friction must be finite"),
        ({"contact": ContactBoundary("bottom", friction=lambda x: x[0] - 9)}, "node 1 is negative"),
        ({"supports": []}, "free to move by translation x and translation y and rotation"),
        ({"supports": [Support("top", directions="y")]}, "free to move by translation x;"),
        ({"supports": [Support("left", directions="x")]}, "free to move by translation y;"),
        ({"supports": [Support("roof")]}, "boundary of support 1: the mesh has no boundary 'roof'"),
        ({"supports": [Support(nowhere)]}, "boundary of support 1 is empty"),
        (
            {"supports": [Support("top"), Support("left", (1.0, 0.0))]},
            r"support 2 prescribes another displacement at \(0, 1\)",
        ),
        (
            {"supports": [Support("top"), Support("bottom", directions="y")]},
            r"contact node at \(0, 0\) is held in direction y, which is not tangential",
        ),
        ({"supports": [Support("top", (1.0, 2.0, 3.0))]}, "must be a pair"),
        ({"loads": [Traction("side", (1.0, 0.0))]}, "boundary of load 1: the mesh has no boundary"),
        ({"loads": [BodyForce((np.inf, 0.0))]}, "load 1 is not finite"),
        (
            {"loads": [BodyForce((1.0, 0.0), subdomain="core")]},
            "no subdomain 'core'; it has none; give a predicate instead",
        ),
        ({"material": {"core": Lame(1, 1)}}, "a material: the mesh has no subdomain 'core'"),
        ({"order": 3}, "order must be 1 or 2, got 3"),
        ({"mesh": skfem.MeshTet()}, "plane mesh of triangles or quadrilaterals, got MeshTet1"),
        ({"mesh": "nowhere.msh"}, "there is no mesh file nowhere.msh"),
        # vertex 9 is (2/3, 1/3); moved across its neighbours
        ({"mesh": moved("quad", 9, (1.9, 0.9))}, "elements are inverted or degenerate: "),
        ({"mesh": moved("tri", 9, (0.66, 0.9))}, "elements are inverted: they overlap a neighbour"),
        ({"mesh": moved("tri", 9, (1.0, 0.0))}, "elements are inverted"),
    ],
)
def test_errors_say_what_is_wrong(changes, words):
    with pytest.raises(InvalidInputError, match=words):
        body_with(**changes)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (lambda: Support("top", directions="z"), "must be 'x', 'y' or 'xy', got 'z'"),
        (lambda: Young(-1.0, 0.3), "E must be positive"),
        (lambda: Young(1.0, 0.5), "nu must be above -1 and below 0.5, got 0.5"),
        (lambda: Young(1.0, -1.0), "nu must be above -1"),
        (lambda: Young(1.0, np.nan), "nu must be above -1"),
        (lambda: Lame(1.0, 0.0), "mu must be positive"),
        (lambda: Lame(-1.0, 1.0), "lam must be above"),
        (lambda: Lame(np.inf, 1.0), "must be finite"),
    ],
)
def test_bad_values(material, words):
    with pytest.raises(InvalidInputError, match=words):
        material()


def test_materials_must_cover_the_body_once():
    mesh = strip().with_subdomains({"half": lambda x: x[0] < 1.0, "most": lambda x: x[0] < 1.5})
    with pytest.raises(InvalidInputError, match="9 of 18 elements have no material"):
        body_with(mesh=mesh, material={"half": Lame(1, 1)})
    with pytest.raises(InvalidInputError, match="have more than one material"):
        body_with(
            mesh=mesh.with_subdomains({"all": lambda x: x[0] < 3.0}),
            material={"half": Lame(1, 1), "all": Lame(1, 1)},
        )


def test_a_free_rotation_is_named_with_its_centre():
    """A single held node leaves the rotation about it; a lone part of the mesh is named."""
    mesh = strip("tri", 4, 2)
    body = pressed(mesh)
    from pwscont_coulomb.elastic.supports import free_motions  # noqa: PLC0415

    nodes = np.arange(mesh.nvertices)
    held = np.array([2 * 3, 2 * 3 + 1])
    x, y = mesh.p[:, 3]
    (word,) = free_motions(body.positions, nodes, held)
    assert word == f"rotation about ({x:.6g}, {y:.6g})"


def test_a_part_that_hangs_on_nothing_is_named():
    left, right = strip(nx=2, ny=2), strip(nx=2, ny=2).translated((5.0, 0.0))
    both = skfem.MeshQuad(
        np.hstack([left.p, right.p]), np.hstack([left.t, right.t + left.nvertices])
    )
    with pytest.raises(InvalidInputError, match="part 2 of 2 of the body is not clamped"):
        body_with(
            mesh=both,
            supports=[Support(lambda x: (x[1] > 0.99) & (x[0] < 3.0))],
            contact=ContactBoundary(lambda x: x[1] < 0.01),
        )


@pytest.mark.parametrize("missing", ["skfem", "meshio"])
def test_a_missing_library_is_named(missing, monkeypatch):
    monkeypatch.setitem(sys.modules, missing, None)
    words = rf"{missing} cannot be imported: pip install scikit-fem meshio, or .* '\.\[fem\]'"
    with pytest.raises(MissingPackageError, match=words):
        press_body()
