"""The branches that a run has followed, as its search sees them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.continuation.discovery import Edge
from pwscont.curve.metric import Metric
from pwscont.search.search import KnownBranches

#: A curve strays from the chord between two stored points by less than this part of its length.
NEAR = 0.2
TINY = 1e-300


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

    def near(self, x: Array, metric: Metric) -> Array | None:
        """Return the nearest point on the straight lines between stored points, if it is near."""
        found = (_nearest(edge.track.points, x, metric) for edge in self.edges)
        near = [(distance / length, point) for distance, length, point in found]
        part, point = min(near, key=lambda each: each[0], default=(np.inf, x))
        return point if part <= NEAR else None

    def extremes(self) -> list[Array]:
        """Return the points of pieces at which alpha or an unknown is extremal."""
        return [x for edge in self.edges for x in _extremes(edge.track.points)]


def _crossings(points: Array, alpha: float) -> list[Array]:
    """Return where the polygon through some points has an alpha."""
    sides = np.sign(points[:, -1] - alpha)
    found = [points[i] for i in np.flatnonzero(sides == 0.0)]
    for i in np.flatnonzero(sides[1:] * sides[:-1] < 0.0):
        a, b = points[i], points[i + 1]
        found.append(a + (alpha - a[-1]) / (b[-1] - a[-1]) * (b - a))
    return found


def _nearest(points: Array, x: Array, metric: Metric) -> tuple[float, float, Array]:
    """Return the distance to the nearest point of a polygon, the length of its chord, the point."""
    starts, chords = points[:-1] / metric.scale, np.diff(points, axis=0) / metric.scale
    away = metric.difference(x, points[:-1]) / metric.scale
    lengths = np.maximum((chords**2).sum(axis=1), TINY)
    parts = np.clip((away * chords).sum(axis=1) / lengths, 0.0, 1.0)
    distances = np.linalg.norm(away - parts[:, np.newaxis] * chords, axis=1)
    i = int(np.argmin(distances / np.sqrt(lengths)))
    point = (starts[i] + parts[i] * chords[i]) * metric.scale
    return float(distances[i]), float(np.sqrt(lengths[i])), point


def _extremes(points: Array) -> list[Array]:
    """Return the points at which a coordinate is largest or smallest, each once."""
    numbers = {*points.argmin(axis=0).tolist(), *points.argmax(axis=0).tolist()}
    return [points[i] for i in sorted(numbers)]
