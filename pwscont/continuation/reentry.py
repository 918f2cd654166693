"""Paths that leave the interval at one of its ends, turn beyond, and come back.

Inside the interval such a path is several components, which only the way outside joins. A search
that promises nothing may miss the others: each path that leaves is followed a little further, and
where it comes back is another start.

Failure modes and answers
-------------------------
- Beyond the interval H may not make sense: the system's domain is kept to, and whatever goes wrong
  there says nothing about the interval.
- The path goes on for ever: it is followed over a part of the interval's length, and over no more
  pieces than were found inside, or a few. Paths may come back for ever: only so many are followed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from typing import NamedTuple

from pwscont.basics.budget import Budget
from pwscont.basics.kind import Kind
from pwscont.basics.limits import Limits
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.discovery import Discovery
from pwscont.continuation.follow import Follower
from pwscont.curve.curve import Curve
from pwscont.curve.metric import Metric
from pwscont.search.enumeration import Found
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import Ray

#: How far beyond an end a path is followed, as a part of the interval.
PART = 0.25
#: Over so many pieces at least.
FEW_PIECES = 20
MOST_PATHS = 100
Interval = tuple[float, float]


class Outside(NamedTuple):
    """What follows paths in an interval beside that of a run."""

    system: PiecewiseSystem
    metric: Metric
    follower: Follower


def reentries(
    discovery: Discovery,
    interval: Interval,
    domain: Interval,
    outside: Callable[[Interval], Outside],
) -> Iterator[Found]:
    """Yield the solutions at which paths come back that leave the interval.

    Parameters
    ----------
    discovery : Discovery
        It grows while solutions are taken.
    interval, domain : tuple of float
    outside : callable
        Interval -> what follows paths there.
    """
    for ray in islice(discovery.leaving, MOST_PATHS):
        limits = Limits(pieces=max(FEW_PIECES, len(discovery.edges)))
        for end, beyond in _beyond(ray, interval, domain):
            try:
                yield from _coming_back(ray, end, outside(beyond), limits)
            except Exception:
                continue


def _beyond(ray: Ray, interval: Interval, domain: Interval) -> Iterator[tuple[float, Interval]]:
    """Yield the end of the interval at which a ray leaves, and the interval beyond."""
    (lo, hi), (low, high), alpha = interval, domain, ray.state.alpha
    same, further = SAME_ALPHA * (hi - lo), PART * (hi - lo)
    if abs(alpha - lo) <= same and low < lo:
        yield lo, (max(lo - further, low), lo)
    if abs(alpha - hi) <= same and high > hi:
        yield hi, (hi, min(hi + further, high))


def _coming_back(ray: Ray, end: float, outside: Outside, limits: Limits) -> Iterator[Found]:
    """Yield where the path of a ray comes back to the same end of the interval."""
    selection = ray.curve.selection
    there = Selection(outside.system, selection.character, selection.adjacent_cells)
    curve = Curve(there, outside.metric)
    onwards = Ray(curve, ray.state, ray.interface_cells, ray.index)
    with Budget(limits) as budget:
        discovery = Discovery(outside.follower, lambda *_: None, budget)
        discovery.add(SpecialPointFound(Kind.END, ray.state.x, "", (onwards,)))
    first, *others = discovery.nodes.values()
    for node in others:
        if node.kind == Kind.END and node.place.alpha == end:
            yield node.place.x, node.place.error[None]
