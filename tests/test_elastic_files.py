"""Elastic bodies: files, and errors."""

import json
import subprocess
import sys

import numpy as np
import pytest
import skfem
from elastic_bodies import pressed, strip
from elastic_parts import body_with
from gmsh_files import GMSH_22, GMSH_41
from pwscont_coulomb.elastic import (
    BodyForce,
    ContactBoundary,
    ElasticBody,
    Lame,
    Support,
    Traction,
    Young,
)
from pwscont_coulomb.elastic.meshes import check_elements
from pwscont_coulomb.elastic.scenes import press_body

from pwscont import MissingPackageError
from pwscont.basics.errors import InvalidInputError

# -- files ---------------------------------------------------------------------------------------


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


@pytest.mark.slow
def test_finite_element_libraries_are_loaded_only_for_a_body():
    code = (
        "import sys, json, pwscont_coulomb, pwscont_coulomb.elastic\n"
        "from pwscont_coulomb.elastic import scenes\n"
        "scenes.block(), scenes.triangle()\n"
        "print(json.dumps([m for m in ('skfem', 'meshio', 'matplotlib') if m in sys.modules]))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == []


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


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("slit", [0.0, 1e-12])
def test_elements_that_touch_without_common_nodes_are_refused(unit, slit):
    """A seam with nodes of its own on either side, and a node in the middle of a longer facet."""
    left, right = ([[0, 1, 1, 0], [0, 0, 1, 1]], [[1 + slit, 2, 2, 1 + slit], [0, 0, 1, 1]])
    seam = skfem.MeshQuad(unit * np.hstack([left, right]), np.arange(8).reshape(2, 4).T)
    corners = [[0, 1, 1, 0, 2, 2, 1 + slit], [0, 0, 1, 1, 0, 1, 0.5]]
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 6], [4, 5, 6], [5, 2, 6]]).T
    hanging = skfem.MeshTri(unit * np.array(corners, dtype=float), triangles)
    for mesh, words in ((seam, "2 of 2 elements are not joined"), (hanging, "1 of 5 elements")):
        with pytest.raises(InvalidInputError, match=words):
            check_elements(mesh)
    check_elements(skfem.MeshQuad(seam.p + 1e-3 * unit * (np.arange(8) > 3), seam.t))
