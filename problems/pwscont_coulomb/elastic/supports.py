"""The prescribed displacements of a body, and the rigid motions that supports leave free."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices
from pwscont_coulomb.elastic.discretisation import Discretisation
from pwscont_coulomb.elastic.loads import Support, evaluate
from pwscont_coulomb.elastic.regions import facets_of

#: Largest part of a free rigid motion that the supported unknowns feel: rounding, with a margin.
FREE = 1e-8
#: Largest difference of two values prescribed for the same unknown, as a part of the largest value
#: on the boundary: rounding, with a margin.
AGREE = 1e-12


def prescribed(space: Discretisation, supports: Sequence[Support]) -> tuple[Indices, Array]:
    """Return the prescribed unknowns, and constant and growing value of each, shape (2, m).

    Raises
    ------
    InvalidInputError
        If two supports contradict each other, or a rigid motion remains free.
    """
    values = np.full((2, 2 * space.count), np.nan)
    for number, support in enumerate(supports):
        _prescribe(space, support, f"support {number + 1}", values)
    unknowns = np.flatnonzero(np.isfinite(values[0]))
    _refuse_free_motions(space, unknowns)
    return unknowns, values[:, unknowns]


def _prescribe(space: Discretisation, support: Support, name: str, values: Array) -> None:
    nodes = space.nodes_on(facets_of(space.mesh, f"the boundary of {name}", support.boundary))
    x = space.positions[:, nodes]
    for part, field in enumerate((support.constant, support.growing)):
        wanted = evaluate(f"the displacement of {name}", field, x)
        for a in support.components:
            old, new = values[part, 2 * nodes + a], wanted[a]
            largest = np.nanmax(np.abs([old, new]), initial=0.0)
            clash = np.abs(old - new) > AGREE * largest
            if clash.any():
                where = tuple(float(v) for v in x[:, np.argmax(clash)])
                raise InvalidInputError(
                    f"{name} prescribes another displacement at ({where[0]:.6g}, {where[1]:.6g}) "
                    "than a support before it"
                )
            values[part, 2 * nodes + a] = new


def _refuse_free_motions(space: Discretisation, unknowns: Indices) -> None:
    """Refuse a body if the body or an unconnected part can move without strain."""
    parts, part = _parts(space)
    for number in range(parts):
        nodes = np.flatnonzero(part == number)
        held = unknowns[part[unknowns // 2] == number]
        motions = free_motions(space.positions, nodes, held)
        if motions:
            where = f"part {number + 1} of {parts} of the body" if parts > 1 else "the body"
            raise InvalidInputError(
                f"{where} is not clamped well enough: free to move by {' and '.join(motions)}; "
                "support more of its boundary (contact does not count, it may open)"
            )


def _parts(space: Discretisation) -> tuple[int, Indices]:
    """Return how many connected parts the body has, and the part of each node."""
    first, rest = space.element_nodes[0], space.element_nodes[1:]
    rows = np.broadcast_to(first, rest.shape).ravel()
    links = csr_matrix((np.ones(rest.size), (rows, rest.ravel())), (space.count, space.count))
    parts, part = connected_components(links, directed=False)
    return int(parts), np.asarray(part, dtype=np.intp)


def free_motions(positions: Array, nodes: Indices, held: Indices) -> list[str]:
    """Return in words the rigid motions of some nodes that the held unknowns leave free."""
    centre, size = positions[:, nodes].mean(axis=1), np.ptp(positions[:, nodes]) or 1.0
    x, y = (positions[:, held // 2] - centre[:, np.newaxis]) / size
    along_y = held % 2
    felt = np.column_stack([1.0 - along_y, along_y, np.where(along_y, x, -y)])
    _, strength, motions = np.linalg.svd(np.vstack([felt, np.zeros((3, 3))]))
    free = motions[strength <= FREE * np.sqrt(max(len(held), 1))]
    return _words(free, centre, size)


def _words(free: Array, centre: Array, size: float) -> list[str]:
    """Return names for a space of rigid motions (translation x, translation y, rotation)."""
    if len(free) == 3:
        return ["translation x", "translation y", "rotation"]
    if len(free) == 2 and np.abs(free[:, 2]).max() < FREE:
        return ["translation x", "translation y"]
    return [_word(motion, centre, size) for motion in free]


def _word(motion: Array, centre: Array, size: float) -> str:
    tx, ty, turn = motion
    if abs(turn) < FREE:
        named = {True: "translation x", abs(tx) < FREE: "translation y"}
        return named[True] if min(abs(tx), abs(ty)) < FREE else f"translation ({tx:.3g}, {ty:.3g})"
    x, y = centre + size * np.array([-ty, tx]) / turn
    return f"rotation about ({x:.6g}, {y:.6g})"
