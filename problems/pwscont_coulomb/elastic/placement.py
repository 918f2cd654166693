"""The places of a body and an obstacle in a picture with magnified displacements.

Distances to the obstacle are magnified like displacements, so that closed nodes lie on the drawn
obstacle. An obstacle straighter than the boundary of the body, as the ground below a round body,
stays in place, and the boundary of the body is moved away from the obstacle, inner nodes less and
less. Any other obstacle is drawn at the magnified distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.spatial import KDTree

from pwscont.extending import Array, Indices
from pwscont_coulomb.elastic.contact_boundary import ContactNodes
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.recovery import BodyState

#: Drawn size of the largest displacement, and most of the largest gap, as parts of the body's size.
DRAWN, DRAWN_GAP = 0.08, 0.25
#: Depth to which a body is moved away from an obstacle, as a part of the body's size.
DEPTH = 0.5


def magnification(body: DiscretisedBody, states: Sequence[BodyState]) -> float:
    """Return the factor by which displacements are drawn: 1, 2 or 5 times a power of ten.

    Large gaps, which are magnified as well, keep the factor down to 1.
    """
    return magnified(body, max(float(np.abs(state.displacements).max()) for state in states))


def magnified(body: DiscretisedBody, largest: float) -> float:
    """Return the factor by which displacements are drawn, from the largest displacement."""
    size, gap = _size(body), float(body.contact.gap.max(initial=0.0))
    if largest == 0.0:
        return 1.0
    wanted = DRAWN * size / largest
    if gap > 0.0:
        wanted = min(wanted, max(1.0, DRAWN_GAP * size / gap))
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _size(body: DiscretisedBody) -> float:
    return float(np.ptp(body.positions, axis=1).max())


def parts_of(contact: ContactNodes) -> list[Indices]:
    """Return the nodes of each connected part of the contact boundary."""
    return [np.flatnonzero(contact.part == part) for part in np.unique(contact.part)]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Positions in a picture.

    Attributes
    ----------
    body : DiscretisedBody
    factor : float
        By which displacements and gaps are magnified.
    rest : ndarray, shape (2, nodes)
        Drawn places of the nodes without displacements.
    obstacle : ndarray, shape (2, p)
        Drawn place of the obstacle at each contact node.
    into : ndarray, shape (2, p)
        Unit normals into the obstacle, as drawn.
    """

    body: DiscretisedBody
    factor: float
    rest: Array
    obstacle: Array
    into: Array

    @classmethod
    def of(cls, body: DiscretisedBody, factor: float) -> Placement:
        """Return the positions for a factor."""
        contact = body.contact
        gaps = contact.gap * contact.normals
        obstacle, into = contact.positions + factor * gaps, contact.normals.copy()
        away = np.zeros_like(gaps)
        for nodes in parts_of(contact):
            surface = contact.positions[:, nodes] + gaps[:, nodes]
            across, bend = _straightened(surface)
            if bend < _straightened(contact.positions[:, nodes])[1]:
                obstacle[:, nodes] = surface
                away[:, nodes] = (1.0 - factor) * np.outer(across, across @ gaps[:, nodes])
                into[:, nodes] = (across * np.sign(across @ into[:, nodes].sum(axis=1)))[:, None]
        return cls(body, factor, body.positions + _faded(body, away), obstacle, into)

    def moved(self, state: BodyState) -> Array:
        """Return where the nodes are drawn, shape (2, nodes)."""
        moved: Array = self.rest + self.factor * state.displacements.T
        return moved

    def outlines(self) -> list[tuple[Array, Array]]:
        """Return surface and outline of the obstacle along each part of the boundary."""
        depth = 0.02 * float(np.ptp(self.body.positions))
        parts = parts_of(self.body.contact)
        return [_outline(self.obstacle[:, i], self.into[:, i], depth) for i in parts]

    def words(self) -> str:
        """Return what is magnified, and by how much."""
        if self.factor == 1.0:
            return "displacements true to scale"
        gaps = " and gaps" if self.body.contact.gap.any() else ""
        if self.factor < 1.0:
            return f"displacements{gaps} drawn at {self.factor:.3g} of their size"
        return f"displacements{gaps} magnified {self.factor:.3g} times"


def _outline(line: Array, normals: Array, depth: float) -> tuple[Array, Array]:
    """Return a surface, and the outline of a strip of this depth below, each of shape (2, k)."""
    below = line + depth * normals
    if line.shape[1] == 1:  # a single node: a short piece of the tangent
        along = 4.0 * depth * np.array([[-1.0, 1.0]]) * np.stack([-normals[1], normals[0]])
        line, below = line + along, below + along
    return line, np.hstack([line, below[:, ::-1]])


def _straightened(line: Array) -> tuple[Array, float]:
    """Return the normal of the line closest to points, shape (2, k), and the size of the bend."""
    centred = line - line.mean(axis=1, keepdims=True)
    axes, sizes, _ = np.linalg.svd(centred, full_matrices=False)
    return axes[:, -1], float(sizes[-1]) if len(sizes) > 1 else 0.0


def _faded(body: DiscretisedBody, away: Array) -> Array:
    """Return shifts of all nodes: the shift of the nearest contact node, less with the distance."""
    if not away.any():
        return np.zeros_like(body.positions)
    distance, nearest = KDTree(body.contact.positions.T).query(body.positions.T)
    shifts: Array = away[:, nearest] * np.maximum(0.0, 1.0 - distance / (DEPTH * _size(body)))
    return shifts
