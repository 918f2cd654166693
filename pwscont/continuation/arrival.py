"""Where pieces arrive: the place of a special point, the keys of its rays, and which stay."""

from __future__ import annotations

from functools import partial, reduce

import numpy as np

from pwscont.basics.kind import Kind
from pwscont.basics.outcome import ON_BOUND
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.continuation.follow import FollowedPiece
from pwscont.continuation.ray_keys import RayKey
from pwscont.curve.error_samples import magnitude
from pwscont.graph.packing import place as place_of
from pwscont.graph.place import Place, Stored
from pwscont.system.ending import Ending
from pwscont.transitions.bounds import Bounds
from pwscont.transitions.detector import Said, SpecialPointFound, worded
from pwscont.transitions.rays import Ray


def ends_on_purpose(arrival: SpecialPointFound) -> bool:
    """Tell whether the system, or an event, ends curves at a special point."""
    rays = arrival.rays
    stops = arrival.kind == Kind.EVENT and len(rays) == 1
    ends = arrival.kind == Kind.END and len(rays) > 0
    return stops or (ends and isinstance(rays[0].curve.selection.system, Ending))


def place_of_arrival(arrival: SpecialPointFound) -> Place:
    """Return the place of an arrival, with the error of its least certain ray.

    The place is stored as a solution of the selection of the piece that arrived.
    """
    x = arrival.x
    if not arrival.rays:
        return Stored(x, magnitude(x, np.zeros((1, len(x)))))
    selection = arrival.rays[0].curve.selection
    first, *others = [ray.state.size for ray in arrival.rays]
    error = reduce(np.maximum, [size for size in others if size is not first], first)
    return place_of(selection.system, selection.character, x, error)


def keys_at_end(walk: FollowedPiece, ray: Ray, key: RayKey, end: Place) -> list[RayKey]:
    """Return the keys of the rays at the end of a piece, which began with a ray with this key."""
    back, *others = walk.arrival.rays
    is_straight = len(walk.points) == 2 and back.curve is ray.curve
    first = key.reversed(end) if is_straight else RayKey.of(back, end)
    return [first, *[RayKey.of(other, end) for other in others]]


def points_inside(ray: Ray, lo: float, hi: float) -> bool:
    """Tell whether a ray from a point of the interval stays in it at first.

    At a fold at an end the rays' own alphas may be beside that end by rounding.
    """
    alpha, slope, same = ray.state.alpha, ray.curve.slope(ray.state), SAME_ALPHA * (hi - lo)
    return not ((alpha - lo <= same and slope < 0.0) or (hi - alpha <= same and slope > 0.0))


def without_leaving(
    arrival: SpecialPointFound, staying: tuple[Ray, ...], bounds: Bounds
) -> SpecialPointFound:
    """Return a special point with the rays that stay, and words on bounds that others leave."""
    gone = [ray for ray in arrival.rays if ray not in staying]
    why = next(filter(None, map(bounds.left_by, gone)), None)
    if why is None:
        return arrival.leading(staying)
    if len(staying) == 1:
        return SpecialPointFound(Kind.END, arrival.x, why, staying)
    said = partial(_also, arrival.said, f"{ON_BOUND}: {why}")
    return SpecialPointFound(arrival.kind, arrival.x, said, staying)


def _also(said: Said, more: str) -> str:
    return f"{worded(said)}; {more}"
