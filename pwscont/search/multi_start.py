"""Newton from many rough starts: at the ends of the interval, and throughout the interval.

Closed loops, and branches that come from infinity and return to infinity, may lie inside of the
interval (docs/theory, F19): solutions at the ends of the interval do not lead to such branches. The
number of slices and starts follows from a budget of evaluations. Where Newton at fixed alpha
stalls, alpha is set free, for a loop may lie between two slices. An equation in a single unknown
has many solutions beside each other, which sign changes show.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from numbers import Integral
from typing import TypeAlias, final

import numpy as np

from pwscont.basics.arrays import GOLDEN, Array, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Guarantee, SearchScope
from pwscont.basics.printing import counted
from pwscont.curve.error_samples import Found
from pwscont.curve.magnitudes import farther_reaches, nonlinear_reach
from pwscont.curve.metric import Metric, Range
from pwscont.search.bounds import on_bounds
from pwscont.search.enumeration import starts_at
from pwscont.search.pursuit import FEW_MORE, MOST_FOUND, Pursuit, is_new, solution_from
from pwscont.search.search import KnownBranches, Search
from pwscont.search.side_paths import SidePaths
from pwscont.system.abilities import completed, shown_size
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem

#: States to start from.
States: TypeAlias = tuple[tuple[float, ...], ...]
#: Evaluations of H that a search may take; a Newton iteration takes about n + 2.
MOST_EVALUATIONS = 12_000
#: Newton iterations of a start, on average.
USUAL = 20
#: Number of random starts at an end by default.
STARTS_AT_AN_END = 20
#: Number of starts at an end over each reach farther out, where the growth of H changes again.
FEW_FAR = 6
#: Most rounds of starts between the ends, if rounds find more, or if nothing is known at all.
MOST_ROUNDS = 4
#: Number of other starts at each alpha for a single unknown, and of alphas.
FEW_ON_LINE = 6
#: Number of alphas between the ends at which side paths are followed.
SIDE_PATHS = 20
#: Number of slices with infinitely many solutions from which on no other round begins.
MOST_FILLED = 4
#: Number of steps along side paths in the place of a start.
STEPS_PER_START = 50
#: Fewest unknowns for which side paths are followed in the place of half of the starts, and the
#: number of steps along side paths of two or three unknowns.
MANY_UNKNOWNS, FEW_STEPS = 4, 150


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

    count: int = STARTS_AT_AN_END
    seed: int = 0
    spread: float = 1.0
    around: States = ()

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

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield the solutions found at lo, then the solutions found at hi.

        A successful start is tried again, with the known solutions deflated away.
        """
        box, shown, scale = Box.of(system), shown_size(system), metric.scale[:-1]
        widths = self.spread * scale
        guesses = _rough_starts(system, scale, widths, self.count, self.around, self.seed)
        for alpha in interval:
            known: list[Array] = []
            for rough in guesses:
                guess = completed(system, rough[:shown], alpha)
                while found := solution_from(system, metric, guess, alpha, known):
                    if not is_new(metric, found[0], known):
                        break
                    found[0][:-1] = box.wrapped(found[0][:-1])
                    known.append(found[0])
                    yield found

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing."""
        starts = f"{counted(self.count, 'start')} at both ends (seed {self.seed})"
        return SearchScope(f"Newton from {starts}, with deflation", Guarantee.NOTHING)


def _rough_starts(
    system: PiecewiseSystem, scale: Array, widths: Array, count: int, around: States, seed: int = 0
) -> list[Array]:
    """Return all starts: fixed states, then random states, every other around a fixed state."""
    box, shown, shape = Box.of(system), shown_size(system), (count, len(scale))
    rng = np.random.default_rng(seed)
    normal, even = rng.normal(size=shape), rng.uniform(-0.5, 0.5, size=shape)
    more = np.zeros(len(scale) - shown)  # of the unknowns that follow from a state
    fixed = [np.append(finite_array("around", z, (shown,)), more) for z in around]
    guesses = [*map(box.inside, fixed), box.centre(scale)]
    for i in range(1, count):
        near = fixed[i // 2 % len(fixed)] if fixed and i % 2 else None
        guesses.append(box.guess(normal[i], even[i], widths, near))
    return guesses


def _is_whole(number: object) -> bool:
    return isinstance(number, Integral) and not isinstance(number, bool)


@final
@dataclass(frozen=True, slots=True)
class Throughout(Search):
    """Newton from many starts at the ends and at values of alpha between, deflated."""

    around: States = ()  # states to start from at the ends
    at_ends: int = STARTS_AT_AN_END
    slices: int = 9  # number of values of alpha between the ends, and of starts at each value
    count: int = 6
    steps: int = 0  # along side paths
    in_cells: bool = False  # whether Newton is tried once in each cell at both ends before

    @classmethod
    def affordable(cls, system: PiecewiseSystem, around: States, in_cells: bool) -> Throughout:
        """Return the search that a budget of evaluations allows for a system of this size."""
        starts, at_ends = affordable_starts(system, 1, 63), STARTS_AT_AN_END
        if shown_size(system) == 1:  # sign changes find nearly all
            starts, at_ends = FEW_ON_LINE**2, FEW_ON_LINE
        steps = FEW_STEPS if shown_size(system) > 1 else 0
        if system.size >= MANY_UNKNOWNS:  # side paths find more than starts at the same cost
            starts, steps = max(starts // 2, 1), STEPS_PER_START * starts
        slices = int(min(max(starts**0.5, 3), 9))
        return cls(around, at_ends, slices, max(starts // slices, 1), steps, in_cells)

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield solutions at the ends of the interval and inside."""
        return self.starts_beside(system, metric, interval, KnownBranches())

    def starts_beside(
        self, system: PiecewiseSystem, metric: Metric, interval: Range, known: KnownBranches
    ) -> Iterator[Found]:
        """Yield solutions that are not on known branches."""
        for alpha in interval if self.in_cells else ():
            yield from starts_at(system, metric, alpha)
        reach, scale = nonlinear_reach(system, metric), metric.scale[:-1]
        pursuit = Pursuit(system, metric, known, reach)
        rough = _rough_starts(system, scale, reach / scale * scale, self.at_ends, self.around)
        for alpha in interval:
            yield from pursuit.at(alpha, rough)
        for far in farther_reaches(system, metric, reach):
            yield from _far_out(Pursuit(system, metric, known, far), interval)
        if known.are_all():
            return
        if not known.extremes():  # only undamped steps cross kinks where H grows at first
            yield from MultiStart(count=1, around=self.around).starts(system, metric, interval)
        count, most = 0, FEW_MORE if known.is_left_off else MOST_FOUND
        for turn in range(MOST_ROUNDS):
            before, all_found = count, self._between(pursuit, interval, turn)
            if self.steps:
                paths = SidePaths(pursuit, self.steps)
                all_found = chain(_on_side_paths(paths, interval, turn), all_found)
            if Box.of(system).is_bounded:
                starts = self.slices * self.count
                all_found = chain(all_found, on_bounds(pursuit, reach, starts, turn))
            for count, found in enumerate(all_found, before + 1):
                yield found
                if count > most:
                    known.leave_off()
                    return
            if count == before and (turn or known.extremes()):
                return
            if pursuit.filled >= MOST_FILLED and known.extremes():
                break
        known.leave_off()  # the last round found more, as of branches that repeat themselves

    def _between(self, pursuit: Pursuit, interval: Range, turn: int) -> Iterator[Found]:
        """Yield solutions from starts inside the interval, at other alphas and states each turn."""
        (lo, hi), count = interval, self.count
        alphas = [(alpha, turn) for alpha in interval if turn]
        for k in range(turn * self.slices, (turn + 1) * self.slices):
            part = (0.5 + GOLDEN * (k + 0.118)) % 1.0  # evenly spread, avoids special values
            alphas.append((lo + (hi - lo) * part, k))
        for alpha, k in alphas:
            yield from pursuit.at(alpha, map(pursuit.guess, range(k * count, (k + 1) * count)))

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing."""
        what = "Newton once per cell at both ends; " if self.in_cells else ""
        what += f"Newton from {self.at_ends} starts at both ends (seed 0)"
        what += f" and {self.count} at {self.slices} values of alpha between, deflated"
        what += ", and where one equation changes its sign" if shown_size(system) == 1 else ""
        what += "; along side paths" if self.steps else ""
        what += "; on bounds of unknowns" if Box.of(system).is_bounded else ""
        what += "; again while more is found"
        return SearchScope(what, Guarantee.NOTHING)


def _far_out(pursuit: Pursuit, interval: Range) -> Iterator[Found]:
    """Yield solutions at the ends from a few starts of a pursuit that reaches far."""
    for alpha in interval:
        guesses = map(pursuit.guess, range(FEW_FAR))
        yield from pursuit.at(alpha, guesses, freely=False)  # from so far, to known folds


def _on_side_paths(paths: SidePaths, interval: Range, turn: int) -> Iterator[Found]:
    """Yield solutions on side paths at the ends, and inside of the interval."""
    lo, hi = interval
    for alpha in () if turn else (hi, lo):
        yield from paths.at(alpha, 0)
    for k in range(turn * SIDE_PATHS, (turn + 1) * SIDE_PATHS):
        part = (0.5 + GOLDEN * (k + 0.618)) % 1.0
        yield from paths.at(lo + (hi - lo) * part, k + 1)


def affordable_starts(system: PiecewiseSystem, fewest: int, most: int) -> int:
    """Return how many starts a budget of evaluations allows for a system of this size."""
    return min(max(MOST_EVALUATIONS // ((system.size + 2) * USUAL), fewest), most)
