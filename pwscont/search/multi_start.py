"""Newton from many rough starts, with the solutions already found deflated away."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Integral
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, Guarantee, SearchScope
from pwscont.basics.rounding import EPS
from pwscont.curve.error_samples import Found
from pwscont.curve.metric import Metric
from pwscont.curve.semismooth import semismooth_newton
from pwscont.search.search import Search
from pwscont.system.abilities import completed, shown_size
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.ends import settled

#: Distance in the metric below which two solutions coincide, far above the error that Newton
#: leaves.
SAME_SOLUTION = EPS**0.5


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
        """Yield the solutions found at lo, then the solutions found at hi."""
        box = Box.of(system)
        guesses = self.guesses(box, metric.scale[:-1], shown_size(system))
        for alpha in interval:
            yield from _found_at(system, metric, box, alpha, guesses)

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


def _found_at(
    system: PiecewiseSystem, metric: Metric, box: Box, alpha: float, guesses: list[Array]
) -> Iterator[Found]:
    """Yield the solutions at an alpha; a successful start is tried again, deflated."""
    known: list[Found] = []
    for rough in guesses:
        guess = completed(system, rough[: shown_size(system)], alpha)
        while found := _another(system, metric, guess, alpha, known):
            found[0][:-1] = box.wrapped(found[0][:-1])
            known.append(found)
            yield found


def _another(
    system: PiecewiseSystem, metric: Metric, guess: Array, alpha: float, known: list[Found]
) -> Found | None:
    """Return the solution to which a start leads, None for a known solution or a failure."""
    found = semismooth_newton(system, metric, guess, alpha, [x for x, _ in known])
    if isinstance(found, Failure) or not _is_new(metric, found, known):
        return None
    on_curve = settled(system, metric, found)
    return on_curve if on_curve and _is_new(metric, on_curve, known) else None


def _is_new(metric: Metric, found: Found, known: list[Found]) -> bool:
    return all(metric.norm(metric.difference(found[0], x)) > SAME_SOLUTION for x, _ in known)


def _is_whole(number: object) -> bool:
    return isinstance(number, Integral) and not isinstance(number, bool)
