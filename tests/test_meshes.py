"""What a mesh and a contact boundary may hold, and what a solution is on the whole body.

Cells listed twice, subdomains that overlap, gaps that are rounding, normals of the obstacle, and
the load of a solution whose parameter is the friction.
"""

import re
import sys

import numpy as np
import pytest
import skfem
from elastic_bodies import pressed, square, strip
from gmsh_files import GMSH_22, GMSH_41
from pwscont_coulomb.elastic import (
    BodyForce,
    ContactBoundary,
    ElasticBody,
    Lame,
    Support,
    Young,
    recover,
)
from pwscont_coulomb.elastic.mesh_files import read_mesh
from scipy.optimize import nnls

from pwscont import explore, trace
from pwscont.basics.errors import InvalidInputError, MissingPackageError

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

# -- cells that are listed twice ------------------------------------------------------------------


def more_groups(text, elements, lines):
    """Return a mesh of MSH 2.2 in which Gmsh's copies for two more groups follow."""
    names = '5\n1 1 "bottom"\n1 2 "top"\n2 3 "body"\n2 4 "all"\n1 5 "low"'
    named = text.replace('3\n1 1 "bottom"\n1 2 "top"\n2 3 "body"', names)
    extra = [f"{5 + k} {cell}" for k, cell in enumerate([*elements, *lines])]
    rows = "\n".join(["4 2 2 3 1 1 3 4", *extra])
    return named.replace("$Elements\n4\n", f"$Elements\n{4 + len(extra)}\n").replace(
        "4 2 2 3 1 1 3 4", rows
    )


@pytest.mark.parametrize(
    ("elements", "lines", "words"),
    [
        (
            ["2 2 4 1 2 3 1"],
            [],
            r"lists 1 of its 3 triangle cells again \(in 'all' and 'body'\), the first at "
            r"\(0.666667, 0.333333\); list each once; Gmsh writes .* MSH 4.1",
        ),
        (
            [],
            ["1 2 5 1 2 1"],
            r"1 of its 3 line cells again \(in 'bottom' and 'low'\), the first at \(0.5, 0\)",
        ),
    ],
)
def test_msh_2_2_lists_a_copy_for_each_group(tmp_path, elements, lines, words):
    file = tmp_path / "copies.msh"
    file.write_text(more_groups(GMSH_22, elements, lines))
    with pytest.raises(InvalidInputError, match=words):
        pressed(file)


def test_msh_4_1_has_overlapping_groups_without_copies(tmp_path):
    """The same groups: two triangles once each, the line of two boundaries in both."""
    names = '5\n1 1 "bottom"\n1 2 "top"\n2 3 "body"\n2 4 "all"\n1 5 "low"'
    text = GMSH_41.replace('3\n1 1 "bottom"\n1 2 "top"\n2 3 "body"', names)
    text = text.replace("1 0 0 0 1 1 0 1 3 2 1 2", "1 0 0 0 1 1 0 2 3 4 2 1 2")
    file = tmp_path / "groups.msh"
    file.write_text(text.replace("1 0 0 0 1 0 0 1 1 0", "1 0 0 0 1 0 0 2 1 5 0"))
    body = pressed(file, material={"all": Lame(1.2, 0.8)})
    mesh = body.space.mesh
    assert mesh.nelements == 2
    assert sorted(mesh.subdomains) == ["all", "body"]
    assert list(mesh.boundaries["low"]) == list(mesh.boundaries["bottom"])
    same = pressed(file, material=Lame(1.2, 0.8))
    np.testing.assert_array_equal(body.A.toarray(), same.A.toarray())


def without_names(text):
    return re.sub(r"\$PhysicalNames.*?\$EndPhysicalNames\n", "", text, flags=re.DOTALL)


