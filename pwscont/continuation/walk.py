"""One piece, from a ray to the special point where it ends."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.stepping.stepper import CurvedSegment, Segment, Stepper
from pwscont.transitions.bounds import Bounds
from pwscont.transitions.detection import (
    Event,
    Joined,
    Watch,
    first_on_curve,
    first_on_ray,
)
from pwscont.transitions.detector import Arrival
from pwscont.transitions.rays import Ray

#: A piece of more steps is lost: at the default step it is thousands of intervals long.
MOST_STEPS = 20_000


@final
@dataclass(frozen=True, slots=True)
class Walk:
    """A finished piece: its points, shape (k, n + 1), and where it arrived."""

    points: Array
    arrival: Arrival

    def sharing(self, ray: Ray) -> Walk:
        """Return the walk with what its first ray knows of an interface at its end as well."""
        if not ray.shared:
            return self
        back, *others = self.arrival.rays
        back = replace(back, shared=ray.shared, index=ray.index)
        return Walk(self.points, replace(self.arrival, rays=(back, *others)))


class Follower(ABC):
    """Follows rays to the ends of their pieces, within an interval of alpha and bounds of z."""

    interval: tuple[float, float]
    bounds: Bounds

    @abstractmethod
    def walk(self, ray: Ray) -> Walk:
        """Return the piece that ``ray`` begins."""


@final
@dataclass(frozen=True, slots=True)
class Walker(Follower):
    """Follows a ray to the end of its piece; the policy is here, the step is the stepper's."""

    stepper: Stepper
    watch: Watch
    interval: tuple[float, float]
    bounds: Bounds

    def walk(self, ray: Ray) -> Walk:
        """Return the piece that ``ray`` begins."""
        points, state, before, longest = [ray.state.x], ray.state, None, np.inf
        reading, blocked = self.watch.read(ray.curve, state), None
        for _ in range(MOST_STEPS):
            segment = self.stepper.step(ray.curve, self.interval, state, before, longest)
            if isinstance(segment, Failure):
                return self._stopped(points, Ray(ray.curve, state), blocked or segment)
            event, after = self._first_event(segment, reading)
            if isinstance(event, Event):
                return Walk(np.array([*points, event.state.x]), event.arrive(ray.curve))
            if isinstance(event, Failure):  # too long a step to see what happens within it
                if not isinstance(segment, CurvedSegment):
                    return self._stopped(points, Ray(ray.curve, state), event)
                longest, blocked = 0.5 * segment.length, event
                continue
            assert isinstance(segment, CurvedSegment)  # a ray ends in an event or a failure
            points.append(segment.end.x)
            state, before, reading, longest = segment.end, segment, after, np.inf
            blocked = None
        return self._stopped(points, Ray(ray.curve, state), Failure(Trouble.TOO_MANY_STEPS))

    def _first_event(
        self, segment: Segment, reading: Joined
    ) -> tuple[Event | Failure | None, Joined]:
        """Return the first event on the segment, and what is read at its end."""
        if not isinstance(segment, CurvedSegment):
            return first_on_ray(self.watch, segment, reading), reading
        after = self.watch.read(segment.curve, segment.end)
        return first_on_curve(self.watch, segment, reading, after), after

    def _stopped(self, points: list[Array], reached: Ray, failure: Failure) -> Walk:
        arrival = Arrival(Kind.STOPPED, points[-1], str(failure), (reached.reversed(),))
        return Walk(np.array(points), arrival)
