"""The boundary that may touch the obstacle: nodes in order, normals, gaps and friction.

Contact is nodal: every node of the boundary, with quadratic elements also the middle node of
each edge, touches or not for itself. The normal of a node is the mean of the outward normals of the
node's contact edges, weighted with the shape function, or is given by the user; the tangent is the
normal turned counter-clockwise, and points forward along the boundary with the body on the left.

Failure modes and answers
-------------------------
- The normals of a round body spread, and the normals of a plane obstacle do not: the contact is a
  little too stiff. Give the obstacle's normal.
- A given normal that points out of the obstacle into the body would turn contact inside out, and is
  refused.
- Gaps computed from positions err by rounding. A negative gap would be refused; tiny positive gaps
  would close in turn, within rounding. A gap within rounding counts as zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from pwscont import InvalidInputError
from pwscont.extending import EPS, GUARD, Array, Indices, Matrix, counted, finite_array, named
from pwscont_coulomb.elastic.discretisation import Discretisation
from pwscont_coulomb.elastic.edges import Edges
from pwscont_coulomb.elastic.loads import Field, Region, evaluate
from pwscont_coulomb.elastic.regions import facets_of
from pwscont_coulomb.elastic.rollers import ACROSS, across, held_directions, refuse_moving

#: A number for all contact nodes, p numbers, or a function of positions (2, p) -> p numbers.
PerNode: TypeAlias = float | Array | Callable[[Array], Any]

WHAT = "the contact boundary"


@final
@dataclass(frozen=True, slots=True)
class ContactBoundary:
    """The boundary on which a body may touch a rigid obstacle.

    Attributes
    ----------
    boundary : Region
    friction : PerNode
        Coulomb's coefficient F >= 0.
    gap : PerNode
        Initial distance of each contact node to the obstacle along the normal (length, not
        negative; rounding of the mesh's size counts as zero).
    normal : Field, optional
        The direction from the body into the obstacle at each contact node: a pair, pairs of shape
        (2, p), or a function of positions; any length except zero. Default: the outward normals of
        the body at the nodes.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import ContactBoundary
    >>> ContactBoundary("bottom", friction=0.3).gap
    0.0
    """

    boundary: Region
    friction: PerNode = 0.0
    gap: PerNode = 0.0
    normal: Field | None = None


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
        No friction where a node is guided.
    guided : ndarray of bool, shape (p,)
        Nodes that a roller holds along the tangent, such as nodes on an axis of symmetry.
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
    guided: npt.NDArray[np.bool_]

    @property
    def count(self) -> int:
        """Number p of contact nodes."""
        return len(self.nodes)

    def __repr__(self) -> str:
        return named(self, counted(self.count, "node"))

    def rotation(self) -> Matrix:
        """Return the (2 p, 2 p) matrix from (x, y) of each node to all u_nu, then all u_t."""
        p, at = self.count, np.arange(2 * self.count).reshape(-1, 2)
        rows = np.concatenate([np.repeat(np.arange(p), 2), p + np.repeat(np.arange(p), 2)])
        values = np.concatenate([self.normals.T.ravel(), self.tangents.T.ravel()])
        columns = np.concatenate([at.ravel(), at.ravel()])
        return sp.csr_matrix((values, (rows, columns)), shape=(2 * p, 2 * p))


def contact_nodes(
    space: Discretisation, contact: ContactBoundary, held: Indices, given: Array
) -> ContactNodes:
    """Return the contact nodes, without nodes that supports hold entirely.

    Parameters
    ----------
    space : Discretisation
    contact : ContactBoundary
    held : ndarray of int, shape (m,)
        The prescribed unknowns.
    given : ndarray, shape (2, m)
        Constant and growing value of each prescribed unknown.

    Raises
    ------
    InvalidInputError
        If the boundary is empty or unknown, overlaps a support, has no free node, or normal, gap
        or friction do not fit; if a roller moves a node, or holds a node in another direction than
        the tangent.
    """
    facets = facets_of(space.mesh, WHAT, contact.boundary)
    along = space.edges(facets)
    _refuse_overlap(space, along, held)
    order, arc, part = _in_order(along, space.positions)
    free = np.flatnonzero(~(np.isin(2 * order, held) & np.isin(2 * order + 1, held)))
    nodes = order[free]
    if not len(nodes):
        raise InvalidInputError(f"{WHAT} has no free node: supports hold both ends of its edges")
    x, direction = space.positions[:, nodes], held_directions(nodes, held)
    one_sided = np.isin(nodes, _ends(along)) & (contact.normal is None)
    normals = across(direction, _normals(space, along, nodes, contact.normal), one_sided, x)
    refuse_moving(direction, nodes, _everywhere(held, given, space.count), x)
    guided, size = direction >= 0, float(np.ptp(space.positions, axis=1).max())
    return ContactNodes(
        nodes,
        x,
        normals,
        np.stack([-normals[1], normals[0]]),
        along.assemble(np.ones(along.lengths.shape), space.count)[nodes],
        arc[free],
        part[free],
        np.where(guided, 0.0, _not_negative("friction", contact.friction, x)),
        _not_negative("gap", contact.gap, x, GUARD * EPS * size),
        guided,
    )


def _ends(along: Edges) -> Indices:
    """Return the nodes at which the boundary begins or ends."""
    nodes, times = np.unique(along.nodes[:, :2], return_counts=True)
    return np.asarray(nodes[times == 1], dtype=np.intp)


def _everywhere(held: Indices, given: Array, count: int) -> Array:
    moves = np.zeros((2, 2 * count))
    moves[:, held] = given
    return moves


def _normals(space: Discretisation, along: Edges, nodes: Indices, given: Field | None) -> Array:
    """Return the unit normals of contact nodes, shape (2, p): given normals, or the body's."""
    own: Array = np.stack([along.assemble(n, space.count)[nodes] for n in along.normals])
    own /= np.hypot(*own)
    if given is None:
        return own
    x = space.positions[:, nodes]
    pairs = np.array(evaluate("the obstacle's normal", given, x))
    length = np.hypot(*pairs)
    inward = ~((pairs * own).sum(axis=0) > ACROSS * length)
    if inward.any():
        node = int(np.argmax(inward))
        raise InvalidInputError(
            f"the obstacle's normal ({pairs[0, node]:.6g}, {pairs[1, node]:.6g}) at contact node "
            f"{node + 1}, ({x[0, node]:.6g}, {x[1, node]:.6g}), does not point out of the body, "
            f"whose own is ({own[0, node]:.6g}, {own[1, node]:.6g}): give the direction from the "
            "body into the obstacle"
        )
    unit: Array = pairs / length
    return unit


def _refuse_overlap(space: Discretisation, along: Edges, held: Indices) -> None:
    """Refuse contact edges whose nodes are all held."""
    fixed = np.isin(2 * along.nodes, held) & np.isin(2 * along.nodes + 1, held)
    overlap = fixed.all(axis=1)
    if overlap.any():
        x, y = space.positions[:, along.nodes[np.argmax(overlap)]].mean(axis=1)
        raise InvalidInputError(
            f"{WHAT} overlaps a clamped one on {np.count_nonzero(overlap)} of {len(along.nodes)} "
            f"facets, the first near ({x:.6g}, {y:.6g}); they may share end nodes only"
        )


def _in_order(along: Edges, positions: Array) -> tuple[Indices, Array, Indices]:
    """Return the nodes of all edges along the boundary, with arc length and part of each."""
    following = dict(zip(along.nodes[:, 0].tolist(), range(len(along.nodes)), strict=True))
    entered = set(along.nodes[:, 1].tolist())
    heads = [start for start in following if start not in entered]
    heads.sort(key=lambda k: tuple(positions[:, k]))
    chains: list[list[tuple[int, float]]] = []
    for head in heads + list(following):  # nodes that no head leads to form closed loops
        if head in following:
            start = chains[-1][-1][1] if chains else 0.0
            chains.append(_chain(head, start, following, along))
    nodes, arc = zip(*(pair for chain in chains for pair in chain), strict=True)
    part = np.repeat(np.arange(len(chains)), [len(chain) for chain in chains])
    return np.array(nodes, dtype=np.intp), np.array(arc), part


def _chain(
    node: int, length: float, following: dict[int, int], along: Edges
) -> list[tuple[int, float]]:
    """Return a chain of nodes with arc lengths, and remove the edges from ``following``."""
    chain, first = [(node, length)], node
    while node in following:
        edge = following.pop(node)
        step = float(along.lengths[edge].sum())
        chain += [(int(middle), length + 0.5 * step) for middle in along.nodes[edge, 2:]]
        node, length = int(along.nodes[edge, 1]), length + step
        if node != first:
            chain.append((node, length))
    return chain


def _not_negative(name: str, given: PerNode, x: Array, rounding: float = 0.0) -> Array:
    """Return a value per contact node, shape (p,); values that are rounding are set to zero."""
    values = finite_array(name, given(x) if callable(given) else given)
    p = x.shape[1]
    if values.shape not in ((), (p,)):
        raise InvalidInputError(
            f"{name} must be a number, {p} numbers (one per contact node, in order along the "
            f"boundary) or a function of positions that returns them; got shape {values.shape}"
        )
    found = np.where(np.abs(values) <= rounding, 0.0, np.broadcast_to(values, (p,)))
    if (found < 0.0).any():
        node = int(np.argmin(found))
        raise InvalidInputError(
            f"{name} of contact node {node + 1} is negative: {found[node]:.6g} at "
            f"({x[0, node]:.6g}, {x[1, node]:.6g})"
        )
    return found