MEDIT = """MeshVersionFormatted 2\nDimension 2\nVertices\n4\n0 0 0\n1 0 0\n1 1 0\n0 1 0
Edges\n2\n1 2 1\n3 4 2\nTriangles\n2\n1 2 3 3\n1 3 4 3\nEnd\n"""


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.msh", without_names(GMSH_22)), ("b.msh", without_names(GMSH_41)), ("c.mesh", MEDIT)],
)
def test_groups_without_names_have_their_numbers(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    mesh = read_mesh(tmp_path / name)
    assert {group: len(part) for group, part in mesh.boundaries.items()} == {"1": 1, "2": 1}
    for group, height in (("1", 0.0), ("2", 1.0)):
        assert (mesh.p[1, mesh.facets[:, np.asarray(mesh.boundaries[group])]] == height).all()
    assert {group: part.tolist() for group, part in mesh.subdomains.items()} == {"3": [0, 1]}


def test_some_groups_may_have_names(tmp_path):
    file = tmp_path / "some.msh"
    file.write_text(GMSH_22.replace('3\n1 1 "bottom"\n1 2 "top"\n', '2\n1 1 "bottom"\n'))
    assert set(read_mesh(file).boundaries) == {"bottom", "2"}
    file.write_text(GMSH_22.replace('3\n1 1 "bottom"\n1 2 "top"\n', '2\n1 1 "2"\n'))
    with pytest.raises(InvalidInputError, match=r"group 2 in .* has no name; another one is 2"):
        read_mesh(file)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("empty.msh", "", r"the mesh file .*empty.msh is empty"),
        ("e.mesh", "MeshVersionFormatted 2\nhello\n", r"Couldn't read file .* as medit"),
        ("u.vtu", "no xml", r"Couldn't read file .* as vtu"),
        ("v.vtu", "<VTKFile/>", r"KeyError: 'type'"),
        ("v.msh", "$MeshFormat\n9.9 0 8\n$EndMeshFormat\n", r"got 9.9"),
        ("a.nothing", "a", "Could not deduce file format"),
    ],
)
def test_why_a_file_is_not_read(tmp_path, capsys, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidInputError, match=words):
        read_mesh(tmp_path / name)
    assert capsys.readouterr() == ("", "")


def test_the_package_that_a_format_needs_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)  # as where h5py is not installed
    (tmp_path / "a.med").write_text("a")
    with pytest.raises(
        MissingPackageError, match=r"meshio needs h5py to read .*: pip install h5py"
    ):
        read_mesh(tmp_path / "a.med")


def test_groups_of_lines_and_of_surfaces_may_have_the_same_number(tmp_path):
    text = GMSH_22.replace('2 3 "body"', '2 1 "body"').replace("2 2 3 1", "2 2 1 1")
    file = tmp_path / "numbers.msh"
    file.write_text(text)
    mesh = pressed(file, material={"body": Lame(1.2, 0.8)}).space.mesh
    assert list(mesh.subdomains) == ["body"]
    assert sorted(mesh.boundaries) == ["bottom", "top"]


def test_lines_that_no_element_has_are_no_boundary(tmp_path):
    file = tmp_path / "diagonal.msh"
    file.write_text(GMSH_22.replace("1 1 2 1 1 1 2", "1 1 2 1 1 2 4"))
    with pytest.raises(InvalidInputError, match=r"1 of 1 lines of 'bottom' in .* no element"):
        pressed(file)


@pytest.mark.parametrize("kind", ["tri", "quad"])
def test_a_repeated_element_is_named(kind):
    """An inclusion listed again, by other corners first: the pressure would be wrong by 14 %."""
    mesh = strip(kind)
    again = np.roll(mesh.t[:, [8, 9]], 1, axis=0)
    twice = type(mesh)(
        mesh.p,
        np.hstack([mesh.t, again]),
        _boundaries=mesh.boundaries,
        _subdomains={
            "all": np.arange(mesh.nelements),
            "incl": np.array([mesh.nelements, mesh.nelements + 1]),
        },
    )
    count = mesh.nelements
    words = rf"2 of {count + 2} elements are listed again \(in 'all' and 'incl'\): {count}, "
    with pytest.raises(InvalidInputError, match=words):
        pressed(twice, material={"all": Lame(1, 1), "incl": Lame(9, 9)})


def test_an_element_again_on_nodes_of_its_own():
    mesh = strip("tri", 2, 1)
    p, t = np.hstack([mesh.p, mesh.p[:, mesh.t[:, 1]]]), mesh.nvertices + np.array([[0, 1, 2]]).T
    with pytest.raises(InvalidInputError, match="1 of 5 elements are listed again: 4"):
        pressed(skfem.MeshTri(p, np.hstack([mesh.t, t])).with_defaults())


