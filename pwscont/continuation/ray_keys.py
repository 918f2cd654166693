"""Keys of rays: enough to recognise a ray that was followed or arrived on.

A ray is recognised by its cells, its place and its direction. Directions are compared by the cosine
between their sketches, see :meth:`~pwscont.curve.metric.Metric.sketch`.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.curve import Curve
from pwscont.curve.metric import Metric
from pwscont.graph.place import Place
from pwscont.system.selection import Selection
from pwscont.transitions.rays import Ray

#: Names of cells with more bytes than this are replaced by a digest of so many.
LONG, DIGEST = 64, 20
#: Places closer than this times their size are one, if the rays there agree as well.
#: Far above the accuracy of a located point, far below what separates equal transitions.
JOIN = EPS**0.5


@final
class RayKey(NamedTuple):
    """A ray as a node remembers it.

    Attributes
    ----------
    place : Place
        Where it starts.
    names : tuple of bytes
        Cells in which it may be met.
    direction : ndarray
        Of length one.
    """

    place: Place
    names: tuple[bytes, ...]
    direction: Array

    @classmethod
    def of(cls, ray: Ray, place: Place) -> RayKey:
        """Return the key of a ray that leaves a place."""
        return cls(place, names(ray), ray.curve.metric.sketch(ray.state.tangent))

    def reversed(self, place: Place) -> RayKey:
        """Return the key of the ray that leads back from the end of a straight piece."""
        return RayKey(place, self.names, -self.direction)

    def alignment(self, ray: Ray, key: RayKey) -> float:
        """Return the cosine to a ray with another key, 0 where it starts elsewhere."""
        cosine = self.direction.dot(key.direction)
        return cosine if cosine > 0.0 and self.is_where(ray) else 0.0

    def is_where(self, ray: Ray) -> bool:
        """Tell whether a ray starts at this place, to within the errors of both."""
        return self.is_at(ray.curve.metric, ray.state.x, ray.state.size)

    def is_at(self, metric: Metric, x: Array, size: Array) -> bool:
        """Tell whether a point with an error of this size is this place."""
        near = metric.norm(metric.difference(self.place.x, x)) <= metric.slack(x, JOIN)
        return near or self.is_within(metric, x, size)

    def is_within(self, metric: Metric, x: Array, size: Array) -> bool:
        """Tell whether the errors of both alone explain how far a point is from this place."""
        apart = np.abs(metric.difference(self.place.x, x))
        return bool((apart <= CONFIDENCE * (self.place.error + size)).all())


def names(ray: Ray) -> tuple[bytes, ...]:
    """Return short names of the cells in which a ray may be met again."""
    if not ray.interface_cells:
        return (name_of(ray.curve.selection.cell),)  # nearly always
    return tuple(map(name_of, ray.cells))


def name_of(cell: bytes) -> bytes:
    """Return the short name of a cell."""
    return cell if len(cell) <= LONG else blake2b(cell, digest_size=DIGEST).digest()


@final
@dataclass(slots=True, eq=False)
class FollowedRay:
    """The data of a followed ray that its edge keeps.

    Attributes
    ----------
    selection : tuple of Character
        The frozen character, and for a ray along an interface those of all its cells.
    names : tuple of bytes
        Names of the cells in which the ray may be met again.
    along_interface : bool
        Whether the ray runs along an interface.
    index, orientation, slope
        Of the ray and its state.
    """

    selection: tuple[Character, ...]
    names: tuple[bytes, ...]
    along_interface: bool
    index: int
    orientation: int
    slope: float

    @classmethod
    def of(cls, ray: Ray, key: RayKey) -> FollowedRay:
        """Return what to remember of a ray with this key."""
        selection = (ray.curve.selection.character, *ray.interface_cells)
        for character in selection:
            character.pack()
        return cls(
            selection,
            key.names,
            bool(ray.interface_cells),
            ray.index,
            ray.state.orientation,
            ray.curve.slope(ray.state),
        )

    @property
    def character(self) -> Character:
        """The frozen character of the piece."""
        return self.selection[0]

    def curve(self, like: Curve) -> Curve:
        """Return the curve of the piece, in the system and metric of another."""
        first, *beside = self.selection
        return Curve(Selection(like.selection.system, first, tuple(beside)), like.metric)
