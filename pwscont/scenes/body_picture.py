"""The seam by which a problem shows its solutions on a body."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.character import Character

#: What a contact node may do.
CONTACT_STATES = ("no contact", "stick", "slip+", "slip-")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """The shapes in which pictures show a body in several states.

    Between two states all numbers are interpolated, so they must depend on (z, alpha) linearly to
    be true there.

    Attributes
    ----------
    corners : ndarray of int, shape (elements, c)
        The nodes around each element.
    positions : ndarray, shape (states, 2, nodes)
        Where nodes are drawn: displacements may be magnified.
    shade : ndarray, shape (states, m, elements)
        Its Euclidean norm over the m components chooses the colour of an element.
    contact : ndarray of int, shape (p,)
        The nodes in or near contact.
    tangents : ndarray, shape (2, p)
        Unit vectors in the direction of ``slip+``.
    pressure, shear, bound : ndarray, shape (states, p)
        Force per area on each contact node, and the most that friction can hold.
    arc : ndarray, shape (p,)
        Length along the boundary at each contact node.
    part : ndarray of int, shape (p,)
        Number of the connected part of the boundary that each contact node belongs to.
    obstacles : tuple of ndarray, each of shape (2, j)
        Outlines of what the body leans on.
    held : ndarray of int
        Nodes that are held in place.
    note : str
        What is magnified, and by how much.
    shade_label, arc_label, force_label : str
        Names of colours and axes, with units.
    """

    corners: Indices
    positions: Array
    shade: Array
    contact: Indices
    tangents: Array
    pressure: Array
    shear: Array
    bound: Array
    arc: Array
    part: Indices
    obstacles: tuple[Array, ...] = ()
    held: Indices = field(default_factory=lambda: np.zeros(0, dtype=int))
    note: str = ""
    shade_label: str = "largest shear stress"
    arc_label: str = "length along the boundary"
    force_label: str = "force per area"


class BodyPicture(ABC):
    """How the states of a system look on a body; the field ``body`` of a scene holds it.

    :class:`pwscont.View` shows the body beside the branch diagram.
    """

    @abstractmethod
    def shapes(self, points: Array) -> Shapes:
        """Return the body in several states.

        Parameters
        ----------
        points : ndarray, shape (states, n + 1)
            Solutions (z, alpha).
        """

    @abstractmethod
    def contact_states(self, character: Character) -> Sequence[str]:
        """Return what each contact node does in a cell.

        Returns
        -------
        sequence of str, length p
            ``no contact``, ``stick``, ``slip+`` or ``slip-``.
        """