def test_a_third_element_at_a_facet():
    """Beside two triangles of a square one of the other diagonal's: it overlaps both."""
    corners = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    elements = np.array([[0, 1, 2], [0, 2, 3], [0, 2, 1]]).T
    more = np.hstack([corners, [[2.0], [0.5]]])
    elements[:, 2] = [0, 2, 4]
    with pytest.raises(InvalidInputError, match="at a facet of more than two elements"):
        pressed(skfem.MeshTri(more, elements).with_defaults())


def test_subdomains_that_overlap_are_named():
    mesh = strip().with_subdomains({"all": lambda x: x[0] < 9, "incl": lambda x: x[0] < 0.5})
    words = r"3 of 18 elements have more than one material, .* in 'all' and 'incl'; subdomains must"
    with pytest.raises(InvalidInputError, match=words):
        pressed(mesh, material={"all": Lame(1, 1), "incl": Lame(9, 9)})


# -- gaps that are rounding -----------------------------------------------------------------------


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_a_gap_that_is_rounding_is_none(size):
    """Below and above zero, in the unit of the mesh; what is more than rounding stays."""
    mesh = strip(length=2 * size, height=size)
    signs = np.array([-1.0, 1.0, -1.0, 0.0, 1.0, -1.0, 1.0])
    body = pressed(mesh, gap=1e-17 * size * signs, down=0.01 * size)
    assert not body.contact.gap.any()
    kept = pressed(mesh, gap=1e-12 * size * np.abs(signs), down=0.01 * size)
    assert np.count_nonzero(kept.contact.gap) == 6
    with pytest.raises(InvalidInputError, match=r"gap of contact node 3 is negative: -1e-0?\d+ at"):
        pressed(mesh, gap=np.array([0, 0, -1e-12 * size, 0, 0, 0, 0]), down=0.01 * size)


def test_a_gap_computed_from_positions():
    mesh = strip().translated((0.0, 0.1))
    body = pressed(mesh, gap=lambda x: x[1] - 0.1 * (1.0 + 1e-15) * np.cos(0.0 * x[0]))
    assert not body.contact.gap.any()
    with pytest.raises(InvalidInputError, match=r"node 1 is negative: -0.1 at \(0, 0.1\)"):
        pressed(mesh, gap=lambda x: x[1] - 0.2)


# -- the load of a solution -----------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.slow
def test_recover_knows_the_load_of_a_friction_path(unit):
    """Displacements of the whole body are those of the full problem's unknowns."""
    body = pressed(strip(nx=7, ny=4), material=Lame(1.2 * unit, 0.8 * unit))
    condensed, full, alpha = body.condensed(), body.full(), 1.3
    wanted = explore(full.along_friction(alpha), (0.1, 1.0))
    found = explore(condensed.along_friction(alpha), (0.1, 1.0))
    for friction in (0.17, 0.5, 0.9):
        (one,), (other,) = (graph.solutions(friction) for graph in (found, wanted))
        u = body.all_displacements(other.z[: full.body.n], alpha)
        for problem, solution in ((condensed, one), (full, other)):
            state = recover(problem, solution)
            np.testing.assert_allclose(state.displacements, u, atol=1e-13)
            assert state.alpha == friction
        assert condensed.load_parameter(one.z, friction) == pytest.approx(alpha, rel=1e-12)


def test_along_the_load_the_parameter_is_taken_as_it_is():
    problem = pressed(strip()).condensed()
    graph = explore(problem.along_load(), (0.0, 2.0))
    for alpha in (0.0, 1e-12, 0.3, 2.0):
        for solution in graph.solutions(alpha):
            assert problem.load_parameter(solution.z, alpha) == alpha


