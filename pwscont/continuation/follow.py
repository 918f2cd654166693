"""One piece, from a ray to the special point where it ends.

Shorter steps of differences amplify rounding and noise: finer steps are taken only if the next
finer steps change derivatives more than the finest steps do, or if only finer steps are finite, as
beside the end of a model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, final

import numpy as np

from pwscont.basics.arguments import wrong_result
from pwscont.basics.arrays import Array, generic
from pwscont.basics.budget import check_budget, current_budget
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, FailureReason, Kind, Remark
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Gauge, Range
from pwscont.curve.stepper import (
    CurvedSegment,
    Segment,
    Stepper,
    StepSize,
    StraightSegment,
    step_size_of,
)
from pwscont.system.contract import refuse_wrong_jacobian
from pwscont.system.differences import FINEST_PART, REFINEMENT, STEP
from pwscont.transitions.bounding import BoundingTests
from pwscont.transitions.branch_points import SmoothBranchPoints, crossing_on_end
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.ends import Bounds, IntervalEnds, ended_by_system, solves
from pwscont.transitions.rays import NEARBY, Ray
from pwscont.transitions.smooth_folds import SmoothFolds, leaning
from pwscont.transitions.straight import StraightTests
from pwscont.transitions.watch import Event, Watch, first_on_curve, first_on_ray

if TYPE_CHECKING:
    from pwscont.events.along import EventsAlong
    from pwscont.events.events import Events


def default_detectors(stepper: Stepper, interval: Range) -> tuple[TransitionDetector, ...]:
    """Return the detectors of every run: straight pieces neither fold nor branch in a cell.

    Branch points come before folds, for alpha may turn at a branch point.
    """
    ends = IntervalEnds(*interval)
    if stepper.takes_rays:
        return ends, StraightTests()
    return ends, BoundingTests(), SmoothBranchPoints(), SmoothFolds()


def refine_if_better(curve: Curve, x: Array) -> bool:
    """Let differences have shorter steps if derivatives at x become better; return whether so."""
    part = part_of_steps(curve)
    if part * REFINEMENT < FINEST_PART:
        return False
    usual, finer, finest = (_derivatives(curve, x, part * REFINEMENT**k) for k in range(3))
    late, early = _apart(finer, finest), _apart(usual, finer)
    is_better = early > late or (np.isfinite(late) and not np.isfinite(early))
    curve.selection.system.refine_differences(part * REFINEMENT if is_better else part)
    return is_better


def part_of_steps(curve: Curve) -> float:
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
#: A piece creeps after this many tiny steps in turn: steps below this part of the longest step.
MOST_TINY, TINY_PART = 300, 1e-5
#: A piece crawls along a double root where steps are shorter than this on average, and the
#: determinant has changed its sign more often than this; asked after every such number of steps.
CRAWLING, MOST_FLIPS, CRAWL_CHECK_EVERY = 1e-5, 10, 100
#: A piece is singular after this many steps too long to tell which event comes first.
MOST_BLOCKED = 200
#: Derivatives by differences are wrong if this many more steps were shortened than were not: with
#: right derivatives Newton converges better in shorter steps, and a seventh of steps is short.
MOST_SHORTENED = 100
#: A step is shortened if the length is less than this part of the length that was proposed.
SHORTENED = 0.75
#: Failures that wrong derivatives may cause.
BY_DERIVATIVES = (FailureReason.NOT_CONVERGED, FailureReason.NOT_FINITE, FailureReason.JUMP)
#: The end of the model is at most this many times the last step away: steps shrink towards the end.
REST_OF_THE_WAY = 4.0
#: A component of a unit tangent that is smaller does not move.
NEARLY_STILL = 1e-6

# A piece may run to infinity while alpha stays inside the interval (PieceFollower._is_endless).

#: After every such number of steps a piece is checked for running to infinity.
ENDLESS_CHECK_EVERY = 200
#: A piece of more steps is long: a long piece runs to infinity under weaker conditions.
ENDLESS_STEPS = 450
#: Far out: the distance of z, in typical magnitudes; the parts of this distance between which
#: changes of alpha are compared; and the largest ratio of such a change to the change before.
ENDLESS_FROM, PARTS, ENDLESS_RATIO = 20.0, (0.7, 0.85), 0.8
#: If alpha nears the limit as a power of 1 / z of at least 1/2, all changes to come are at most
#: ENDLESS_REST times the last change. They must be at most ENDLESS_CHANGE of the interval.
ENDLESS_REST, ENDLESS_CHANGE = 13.0, 1e-3
#: A long piece nearer by: three successive parts of the way, over which z grows by one factor. The
#: part is LONG_PART; for a piece that began farther out, as much larger as the way needs (EXCESS),
#: and at most MOST_PART.
LONG_PART, MOST_PART, EXCESS = 0.7, 0.9, 1.001
#: There changes of alpha must shrink at least as this power of 1 / z, between parts larger than
#: LONG_PART as a geometric sequence up to GEOMETRIC, and all changes to come must be at most
#: LONG_CHANGE of the interval.
LONG_POWER, GEOMETRIC, LONG_CHANGE = 0.45, 0.95, 1e-2


#: A piece: its points, each of shape (n + 1,), and where it arrived.
Followed: TypeAlias = tuple[Sequence[Array], SpecialPointFound]
#: Returns the piece that a ray begins.
Follow: TypeAlias = Callable[[Ray], Followed]


def is_cut(arrival: SpecialPointFound) -> bool:
    """Tell whether a piece stops before its end because the budget of the run is spent."""
    return bool(current_budget().spent) and arrival.kind == Kind.STOPPED


@final
@dataclass(eq=False)
class PieceFollower:
    """Follows rays, one after the other, to the ends of their pieces; the steps are the stepper's.

    Where nothing is watched except straight pieces and the ends of the interval, ``straight`` leads
    from cell to cell by itself. A ``gauge`` sees every step.
    """

    stepper: Stepper
    watch: Watch
    interval: Range
    bounds: Bounds | None = None
    straight: StraightTests | None = None
    gauge: Gauge | None = None
    events: Events | None = None

    def follow(self, ray: Ray) -> Followed:
        """Return the piece that ``ray`` begins, as far as the budget of the run allows."""
        self._curve, self._state, self._points = ray.curve, ray.state, [ray.state.x]
        self._before: State | None = None
        self._step_before: CurvedSegment | None = None
        self._blocked = self._tiny = self._shortened = 0
        self._flips = 0  # changes of sign that no detector took for a special point
        self._part = part_of_steps(ray.curve)
        self._stops: EventsAlong | None = None
        try:
            check_budget()
            if arrival := self.straight and self.straight.next(ray, self.interval):
                return (ray.state.x, arrival.x), arrival
            self._state, selection = leaning(ray).state, ray.curve.selection
            if not selection.is_straight:
                refuse_wrong_jacobian(selection.system, selection.character, ray.state.x)
            return self._to_the_end()
        except KeyboardInterrupt as why:
            return self._stopped(current_budget().end(why))

    def _to_the_end(self) -> Followed:
        """Return the piece, step after step."""
        watch, curve = self.watch, self._curve
        self._stops = self.events and self.events.stops_along(curve, self._state)
        reading, longest, blocked = watch.read(curve, self._state), np.inf, None
        for _ in range(MOST_STEPS):
            check_budget()
            if aimed := self._aimed(longest, reading):
                return self._ended(*aimed)
            step = self._step(longest)
            if isinstance(step, Failure):
                if not blocked and step.trouble in BY_DERIVATIVES and self._refines():
                    continue
                return self._stopped(str(blocked or step))
            event, after = self._first_event(step, reading)
            if isinstance(event, Event):
                if self._step_before is None and watch.is_rounding(event, curve):
                    reading = watch.without(reading, event)
                    continue
                return self._ended(step, event)
            is_final = event and event.trouble is FailureReason.TWICE
            if is_final or not isinstance(step, CurvedSegment):  # or a ray without an event
                return self._stopped(str(event))
            if event:  # a failure: the step is too long to tell which event comes first
                self._blocked += 1
                if self._blocked > MOST_BLOCKED:
                    break
                longest, blocked = 0.5 * step.length, event
                continue
            if end := self._ended_by_user(step, step.length):
                return end
            self._go_to(step)
            reading, longest, blocked = after, np.inf, None
        return self._stopped(str(Failure(FailureReason.TOO_MANY_STEPS)))

    def _first_event(
        self, step: Segment, reading: Reading, aimed: Event | None = None
    ) -> tuple[Event | Failure | None, Reading]:
        """Return the first event on a step, perhaps ``aimed`` at, and the reading at the end."""
        watch = self.watch
        if not isinstance(step, CurvedSegment):
            return first_on_ray(watch, step, reading), reading
        step.behind, after = self._before, watch.read(self._curve, step.end)
        return first_on_curve(watch, step, reading, after, aimed), after

    def _step(self, longest: float) -> Segment | Failure:
        """Return the next step; the farther a long piece has gone, the longer the step."""
        stepper, number = self.stepper, len(self._points)
        if number % ENDLESS_CHECK_EVERY == 0 and self._is_endless():
            return Failure(FailureReason.ENDLESS)
        if self._tiny > MOST_TINY:
            return Failure(FailureReason.CREEPING)
        is_due = number % CRAWL_CHECK_EVERY == 0
        if is_due or number > MANY_STEPS:
            gone = self._curve.metric.norm(self._state.x - self._points[0])
            if is_due and self._flips > MOST_FLIPS and gone < CRAWLING * number:
                return Failure(FailureReason.TWICE)  # rounding flips the determinant's sign
            if number > MANY_STEPS and gone > STRETCHED_FROM:
                stepper = stepper.stretched(gone / STRETCHED_FROM)
        step = stepper.step(self._curve, self.interval, self._state, self._step_before, longest)
        if isinstance(step, CurvedSegment) and not stepper.takes_rays:
            largest = (step_size_of(stepper) or StepSize()).largest
            self._tiny = self._tiny + 1 if step.length < TINY_PART * largest else 0
        elif not isinstance(step, Failure | (StraightSegment if stepper.takes_rays else Segment)):
            kind = "StraightSegment" if stepper.takes_rays else "Segment"
            raise self._broken("step", f"a {kind} or a Failure", step)
        if isinstance(step, Failure) or step.start is self._state:
            return step
        if not np.array_equal(step.start.x, self._state.x):
            raise self._broken("step", "a segment that begins at the state given", step)
        return step

    def _aimed(self, longest: float, reading: Reading) -> tuple[CurvedSegment, Event] | None:
        """Return the step to the event that seems to come next, None if that event is not next."""
        curve, watch = self._curve, self.watch
        ahead = watch.ahead(reading)
        if ahead is None or ahead[0] > longest:
            return None
        distance, detector, index = ahead
        if (border := detector.border(curve, index)) is None:
            return None
        step = self.stepper.aim(curve, self._state, self._step_before, distance, border)
        if step is None:
            return None
        if not isinstance(step, CurvedSegment):
            raise self._broken("aim", "a CurvedSegment or None", step)
        event = Event(detector, index, step.length, step.end)
        first, _ = self._first_event(step, reading, event)
        if not isinstance(first, Event) or watch.is_rounding(first, curve):
            return None
        return step, first

    def _broken(self, method: str, what: str, got: object) -> InvalidInputError:
        """Return the error that says what the stepper returned instead of what it must."""
        return wrong_result(self.stepper, method, what, got, "check_stepper")

    def _go_to(self, step: CurvedSegment) -> None:
        """Add the end of a step; the step may be shorter than the step before suggested."""
        before, self._step_before = self._step_before, step
        self._before, self._state = step.start, step.end
        self._points.append(step.end.x)
        self._flips += step.start.orientation != step.end.orientation
        if before and step.length < SHORTENED * before.suggestion:
            self._shortened += 1
        elif before and before.suggestion > before.length:  # else kept short for another reason
            self._shortened = max(self._shortened - 1, 0)
        if before and self._shortened == MOST_SHORTENED:
            self._refines()
        if self.gauge:
            self.gauge.see(step.start.x, step.end.x)

    def _refines(self) -> bool:
        """Let differences have shorter steps if shorter steps help; return whether so."""
        self._shortened = 0
        return refine_if_better(self._curve, self._state.x)

    def _ended(self, step: Segment, event: Event) -> Followed:
        """Return the piece that an event on the last step ends, with the ways on allowed there."""
        if end := self._ended_by_user(step, event.position):
            return end
        if self.gauge:
            self.gauge.end(len(self._points))
        # before the arrival, while the system still keeps the factorisation at the end
        points = self._points_to(step, event.position, event.state)
        arrival = event.arrive(self._curve)
        arrival = self.events.ended(arrival) if self.events else arrival
        arrival = arrival.adding(f"; {Remark.TWOFOLD}") if self._flips else arrival
        final = ended_by_system(arrival)
        return points, arrival if final is arrival else final.leading(final.rays[:1])

    def _ended_by_user(self, step: Segment, length: float) -> Followed | None:
        """Return the piece up to the event of a user that ends the branch on a stretch, if any."""
        if not (self.events and self._stops and length > 0.0):
            return None
        marks = self._stops.look(step, length, len(self._points))
        if not marks:
            return None
        points = self._points_to(step, marks[0].position, marks[0].state)
        return points, self.events.stopped(self._curve, marks[0])

    def _points_to(self, step: Segment, position: float, end: State) -> list[Array]:
        """Return the points of a piece that ends on a step; a curved piece has at least three."""
        if isinstance(step, CurvedSegment) and len(self._points) == 1:
            middle = step.point(0.5 * position, end.located_by)
            if middle is not None:
                if self.gauge:  # as where the piece is read from a journal
                    self.gauge.see(self._state.x, middle)
                return [*self._points, middle, end.x]
        return [*self._points, end.x]

    def _is_endless(self) -> bool:
        """Tell whether a piece leads to infinity while alpha stays inside the interval.

        Between parts of the way to the farthest point, changes of alpha shrink where alpha
        approaches a limit like a power of 1 / z, not like a logarithm. Two rules: one for pieces
        far out, one for long pieces at any distance.
        """
        points = np.array(self._points) / self._curve.metric.scale
        sizes, alpha = np.linalg.norm(points[:, :-1], axis=1), points[:, -1]
        is_long = len(points) > ENDLESS_STEPS
        found = _changes(sizes, alpha, PARTS, ENDLESS_RATIO) if sizes.max() >= ENDLESS_FROM else []
        if found and (is_long or ENDLESS_REST * found[-1] <= ENDLESS_CHANGE):
            return True
        if not (is_long and sizes.any()):
            return False
        part = min(max(LONG_PART, EXCESS * (sizes[0] / sizes.max()) ** (1.0 / 3.0)), MOST_PART)
        found = _changes(sizes, alpha, (part**3, part**2, part), part**LONG_POWER)
        if not found or (part > LONG_PART and found[0] * found[2] < GEOMETRIC * found[1] ** 2):
            return False
        # last (r + r^2 + ...), evenly
        return found[2] ** 2 <= LONG_CHANGE * (found[1] - found[2])

    def _stopped(self, why: str) -> Followed:
        """Return the piece that ends here; finer differences have been of no use."""
        part = part_of_steps(self._curve)
        self._curve.selection.system.refine_differences(self._part)
        if piece := self._up_to_crossing():
            return piece
        is_end = why == str(Failure(FailureReason.NOT_FINITE))
        if len(self._points) > 2 and (is_end or not self._ends_on_solution()):
            self._end_inside(part)
        back = Ray(self._curve, self._state).reversed()
        return self._points, SpecialPointFound(Kind.STOPPED, self._state.x, why, (back,))

    def _up_to_crossing(self) -> Followed | None:
        """Return the piece up to a crossing of curves on an end of the interval, None without one.

        Points so close to the crossing may lie on either curve, and are left out.
        """
        if len(self._points) == 1 or not (point := crossing_on_end(self._curve, self._state.x)):
            return None  # a start at a crossing is recognised as one
        metric = self._curve.metric
        points = [x for x in self._points if metric.norm(x - point.x) > NEARBY] or self._points[:1]
        way = metric.covector(point.x - points[-1])
        rays = sorted(point.rays, key=lambda ray: float(way.dot(ray.state.tangent)))
        return [*points, point.x], point.leading(tuple(rays))

    def _ends_on_solution(self) -> bool:
        curve = self._curve
        return solves(curve.selection.system, curve.metric, self._points[-1])

    def _end_inside(self, part: float) -> None:
        """End at the last solution; where H is not finite, the model ends a few steps farther.

        ``part``: of the usual steps, which differences took, and at whose ends H is not finite.
        """
        last = self._state
        while len(self._points) > 2 and not self._ends_on_solution():
            last = self._before or last
            self._points.pop()
        steps = [self._points[-1] - self._points[-2]]
        if not self._curve.selection.system.knows_jacobian:
            # along the tangent, each component moves by a step of differences
            along = np.abs(last.tangent / self._curve.metric.scale)
            steps.append(part * STEP / along[along > NEARLY_STILL].min() * last.tangent)
        error = np.vstack([last.error, *(REST_OF_THE_WAY * step for step in steps)])
        self._state = State(self._points[-1], last.tangent, error, last.orientation)


def _changes(sizes: Array, alpha: Array, parts: Sequence[float], ratio: float) -> list[float]:
    """Return the changes of alpha between parts of the way out, empty if no ratio bounds them."""
    farthest, largest = int(np.argmax(sizes)), sizes.max()
    if sizes[-1] < parts[-1] * largest or parts[0] * largest < sizes[0]:
        return []
    ends = [*(int(np.argmax(sizes >= part * largest)) for part in parts), farthest]
    changes = np.abs(np.diff(alpha[ends]))
    changes[changes <= GUARD * EPS * np.abs(alpha).max()] = 0.0  # rounding shrinks no more
    return changes.tolist() if (changes[1:] <= ratio * changes[:-1]).all() else []


def alone(watched: Sequence[TransitionDetector]) -> StraightTests | None:
    """Return the tests of straight pieces, where nothing else is watched inside the interval."""
    others = [each for each in watched if not isinstance(each, IntervalEnds)]
    return others[0] if len(others) == 1 and isinstance(others[0], StraightTests) else None
