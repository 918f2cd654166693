"""One piece, from a ray to the special point where it ends.

Failure modes and answers
-------------------------
- Shorter steps of differences amplify rounding and the noise of the user's function. Finer steps
  are taken only if the next finer steps change derivatives more than the finest steps do.
- Beside an end of the model derivatives change by rounding, which is no reason for finer steps.
- The step of the differences leads beyond an end of the model, although the point does not: finer
  steps are taken if only finer steps are finite. So a piece reaches the end of the model as closely
  as the finest steps allow, whatever the magnitudes are.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, are_finite, generic
from pwscont.basics.budget import check_budget, current_budget
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, FailureReason, Kind
from pwscont.curve.curve import Curve, State
from pwscont.curve.magnitudes import Gauge
from pwscont.curve.step_size import StepSize, step_size_of
from pwscont.curve.stepper import CurvedSegment, ExactLinear, Segment, Stepper
from pwscont.system.contract import refuse_wrong_jacobian
from pwscont.system.differences import FINEST_PART, REFINEMENT, STEP
from pwscont.transitions.bounding import BoundingTests
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.ends import Bounds, IntervalEnds, ended_by_system
from pwscont.transitions.events import Events, EventsAlong
from pwscont.transitions.rays import Ray
from pwscont.transitions.smooth import SmoothBranchPoints, SmoothFolds, leaning
from pwscont.transitions.straight import StraightTests
from pwscont.transitions.watch import Event, Watch, first_on_curve, first_on_ray


def default_detectors(
    stepper: Stepper, interval: tuple[float, float]
) -> tuple[TransitionDetector, ...]:
    """Return the detectors of every run: straight pieces neither fold nor branch in a cell.

    Branch points come before folds, for alpha may turn at a branch point.
    """
    ends = IntervalEnds(*interval)
    if isinstance(stepper, ExactLinear):
        return ends, StraightTests()
    return ends, BoundingTests(), SmoothBranchPoints(), SmoothFolds()


def refined(curve: Curve, x: Array) -> bool:
    """Let differences have shorter steps if derivatives become better; return whether so.

    Parameters
    ----------
    curve : Curve
    x : ndarray, shape (n + 1,)
        Where derivatives are compared.
    """
    part = part_of(curve)
    if part * REFINEMENT < FINEST_PART:
        return False
    usual, finer, finest = (_derivatives(curve, x, part * REFINEMENT**k) for k in range(3))
    late, early = _apart(finer, finest), _apart(usual, finer)
    is_better = early > late or (np.isfinite(late) and not np.isfinite(early))
    curve.selection.system.refine_differences(part * REFINEMENT if is_better else part)
    return is_better


def part_of(curve: Curve) -> float:
    """Return what part of the usual steps differences take."""
    return curve.selection.system.differences(curve.metric.interval[0]).part


def _derivatives(curve: Curve, x: Array, part: float) -> tuple[Array, Array]:
    """Return derivatives along a generic direction by steps of this part, and their terms."""
    curve.selection.system.refine_differences(part)
    jacobian, scale = curve.selection.jacobian(x), curve.metric.scale
    return jacobian @ (scale * generic(len(scale))), abs(jacobian) @ scale


def _apart(one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """Return the largest difference of derivatives, relative to the terms of the second ones."""
    (first, _), (second, terms) = one, other
    with np.errstate(invalid="ignore"):
        apart = np.abs(first - second)
    known = terms != 0.0
    return float(np.divide(apart, terms, out=np.zeros_like(terms), where=known).max())


#: A piece of more steps is given up: at the default step that is thousands of intervals.
MOST_STEPS = 20_000
#: After this many steps, and this distance in typical magnitudes from where the piece began, the
#: longest step grows with the distance: a piece that runs to infinity is recognised after a few
#: hundred steps.
MANY_STEPS, STRETCHED_FROM = 150, 2.0
#: After every such number of steps a piece is checked for running to infinity.
ENDLESS_CHECK_EVERY = 200
#: A piece runs to infinity if the piece is this far from the beginning, in typical magnitudes,
ENDLESS_FROM = 20.0
#: if alpha changes by at most this part of the change before while z grows by as much,
ENDLESS_RATIO = 0.8
#: and if all changes of alpha to come, at most this many times the last change where the distance
#: from the limit is a power of 1 / z of at least 1/2,
ENDLESS_REST = 13.0
#: are at most this part of the interval,
ENDLESS_CHANGE = 1e-3
#: or the piece has more steps than these.
ENDLESS_STEPS = 600
#: The parts of the way out that are compared end at these parts of the size of z.
PARTS = 0.7, 0.85
#: A piece of so many steps runs to infinity nearer to its beginning, too, where alpha approaches a
#: limit evenly, as a power of 1 / z of at least 1/2: while z grows by the same factor three times,
#: alpha changes by at most this part of the change before. The changes next to a fold are uneven.
LONG_RATIO, LONG_PARTS = 0.85, (0.343, 0.49, 0.7)
#: A piece creeps after this many tiny steps in turn: steps below this part of the longest step.
MOST_TINY, TINY_PART = 300, 1e-5
#: A piece is singular after this many steps too long to tell which event comes first.
MOST_BLOCKED = 200
#: Derivatives by differences are wrong if this many more steps were shortened than were not: with
#: right derivatives Newton converges better in shorter steps, and a seventh of steps is short.
MOST_SHORTENED = 100
#: Failures that wrong derivatives may cause.
BY_DERIVATIVES = (FailureReason.NOT_CONVERGED, FailureReason.NOT_FINITE, FailureReason.JUMP)
#: The end of the model is at most this many times the last step away: steps shrink towards the end.
REST_OF_THE_WAY = 4.0
#: A component of a unit tangent that is smaller does not move.
NEARLY_STILL = 1e-6
#: A step is shortened if the length is less than this part of the length that was proposed.
SHORTENED = 0.75


@final
@dataclass(slots=True, eq=False)
class FollowedPiece:
    """A piece: its points, each of shape (n + 1,), and where it arrived.

    The piece is cut where the budget of the run was spent before the end of the piece.
    """

    points: Sequence[Array]
    arrival: SpecialPointFound
    is_cut: bool = False

    @property
    def inner(self) -> Array:
        """The points between both ends, shape (k - 2, n + 1)."""
        between = self.points[1:-1]
        return np.array(between) if len(between) else np.empty((0, len(self.points[0])))

    @property
    def steps(self) -> Sequence[Array]:
        """The points between whole steps, without the step that the special point ended."""
        return self.points if self.arrival.kind == Kind.STOPPED else self.points[:-1]

    def sharing(self, ray: Ray) -> FollowedPiece:
        """Return the piece with the interface and the index of a ray on the ray back.

        Beyond an event the ray that goes on along the interface gets both, too.
        """
        if not ray.interface_cells:
            return self
        along = len(self.arrival.rays) if self.arrival.kind == Kind.EVENT else 1
        rays = [
            replace(r, interface_cells=ray.interface_cells, index=ray.index)
            for r in self.arrival.rays[:along]
        ]
        rays += self.arrival.rays[along:]
        return replace(self, arrival=self.arrival.leading(tuple(rays)))


class Follower(ABC):
    """Follows rays to the ends of their pieces, within an interval of alpha and bounds of z."""

    interval: tuple[float, float]
    bounds: Bounds | None

    @abstractmethod
    def walk(self, ray: Ray) -> FollowedPiece:
        """Return the piece that ``ray`` begins."""


@final
@dataclass(frozen=True, slots=True)
class PieceFollower(Follower):
    """Follows a ray to the end of its piece; the policy is here, the step is the stepper's.

    Where nothing is watched but straight pieces and the ends of the interval, ``straight`` leads
    from cell to cell by itself. A ``gauge`` sees every step.
    """

    stepper: Stepper
    watch: Watch
    interval: tuple[float, float]
    bounds: Bounds | None
    straight: StraightTests | None = None
    gauge: Gauge | None = None
    events: Events | None = None

    def walk(self, ray: Ray) -> FollowedPiece:
        """Return the piece that ``ray`` begins, as far as the budget of the run allows."""
        reached = None
        try:
            check_budget()
            if arrival := self.straight and self.straight.next(ray, self.interval):
                return FollowedPiece((ray.state.x, arrival.x), arrival)
            reached = _Reached(leaning(ray))
            if not (selection := ray.curve.selection).is_straight:
                refuse_wrong_jacobian(selection.system, selection.character, ray.state.x)
            reached.stops = self.events and self.events.stops_along(ray.curve, ray.state)
            return self._to_the_end(reached)
        except KeyboardInterrupt as why:
            walk = (reached or _Reached(ray)).stopped(current_budget().end(why))
            return replace(walk, is_cut=True)

    def _to_the_end(self, reached: _Reached) -> FollowedPiece:
        curve, before, longest, blocked = reached.curve, None, np.inf, None
        reading = self.watch.read(curve, reached.state)
        for _ in range(MOST_STEPS):
            check_budget()
            if aimed := self._aimed(reached, before, longest, reading):
                return self._ended(reached, *aimed)
            segment = self._step(reached, before, longest)
            if isinstance(segment, Failure):
                if not blocked and segment.trouble in BY_DERIVATIVES and reached.refines():
                    continue
                return reached.stopped(str(blocked or segment))
            event, after = self._first_event(segment, reading)
            if isinstance(event, Event) and before is None and self.watch.is_rounding(event, curve):
                reading = self.watch.without(reading, event)
                continue
            if isinstance(event, Event):
                return self._ended(reached, segment, event)
            if isinstance(event, Failure):  # the step is too long to tell which event comes first
                if not isinstance(segment, CurvedSegment) or event.trouble is FailureReason.TWICE:
                    return reached.stopped(str(event))
                reached.blocked += 1
                if reached.blocked > MOST_BLOCKED:
                    break
                longest, blocked = 0.5 * segment.length, event
                continue
            assert isinstance(segment, CurvedSegment)  # a ray ends in an event or a failure
            if end := self._gone(reached, segment, before):
                return end
            before, reading, longest, blocked = segment, after, np.inf, None
        return reached.stopped(str(Failure(FailureReason.TOO_MANY_STEPS)))

    def _gone(
        self, reached: _Reached, step: CurvedSegment, before: Segment | None
    ) -> FollowedPiece | None:
        """Go to the end of a step; return the piece if an event of a user ends it on the way."""
        if end := self._ended_by_event(reached, step, step.length):
            return end
        reached.go_to(step, before)
        if self.gauge:
            self.gauge.see(step.start.x, step.end.x)
        return None

    def _step(self, reached: _Reached, before: Segment | None, longest: float) -> Segment | Failure:
        """Return the next step; the farther a long piece has gone, the longer the step."""
        stepper, number = self.stepper, len(reached.points)
        if number % ENDLESS_CHECK_EVERY == 0 and reached.is_endless():
            return Failure(FailureReason.ENDLESS)
        if reached.tiny > MOST_TINY:
            return Failure(FailureReason.CREEPING)
        if number > MANY_STEPS and (factor := reached.distance() / STRETCHED_FROM) > 1.0:
            stepper = stepper.stretched(factor)
        segment = stepper.step(reached.curve, self.interval, reached.state, before, longest)
        if not isinstance(segment, Segment | Failure):
            raise self._broken("step", "a Segment or a Failure", segment)
        if isinstance(segment, CurvedSegment):
            largest = (step_size_of(stepper) or StepSize()).largest
            is_tiny = segment.length < TINY_PART * largest
            reached.tiny = reached.tiny + 1 if is_tiny else 0
        return segment

    def _aimed(
        self, reached: _Reached, before: Segment | None, longest: float, reading: Reading
    ) -> tuple[CurvedSegment, Event] | None:
        """Return the step to the event that seems to come next, None if that event is not next."""
        curve, ahead = reached.curve, self.watch.ahead(reading)
        if ahead is None or ahead[0] > longest:
            return None
        distance, detector, index = ahead
        border = detector.border(curve, index)
        segment = border and self.stepper.aim(curve, reached.state, before, distance, border)
        if segment is None:
            return None
        if not isinstance(segment, CurvedSegment):
            raise self._broken("aim", "a CurvedSegment or None", segment)
        event = Event(detector, index, segment.length, segment.end)
        after = self.watch.read(curve, segment.end)
        first = first_on_curve(self.watch, segment, reading, after, event)
        if not isinstance(first, Event) or self.watch.is_rounding(first, curve):
            return None
        return segment, first

    def _broken(self, method: str, what: str, got: object) -> InvalidInputError:
        """Return the error that says what the stepper returned instead of what it must."""
        return InvalidInputError(
            f"{type(self.stepper).__name__}.{method} must return {what}, got {got!r}; "
            "check_stepper tells what else is wrong"
        )

    def _ended(self, reached: _Reached, segment: Segment, event: Event) -> FollowedPiece:
        """Return the piece that an event on the last step ends."""
        if end := self._ended_by_event(reached, segment, event.position):
            return end
        points = self._points(reached, segment, event.position, event.state)
        return FollowedPiece(points, self._arrived(event, reached.curve))

    def _points(
        self, reached: _Reached, segment: Segment, position: float, end: State
    ) -> list[Array]:
        """Return the points of a piece that ends on a segment."""
        between = reached.between(segment, position, end)
        if self.gauge and between:  # as where the piece is read from a journal
            self.gauge.see(reached.state.x, *between)
        return [*reached.points, *between, end.x]

    def _ended_by_event(
        self, reached: _Reached, segment: Segment, length: float
    ) -> FollowedPiece | None:
        """Return the piece up to the event of a user that ends the branch on a stretch, if any."""
        if not (self.events and reached.stops and length > 0.0):
            return None
        marks = reached.stops.look(segment, length, len(reached.points))
        if not marks:
            return None
        mark = marks[0]
        points = self._points(reached, segment, mark.position, mark.state)
        return FollowedPiece(points, self.events.stopped(reached.curve, mark))

    def _arrived(self, event: Event, curve: Curve) -> SpecialPointFound:
        """Return the special point that an event makes, with the ways on that are allowed."""
        arrival = self.watch.ended(event.arrive(curve))
        arrival = self.events.ended(arrival) if self.events else arrival
        final = ended_by_system(arrival)
        return arrival if final is arrival else final.leading(final.rays[:1])

    def _first_event(
        self, segment: Segment, reading: Reading
    ) -> tuple[Event | Failure | None, Reading]:
        """Return the first event on the segment, and the reading at its end."""
        if not isinstance(segment, CurvedSegment):
            return first_on_ray(self.watch, segment, reading), reading
        after = self.watch.read(segment.curve, segment.end)
        return first_on_curve(self.watch, segment, reading, after), after


@final
class _Reached:
    """The points of a walk so far, and its last state."""

    def __init__(self, ray: Ray) -> None:
        self.curve, self.state, self.points = ray.curve, ray.state, [ray.state.x]
        self._before = ray.state
        self.blocked = self.tiny = self._shortened = 0
        self.stops: EventsAlong | None = None
        self._part = part_of(self.curve)

    def go_to(self, step: CurvedSegment, before: Segment | None) -> None:
        """Add a point, at the end of a step that may be shorter than the step before suggested."""
        self._before, self.state = self.state, step.end
        self.points.append(step.end.x)
        if not isinstance(before, CurvedSegment):
            return
        if step.length < SHORTENED * before.suggestion:
            self._shortened += 1
        elif before.suggestion > before.length:  # else the step was kept short for another reason
            self._shortened = max(self._shortened - 1, 0)
        if self._shortened == MOST_SHORTENED:
            self.refines()

    def distance(self) -> float:
        """Return how far from its beginning the piece is now."""
        return self.curve.metric.norm(self.state.x - self.points[0])

    def is_endless(self) -> bool:
        """Tell whether a long piece leads to infinity while alpha stays inside the interval.

        Changes of alpha shrink where alpha approaches a limit like a power of 1 / z, not like a
        logarithm. All changes that are still to come are next to nothing together, or the piece is
        very long and z far away.
        """
        is_long = len(self.points) > ENDLESS_STEPS
        late, shrinks = self._late_change(ENDLESS_FROM, PARTS, ENDLESS_RATIO)
        if not shrinks and is_long:
            late, shrinks = self._late_change(0.0, LONG_PARTS, LONG_RATIO)
            is_long = False
        is_next_to_nothing = ENDLESS_REST * late <= ENDLESS_CHANGE * self.curve.metric.width
        return shrinks and (is_next_to_nothing or is_long)

    def _late_change(
        self, least: float, parts: tuple[float, ...], ratio: float
    ) -> tuple[float, bool]:
        """Return the last of the changes of alpha on parts of the way out, and whether all shrink.

        Infinite where z is smaller than ``least``, in typical magnitudes, or has been farther out.
        """
        points = np.array(self.points)
        sizes = np.linalg.norm((points / self.curve.metric.scale)[:, :-1], axis=1)
        if sizes[-1] < max(least, sizes.max()) or sizes[0] > parts[0] * sizes[-1]:
            return np.inf, False
        ends = [*(int(np.argmax(sizes >= part * sizes[-1])) for part in parts), -1]
        changes = np.abs(np.diff(points[ends, -1]))
        return float(changes[-1]), bool((changes[1:] <= ratio * changes[:-1]).all())

    def refines(self) -> bool:
        """Let differences have shorter steps if shorter steps help; return whether so."""
        self._shortened = 0
        return refined(self.curve, self.state.x)

    def between(self, segment: Segment, position: float, end: State) -> list[Array]:
        """Return a middle point for a curved piece of two points, which would look straight."""
        if not isinstance(segment, CurvedSegment) or len(self.points) > 1:
            return []
        middle = segment.point(0.5 * position, end.located_by)
        return [] if middle is None else [middle]

    def stopped(self, why: str) -> FollowedPiece:
        """Return the walk that ends here; finer differences have been of no use."""
        part = part_of(self.curve)
        self.curve.selection.system.refine_differences(self._part)
        if why == str(Failure(FailureReason.NOT_FINITE)) and len(self.points) > 2:
            self._end_inside(part)
        back = Ray(self.curve, self.state).reversed()
        arrival = SpecialPointFound(Kind.STOPPED, self.state.x, why, (back,))
        return FollowedPiece(self.points, arrival)

    def _end_inside(self, part: float) -> None:
        """End at the last point at which H is finite; the end of the model is a few steps farther.

        The last correction may have led beyond the end, where H was not asked for. Differences took
        this part of the usual steps, and H is not finite at the ends of these.
        """
        last, residual = self.state, self.curve.selection.residual
        while len(self.points) > 2 and not are_finite(residual(self.points[-1])):
            last = self._before
            self.points.pop()
        steps = [self.points[-1] - self.points[-2]]
        if not self.curve.selection.system.knows_jacobian:
            steps.append(self._reach_of_differences(last.tangent, part))
        error = np.vstack([last.error, *(REST_OF_THE_WAY * step for step in steps)])
        self.state = State(self.points[-1], last.tangent, error, last.orientation)

    def _reach_of_differences(self, tangent: Array, part: float) -> Array:
        """Return a step along a tangent in which each component moves by a step of differences."""
        along = np.abs(tangent / self.curve.metric.scale)
        reach: Array = part * STEP / along[along > NEARLY_STILL].min() * tangent
        return reach


def alone(watched: Sequence[TransitionDetector]) -> StraightTests | None:
    """Return the tests of straight pieces, where nothing else is watched inside the interval."""
    others = [each for each in watched if not isinstance(each, IntervalEnds)]
    return others[0] if len(others) == 1 and isinstance(others[0], StraightTests) else None