@pytest.mark.slow
def test_a_load_that_no_contact_node_feels_must_be_given():
    """Two bodies in one: that without contact is loaded, and the other's state does not tell."""
    left, right = strip(nx=2, ny=2), strip(nx=2, ny=2).translated((5.0, 0.0))
    both = skfem.MeshQuad(
        np.hstack([left.p, right.p]), np.hstack([left.t, right.t + left.nvertices])
    )
    body = ElasticBody(
        both,
        Lame(1.0, 1.0),
        supports=[Support(lambda x: x[1] > 0.99, constant=(0.0, -0.01))],
        contact=ContactBoundary(lambda x: (x[1] < 0.01) & (x[0] < 3.0), friction=0.5),
        loads=[BodyForce(growing=lambda x: np.stack([0.0 * x[0], 1.0 * (x[0] > 3.0)]))],
    )
    problem = body.condensed()
    (solution,) = explore(problem.along_friction(2.0), (0.1, 1.0)).solutions(0.5)
    with pytest.raises(InvalidInputError, match=r"does not tell under which load .* load_alpha"):
        recover(problem, solution)
    u = recover(problem, solution, load_alpha=2.0).displacements
    full = body.full()
    (other,) = explore(full.along_friction(2.0), (0.1, 1.0)).solutions(0.5)
    np.testing.assert_allclose(u, body.all_displacements(other.z[: full.body.n], 2.0), atol=1e-13)


def test_a_solution_of_another_problem():
    body = pressed(strip())
    (solution,) = explore(body.condensed().along_load(), (0.0, 1.0)).solutions(0.5)
    with pytest.raises(InvalidInputError, match="the state has 28 unknowns, the problem 56"):
        recover(body.full(), solution)


