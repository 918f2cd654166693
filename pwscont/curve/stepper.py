"""The base class of steppers, the segment of a curve that a step makes, and the step length."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import final

from pwscont.basics.arrays import Array, dot, finite_array, plus, times
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.printing import at, named
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, TINY
from pwscont.curve.corrector import BorderedNewton
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Range
from pwscont.curve.newton import Border, by_chords
from pwscont.linear.factor import Factor

#: Least cosine between a tangent and the chord for the tangent to help in finding points between.
STEEPEST = 0.5
#: Shortest chord, in the metric, whose direction has enough digits for a step of its own.
SHORTEST_CHORD = 1e-6
#: Bound on the distance of the curve from the cubic of a segment, as a part of the chord; a step is
#: accepted if the distance at points inside is at most a tenth of the bound.
BESIDE = 1e-3


class Segment(ABC):
    """A stretch of a curve, parametrised by the distance s along the chord.

    Attributes
    ----------
    curve : Curve
    start : State
    """

    curve: Curve
    start: State

    @abstractmethod
    def near(self, s: float) -> Array:
        """Return a point close to the curve at distance ``s``, shape (n + 1,)."""

    @abstractmethod
    def position(self, x: Array) -> float:
        """Return the distance s of a point of the curve."""

    def at(self, s: float) -> State | Failure:
        """Return the state of the curve at distance ``s``; on a ray the point close by is exact."""
        start = self.start
        return State(self.near(s), start.tangent, start.error, start.orientation)

    def is_beside(self, state: State, s: float) -> bool:
        """Tell whether a point at distance ``s`` is near enough to belong to this stretch."""
        return True


@final
@dataclass(frozen=True, slots=True)
class StraightSegment(Segment):
    """A ray: the curve of an affine selection from ``start`` on, without an end."""

    curve: Curve
    start: State

    def near(self, s: float) -> Array:
        """Return the point at distance ``s``, exact up to rounding."""
        return self.start.x + s * self.start.tangent

    def __repr__(self) -> str:
        return named(self, self.curve.selection, f"from {at(self.start.x)}")

    def position(self, x: Array) -> float:
        """Return the distance of ``x`` along the ray."""
        return float(self.curve.metric.covector(self.start.tangent).dot(x - self.start.x))


@final
@dataclass(slots=True, eq=False)
class CurvedSegment(Segment):
    """A step between two states of a curve.

    Attributes
    ----------
    end : State
    chord : ndarray, shape (n + 1,)
        Unit direction from start to end.
    leaving, arriving : tuple of ndarray, shape (n + 1,), and float
        The tangents at the two ends, and the factors that make the tangents unit speed along the
        chord.
    length : float
        Length of the chord.
    suggestion : float
        Length that the stepper would try next.
    gap : float
        Distance between the places at which was looked into the step; zero for no look.
    factor_at_end : Factor, optional
        A factorisation of [J; border] from right beside the end.
    behind : State, optional
        The state before ``start`` on the same piece.
    """

    curve: Curve
    start: State
    end: State
    chord: Array
    leaving: tuple[Array, float]
    arriving: tuple[Array, float]
    length: float
    suggestion: float
    gap: float = 0.0
    factor_at_end: Factor | None = None
    behind: State | None = None

    def __repr__(self) -> str:
        ends = f"alpha {self.start.alpha:.10g} → {self.end.alpha:.10g}"
        return named(self, self.curve.selection, ends)

    @classmethod
    def between(cls, curve: Curve, start: State, end: State, suggestion: float) -> CurvedSegment:
        """Return the segment between two states."""
        difference = end.x - start.x
        row = curve.metric.covector(difference)
        length = math.sqrt(dot(row, difference))
        share = 1.0 / length if length else math.nan  # no direction leads from a point to itself
        chord = times(share, difference)
        leaving = _along(start.tangent, chord, share * dot(row, start.tangent))
        arriving = _along(end.tangent, chord, share * dot(row, end.tangent))
        return cls(curve, start, end, chord, leaving, arriving, length, suggestion)

    def near(self, s: float) -> Array:
        """Return the point at ``s`` of the cubic through the two ends and along the tangents."""
        u, (leaving, by), (arriving, to) = s / self.length, self.leaving, self.arriving
        v = s * (1.0 - u)
        first, last = v * (1.0 - u), v * u
        point = plus(self.start.x.copy(), s - first + last, self.chord)
        point = plus(point, first * by, leaving)
        return plus(point, -last * to, arriving)

    def slopes_of_alpha(self) -> tuple[float, float, float]:
        """Return d alpha per distance along the chord: at the start, on average, at the end."""
        (leaving, by), (arriving, to) = self.leaving, self.arriving
        return float(leaving[-1]) * by, float(self.chord[-1]), float(arriving[-1]) * to

    def position(self, x: Array) -> float:
        """Return the distance of the projection of ``x`` on the chord."""
        return float(self.curve.metric.covector(self.chord).dot(x - self.start.x))

    def is_beside(self, state: State, s: float) -> bool:
        """Tell whether a state is as near to the cubic at ``s`` as the curve is."""
        metric, x = self.curve.metric, state.x
        slack = max(metric.slack(x, CONVERGED), CONFIDENCE * metric.norm(state.size))
        return metric.norm(x - self.near(s)) <= BESIDE * self.length + slack

    def point(self, s: float, factor: Factor | None) -> Array | None:
        """Return a point of the curve at about ``s``, shape (n + 1,), None if not found.

        A factorisation [J; border] from close by is used, if given and good enough.
        """
        near = self.near(s)
        x = by_chords(self.curve, factor, near) if factor else None
        if x is not None and self.curve.metric.norm(x - near) <= BESIDE * self.length:
            return x
        found = self.at(s)
        return None if isinstance(found, Failure) else found.x

    def at(self, s: float) -> State | Failure:
        """Return the state of the curve in the hyperplane normal to the chord at ``s``."""
        if s in (0.0, self.length):
            return self.end if s else self.start
        found = BorderedNewton().correct(self.curve, self.near(s), self.chord)
        if isinstance(found, Failure):
            return found
        return found.state if self.is_beside(found.state, s) else Failure(FailureReason.JUMP)


def _along(tangent: Array, chord: Array, along: float) -> tuple[Array, float]:
    """Return a tangent, and the factor that makes the tangent unit speed along the chord.

    The chord itself is returned where the cosine ``along`` of tangent and chord is too small.
    """
    if along < STEEPEST:  # the chord is rounding, or the tangent points backwards
        return chord, 1.0
    return tangent, 1.0 / along


class Stepper(ABC):
    """Owns a step along the curve of a frozen selection; the loop decides what follows.

    Attributes
    ----------
    takes_rays : bool
        A promise that each step is a :class:`~pwscont.extending.StraightSegment`, for a
        :class:`~pwscont.PiecewiseLinearSystem` only; default False.

    Examples
    --------
    >>> from pwscont import LCP, NaturalParameter, Stepper, explore
    >>> isinstance(NaturalParameter(), Stepper)
    True
    >>> problem = LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0])
    >>> len(explore(problem, (-1.0, 2.0), stepper=NaturalParameter()).pieces)
    2
    """

    takes_rays: bool = False

    @abstractmethod
    def step(
        self,
        curve: Curve,
        interval: tuple[float, float],
        state: State,
        before: Segment | None,
        longest: float,
    ) -> Segment | Failure:
        """Return the next segment from ``state``.

        Parameters
        ----------
        curve : Curve
        interval : tuple of float
            No point outside this interval of alpha is computed.
        state : State
            The state from which the step begins.
        before : Segment or None
            The step before on the same piece; None on the first.
        longest : float
            Upper bound on the length of the step in the curve's metric: there the interval of alpha
            has length 1, and each unknown is measured by the typical magnitude.

        Returns
        -------
        Segment or Failure
        """

    def aim(
        self, curve: Curve, state: State, before: Segment | None, distance: float, border: Border
    ) -> CurvedSegment | None:
        """Return the step to a zero that lies ahead, instead of a step beyond the zero.

        Parameters
        ----------
        curve, state, before
            As for :meth:`step`.
        distance : float
            How far along the tangent ``border`` seems to vanish, in the metric.
        border : callable
            x -> (value, gradient), positive at ``state``.

        Returns
        -------
        CurvedSegment or None
            The step ends where ``border`` is zero. None, the default, if the zero is too far for a
            step or the step would not be true: the zero is then located in a step beyond.
        """
        return None

    def stretched(self, factor: float) -> Stepper:
        """Return a stepper whose longest step is longer by a factor; default: this stepper.

        A piece that runs towards infinity is followed by steps in proportion to the distance.
        """
        return self


@final
@dataclass(frozen=True, slots=True)
class ExactLinear(Stepper):
    """Takes a whole piece of a :class:`~pwscont.PiecewiseLinearSystem` in a single step.

    The ray along the tangent is the curve. A ratio test says where the ray leaves the cell, and the
    point there is solved for afresh, so that errors do not accumulate from piece to piece.

    Examples
    --------
    >>> from pwscont import LCP, ExactLinear, explore
    >>> problem = LCP([[2, 1], [1, 2]], q=[-1, -1], d=[1, 0])
    >>> len(explore(problem, (-1.0, 2.0), stepper=ExactLinear()).pieces)
    2
    """

    takes_rays = True

    def step(
        self, curve: Curve, interval: Range, state: State, before: Segment | None, longest: float
    ) -> Segment | Failure:
        """Return the ray from ``state``."""
        return StraightSegment(curve, state)


# -- the length of a step, from the strain and the turn of the last step ---------------------------

#: The strain that the control aims at, where 1 is the largest strain that is accepted.
WANTED_STRAIN = 0.5
#: Default lengths in the metric: the first step of a piece, and the gap between looks into a step.
FIRST_STEP = 0.02
LARGEST_GAP = 0.0025


@final
@dataclass(frozen=True, slots=True)
class StepSize:
    """Control the step length: grow where Newton converges fast and the curve is straight.

    Lengths are measured in the metric, in which the interval of alpha has length 1.

    Attributes
    ----------
    first, smallest, largest : float
        Lengths of the first step of a piece, of the last try, and of the longest step. If only
        ``largest`` is given, and is shorter than 0.02, the first step is as long as the longest.
    least_cosine : float
        Cosine of the largest angle between the tangents at the two ends of a step.
    gap : float
        Distance between the places inside a step in which H is evaluated; with n > 8 unknowns
        sqrt(n / 8) times the given distance. Two smooth folds closer together may be passed over.
        Half the gap doubles the evaluations.

    Raises
    ------
    InvalidInputError
        If not 0 < smallest <= first <= largest, the cosine is not between -1 and 1, or the gap is
        not positive.

    Examples
    --------
    >>> from pwscont import PseudoArclength, StepSize
    >>> PseudoArclength(step_size=StepSize(largest=0.01)).step_size.first
    0.01
    """

    first: float = FIRST_STEP
    smallest: float = 1e-10
    largest: float = 0.1
    least_cosine: float = 0.98
    gap: float = LARGEST_GAP

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("first", "smallest", "largest", "least_cosine", "gap"):
            number = finite_array(f"{name} of StepSize", getattr(self, name), ())
            object.__setattr__(self, name, float(number))
        if self.largest < self.first == FIRST_STEP:
            object.__setattr__(self, "first", self.largest)
        if not 0.0 < self.smallest <= self.first <= self.largest:
            raise InvalidInputError(
                f"StepSize needs 0 < smallest <= first <= largest, got smallest = {self.smallest}, "
                f"first = {self.first}, largest = {self.largest}"
            )
        if not -1.0 <= self.least_cosine < 1.0:
            raise InvalidInputError(
                f"least_cosine of StepSize must be in [-1, 1), got {self.least_cosine}"
            )
        if not self.gap > 0.0:
            raise InvalidInputError(f"gap of StepSize must be positive, got {self.gap}")

    def stretched(self, factor: float) -> StepSize:
        """Return the control with ``largest`` and ``gap`` multiplied by a factor."""
        return replace(self, largest=factor * self.largest, gap=factor * self.gap)

    def after(self, length: float, strain: float, cosine: float) -> float:
        """Return the length of the next step, at least half and at most twice ``length``.

        ``strain`` is the largest ratio of a measure of the last step to the measure's tolerance.
        """
        # the angle grows like the step, 1 - cos and the strain like the square or faster
        by_strain = WANTED_STRAIN / max(strain, TINY)
        by_angle = (1.0 - self.least_cosine) / max(2.0 * (1.0 - cosine), TINY)
        factor = min(max(min(by_strain, by_angle) ** 0.5, 0.5), 2.0)
        return float(min(max(length * factor, self.smallest), self.largest))


def step_size_of(stepper: object) -> StepSize | None:
    """Return the step control of a stepper, None for a stepper without any."""
    found = getattr(stepper, "step_size", None)
    return found if isinstance(found, StepSize) else None
