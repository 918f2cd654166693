"""The branches that a run has followed, as its search sees them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.continuation.joints import Edge
from pwscont.search.known import KnownBranches


@final
class FollowedBranches(KnownBranches):
    """The pieces of a discovery.

    Attributes
    ----------
    edges : callable
        Returns the pieces; none before the discovery begins.
    """

    def __init__(self) -> None:
        self.edges: Sequence[Edge] = ()

    def at(self, alpha: float) -> list[Array]:
        """Return a point for each known solution, by straight lines between stored points."""
        return [x for edge in self.edges for x in _crossings(edge.track.points, alpha)]

    def extremes(self) -> list[Array]:
        """Return the points of pieces at which alpha or an unknown is extremal."""
        return [x for edge in self.edges for x in _extremes(edge.track.points)]


def _crossings(points: Array, alpha: float) -> list[Array]:
    """Return where the polygon through some points has an alpha."""
    above = points[:, -1] >= alpha
    found = []
    for i in np.flatnonzero(above[1:] != above[:-1]):
        a, b = points[i], points[i + 1]
        part = (alpha - a[-1]) / (b[-1] - a[-1])
        found.append(a + part * (b - a))
    return found


def _extremes(points: Array) -> list[Array]:
    """Return the points at which a coordinate is largest or smallest, each once."""
    numbers = {*points.argmin(axis=0).tolist(), *points.argmax(axis=0).tolist()}
    return [points[i] for i in sorted(numbers)]
