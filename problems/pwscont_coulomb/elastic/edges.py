"""Boundary edges: integrals of shape functions and normals along straight or curved edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.extending import Array, Indices

#: Gauss points and weights on [0, 1]: exact to degree 7.
POINTS, WEIGHTS = (np.polynomial.legendre.leggauss(4) + np.array([[1.0], [0.0]])) / 2.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Edges of the boundary, each run through counter-clockwise (body on the left).

    Attributes
    ----------
    nodes : ndarray of int, shape (k, 2) or (k, 3)
        Start, end and, with quadratic elements, middle node of each edge.
    positions : ndarray, shape (2, k, q)
        Points of integration.
    shapes : ndarray, shape (nodes per edge, q)
        Shape functions there.
    normals : ndarray, shape (2, k, q)
        Outward unit normals there.
    lengths : ndarray, shape (k, q)
        Weights of integration (length).
    """

    nodes: Indices
    positions: Array
    shapes: Array
    normals: Array
    lengths: Array

    def assemble(self, values: Array, count: int) -> Array:
        """Return the integrals of values, shape (k, q), times each node's shape function.

        Parameters
        ----------
        values : ndarray, shape (k, q)
        count : int
            Number of nodes of the body.
        """
        parts = np.einsum("iq,kq,kq->ki", self.shapes, values, self.lengths)
        return np.bincount(self.nodes.ravel(), parts.ravel(), minlength=count).astype(float)


def edges(mesh: Any, basis: Any, facets: Indices) -> Edges:
    """Return the edges that facets of the boundary make.

    Parameters
    ----------
    mesh : skfem.Mesh
    basis : skfem.Basis
        Scalar, P1, P2, Q1 or Q2.
    facets : ndarray of int
    """
    ends = mesh.facets[:, facets]
    corners, middle = mesh.p[:, ends], _middles(mesh, facets)
    inside = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    along = corners[:, 1] - corners[:, 0]
    inward = inside - corners[:, 0]
    clockwise = along[0] * inward[1] - along[1] * inward[0] < 0.0
    order = np.where(clockwise, [[1], [0]], [[0], [1]])
    ends = np.take_along_axis(ends, order, axis=0)
    points = np.stack([mesh.p[:, ends[0]], mesh.p[:, ends[1]], middle])
    positions = np.einsum("iq,iak->akq", _quadratic(POINTS), points)
    tangents = np.einsum("iq,iak->akq", _quadratic_slopes(POINTS), points)
    speed = np.hypot(*tangents)
    normals = np.stack([tangents[1], -tangents[0]]) / speed
    quadratic = basis.facet_dofs.shape[0] > 0
    nodes = np.vstack([ends, basis.facet_dofs[:, facets] if quadratic else ends[:0]]).T
    shapes = _quadratic(POINTS) if quadratic else np.stack([1.0 - POINTS, POINTS])
    return Edges(nodes, positions, shapes, normals, speed * WEIGHTS)


def _middles(mesh: Any, facets: Indices) -> Array:
    """Return the middle of each facet, on the curve where the mesh is quadratic."""
    if mesh.dofs.facet_dofs.shape[0]:
        return np.asarray(mesh.doflocs[:, mesh.dofs.facet_dofs[0, facets]])
    return np.asarray(mesh.p[:, mesh.facets[:, facets]].mean(axis=1))


def _quadratic(s: Array) -> Array:
    return np.stack([(1.0 - s) * (1.0 - 2.0 * s), s * (2.0 * s - 1.0), 4.0 * s * (1.0 - s)])


def _quadratic_slopes(s: Array) -> Array:
    return np.stack([4.0 * s - 3.0, 4.0 * s - 1.0, 4.0 - 8.0 * s])
