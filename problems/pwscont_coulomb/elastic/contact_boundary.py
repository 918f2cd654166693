"""The boundary that may touch the obstacle: nodes in order, normals, gaps and friction.

Contact is nodal: every node of the boundary, with quadratic elements also the middle node of
each edge, touches or not for itself. The normal of a node is the mean of the outward normals of
its contact edges, weighted with its shape function; the tangent is the normal turned
counter-clockwise, so that with the body on the left it points forward along the boundary.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np
import scipy.sparse as sp

from pwscont.foundation.arrays import Array, Indices, Matrix, finite_array
from pwscont.foundation.errors import InvalidInputError
from pwscont_coulomb.elastic.discretisation import Discretisation
from pwscont_coulomb.elastic.edges import Edges
from pwscont_coulomb.elastic.loads import Region
from pwscont_coulomb.elastic.regions import facets_of

#: A number, one per contact node, or a function of positions (2, p) that returns them.
PerNode: TypeAlias = float | Array | Callable[[Array], Any]

WHAT = "the contact boundary"


@final
@dataclass(frozen=True, slots=True)
class ContactBoundary:
    """Where a body may touch a rigid obstacle.

    Attributes
    ----------
    boundary : Region
    friction : PerNode
        Coulomb's coefficient F >= 0.
    gap : PerNode
        Initial distance of each contact node to the obstacle along its outward normal (length,
        not negative).
    """

    boundary: Region
    friction: PerNode = 0.0
    gap: PerNode = 0.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class ContactNodes:
    """The contact nodes of a body, in order along the boundary (body on the left).

    Attributes
    ----------
    nodes : ndarray of int, shape (p,)
    positions, normals, tangents : ndarray, shape (2, p)
        Normals point out of the body towards the obstacle.
    areas : ndarray, shape (p,)
        Integral of each node's shape function over the contact boundary: nodal force by area
        is pressure (area per thickness, a length).
    arc : ndarray, shape (p,)
        Length along the boundary; unconnected parts follow each other.
    part : ndarray of int, shape (p,)
        The connected part of the boundary that a node lies on: 0, 1, ...
    friction, gap : ndarray, shape (p,)
    """

    nodes: Indices
    positions: Array
    normals: Array
    tangents: Array
    areas: Array
    arc: Array
    part: Indices
    friction: Array
    gap: Array

    @property
    def count(self) -> int:
        """Number p of contact nodes."""
        return len(self.nodes)

    def rotation(self) -> Matrix:
        """Return the (2 p, 2 p) matrix from (x, y) of each node to all u_nu, then all u_t."""
        p, at = self.count, np.arange(2 * self.count).reshape(-1, 2)
        rows = np.concatenate([np.repeat(np.arange(p), 2), p + np.repeat(np.arange(p), 2)])
        values = np.concatenate([self.normals.T.ravel(), self.tangents.T.ravel()])
        columns = np.concatenate([at.ravel(), at.ravel()])
        return sp.csr_matrix((values, (rows, columns)), shape=(2 * p, 2 * p))


def contact_nodes(space: Discretisation, contact: ContactBoundary, held: Indices) -> ContactNodes:
    """Return the contact nodes; those that supports hold entirely are none.

    Parameters
    ----------
    space : Discretisation
    contact : ContactBoundary
    held : ndarray of int
        The prescribed unknowns.

    Raises
    ------
    InvalidInputError
        If the boundary is empty or unknown, overlaps a support, has no free node, or gap or
        friction do not fit.
    """
    facets = facets_of(space.mesh, WHAT, contact.boundary)
    along = space.edges(facets)
    _refuse_overlap(space, along, held)
    order, arc, part = _in_order(along, space.positions)
    free = np.flatnonzero(~(np.isin(2 * order, held) & np.isin(2 * order + 1, held)))
    nodes = order[free]
    if not len(nodes):
        raise InvalidInputError(f"{WHAT} has no free node: supports hold both ends of its edges")
    _refuse_rollers(space, nodes, held)
    normals = np.stack([along.assemble(n, space.count)[nodes] for n in along.normals])
    normals /= np.hypot(*normals)
    x = space.positions[:, nodes]
    return ContactNodes(
        nodes,
        x,
        normals,
        np.stack([-normals[1], normals[0]]),
        along.assemble(np.ones(along.lengths.shape), space.count)[nodes],
        arc[free],
        part[free],
        _per_node("friction", contact.friction, x),
        _per_node("gap", contact.gap, x),
    )


def _refuse_overlap(space: Discretisation, along: Edges, held: Indices) -> None:
    """Refuse contact edges of which every node is held."""
    fixed = np.isin(2 * along.nodes, held) & np.isin(2 * along.nodes + 1, held)
    overlap = fixed.all(axis=1)
    if overlap.any():
        x, y = space.positions[:, along.nodes[np.argmax(overlap)]].mean(axis=1)
        raise InvalidInputError(
            f"{WHAT} overlaps a clamped one on {np.count_nonzero(overlap)} of {len(along.nodes)} "
            f"facets, the first near ({x:.6g}, {y:.6g}); they may share end nodes only"
        )


def _refuse_rollers(space: Discretisation, nodes: Indices, held: Indices) -> None:
    sliding = np.isin(2 * nodes, held) | np.isin(2 * nodes + 1, held)
    if sliding.any():
        x, y = space.positions[:, nodes[np.argmax(sliding)]]
        raise InvalidInputError(
            f"the contact node at ({x:.6g}, {y:.6g}) is supported in one direction: a contact node "
            "must be free or clamped in both; end the support or the contact before it"
        )


def _in_order(along: Edges, positions: Array) -> tuple[Indices, Array, Indices]:
    """Return the nodes of all edges along the boundary, with arc length and part of each."""
    following = dict(zip(along.nodes[:, 0].tolist(), range(len(along.nodes)), strict=True))
    entered = set(along.nodes[:, 1].tolist())
    heads = [start for start in following if start not in entered]
    heads.sort(key=lambda k: tuple(positions[:, k]))
    chains: list[list[tuple[int, float]]] = []
    for head in heads + list(following):  # what no head leads to is a closed loop
        if head in following:
            start = chains[-1][-1][1] if chains else 0.0
            chains.append(_chain(head, start, following, along))
    nodes, arc = zip(*(pair for chain in chains for pair in chain), strict=True)
    part = np.repeat(np.arange(len(chains)), [len(chain) for chain in chains])
    return np.array(nodes, dtype=np.intp), np.array(arc), part


def _chain(
    node: int, length: float, following: dict[int, int], along: Edges
) -> list[tuple[int, float]]:
    """Return a chain of nodes with their arc lengths; its edges are used up."""
    chain, first = [(node, length)], node
    while node in following:
        edge = following.pop(node)
        step = float(along.lengths[edge].sum())
        chain += [(int(middle), length + 0.5 * step) for middle in along.nodes[edge, 2:]]
        node, length = int(along.nodes[edge, 1]), length + step
        if node != first:
            chain.append((node, length))
    return chain


def _per_node(name: str, given: PerNode, x: Array) -> Array:
    values = finite_array(name, given(x) if callable(given) else given)
    p = x.shape[1]
    if values.shape not in ((), (p,)):
        raise InvalidInputError(
            f"{name} must be a number, {p} numbers (one per contact node, in order along the "
            f"boundary) or a function of positions that returns them; got shape {values.shape}"
        )
    if (values < 0.0).any():
        node = int(np.argmin(np.broadcast_to(values, (p,)))) + 1
        raise InvalidInputError(f"{name} of contact node {node} is negative: {values.min():.6g}")
    return np.broadcast_to(values, (p,)).copy()
