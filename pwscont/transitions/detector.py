"""The base class of detectors, which watch functions along a piece, and what detectors return."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise, starmap
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, Kind
from pwscont.basics.printing import at, counted, named, short
from pwscont.basics.rounding import CONFIDENCE, CONVERGED
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import Border
from pwscont.curve.stepper import CurvedSegment, Segment
from pwscont.transitions.rays import Ray
from pwscont.transitions.zeros import ratio_test

#: A message, or a function that returns the message: thousands of messages are never read.
Said = str | Callable[[], str]
#: A watched function and its negative, as multiples of the function.
BOTH_SIGNS = np.array([1.0, -1.0])
#: The slopes of a pair of functions whose slopes are not known.
UNKNOWN = np.zeros(2)
UNKNOWN.setflags(write=False)
#: The index of a special point that no function of a reading tells.
HIDDEN = -1
#: Places on a straight piece at which functions without a slope are read.
PLACES_ON_RAY = 64


def worded(said: Said) -> str:
    """Return a message in words, calling a message that is a function."""
    return said if isinstance(said, str) else said()


@final
@dataclass(slots=True, eq=False)
class Reading:
    """Values of the watched functions at a state, and their slopes along its tangent.

    Attributes
    ----------
    values : ndarray, shape (k,)
        Positive while nothing happens; a change to zero or below is an event.
    slopes : ndarray, shape (k,)
        Derivatives along the tangent; zero where unknown.
    parts : sequence of Reading
        What each detector read, in a reading of several detectors.
    """

    values: Array
    slopes: Array
    parts: Sequence[Reading] = ()

    @property
    def begins(self) -> tuple[int, ...]:
        """Where the functions of each detector begin and end."""
        return tuple(accumulate((len(part.values) for part in self.parts), initial=0))

    def having(self, values: Array, slopes: Array) -> Reading:
        """Return a reading of the same detectors, with other values and slopes."""
        own = starmap(slice, pairwise(self.begins))
        return Reading(values, slopes, [Reading(values[i], slopes[i]) for i in own])


@final
class SpecialPointFound:
    """A special point reached, and the rays that leave the point.

    Parameters
    ----------
    kind : Kind or str
        A word of the detector's own, where none of :class:`Kind` fits.
    x : ndarray, shape (n + 1,)
    message : str or callable
        What happens at the point, for the user; a function without arguments is called when the
        message is read.
    rays : tuple of Ray
        Every piece that is known to end here; the first ray is the piece that was followed,
        pointing back.
    """

    __slots__ = ("kind", "rays", "said", "x")

    def __init__(self, kind: Kind | str, x: Array, message: Said, rays: tuple[Ray, ...]) -> None:
        self.kind, self.x, self.said, self.rays = kind, x, message, rays

    @property
    def message(self) -> str:
        """What happens there."""
        return worded(self.said)

    def leading(self, rays: tuple[Ray, ...]) -> SpecialPointFound:
        """Return the same special point with other ways on."""
        return SpecialPointFound(self.kind, self.x, self.said, rays)

    def adding(self, words: str) -> SpecialPointFound:
        """Return the same special point with words at the end of the message."""
        return SpecialPointFound(self.kind, self.x, self.message + words, self.rays)

    def __repr__(self) -> str:
        rays = counted(len(self.rays), "ray")
        return named(self, self.kind, at(self.x), short(self.message), rays)


class TransitionDetector(ABC):
    """Watches functions along a piece; a function that falls to zero makes a special point.

    The contract: :meth:`read` returns the same number of functions all along a piece. Each function
    is positive while nothing happens; where a function changes from positive to zero or below, the
    zero is located and a special point made. A function that is zero or negative is not watched
    until the function is positive again, so return g and -g where sign changes in both directions
    matter. Right after its own special point a function must be zero up to rounding, or negative,
    or rise. Values at a point of a curve depend on that point, not on the way there.

    Attributes
    ----------
    is_affine : bool
        A promise that along straight pieces all functions are affine, read with their slopes, and
        negative at most at the end of the piece: the ratio test then finds the zeros; default
        False.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import Switched, TransitionDetector, trace
    >>> from pwscont.extending import Ray, Reading, SpecialPointFound, locate_zero
    >>> class Level(TransitionDetector):  # z falls to 1/2
    ...     def read(self, curve, state):
    ...         return Reading(state.x[:1] - 0.5, state.tangent[:1])
    ...     def locate(self, segment, index, bracket):
    ...         row = np.array([1.0, 0.0])
    ...         return locate_zero(segment, lambda x: (x[0] - 0.5, row), bracket)
    ...     def arrive(self, curve, state, index):
    ...         forth = Ray(curve, state)
    ...         return SpecialPointFound("level", state.x, "low", (forth.reversed(), forth))
    >>> circle = Switched(1, lambda z, t, sw: z**2 + t**2 - 1)
    >>> graph = trace(circle, ([1.0], 0.0), (-2.0, 2.0), detectors=[Level()])
    >>> [round(point.alpha, 6) for point in graph.special_points("level")]
    [-0.866025, 0.866025]
    """

    is_affine: bool = False

    @abstractmethod
    def read(self, curve: Curve, state: State) -> Reading:
        """Return the values of the watched functions at ``state``.

        Parameters
        ----------
        curve : Curve
            The selection that is followed, and the metric.
        state : State
            A point of the curve, and the tangent in the direction of travel.

        Returns
        -------
        Reading
        """

    def falls(self, segment: Segment, start: Reading, farthest: float) -> Array:
        """Return the distance at which each function falls to zero on a straight segment.

        Parameters
        ----------
        segment : Segment
            A ray without an end.
        start : Reading
            The reading of this detector at the beginning of the segment.
        farthest : float
            Zeros beyond this distance do not matter, for the piece ends there at the latest.

        Returns
        -------
        ndarray, shape (k,)
            Infinite for functions that do not fall. The default takes functions with a slope to be
            affine along straight pieces (the ratio test), and evaluates functions with unknown
            slopes at a number of places; override ``falls`` for other functions. Functions that are
            zero or negative fall at once where :attr:`is_affine` is promised.
        """
        if self.is_affine:
            return ratio_test(start.values, start.slopes)
        positive = start.values > 0.0
        distances = ratio_test(np.where(positive, start.values, np.inf), start.slopes)
        unknown = np.flatnonzero(positive & (start.slopes == 0.0))
        if not (len(unknown) and np.isfinite(farthest)):
            return distances
        places = np.linspace(0.0, farthest, PLACES_ON_RAY + 1)[:-1].tolist()
        read = np.array([values_on(self, segment, s) for s in places])
        for k in unknown:
            fallen = np.flatnonzero((read[:-1, k] > 0.0) & (read[1:, k] <= 0.0))
            if len(fallen):
                lo, hi = places[fallen[0] : fallen[0] + 2]
                while lo < (middle := 0.5 * (lo + hi)) < hi:
                    is_positive = values_on(self, segment, middle)[k] > 0.0
                    lo, hi = (middle, hi) if is_positive else (lo, middle)
                distances[k] = hi
        return distances

    def border(self, curve: Curve, index: int) -> Border | None:
        """Return function ``index`` of a point with its gradient, x -> (value, gradient).

        With a gradient, a step may end where the function vanishes, instead of beyond. None, the
        default, where there is no gradient.
        """
        return None

    @abstractmethod
    def locate(
        self, segment: Segment, index: int, bracket: tuple[float, float]
    ) -> State | Failure | None:
        """Return the state at which function ``index`` vanishes, for s within the bracket.

        Parameters
        ----------
        segment : Segment
        index : int
            Place of the function in the reading of :meth:`read`.
        bracket : tuple of float
            Distances along the segment; the function is positive at the first. On a straight
            segment both distances are equal.

        Returns
        -------
        State, Failure or None
            The state's tangent points in the direction of the segment. None, on a curved segment
            only, for a change that is no special point.
        """

    def needs_shorter_step(
        self, segment: CurvedSegment, start: Reading, end: Reading
    ) -> Failure | None:
        """Say why a shorter step must be taken, if this step may hide a special point.

        Parameters
        ----------
        segment : CurvedSegment
        start, end : Reading
            The readings of this detector at both ends.

        Returns
        -------
        Failure or None
            The message of the branch's end where no shorter step helps.
        """
        return None

    def look_inside(self, segment: CurvedSegment) -> State | Failure | None:
        """Look for a special point within a segment that no reading at its ends tells.

        Returns
        -------
        State, Failure or None
            The special point, which :meth:`arrive` gets with the index :data:`HIDDEN`; a Failure if
            a shorter step must be taken. None, the default, if there is none.
        """
        return None

    @abstractmethod
    def arrive(self, curve: Curve, state: State, index: int) -> SpecialPointFound:
        """Return the special point at ``state``, where function ``index`` vanishes.

        The rays of the point are all known ways from there, the way back first. A detector that
        only marks a point goes on along the same curve::

            forth = Ray(curve, state)
            return SpecialPointFound("my kind", state.x, "what happened", (forth.reversed(), forth))
        """


def values_on(detector: TransitionDetector, ray: Segment, s: float) -> Array:
    """Return the values of the watched functions on a straight segment, at distance s."""
    state = ray.at(s)
    assert isinstance(state, State)  # of a ray, the prediction is exact
    return np.asarray(detector.read(ray.curve, state).values)


def kinds_at(
    detector: TransitionDetector, curve: Curve, x: Array, error: Array, inner: Array
) -> list[str]:
    """Return the kinds of the special points that a detector sees where a piece ends.

    ``x``, ``error``, shape (n + 1,): the end of the piece.
    ``inner``, shape (n + 1,): the point of the piece before the end.
    """
    metric, way = curve.metric, x - inner
    if not (length := metric.norm(way)):
        return []
    here = State(x, metric.normalised(way), error[np.newaxis], 1)
    before = State(inner, here.tangent, 0.0 * here.error, 1)
    # functions may be read into the same array
    inside = np.array(detector.read(curve, before).values)
    values = np.array(detector.read(curve, here).values)
    reach = metric.slack(x, CONVERGED) + CONFIDENCE * metric.norm(error)
    vanish = (inside > 0.0) & (np.abs(values) <= (inside - values) * reach / length)
    return [str(detector.arrive(curve, here, int(i)).kind) for i in np.flatnonzero(vanish)]
