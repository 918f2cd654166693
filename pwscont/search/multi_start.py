"""Newton from many rough starts: at the ends of the interval, and throughout the interval.

Closed loops, and branches that come from infinity and return to infinity, may lie inside of the
interval (docs/theory, F19): solutions at the ends of the interval do not lead to such branches. The
number of slices and starts follows from a budget of evaluations. Where Newton at fixed alpha
stalls, alpha is set free, for a loop may lie between two slices. An equation in a single unknown
has many solutions beside each other, which sign changes show.

Most starts would only repeat known solutions: the solutions of all known branches are deflated
away, and a point found with alpha free is compared with all known branches before it is passed on.
A solution found is compared with all known solutions, because solutions beside a fold are closer
together than solutions deflated away may be. A start that has run away, to where H is nearly flat,
has no certain digit, and is no solution.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from numbers import Integral
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, finite_array, generic, product
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, Guarantee, SearchScope
from pwscont.basics.rounding import CONVERGED, EPS
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import Found, has_digits, is_inside
from pwscont.curve.metric import Metric
from pwscont.curve.newton import is_solved, newton
from pwscont.curve.semismooth import semismooth_newton
from pwscont.enumeration.continua import is_one_of_many
from pwscont.search.pursuit import Pursuit
from pwscont.search.search import KnownBranches, NothingKnown, Search
from pwscont.system.abilities import completed, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import residual_at
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.ends import settled

#: Evaluations of H that a search may take; a Newton iteration takes about n + 2.
MOST_EVALUATIONS = 12_000
#: Newton iterations of a start, on average.
USUAL = 20
#: Distance below which two solutions coincide, in typical magnitudes, as a part of 1 plus the
#: length of a solution.
SAME_SOLUTION = EPS**0.5
#: Distance below which two rough known solutions coincide, measured in the same way.
DISTINCT = 1e-5
#: Most solutions from a start.
MOST_FROM_ONE = 16
#: Most rounds of starts between the ends, if rounds find more, or if nothing is known at all.
MOST_ROUNDS = 4
#: Most solutions at an end, and most between the ends: an equation such as tan(z) = alpha has
#: infinitely many branches.
MOST_FOUND = 48
#: Starts are spread over a typical magnitude, over WIDER_BY times as much, and so on for SPREADS
#: widths in turn.
WIDER_BY, SPREADS = 4.0, 3
#: Largest distance from zero, in typical magnitudes, over which starts are spread at first: each
#: branch of a periodic function would lead farther out.
FARTHEST_START = 1e3
#: Number of values of a single unknown at which the equation is evaluated, within LINE_WIDTH times
#: the known magnitude and again farther out.
ON_LINE, LINE_WIDTH = 64, 1.5
#: Number of other starts at each alpha for a single unknown, and of alphas.
FEW_ON_LINE = 6
#: Accuracy of a sign change, as a part of the known magnitude, and distance below which a sign
#: change is a known solution, measured like SAME_SOLUTION.
ZERO_ACCURACY, NEAR_ZERO = 1e-3, 1e-2
#: The golden section.
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
#: Largest correction of a point that a pursuit found, as a part of 1 plus the length of the point.
MOST_CORRECTED = 1e-3
#: Most Newton iterations of such a correction, and most cells that are tried: a root of a selection
#: is a solution only in the cell of the selection.
MOST_STANDING, MOST_CELLS = 8, 4


@final
@dataclass(frozen=True, slots=True)
class MultiStart(Search):
    """Semismooth Newton at the two ends of the interval from random starts, with deflation.

    A solution once found is divided out of H (Farrell, Birkisson and Funke 2015), so that the
    same start may lead to the next solution. Any number may be missed: nothing is promised. Runs
    with the same seed are identical.

    Attributes
    ----------
    count : int
        Number of starts at each end; the first is z = 0, or the point within the bounds near zero.
    seed : int
    spread : float
        Deviation of the normally distributed starts, in typical magnitudes. Starts are spread
        evenly over a period, and between bounds not much further apart than the deviation.
    around : tuple of tuple of float
        States to start from as well; every other random start is around a given state.

    Raises
    ------
    InvalidInputError
        If count is no positive whole number, seed no whole number from 0, around no sequence of
        states, or spread not positive and finite.

    Examples
    --------
    >>> from pwscont import MultiStart, Switched, explore
    >>> arch = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    >>> explore(arch, (-0.5, 1.0), search=MultiStart(count=5, seed=1)).count(0.2)
    3
    """

    count: int = 20
    seed: int = 0
    spread: float = 1.0
    around: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not _is_whole(self.count) or self.count < 1:
            raise InvalidInputError(f"count must be a positive whole number, got {self.count!r}")
        if not _is_whole(self.seed) or self.seed < 0:
            raise InvalidInputError(f"seed must be a whole number from 0, got {self.seed!r}")
        if not 0.0 < finite_array("spread", self.spread, ()) < np.inf:
            raise InvalidInputError(f"spread must be positive, got {self.spread}")
        if not np.iterable(self.around):
            raise InvalidInputError(f"around must be states, got {self.around!r}")

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield the solutions found at lo, then the solutions found at hi.

        A successful start is tried again, with the known solutions deflated away.
        """
        box, shown = Box.of(system), shown_size(system)
        guesses = self.guesses(box, metric.scale[:-1], shown)
        for alpha in interval:
            known: list[Array] = []
            for rough in guesses:
                guess = completed(system, rough[:shown], alpha)
                while found := _solution(system, metric, guess, alpha, known):
                    if not _is_new(metric, found[0], known):
                        break
                    found[0][:-1] = box.wrapped(found[0][:-1])
                    known.append(found[0])
                    yield found

    def guesses(self, box: Box, scale: Array, shown: int) -> list[Array]:
        """Return all starts: fixed states, then random states, every other around a fixed state."""
        rng, shape = np.random.default_rng(self.seed), (self.count, len(scale))
        normal, even = rng.normal(size=shape), rng.uniform(-0.5, 0.5, size=shape)
        more = np.zeros(len(scale) - shown)  # of the unknowns that follow from a state
        around = [np.append(finite_array("around", z, (shown,)), more) for z in self.around]
        guesses = [*map(box.inside, around), box.centre(scale)]
        for i in range(1, self.count):
            near = around[i // 2 % len(around)] if around and i % 2 else None
            guesses.append(box.guess(normal[i], even[i], self.spread * scale, near))
        return guesses

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing."""
        what = f"Newton from {self.count} starts at both ends (seed {self.seed}), with deflation"
        return SearchScope(what, Guarantee.NOTHING)


def _is_whole(number: object) -> bool:
    return isinstance(number, Integral) and not isinstance(number, bool)


def _solution(
    system: PiecewiseSystem, metric: Metric, guess: Array, alpha: float, known: Sequence[Array]
) -> Found | None:
    """Return the solution to which semismooth Newton leads, None for a failure."""
    found = semismooth_newton(system, metric, guess, alpha, known)
    return None if isinstance(found, Failure) else settled(system, metric, found)


def _is_new(metric: Metric, x: Array, known: Sequence[Array], same: float = SAME_SOLUTION) -> bool:
    """Tell whether a point is none of the known points."""
    if not len(known):
        return True
    apart = metric.difference(x, np.array(known)) / metric.scale
    return float(np.linalg.norm(apart, axis=1).min()) > same * (1.0 + metric.norm(x))


@final
@dataclass(frozen=True, slots=True)
class Throughout(Search):
    """Newton from many starts at the ends and at values of alpha between, deflated."""

    ends: MultiStart = field(default_factory=MultiStart)  # the starts at the ends
    slices: int = 9  # number of values of alpha between the ends, and of starts at each value
    count: int = 6

    @classmethod
    def affordable(cls, system: PiecewiseSystem, ends: MultiStart) -> Throughout:
        """Return the search that a budget of evaluations allows for a system of this size."""
        starts = affordable_starts(system, 1, 63)
        if shown_size(system) == 1:  # sign changes find nearly all
            starts, ends = FEW_ON_LINE**2, replace(ends, count=FEW_ON_LINE)
        slices = int(min(max(starts**0.5, 3), 9))
        return cls(ends, slices, max(starts // slices, 1))

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield solutions at the ends of the interval and inside."""
        return self.starts_beside(system, metric, interval, NothingKnown())

    def starts_beside(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        interval: tuple[float, float],
        known: KnownBranches,
    ) -> Iterator[Found]:
        """Yield solutions that are not on known branches."""
        looking = _Looking(system, metric, interval, known)
        rough = self.ends.guesses(looking.box, metric.scale[:-1], shown_size(system))
        for alpha in interval:
            yield from looking.at(alpha, rough)
        if known.are_all():
            return
        count = 0
        for number in range(MOST_ROUNDS):
            before = count
            for count, found in enumerate(self._between(looking, interval, number), before + 1):
                yield found
                if count > MOST_FOUND:
                    return
            if count == before and (number or known.extremes()):
                return

    def _between(
        self, looking: _Looking, interval: tuple[float, float], turn: int
    ) -> Iterator[Found]:
        """Yield solutions from starts inside the interval, at other alphas and states each turn."""
        lo, hi = interval
        for alpha in interval if turn else ():
            more = range(turn * self.count, (turn + 1) * self.count)
            yield from looking.at(alpha, map(looking.guess, more))
        for k in range(turn * self.slices, (turn + 1) * self.slices):
            guesses = map(looking.guess, range(k * self.count, (k + 1) * self.count))
            part = (0.5 + GOLDEN * (k + 0.118)) % 1.0  # evenly spread, avoids special values
            yield from looking.at(lo + (hi - lo) * part, guesses)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing."""
        ends = f"Newton from {self.ends.count} starts at both ends (seed {self.ends.seed})"
        what = f"{ends} and {self.count} at {self.slices} values of alpha between, deflated"
        what += ", and where one equation changes its sign" if shown_size(system) == 1 else ""
        what += "; again while more is found"
        return SearchScope(what, Guarantee.NOTHING)


@final
class _Looking:
    """The search in a single run."""

    def __init__(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        interval: tuple[float, float],
        known: KnownBranches,
    ) -> None:
        self._system, self._metric, self._interval = system, metric, interval
        self.box, self._known = Box.of(system), known
        self._pursuit = Pursuit(system, metric, interval)
        self._reach = metric.scale[:-1]  # grows with the reach of known branches

    def at(self, alpha: float, guesses: Iterable[Array]) -> Iterator[Found]:
        """Yield the new solutions to which starts at an alpha lead, one of infinitely many."""
        here = list[Array]()
        known = self._solutions(alpha)
        zeros = self._sign_changes(alpha, known)
        for number, rough in enumerate(chain(zeros, guesses)):
            if len(here) >= MOST_FOUND:
                return
            z = completed(self._system, rough[: shown_size(self._system)], alpha)
            y = np.append(z, alpha) / self._metric.scale
            for _ in range(MOST_FROM_ONE):
                reached, arrived = self._pursuit.at_alpha(y, self._distinct(known))
                found = self._corrected(reached, alpha) if arrived else None
                if not (found and _is_new(self._metric, found[0], known)):
                    break
                yield found
                if is_one_of_many(self._system, self._metric, found[0]):
                    return
                here.append(found[0])
                known = [*here, *self._solutions(alpha)]
            if not arrived and (found := self._freely(reached, number)):
                yield found
                known = [*here, *self._solutions(alpha)]

    def _sign_changes(self, alpha: float, known: list[Array]) -> Iterator[Array]:
        """Yield sign changes of an equation in a single unknown, except at known solutions."""
        if shown_size(self._system) != 1:
            return
        even = np.linspace(-1.0, 1.0, ON_LINE + 2)[1:-1]  # and ever sparser farther out
        far = WIDER_BY * even * np.sqrt(2.0 / (1.0 - even**2))
        places = self._reach[0] * np.concatenate([LINE_WIDTH * even, far])
        places = np.unique(np.clip(places, self.box.lower[0], self.box.upper[0]))
        signs = np.sign([self._equation(z, alpha) for z in places])
        from scipy.optimize import bisect  # noqa: PLC0415  importing takes as long as all else

        for i in np.flatnonzero(signs[1:] * signs[:-1] < 0.0):
            z = bisect(
                self._equation,
                *places[i : i + 2],
                (alpha,),
                xtol=ZERO_ACCURACY * self._reach[0],
            )
            full = completed(self._system, np.array([z]), alpha)
            if _is_new(self._metric, np.append(full, alpha), known, NEAR_ZERO):
                yield full

    def _equation(self, z: float, alpha: float) -> float:
        full = completed(self._system, np.array([z]), alpha)
        character = self._system.character(full, alpha)
        return float(residual_at(self._system, full, alpha, character)[0])

    def _freely(self, y: Array, number: int) -> Found | None:
        """Return the new solution to which a free alpha leads from where a pursuit stalled."""
        free = self._pursuit.free(y, generic(len(y), float(number)))
        (lo, hi), scale = self._interval, self._metric.scale
        if free is None or not lo <= free[-1] * self._metric.width <= hi:
            return None
        near = self._known.near(free * scale, self._metric)
        if near is not None and self._pursuit.leads_to(near / scale, free):
            return None  # the point lies on a known branch
        return self._standing(self._pursuit.along(free))

    def _standing(self, y: Array) -> Found | None:
        """Return the exact solution near a rough solution, None for a start that ran away."""
        metric, x = self._metric, y * self._metric.scale
        direction = self._pursuit.direction(y)
        if direction is None or self._pursuit.is_flat(y, direction):
            return None
        row, near = metric.covector(direction * metric.scale), x
        for _ in range(MOST_CELLS):
            own = Selection(self._system, self._system.character(near[:-1], float(near[-1])))
            curve = Curve(own, metric)
            root = newton(curve, lambda at: (float(row.dot(at - x)), row), near, MOST_STANDING)
            if isinstance(root, Failure):
                return None
            near = root.x
            rounding = CONVERGED * product(abs(own.test_gradients(near)), metric.sizes(near))
            if (own.tests(near) >= -rounding).all():
                return self._usable((near, root.error[np.newaxis]), x)
        return None

    def _solutions(self, alpha: float) -> list[Array]:
        """Return the known solutions at an alpha."""
        found, scale = [], self._metric.scale
        for x in self._known.at(alpha):
            reach = np.minimum(np.abs(x[:-1]), FARTHEST_START * scale[:-1])
            self._reach = np.maximum(self._reach, reach)
            y, arrived = self._pursuit.at_alpha(x / scale, ())
            found.append(y * scale if arrived else x)
        return found

    def _distinct(self, points: list[Array]) -> list[Array]:
        """Return points, each once: a solution that is deflated away twice attracts from afar."""
        found: list[Array] = []
        for x in points:
            found += [x] if _is_new(self._metric, x, found, DISTINCT) else []
        return found

    def guess(self, number: int) -> Array:
        """Return the state of a start: such points fill space evenly, with heavy tails."""
        root, size = 2.0, self._system.size  # a sequence that fills (-1, 1)^n (Roberts 2018)
        for _ in range(40):
            root = (1.0 + root) ** (1.0 / (size + 1))
        steps = root ** -np.arange(1.0, size + 1.0)
        even = 2.0 * ((0.5 + (number + 1) * steps) % 1.0) - 1.0
        spread = even * np.sqrt(2.0 / (1.0 - even**2))
        farther = WIDER_BY ** (number % SPREADS)
        return self.box.guess(spread, 0.5 * even, farther * self._reach)

    def _corrected(self, y: Array, alpha: float) -> Found | None:
        """Return the solution near a rough solution, None if not found or without a digit."""
        x = y * self._metric.scale
        found = _solution(self._system, self._metric, x[:-1], alpha, ())
        return found and self._usable(found, x)

    def _usable(self, found: Found, rough: Array) -> Found | None:
        """Return a solution with digits, inside the bounds and near a rough solution, else None."""
        metric, (x, error) = self._metric, found
        if metric.norm(metric.difference(x, rough)) > MOST_CORRECTED * (1.0 + metric.norm(rough)):
            return None
        x[:-1] = self.box.wrapped(x[:-1])
        error, scale = np.atleast_2d(error), metric.scale
        if not has_digits(x, error, scale) or not is_inside(self.box, x, error, scale):
            return None
        tests = self._system.test_functions(x[:-1], float(x[-1]))
        if not np.isfinite(tests).all():
            return None
        own = Selection(self._system, Character.of(tests))  # of the cell in which the root lies
        is_root = is_solved(own, metric, x, own.jacobian(x), own.residual(x))
        return (x, error) if is_root else None


def affordable_starts(system: PiecewiseSystem, fewest: int, most: int) -> int:
    """Return how many starts a budget of evaluations allows for a system of this size."""
    return min(max(MOST_EVALUATIONS // ((system.size + 2) * USUAL), fewest), most)
