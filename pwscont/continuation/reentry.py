"""Paths that leave the interval at one of its ends, turn beyond, and come back.

Inside the interval such a path is several components, which only the way outside joins. A search
that promises nothing may miss the others: each path that leaves is followed a little further, and
where it comes back is another start.

Failure modes and answers
-------------------------
- Beyond the interval H may not make sense: only straight pieces, which make sense everywhere, are
  followed there, within the system's domain. Whatever goes wrong says nothing about the interval.
- The path goes on for ever: the path is followed over a part of the interval's length, and over no
  more pieces than were found inside, or a few.
- Paths come back for ever: only a number of paths is followed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import final

from pwscont.basics.budget import Budget, Limits
from pwscont.basics.outcome import Kind
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.discovery import Discovery
from pwscont.continuation.follow import PieceFollower, default_detectors
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found
from pwscont.curve.metric import Metric
from pwscont.curve.stepper import Stepper
from pwscont.system.box import Box
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.ends import Bounds
from pwscont.transitions.rays import Ray
from pwscont.transitions.watch import Watch

#: How far beyond an end a path is followed, as a part of the interval.
PART = 0.25
#: Number of pieces over which a path may be followed in any case, and most paths.
FEW_PIECES, MOST_PATHS = 20, 100
Interval = tuple[float, float]


@final
@dataclass(frozen=True, slots=True)
class Beyond:
    """The parts of a run that follow paths beyond its interval as well.

    Attributes
    ----------
    system : PiecewiseSystem
    metric : Metric
    stepper : Stepper
    bounds : Bounds
    """

    system: PiecewiseSystem
    metric: Metric
    stepper: Stepper
    bounds: Bounds

    def ends(self, ray: Ray) -> Iterator[tuple[float, Interval]]:
        """Yield the end of the interval at which a ray leaves, and the interval beyond."""
        if not ray.curve.selection.is_straight:
            return
        (lo, hi), (low, high) = self.metric.interval, self.system.domain
        same, further, alpha = SAME_ALPHA * (hi - lo), PART * (hi - lo), ray.state.alpha
        if abs(alpha - lo) <= same and low < lo:
            yield lo, (max(lo - further, low), lo)
        if abs(alpha - hi) <= same and high > hi:
            yield hi, (hi, min(hi + further, high))

    def ray(self, ray: Ray, interval: Interval) -> Ray:
        """Return a ray as one that leads into an interval."""
        scale, selection = self.metric.scale, ray.curve.selection
        metric = Metric(scale, interval, Box.of(self.system).period)
        system = self.system.within(*interval, scale[:-1])
        there = Selection(system, selection.character, selection.adjacent_cells)
        return Ray(Curve(there, metric), ray.state, ray.interface_cells, ray.index)

    def follower(self, interval: Interval) -> PieceFollower:
        """Return what follows pieces in an interval."""
        watched = default_detectors(self.stepper, interval)
        is_bounded = Box.of(self.system).is_bounded
        watch = Watch((*watched, self.bounds) if is_bounded else watched)
        return PieceFollower(self.stepper, watch, interval, self.bounds)


def reentries(discovery: Discovery, beyond: Beyond) -> Iterator[Found]:
    """Yield the solutions at which paths come back that leave the interval.

    The discovery grows while solutions are taken.
    """
    for ray in islice(discovery.leaving, MOST_PATHS):
        limits = Limits(pieces=max(FEW_PIECES, len(discovery.edges)))
        for end, interval in beyond.ends(ray):
            try:
                found = _coming_back(beyond, ray, end, interval, limits)
            except Exception:
                continue
            yield from found


def _coming_back(
    beyond: Beyond, ray: Ray, end: float, interval: Interval, limits: Limits
) -> list[Found]:
    """Return where the path of a ray comes back to the same end of the interval."""
    onwards = beyond.ray(ray, interval)
    with Budget(limits) as budget:
        discovery = Discovery(beyond.follower(interval), lambda *_: None, budget)
        discovery.add(SpecialPointFound(Kind.END, ray.state.x, "", (onwards,)))
    reached = [node for node in list(discovery.nodes.values())[1:] if node.kind == Kind.END]
    return [(n.place.x, n.place.error[None]) for n in reached if n.place.alpha == end]