# -- the obstacle's normal ------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", [-0.5, 0.0, 0.3, 1.2])
@pytest.mark.parametrize("push", [-2.0, 0.3, 2.0])
def test_one_node_before_a_tilted_plane(tilt, push):
    """One element with one free node: A = [[a, b], [b, a]] in x and y, solved by hand.

    In contact n.u = gap; it slips against friction F where the multipliers of stick ask for more.
    """
    n = np.array([np.sin(tilt), -np.cos(tilt)])
    t, gap, F, f = np.array([-n[1], n[0]]), 0.1, 0.4, np.array([push, -1.0])
    body = ElasticBody(
        skfem.MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]])),
        Lame(1.0, 1.0),
        supports=[Support(lambda x: x[0] + x[1] > 0.75)],
        contact=ContactBoundary(lambda x: x[1] < 0.25, friction=F, gap=gap, normal=7.0 * n),
        loads=[BodyForce(constant=6.0 * f)],
    )
    np.testing.assert_allclose(body.contact.normals[:, 0], n, atol=1e-15)
    problem = body.condensed()
    graph = explore(problem.along_load(), (0.0, 1.0))
    A = np.array([[2.0, 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(A, body.A.toarray(), atol=1e-14)
    expected = _by_hand(A, f, n, t, gap, F)
    found = [recover(problem, s).displacements[0] for s in graph.solutions(0.5)]
    np.testing.assert_allclose(found, [expected], atol=1e-14)


def _by_hand(A, f, n, t, gap, F):
    """Return u of the one solution: free, stuck, or slipping."""
    u = np.linalg.solve(A, f)
    if n @ u <= gap:
        return u
    u = gap * n
    normal, tangential = n @ (A @ u - f), t @ (A @ u - f)
    if abs(tangential) <= -F * normal:
        return u
    for sign in (1.0, -1.0):
        force = n + F * sign * t  # lam_t = F lam_nu sign
        K = np.block([[A, -force[:, np.newaxis]], [n[np.newaxis], np.zeros((1, 1))]])
        x = np.linalg.solve(K, [*f, gap])
        if x[2] <= 0.0 and sign * (t @ x[:2]) >= 0.0:
            return x[:2]
    raise AssertionError("no solution")


def disc(per, a=0.05, size=0.8):
    """Return the right half of a round body of radius 1, fine up to 2 a, curved Q2 elements."""
    h = a / per
    x = np.concatenate([np.linspace(0.0, 2 * a, 2 * per + 1), 2 * a + growing(h, size - 2 * a)])
    y = np.concatenate([[0.0], growing(h, size)])
    mesh = skfem.MeshQuad.init_tensor(x, y).with_boundaries(
        {
            "axis": lambda x: x[0] < 1e-12,
            "top": lambda x: x[1] > size - 1e-12,
            "sole": lambda x: (x[1] < 1e-12) & (x[0] < 2 * a),
        }
    )
    curved = skfem.MeshQuad2.from_mesh(mesh)
    points = curved.doflocs.copy()
    points[1] += (1.0 - np.sqrt(1.0 - points[0] ** 2)) * (1.0 - points[1] / size)
    return skfem.MeshQuad2(points, curved.t, _boundaries=mesh.boundaries)


def growing(step, length, ratio=1.35):
    """Return places up to a length, each step longer than the one before."""
    steps = step * ratio ** np.arange(1 + np.ceil(np.log1p(length / step) / np.log(ratio)))
    return np.cumsum(steps) * length / steps.sum()


def peak(normal, gap, wide=0.05):
    """Return how far the peak pressure of a disc on a plane is above Hertz's, and the body."""
    E, nu = 1.0, 0.3
    body = ElasticBody(
        disc(20, wide),
        Young(E, nu),
        supports=[Support("top", (0.0, -1.6 * wide**2)), Support("axis", directions="x")],
        contact=ContactBoundary("sole", gap=gap, normal=normal),
    )
    problem = body.condensed()
    system = problem.along_load()
    (solution,) = trace(system, (np.zeros(system.size), 0.0), (0.0, 1.0)).solutions(0.0)
    state = recover(problem, solution)
    force = 2.0 * body.contact.normals[1] @ state.normal_force  # both halves
    width = np.sqrt(4.0 * force * (1.0 - nu**2) / (np.pi * E))
    assert 0.5 * wide < width < 1.1 * wide
    return state.pressure[0] / (2.0 * force / (np.pi * width)) - 1.0, body, state


@pytest.mark.slow
@pytest.mark.parametrize(("wide", "least", "most"), [(0.0125, 0.001, 0.002), (0.05, 0.005, 0.008)])
def test_the_obstacle_s_normal_takes_off_what_nodal_normals_add_to_hertz(wide, least, most):
    """A disc on a plane, a / R = 0.010 and 0.048: Hertz's peak pressure with the plane's normal.

    The body's own normals spread; with them the peak is higher, in proportion to a / R.
    """
    plane, _, _ = peak((0.0, -1.0), lambda x: x[1], wide)
    own, body, _ = peak(None, lambda x: x[1] / np.sqrt(1.0 - x[0] ** 2), wide)
    assert abs(plane) < 0.002
    assert least < own - plane < most
    assert np.abs(body.contact.normals[:, 0] - [0.0, -1.0]).max() == 0.0


@pytest.mark.slow
def test_a_round_body_on_a_plane_is_the_convex_problem_of_the_plane():
    """Without friction: least energy under y + u_y >= 0, by nonnegative least squares."""
    _, body, state = peak((0.0, -1.0), lambda x: x[1])
    N = np.zeros((body.contact.count, len(body.free)))
    unknowns = np.searchsorted(body.free, 2 * body.contact.nodes + 1)
    N[np.arange(len(N)), unknowns] = -1.0
    full = body.full().body
    flexible, free = N @ full.solve(N.T), N @ full.solve(body.f0)
    L = np.linalg.cholesky(flexible)
    force, _ = nnls(L.T, np.linalg.solve(L, free - body.contact.positions[1]))
    np.testing.assert_allclose(-state.normal_force, force, atol=1e-9 * force.max())


def test_a_normal_of_each_node():
    angles = np.linspace(-0.3, 0.3, 7)
    pairs = np.stack([np.sin(angles), -np.cos(angles)])
    given = [ContactBoundary("bottom", normal=n) for n in (pairs, lambda x: 2.0 * pairs)]
    for contact in given:
        nodes = ElasticBody(strip(), Lame(1, 1), supports=[Support("top")], contact=contact).contact
        np.testing.assert_allclose(nodes.normals, pairs, atol=1e-15)
        np.testing.assert_allclose(nodes.tangents, [np.cos(angles), np.sin(angles)], atol=1e-15)


@pytest.mark.parametrize(
    ("normal", "words"),
    [
        (
            (0.0, 1.0),
            r"normal \(0, 1\) at contact node 1, \(0, 0\), does not point out",
        ),
        ((0.0, 0.0), "does not point out of the body"),
        ((1.0, 0.0), "give the direction from the body into the obstacle"),
        (lambda x: np.stack([x[0], x[0] - 1.0]), r"at contact node 4, \(1, 0\)"),
        ((np.nan, -1.0), "the obstacle's normal is not finite"),
        (-1.0, "the obstacle's normal must be a pair"),
        ("down", "the obstacle's normal must be a pair"),
        (np.ones((2, 3)), "the obstacle's normal must be a pair"),
        (np.ones((7, 2)), "the obstacle's normal must be a pair"),
        (lambda x: (0.0, -1.0, 0.0), "the obstacle's normal must be a pair"),
    ],
)
def test_normals_that_do_not_fit(normal, words):
    contact = ContactBoundary("bottom", normal=normal)
    with pytest.raises(InvalidInputError, match=words):
        ElasticBody(strip(), Lame(1, 1), supports=[Support("top")], contact=contact)


def test_a_function_that_returns_one_pair_means_it_for_all_positions():
    """Two contact nodes: (0, -1) is no pair of x components."""
    mesh = square("quad", 1)
    body = ElasticBody(
        mesh,
        Lame(1, 1),
        supports=[Support("top", lambda x: (0.0, -0.01))],
        contact=ContactBoundary("bottom", normal=lambda x: (0.0, -1.0)),
    )
    assert body.contact.normals.tolist() == [[0.0, 0.0], [-1.0, -1.0]]
    top = body.all_displacements(np.zeros(len(body.free)), 0.0)[body.positions[1] == 1.0]
    assert top.tolist() == [[0.0, -0.01], [0.0, -0.01]]


# -- arguments of the wrong kind ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"material": 5}, "material must be an object of Material or Mapping, got 5"),
        ({"material": Young}, "material must be an object of Material or Mapping"),
        ({"material": {"part": 5}}, "the material of 'part' must be an object of Material, got 5"),
        ({"supports": Support("top")}, r"supports must be a list of objects of Support, such as"),
        ({"supports": "top"}, r"such as \[Support\(...\)\], got 'top'"),
        ({"loads": [Support("top")]}, "loads must be a list of objects of Traction or BodyForce"),
        ({"contact": "bottom"}, "contact must be an object of ContactBoundary, got 'bottom'"),
        ({"state": "strain"}, "state must be an object of PlaneState, got 'strain'"),
        (
            {"contact": ContactBoundary(lambda x: x[1])},
            r"predicate must return \d+ truth values, one for each midpoint, got .* float64",
        ),
        ({"contact": ContactBoundary(lambda x: [True, False])}, r"got shape \(2,\) of type bool"),
        (
            {"mesh": skfem.MeshQuad(np.full((2, 4), np.nan), np.arange(4)[:, np.newaxis])},
            "the mesh has nodes whose positions are not finite",
        ),
    ],
)
def test_arguments_of_the_wrong_kind(changes, words):
    given = {
        "mesh": strip().with_subdomains({"part": lambda x: x[0] < 9.0}),
        "material": Lame(1.0, 1.0),
        "supports": [Support("top")],
        "contact": ContactBoundary("bottom"),
    } | changes
    with pytest.raises(InvalidInputError, match=words):
        ElasticBody(given.pop("mesh"), given.pop("material"), **given)


def test_numbers_and_eliminations_of_the_wrong_kind():
    problem = pressed(strip()).condensed()
    wrong = [
        (lambda: Young("1", 0.3), "E must be a number, got '1'"),
        (lambda: Lame(1.0, None), "mu must be a number, got None"),
        (lambda: problem.along_friction("half"), "alpha must be a number, got 'half'"),
        (lambda: problem.elastic.condensed("superlu"), "elimination must be an object of"),
        (lambda: recover(np.zeros(3), problem), "problem must be an object of ElasticProblem"),
        (lambda: recover(problem, np.zeros(28)), "solution must be an object of Solution"),
    ]
    for make, words in wrong:
        with pytest.raises(InvalidInputError, match=words):
            make()
