"""Meshes with finite elements, and the check that no element is inverted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices
from pwscont_coulomb.elastic.libraries import loaded
from pwscont_coulomb.elastic.mesh_files import read_mesh
from pwscont_coulomb.elastic.repetition import ONCE, copies, in_words, repeated

#: Smallest Jacobian of an element, as a part of the element's size: below, an element is
#: degenerate.
FLAT = 1e-12
#: A slit narrower than this part of a facet's length is a facet without neighbour.
SLIT = 1e-6
CUT = "not joined to the elements across a facet: nodes lie on the facet that are not its own"


def library() -> Any:
    """Return scikit-fem, which is loaded only here.

    Raises
    ------
    InvalidInputError
        If scikit-fem is not installed.
    """
    return loaded("skfem")


def as_mesh(mesh: Any) -> Any:
    """Return a scikit-fem mesh, read with meshio where a path is given.

    Physical groups of a Gmsh file become boundaries and subdomains of the same names.

    Raises
    ------
    InvalidInputError
        If the file cannot be read or holds no plane mesh of triangles or quadrilaterals.
    """
    skfem = library()
    found = read_mesh(Path(mesh)) if isinstance(mesh, (str, Path)) else mesh
    if not isinstance(found, (skfem.MeshTri1, skfem.MeshQuad1)):
        raise InvalidInputError(
            f"mesh must be a plane mesh of triangles or quadrilaterals, got {type(found).__name__}"
        )
    return _without_loose_points(found)


def _without_loose_points(mesh: Any) -> Any:
    """Return the mesh without points that no element uses, as centres of circles in Gmsh files."""
    loose = mesh.doflocs.shape[1] - len(np.unique(mesh.dofs.element_dofs))
    return mesh.remove_unused_nodes() if loose else mesh


def element_for(mesh: Any, order: int | None) -> Any:
    """Return P1, P2, Q1 or Q2; the default order is the order of the mesh's geometry.

    Raises
    ------
    InvalidInputError
        If the order is not 1 or 2.
    """
    skfem = library()
    curved = isinstance(mesh, (skfem.MeshTri2, skfem.MeshQuad2))
    chosen = (2 if curved else 1) if order is None else order
    if chosen not in (1, 2):
        raise InvalidInputError(f"order must be 1 or 2, got {order}")
    if isinstance(mesh, skfem.MeshTri1):
        return skfem.ElementTriP1() if chosen == 1 else skfem.ElementTriP2()
    return skfem.ElementQuad1() if chosen == 1 else skfem.ElementQuad2()


def check_elements(mesh: Any) -> None:
    """Refuse elements that are repeated, inverted, degenerate, not joined, or overlap at a facet.

    Raises
    ------
    InvalidInputError
        Naming the elements and the place of the first element.
    """
    if not np.isfinite(mesh.doflocs).all():
        raise InvalidInputError("the mesh has nodes whose positions are not finite")
    _refuse(mesh, _turned(mesh), "inverted or degenerate")
    again = _repeated(mesh)
    _refuse(mesh, again, f"listed again{in_words(_subdomains(mesh, again))}", ONCE)
    _refuse(mesh, _crowded(mesh), "at a facet of more than two elements: they overlap")
    _refuse(mesh, _folded(mesh), "inverted: they overlap a neighbour")
    _refuse(mesh, _unjoined(mesh), CUT, "give elements that touch the same nodes")


def _refuse(mesh: Any, elements: Indices, words: str, remedy: str = "mend the mesh") -> None:
    if len(elements):
        x, y = mesh.p[:, mesh.t[:, elements[0]]].mean(axis=1)
        listed = ", ".join(map(str, elements[:5])) + (", ..." if len(elements) > 5 else "")
        raise InvalidInputError(
            f"{len(elements)} of {mesh.nelements} elements are {words}: {listed} "
            f"(counted from 0; the first lies at ({x:.6g}, {y:.6g})); {remedy}"
        )


def _places(mesh: Any) -> Indices:
    """Return numbers of the corners of each element, equal where corners coincide."""
    _, place = np.unique(mesh.p[0] + 1j * mesh.p[1], return_inverse=True)
    return np.asarray(place[mesh.t], dtype=np.intp)


def _repeated(mesh: Any) -> Indices:
    """Return the elements whose corners coincide with the corners of an earlier element."""
    return repeated(_places(mesh))


def _subdomains(mesh: Any, again: Indices) -> list[str]:
    """Return the subdomains of all copies of the first repeated element."""
    if not len(again):
        return []
    same = copies(_places(mesh), again[0])
    return [name for name, part in (mesh.subdomains or {}).items() if np.isin(same, part).any()]


def _crowded(mesh: Any) -> Indices:
    """Return the elements at facets that more than two elements have."""
    sharing = np.bincount(mesh.t2f.ravel())
    return np.flatnonzero((sharing[mesh.t2f] > 2).any(axis=0))


def _turned(mesh: Any) -> Indices:
    """Return the elements in which the map from the reference element turns over or collapses."""
    determinants = _jacobians(mesh)
    size = np.ptp(mesh.p[:, mesh.t], axis=1).max(axis=0) ** 2
    upright = determinants * np.sign(determinants.sum(axis=1))[:, np.newaxis]
    return np.flatnonzero(~(upright.min(axis=1) > FLAT * size))


def _jacobians(mesh: Any) -> Array:
    """Return det of the map at the nodes of each element, shape (elements, nodes)."""
    element, corners = mesh.elem(), mesh.doflocs[:, mesh.dofs.element_dofs]
    points = np.array(element.doflocs, dtype=float).T
    slopes = [
        np.broadcast_to(element.lbasis(points, i)[1], points.shape) for i in range(len(corners[0]))
    ]
    J = np.einsum("aie,ibq->abeq", corners, np.array(slopes))
    found: Array = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    return found


def _folded(mesh: Any) -> Indices:
    """Return the elements that lie on the same side of a facet as the neighbour."""
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    start, end = mesh.p[:, mesh.facets[0, inner]], mesh.p[:, mesh.facets[1, inner]]
    middles = mesh.p[:, mesh.t].mean(axis=1)
    sides = [_cross(end - start, middles[:, mesh.f2t[k, inner]] - start) for k in (0, 1)]
    bad = mesh.f2t[:, inner[sides[0] * sides[1] >= 0.0]]
    votes = np.bincount(bad.ravel(), minlength=mesh.nelements)
    # an inverted element disagrees with all neighbours, a neighbour only with the inverted element
    return np.flatnonzero((votes == votes.max()) & (votes > 0))


def _unjoined(mesh: Any) -> Indices:
    """Return the elements at whose outer facets other nodes of the boundary lie.

    Between such elements and their neighbours the body is cut, though no gap is to be seen.
    """
    facets = mesh.boundary_facets()
    ends = mesh.facets[:, facets]
    nodes, (start, end) = np.unique(ends), mesh.p[:, ends].transpose(1, 0, 2)
    half = 0.5 * np.hypot(*(end - start))
    tree = cKDTree(mesh.p[:, nodes].T)
    near = tree.query_ball_point(0.5 * (start + end).T, (1.0 + SLIT) * half)
    facet = np.repeat(np.arange(len(facets)), [len(some) for some in near])
    node = nodes[np.concatenate([np.zeros(0), *near]).astype(int)]
    along, beside = (end - start)[:, facet], mesh.p[:, node] - start[:, facet]
    is_on = np.abs(_cross(along, beside)) <= SLIT * 4.0 * half[facet] ** 2
    strange = is_on & (node != ends[0, facet]) & (node != ends[1, facet])
    return np.unique(mesh.f2t[0, facets[facet[strange]]])


def _cross(a: Array, b: Array) -> Array:
    found: Array = a[0] * b[1] - a[1] * b[0]
    return found
