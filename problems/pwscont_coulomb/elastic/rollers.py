"""Contact nodes that a support holds in a direction: on rollers, such as an axis of symmetry.

A node that may touch needs a normal displacement. If a roller holds the tangential displacement,
the node is *guided*: the node touches or not, without moving along the obstacle, and bears no
friction. The support takes tangential forces; on an axis of symmetry there are none.

Failure modes and answers
-------------------------
- At the end of the contact boundary the mean normal is the normal of a single side. The model is
  half of a whole body, where the mirror image of the side follows beyond the roller: the mean
  normal of side and image is the part across the held direction. Elsewhere, or if side and image
  would meet at a sharp angle, a roller across the tangent means something else, and is refused.
- A node held in the normal direction cannot touch or leave. The node is refused, not left out, for
  the node may lie inside the obstacle.
- A roller that moves a node along the tangent makes the node slip: the friction is a force between
  obstacle and support that no equation of the body tells. Such a roller is refused.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pwscont import InvalidInputError
from pwscont.extending import EPS, Array, Indices

#: Component along a direction below which a unit vector counts as across the direction: the error
#: of the normal of an edge whose length is the same part of the mesh.
ACROSS = EPS**0.5
#: Largest component of a unit normal along the held direction, which the mirror image cancels: side
#: and image then meet at an angle of 120 degrees or more.
BLUNT = 0.5

REMEDY = "end the support or the contact boundary before this node"


def held_directions(nodes: Indices, held: Indices) -> Indices:
    """Return 0 or 1 if x or y of a node is held, -1 if the node is free, shape (p,)."""
    return np.where(np.isin(2 * nodes, held), 0, np.where(np.isin(2 * nodes + 1, held), 1, -1))


def across(
    direction: Indices, normals: Array, at_end: npt.NDArray[np.bool_], positions: Array
) -> Array:
    """Return the normals of contact nodes, across the held direction at guided nodes.

    Parameters
    ----------
    direction : ndarray of int, shape (p,)
        From :func:`held_directions`.
    normals, positions : ndarray, shape (2, p)
    at_end : ndarray of bool, shape (p,)
        Whether the normal is the mean of a single side, which a mirror image completes.

    Raises
    ------
    InvalidInputError
        If a roller holds a node in another direction than the tangent.
    """
    found = normals.copy()
    for node in np.flatnonzero(direction >= 0):
        held = direction[node]
        if abs(normals[held, node]) > (BLUNT if at_end[node] else ACROSS):
            (x, y), (nx, ny) = positions[:, node], normals[:, node]
            raise InvalidInputError(
                f"the contact node at ({x:.6g}, {y:.6g}) is held in direction {'xy'[held]}, which "
                f"is not tangential: its normal is ({nx:.6g}, {ny:.6g}), and a node on a roller "
                f"must be free to move along it; {REMEDY}, or give the obstacle's normal"
            )
        found[held, node] = 0.0
        found[1 - held, node] = np.sign(normals[1 - held, node])
    return found


def refuse_moving(direction: Indices, nodes: Indices, moves: Array, positions: Array) -> None:
    """Refuse rollers that move a contact node along the tangent.

    Parameters
    ----------
    direction, nodes : ndarray of int, shape (p,)
    moves : ndarray, shape (2, 2 k)
        Constant and growing prescribed displacement of all unknowns, 0 if not prescribed.
    positions : ndarray, shape (2, p)
    """
    guided = np.flatnonzero(direction >= 0)
    moving = moves[:, 2 * nodes[guided] + direction[guided]].any(axis=0)
    if moving.any():
        x, y = positions[:, guided[np.argmax(moving)]]
        raise InvalidInputError(
            f"a support moves the contact node at ({x:.6g}, {y:.6g}) along its tangent, and would "
            f"take its friction; {REMEDY}"
        )
