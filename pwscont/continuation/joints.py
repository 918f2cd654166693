"""Special points and pieces while they are discovered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple, final

from pwscont.basics.kind import Kind
from pwscont.continuation.ray_keys import FollowedRay, RayKey
from pwscont.graph.place import Place
from pwscont.graph.track import Track
from pwscont.transitions.detector import Said, worded
from pwscont.transitions.rays import Ray


@final
@dataclass(slots=True)
class Node:
    """A special point under discovery.

    Of a ray that was followed, or on which a piece arrived, only the key is kept. ``also`` are the
    words of users' detectors that would have marked the point, which is of another kind.
    """

    kind: Kind | str
    place: Place
    said: Said
    rays: list[Ray | None] = field(default_factory=list)
    keys: list[RayKey] = field(default_factory=list)
    lost: int = 0
    also: list[str] = field(default_factory=list)

    def add(self, rays: Iterable[Ray], keys: Iterable[RayKey]) -> None:
        """Let more rays leave, which are known by these keys."""
        self.rays.extend(rays)
        self.keys.extend(keys)

    def stop(self, message: str, rays: int = 1) -> None:
        """Note that rays could not be followed; a degenerate point keeps its kind."""
        if self.kind != Kind.DEGENERATE:
            self.kind = Kind.STOPPED
        self.lost += rays
        if message not in self.message:  # said already, of another ray
            self.said = f"{self.message}; {message}"

    @property
    def message(self) -> str:
        """What is said of the point."""
        return worded(self.said)


@final
class Edge(NamedTuple):
    """A piece under discovery, from the node where it was begun to the node it reached.

    ``begun_at`` is the point in its middle where tracing began, if it began there.
    """

    start: int
    end: int
    followed: FollowedRay
    track: Track
    begun_at: Place | None = None
