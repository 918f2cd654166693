"""Stiffness and loads of plane elements, from the shape functions of scikit-fem.

With g_i the gradient of shape function i, the stiffness between component a of node i and
component b of node j is the integral of

    lambda g_i,a g_j,b + mu g_i,b g_j,a + mu delta_ab g_i.g_j,

the weak form of div sigma + b = 0 with sigma = lambda tr(e) + 2 mu e. Unknown 2 k + a is component
a of node k; nodes are numbered as scikit-fem numbers its degrees of freedom: vertices, then
facets, then elements.

Failure modes and answers
-------------------------
- Integrals use the absolute Jacobian, and would not notice inverted elements: inverted elements are
  refused before (:mod:`pwscont_coulomb.elastic.meshes`).
- Nearly incompressible bodies (nu towards 0.5) in plane strain lock with P1 and Q1 elements: the
  stiffness is exact for the element but far too stiff. Use order 2.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.elastic.edges import Edges, edges
from pwscont_coulomb.elastic.loads import Field, evaluate
from pwscont_coulomb.elastic.meshes import check_elements, element_for, library


@final
class Discretisation:
    """Finite elements on a mesh.

    Parameters
    ----------
    mesh : skfem.Mesh
    order : int or None
        1 or 2; None for the order of the mesh's geometry.

    Attributes
    ----------
    positions : ndarray, shape (2, k)
        Nodes.
    count : int
        Number k of nodes.
    element_nodes : ndarray of int, shape (nodes per element, elements)

    Raises
    ------
    InvalidInputError
        If elements are inverted or the order is not known.
    """

    def __init__(self, mesh: Any, order: int | None) -> None:
        check_elements(mesh)
        self.mesh = mesh
        self._basis = library().Basis(mesh, element_for(mesh, order))
        self.positions: Array = np.asarray(self._basis.doflocs)
        self.count = self.positions.shape[1]
        self.element_nodes: Indices = np.asarray(self._basis.element_dofs, dtype=np.intp)

    @cached_property
    def _gradients(self) -> Array:
        """Gradients of the shape functions, shape (nodes per element, 2, elements, points)."""
        return np.array([shape[0].grad for shape in self._basis.basis])

    def stiffness(self, lam: Array, mu: Array) -> Matrix:
        """Return the stiffness of all nodes, shape (2 k, 2 k), csr.

        Parameters
        ----------
        lam, mu : ndarray, shape (elements,)
            Parameters of the stress-strain relation in the plane (force per area).
        """
        g, dx = self._gradients, self._basis.dx
        pairs = np.einsum("iaeq,jbeq,eq->ijabe", g, g, dx)
        local = lam * pairs + mu * pairs.swapaxes(2, 3)
        trace = mu * (pairs[:, :, 0, 0] + pairs[:, :, 1, 1])
        local[:, :, 0, 0] += trace
        local[:, :, 1, 1] += trace
        return self._assembled(local)

    def _assembled(self, local: Array) -> Matrix:
        nodes = self.element_nodes[:, np.newaxis].astype(np.int32)
        unknowns = 2 * nodes + np.array([[0], [1]], dtype=np.int32)  # (i, a, e)
        rows = np.broadcast_to(unknowns[:, np.newaxis, :, np.newaxis], local.shape)
        columns = np.broadcast_to(unknowns[np.newaxis, :, np.newaxis], local.shape)
        entries = (local.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_matrix(entries, shape=(2 * self.count, 2 * self.count))

    def body_force(self, name: str, field: Field, elements: Indices) -> Array:
        """Return the nodal forces of a force per volume, shape (2 k,)."""
        x = np.asarray(self._basis.global_coordinates())[:, elements]
        shapes = np.array([np.broadcast_to(s[0], self._basis.dx.shape) for s in self._basis.basis])
        weight = shapes[:, elements] * self._basis.dx[elements]
        parts = np.einsum("ieq,aeq->aie", weight, evaluate(name, field, x))
        nodes = self.element_nodes[:, elements].ravel()
        return _interleaved([_summed(nodes, part, self.count) for part in parts])

    def traction(self, name: str, field: Field, facets: Indices) -> Array:
        """Return the nodal forces of a force per area, shape (2 k,)."""
        along = self.edges(facets)
        values = evaluate(name, field, along.positions)
        return _interleaved([along.assemble(v, self.count) for v in values])

    def edges(self, facets: Indices) -> Edges:
        """Return the edges of facets of the boundary."""
        return edges(self.mesh, self._basis, facets)

    def nodes_on(self, facets: Indices) -> Indices:
        """Return the nodes of facets of the boundary, sorted."""
        return np.unique(self.edges(facets).nodes)

    def strains(self, displacements: Array) -> Array:
        """Return the mean strain of each element, shape (3, elements): e_xx, e_yy, 2 e_xy.

        Parameters
        ----------
        displacements : ndarray, shape (k, 2)
        """
        dx = self._basis.dx
        mean = np.einsum("ibeq,eq->ibe", self._gradients, dx / dx.sum(axis=1, keepdims=True))
        slopes = np.einsum("iea,ibe->abe", displacements[self.element_nodes], mean)
        return np.stack([slopes[0, 0], slopes[1, 1], slopes[0, 1] + slopes[1, 0]])


def _summed(nodes: Indices, values: Array, count: int) -> Array:
    return np.bincount(nodes, values.ravel(), minlength=count).astype(float)


def _interleaved(components: list[Array]) -> Array:
    """Return x and y components of all nodes as a vector, the two components of a node together."""
    forces: Array = np.column_stack(components).ravel()
    return forces
