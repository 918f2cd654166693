"""What is true of a curve given by closed formulas, without a line of the code under test.

A curve is s -> (z(s), alpha(s)). It is sampled; each extremum of alpha and each zero of a test is
located by a one-dimensional minimiser or root finder. Between them alpha is monotone, so that all
solutions at one alpha are roots with a bracket.

Failure modes and answers
-------------------------
- Two special points between two samples: extrema of the sampled values are refined, so a pair is
  missed only if the curve wiggles within one sampling distance; families sample by their own
  highest frequency.
- An alpha so near a fold that the roots cannot tell: no answer there (None), by a margin that is
  derived from the unit roundoff.
- A test that nearly touches zero: whether it crosses is below rounding, and no special points are
  compared for that case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

EPS = float(np.finfo(float).eps)
#: Samples nearer to each other than this part of a stretch are one.
ONE = 1e-9
#: Nearer to a special point than this share of the interval nothing is asked: z at a fold is known
#: to half the digits of alpha.
MARGIN = EPS**0.5
#: What z may differ by, relative to 1 + abs(z).
TOLERANCE = 1e-7
#: The truth must be known this many times better than what is asked for.
GUARD = 1e3
#: A test whose extreme is below this nearly touches zero.
TOUCHES = 1e-9


class Special(NamedTuple):
    """A fold, a transition or a non-smooth fold."""

    kind: str
    alpha: float
    s: float


class Monotone(NamedTuple):
    """A stretch of a curve on which alpha is monotone, by its parameter."""

    a: float
    b: float
    alpha_a: float
    alpha_b: float


@dataclass
class Component:
    """A connected part of the zero set within the interval of alpha."""

    stretches: list[Monotone]
    specials: list[Special]
    closed: bool = False


@dataclass
class Curve:
    """A curve and its special points.

    Attributes
    ----------
    alpha : callable
        s (k,) -> (k,).
    z : callable
        s, a number -> (n,).
    samples : ndarray
        Values of s, ascending, close enough to separate the special points.
    tests : sequence of callable
        s (k,) -> (k,), the test functions along the curve.
    closed : bool
        Whether the last sample is the first point again.
    noise : float
        Rounding error of the equations in units of alpha.
    """

    alpha: Callable[[np.ndarray], np.ndarray]
    z: Callable[[float], np.ndarray]
    samples: np.ndarray
    tests: Sequence[Callable[[np.ndarray], np.ndarray]] = ()
    closed: bool = False
    noise: float = EPS
    touches: bool = field(default=False, init=False)

    def components(self, interval: tuple[float, float]) -> list[Component]:
        """Return the parts of the curve with alpha in the interval, in the order of s."""
        kinks = sorted(s for test in self.tests for s in self._zeros(test))
        nodes = self._nodes(kinks)
        parts = self._parts(list(pairwise(nodes)), interval)
        return [self._component(part, kinks, closed) for part, closed in parts]

    # -- special points ------------------------------------------------------------------

    def _zeros(self, test: Callable[[np.ndarray], np.ndarray]) -> list[float]:
        """Return where a test crosses zero; notes a test that nearly touches it."""
        here = lambda x: float(test(np.array([x]))[0])  # noqa: E731
        s, value = self.samples, test(self.samples)
        extremes = []
        for i in _turns(np.abs(value)):
            side = float(np.sign(value[i])) or 1.0
            if (side * value[i - 1 : i + 2] > 0.0).all():
                extremes.append(_extreme(here, s[i - 1], s[i + 1], -side))
        self.touches |= any(abs(least) < TOUCHES for _, least in extremes)
        grid = np.unique([*s, *(place for place, _ in extremes)])
        return _crossings(here, grid, test(grid))

    def _nodes(self, kinks: list[float]) -> list[float]:
        """Return both ends, all kinks and all extrema of alpha, ascending."""
        bounds = [float(self.samples[0]), *kinks, float(self.samples[-1])]
        nodes = set(bounds)
        for a, b in pairwise(bounds):
            inner = self.samples[(self.samples > a) & (self.samples < b)]
            near = (b - a) * 2.0 ** -np.arange(2.0, 20.0)  # a fold may be close to a kink
            grid = [np.linspace(a, b, 9), inner, a + near, b - near]
            nodes.update(self._extrema(np.concatenate(grid)))
        return sorted(nodes)

    def _extrema(self, grid: np.ndarray) -> Iterator[float]:
        """Yield the smooth folds within a smooth stretch."""
        s = np.unique(grid)
        # of two points that are one but for rounding, the order of their alphas is no turn
        s = s[np.append(True, np.diff(s) > ONE * (s[-1] - s[0]))]
        alpha = self.alpha(s)
        for sign in (1.0, -1.0):
            for i in _turns(sign * alpha):
                at = lambda x: float(self.alpha(np.array([x]))[0])  # noqa: E731
                yield _extreme(at, s[i - 1], s[i + 1], -sign)[0]

    def _kind(self, s: float, before: Monotone, after: Monotone, kinks: list[float]) -> str:
        turns = (before.alpha_b - before.alpha_a) * (after.alpha_b - after.alpha_a) < 0.0
        if s in kinks:
            return "nonsmooth fold" if turns else "transition"
        return "fold" if turns else ""

    # -- parts within the interval -------------------------------------------------------

    def _parts(
        self, spans: list[tuple[float, float]], interval: tuple[float, float]
    ) -> Iterator[tuple[list[Monotone], bool]]:
        """Yield the runs of stretches that are joined within the interval."""
        runs: list[list[Monotone]] = [[]]
        for a, b in spans:
            clipped = self._clipped(a, b, interval)
            if clipped is None or (runs[-1] and clipped.a != runs[-1][-1].b):
                runs.append([])
            if clipped is not None:
                runs[-1].append(clipped)
        runs = [run for run in runs if run]
        first, last = float(self.samples[0]), float(self.samples[-1])
        wraps = self.closed and runs and runs[0][0].a == first and runs[-1][-1].b == last
        if wraps and len(runs) == 1:
            yield runs[0], True
            return
        if wraps:
            runs[0] = runs.pop() + runs[0]
        for run in runs:
            yield run, False

    def _clipped(self, a: float, b: float, interval: tuple[float, float]) -> Monotone | None:
        """Return the part of a monotone stretch with alpha in the interval."""
        at = lambda x: float(self.alpha(np.array([x]))[0])  # noqa: E731
        first, last = at(a), at(b)
        lo, hi = interval
        if max(first, last) <= lo or min(first, last) >= hi:
            return None
        ends = []
        for here in (first, last):
            s, bound = (a if here == first else b), min(max(here, lo), hi)
            if bound != here:
                s = brentq(lambda x, v=bound: at(x) - v, a, b, xtol=4 * EPS * (1 + abs(a)))
            ends.append((s, bound))
        return Monotone(ends[0][0], ends[1][0], ends[0][1], ends[1][1])

    def _component(self, part: list[Monotone], kinks: list[float], closed: bool) -> Component:
        pairs = list(pairwise(part))
        if closed:
            pairs.append((part[-1], part[0]))
        found = [Special(self._kind(y.a, x, y, kinks), y.alpha_a, y.a) for x, y in pairs]
        return Component(part, [point for point in found if point.kind], closed)

    # -- questions -----------------------------------------------------------------------

    def solutions(
        self, component: Component, alpha: float, length: float
    ) -> list[np.ndarray] | None:
        """Return all solutions of a component at alpha, None where the truth cannot tell."""
        nodes = [a for stretch in component.stretches for a in (stretch.alpha_a, stretch.alpha_b)]
        if min(abs(alpha - node) for node in nodes) <= MARGIN * length:
            return None
        found = []
        for a, b, first, last in component.stretches:
            if min(first, last) < alpha < max(first, last):
                s = brentq(
                    lambda x: float(self.alpha(np.array([x]))[0]) - alpha,
                    a,
                    b,
                    xtol=4 * EPS * (1 + abs(a)),
                )
                if self._is_uncertain(s, a, b, length):
                    return None
                found.append(self.z(s))
        return found

    def _is_uncertain(self, s: float, a: float, b: float, length: float) -> bool:
        """Tell whether rounding in alpha moves z by more than the tolerance over the guard."""
        h = 1e-6 * (b - a)
        x, y = max(s - h, a), min(s + h, b)
        rise = abs(float(np.diff(self.alpha(np.array([x, y])))[0]))
        moves = np.abs(self.z(y) - self.z(x)).max() / (1.0 + np.abs(self.z(s)).max())
        return bool(moves * self.noise * GUARD * max(1.0, length) > TOLERANCE * rise)


def _turns(values: np.ndarray) -> np.ndarray:
    """Return the indices of the local minima of sampled values."""
    inner = values[1:-1]
    return 1 + np.flatnonzero((inner <= values[:-2]) & (inner < values[2:]))


def _crossings(f: Callable[[float], float], s: np.ndarray, value: np.ndarray) -> list[float]:
    """Return the zeros of f, of which samples are given, but for both ends."""
    found = [float(x) for x in s[1:-1][value[1:-1] == 0.0]]
    changes = np.flatnonzero(value[:-1] * value[1:] < 0.0)
    found.extend(brentq(f, s[i], s[i + 1], xtol=4 * EPS * (1 + abs(s[i]))) for i in changes)
    return found


def _extreme(f: Callable[[float], float], a: float, b: float, sign: float) -> tuple[float, float]:
    """Return place and value of the minimum (sign -1) or maximum (sign 1) between a and b."""
    found = minimize_scalar(
        lambda x: -sign * f(x),
        bounds=(a, b),
        method="bounded",
        options={"xatol": 1e-13 * (1 + abs(a))},
    )
    return float(found.x), -sign * float(found.fun)
