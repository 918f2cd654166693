"""What is remembered of a ray that was followed: enough to know it again.

A ray is known by its cells, its place and its direction. Directions are compared by the cosine
between them, for which a few projections do as well as all components: the projections of equal
directions agree, those of directions that differ clearly do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from hashlib import blake2b
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.curve import Curve
from pwscont.curve.uncertainty import magnitude
from pwscont.graph.place import Place
from pwscont.system.selection import Selection
from pwscont.transitions.rays import Ray

#: Up to this many unknowns directions are kept whole.
WHOLE = 64
#: Projections that are kept of longer directions.
PROJECTIONS = 16
#: Longer names of cells are replaced by a digest, in bytes.
DIGEST = 20
#: Places closer than this times their size are one, if the rays there agree as well.
#: Far above the accuracy of a located point, far below what separates equal transitions.
JOIN = EPS**0.5


@final
@dataclass(frozen=True, slots=True)
class RayKey:
    """A ray as a node remembers it."""

    place: Place
    direction: Array

    @classmethod
    def of(cls, ray: Ray, place: Place) -> RayKey:
        """Return the key of a ray."""
        return cls(place, direction(ray))

    def alignment(self, ray: Ray, towards: Array) -> float:
        """Return the cosine to a ray with direction ``towards``, 0 where it starts elsewhere."""
        cosine = float(self.direction.dot(towards))
        return cosine if cosine > 0.0 and self.is_where(ray) else 0.0

    def is_where(self, ray: Ray) -> bool:
        """Tell whether a ray starts here, or no further away than both are uncertain."""
        metric, x = ray.curve.metric, ray.state.x
        apart = metric.difference(self.place.x, x)
        if metric.norm(apart) <= metric.slack(x, JOIN):
            return True
        errors = self.place.error + magnitude(x, ray.state.error)
        return bool((np.abs(apart) <= CONFIDENCE * errors).all())


def direction(ray: Ray) -> Array:
    """Return the direction of a ray, or projections of it, of length one."""
    scaled = ray.state.tangent / ray.curve.metric.scale
    seen = scaled if len(scaled) <= WHOLE else _projections(len(scaled)) @ scaled
    unit: Array = seen / np.linalg.norm(seen)
    return unit


@lru_cache(maxsize=2)
def _projections(size: int) -> Array:
    """Return fixed random rows, so that two runs are identical."""
    return np.random.default_rng(size).normal(size=(PROJECTIONS, size))


def names(ray: Ray) -> tuple[bytes, ...]:
    """Return short names of the cells in which a ray may be met again."""
    return tuple(
        cell if len(cell) <= WHOLE else blake2b(cell, digest_size=DIGEST).digest()
        for cell in ray.cells
    )


@final
@dataclass(frozen=True, slots=True)
class FollowedRay:
    """What is remembered of the ray that a piece followed.

    Attributes
    ----------
    selection : tuple of Character
        The frozen character, and for a ray along an interface all that it belongs to.
    names : tuple of bytes
        Cells in which it may be met.
    along_interface : bool
        Whether it runs along an interface.
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
    def of(cls, ray: Ray) -> FollowedRay:
        """Return what to remember of a ray."""
        return cls(
            (ray.curve.selection.character, *ray.interface_cells),
            names(ray),
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
