"""The search from many rough starts in a single run: pursuits of solutions.

Points are in typical magnitudes, y = (z, alpha) / scale, and a pursuit is Newton's method without
error estimates: each point found is corrected with all care. Most starts would only repeat known
solutions: the solutions of all known branches are deflated away (Farrell, Birkisson and Funke
2015). A solution found is compared with all known solutions, because solutions beside a fold are
closer together than deflation resolves.

A deflated iteration without a solution at this alpha creeps to a minimum of the merit, and is given
up. The minimum often lies beside a fold of the branch looked for: the pursuit goes on from there
with alpha free, by steps of least length (Gauss and Newton). Functions that saturate make endless
steps where H is nearly flat: each step is limited, a pursuit that goes too far is given up, and a
point where H is nearly flat has no certain digit, and is no solution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, are_finite, generic, product
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.outcome import Failure
from pwscont.basics.rounding import CONVERGED, EPS
from pwscont.curve.curve import LEAN, Curve
from pwscont.curve.error_samples import Found, has_digits, is_inside
from pwscont.curve.metric import Metric, deflation, stretch
from pwscont.curve.newton import newton
from pwscont.curve.semismooth import semismooth_newton
from pwscont.enumeration.continua import is_one_of_many, underflows
from pwscont.linear.factorise import last_unit
from pwscont.search.search import KnownBranches
from pwscont.system.abilities import completed, shown_size
from pwscont.system.box import Box
from pwscont.system.contract import NOT_ON_CHANCE, equations_in_magnitudes, residual_at
from pwscont.system.selection import Selection
from pwscont.system.system import PiecewiseSystem
from pwscont.system.values import broken
from pwscont.transitions.ends import settled, solves

#: Most iterations at fixed alpha, and again with alpha free.
MOST_PURSUIT_STEPS = 40
#: Most halvings of a step that does not reduce the merit.
MOST_STEP_HALVINGS = 5
#: Least fall of the merit, as a part of the fall that a Newton step, as far as taken, promises.
DESCENT = 0.05
#: Longest step of a pursuit that has arrived, as a part of 1 plus the length of the point.
LAST_STEP = 1e-6
#: Longest step, as a multiple of 1 plus the distance of the point from zero.
LONGEST_STEP = 4.0
#: Length of a point, in distances at which H is clearly nonlinear, from which on a pursuit has run
#: away.
RUN_AWAY = 1e5
#: Regularisation of a shortest step, as a part of the merit: steps stay finite where the Jacobian
#: is singular.
DAMPED = 1e-2
#: Most Newton iterations in a plane across a curve.
MOST_IN_PLANE = 5
#: Distance by which a point found with alpha free is moved along the curve, as a part of 1 plus the
#: length of the point, because a pursuit may have ended right beside a kink.
MOVED_ALONG = 0.01
#: Distance, in typical magnitudes, beyond which a point is far away, and the slope of alpha below
#: which alpha hardly changes there.
FAR_IN_MAGNITUDES, ALMOST = 3.0, 1e-3
#: Distance by which a point is moved aside before alpha is set free, as a part of 1 plus the length
#: of the point, because a minimum of the merit may lie where H is flat by symmetry.
MOVED_ASIDE = 1e-3
#: Distances below which two solutions, and two rough known solutions, coincide, in typical
#: magnitudes, as a part of 1 plus the length of a solution.
SAME_SOLUTION, DISTINCT = EPS**0.5, 1e-5
#: Most known branches, the nearest first, that a solution found with alpha free is compared with.
MOST_NEAR = 16
#: Most solutions from a start.
MOST_FROM_ONE = 16
#: Most solutions at an end, and most between the ends: an equation such as tan(z) = alpha has
#: infinitely many branches. Between the ends fewer are enough if an end has more.
MOST_FOUND, FEW_MORE = 48, 12
#: Starts are spread over a typical magnitude, over WIDER_BY times as much, and so on for SPREADS
#: widths in turn.
WIDER_BY, SPREADS = 4.0, 3
#: Largest distance from zero, in typical magnitudes, over which starts are spread at first: each
#: branch of a periodic function would lead farther out.
FARTHEST_START = 1e3
#: Multiples of known solutions from which pursuits start, since other solutions are often alike in
#: shape, and the most known solutions that are multiplied.
MULTIPLES, MOST_SHAPES = (-1.0, 4.0, 16.0), 8
#: Most interfaces of a known solution beyond which a solution is looked for.
MOST_NEXT_DOOR = 4
#: Number of values of a single unknown at which the equation is evaluated, within LINE_WIDTH times
#: the known magnitude and again farther out.
ON_LINE, LINE_WIDTH = 64, 1.5
#: Number of such values still farther out, on each side, each WIDER_BY times as far as the last,
#: and by what factor the equation must have grown there.
FARTHER_PLACES, GROWN = 8, 2.0
#: Distance from a known solution, as a part of the known magnitude plus the size of the solution,
#: from which on a sign change is another solution.
BESIDE_KNOWN = 1e-6
#: Largest correction of a point that a pursuit found, as a part of 1 plus the length of the point.
MOST_CORRECTED = 1e-3
#: Most Newton iterations of such a correction, and most cells that are tried: a root of a selection
#: is a solution only in the cell of the selection.
MOST_STANDING, MOST_CELLS = 8, 4


@final
class Pursuit:
    """Pursuits of solutions beside known branches; starts ``reach`` so far."""

    def __init__(
        self, system: PiecewiseSystem, metric: Metric, known: KnownBranches, reach: Array
    ) -> None:
        self.system, self.metric, self._scale, self.known = system, metric, metric.scale, known
        self._ends = metric.interval[0] / metric.width, metric.interval[1] / metric.width
        self._box, self._shown = Box.of(system), shown_size(system)
        self._roots: tuple[float, dict[bytes, Array]] = math.nan, {}  # by places beside the roots
        self.reach = reach  # grows with the reach of known branches
        self._farthest = RUN_AWAY * float((self.reach / metric.scale[:-1]).max())
        self.filled = 0  # number of slices at which one of infinitely many solutions was found

    def at(self, alpha: float, guesses: Iterable[Array], *, freely: bool = True) -> Iterator[Found]:
        """Yield the new solutions to which starts at an alpha lead, one of infinitely many.

        ``freely``: whether alpha is free where a pursuit stalls.
        """
        here, known = list[Array](), self.solutions(alpha)
        zeros = self._sign_changes(alpha, known)
        shapes = known[:MOST_SHAPES] if self._shown > 1 else []
        beside = chain.from_iterable(self._next_door(x, alpha) for x in shapes)
        multiples = (self._box.inside(by * x[:-1]) for x in shapes for by in MULTIPLES)
        for number, rough in enumerate(chain(zeros, beside, multiples, guesses)):
            if len(here) >= MOST_FOUND:
                self.known.leave_off()
                return
            z = completed(self.system, rough[: self._shown], alpha)
            y = np.append(z, alpha) / self._scale
            for _ in range(MOST_FROM_ONE):
                apart: list[Array] = []  # a solution deflated away twice attracts from afar
                for x in known:
                    apart += [x] if is_new(self.metric, x, apart, DISTINCT) else []
                reached, arrived = self._at_alpha(y, apart)
                found = self._corrected(reached, alpha) if arrived else None
                if not (found and is_new(self.metric, found[0], known)):
                    break
                is_many = is_one_of_many(self.system, self.metric, found[0])
                if is_many and underflows(self.system, self.metric, found[0]):
                    break
                self.filled += is_many
                yield found
                if is_many:
                    return
                here.append(found[0])
                known = [*here, *self.solutions(alpha)]
            if freely and not arrived and (found := self._freely(reached, number)):
                yield found
                known = [*here, *self.solutions(alpha)]

    def guess(self, number: int) -> Array:
        """Return the state of a start: such points fill space evenly, with heavy tails."""
        root, size = 2.0, self.system.size  # a sequence that fills (-1, 1)^n (Roberts 2018)
        for _ in range(40):
            root = (1.0 + root) ** (1.0 / (size + 1))
        steps = root ** -np.arange(1.0, size + 1.0)
        even = 2.0 * ((0.5 + (number + 1) * steps) % 1.0) - 1.0
        farther = WIDER_BY ** (number % SPREADS)
        return self._box.guess(_with_tails(even), 0.5 * even, farther * self.reach)

    def _sign_changes(self, alpha: float, known: list[Array]) -> Iterator[Array]:
        """Yield sign changes of an equation in a single unknown, except at known solutions."""
        system, reach, box = self.system, float(self.reach[0]), self._box
        if self._shown != 1:
            return
        from scipy.optimize import bisect  # noqa: PLC0415  importing takes as long as all else

        def equation(z: float) -> float:
            full = completed(system, np.array([z]), alpha)
            return float(residual_at(system, full, alpha, system.character(full, alpha))[0])

        even = np.linspace(-1.0, 1.0, ON_LINE + 2)[1:-1]
        near = np.concatenate([LINE_WIDTH * even, wide := WIDER_BY * _with_tails(even)])
        farther = wide[-1] * WIDER_BY ** np.arange(1, FARTHER_PLACES + 1)
        own = np.array([x[0] for x in known])  # apart from these a sign change is another solution
        apart = BESIDE_KNOWN * (reach + np.abs(own))
        each = [reach * near, reach * farther, -reach * farther, own - apart, own + apart]
        places = np.unique(np.clip(np.concatenate(each), box.lower[0], box.upper[0]))
        values = np.array([equation(z) for z in places])
        # farther out a function that grows has few zeros, and any other function too many
        is_far, sizes = np.abs(places) > reach * wide[-1], np.abs(values)
        grows = sizes > GROWN * sizes.max(where=~is_far & np.isfinite(sizes), initial=0.0)
        grown = np.logical_or.accumulate  # has the equation grown here or farther out?
        grows = np.where(places < 0.0, grown(grows), grown(grows[::-1])[::-1])
        signs = np.where(is_far & ~grows, 0.0, np.sign(values))
        is_known = np.histogram(own, places)[0] > 0
        for i in np.flatnonzero((signs[1:] * signs[:-1] < 0.0) & ~is_known):
            a, b = places[i : i + 2]
            if np.sign([equation(a), equation(b)]).tolist() != signs[i : i + 2].tolist():
                words = f"changed its sign at z = {a} or {b}, alpha = {alpha}: {NOT_ON_CHANCE}"
                raise broken(system, "residual", words)
            z = bisect(lambda z: np.nan_to_num(equation(z)), a, b, xtol=EPS * reach)
            full = completed(system, np.array([z]), alpha)
            is_pole = abs(equation(z)) > sizes[i : i + 2].max()
            if not is_pole and is_new(self.metric, np.append(full, alpha), known):
                yield full

    def _freely(self, y: Array, number: int) -> Found | None:
        """Return the new solution to which a free alpha leads from where a pursuit stalled."""
        metric, (lo, hi) = self.metric, self.metric.interval
        aside = y + self._slack(y, MOVED_ASIDE) * generic(len(y), float(number))
        free, arrived = self._pursued(aside, self._freed_step, ())
        if not (arrived and lo <= free[-1] * metric.width <= hi):
            return None
        if (found := self._standing(self._along(free))) is None:
            return None
        x, alpha = found[0], float(found[0][-1])
        near = self.known.in_cells_at(alpha)
        near.sort(key=lambda each: metric.norm(metric.difference(each[1], x)))  # most are known
        roots = (self._known_root(*each, alpha) for each in near[:MOST_NEAR])
        return found if all(is_new(metric, x, [root], DISTINCT) for root in roots) else None

    def _standing(self, y: Array) -> Found | None:
        """Return the exact solution near a rough solution, None for a start that ran away."""
        metric, x = self.metric, y * self._scale
        direction = self._direction(y)
        if direction is None or self._is_flat(y, direction):
            return None
        row, near = metric.covector(direction * metric.scale), x
        for _ in range(MOST_CELLS):
            own = Selection(self.system, self.system.character(near[:-1], float(near[-1])))
            curve = Curve(own, metric)
            root = newton(curve, lambda at: (float(row.dot(at - x)), row), near, MOST_STANDING)
            if isinstance(root, Failure):
                return None
            near = root.x
            rounding = CONVERGED * product(abs(own.test_gradients(near)), metric.sizes(near))
            if (own.tests(near) >= -rounding).all():
                return self._usable((near, root.error[np.newaxis]), x)
        return None

    def solutions(self, alpha: float) -> list[Array]:
        """Return the known solutions at an alpha."""
        roots = self._roots[1] if self._roots[0] == alpha else {}
        near = {x.tobytes(): (cell, x) for cell, x in self.known.in_cells_at(alpha)}
        new = {key: self._known_root(*near[key], alpha) for key in near if key not in roots}
        self._roots = alpha, roots | new  # most branches were known when last asked
        return [self._roots[1][key] for key in near]

    def _known_root(self, character: Character, x: Array, alpha: float) -> Array:
        """Return the known solution near a point of a known branch; the reach reaches there."""
        reach = np.minimum(np.abs(x[:-1]), FARTHEST_START * self._scale[:-1])
        self.reach = np.maximum(self.reach, reach)
        root = self._in_cell(character, x, alpha)
        if root is None:  # large constants that cancel keep Newton from converging
            y, arrived = self._at_alpha(x / self._scale, ())
            root = y * self._scale if arrived else x
        return root

    def _in_cell(self, character: Character, x: Array, alpha: float) -> Array | None:
        """Return the root of a selection at an alpha to which Newton leads, None for a failure."""
        curve, row = Curve(Selection(self.system, character), self.metric), last_unit(len(x))
        root = newton(curve, lambda at: (float(at[-1]) - alpha, row), x, MOST_STANDING)
        return None if isinstance(root, Failure) else root.x

    def _next_door(self, x: Array, alpha: float) -> Iterator[Array]:
        """Yield the solutions in the cells beyond the nearest interfaces of a solution.

        Two solutions on both sides of a kink may be closer together than deflation resolves.
        """
        own = Selection(self.system, self.system.character(x[:-1], alpha))
        slopes = product(abs(own.test_gradients(x)), self._scale)
        nearest = np.argsort(np.abs(own.tests(x)) / slopes)
        for i in nearest[:MOST_NEXT_DOOR]:
            beyond = own.character.flip(i)
            root = self._in_cell(beyond, x, alpha)
            if root is not None and self.system.character(root[:-1], alpha) == beyond:
                yield root[:-1]

    def solution_near(self, z: Array, alpha: float) -> Found | None:
        """Return the solution to which Newton leads from a state, None if not found."""
        y, arrived = self._at_alpha(np.append(z, alpha) / self._scale, ())
        return self._corrected(y, alpha) if arrived else None

    def _corrected(self, y: Array, alpha: float) -> Found | None:
        x = y * self._scale
        found = solution_from(self.system, self.metric, x[:-1], alpha, ())
        return found and self._usable(found, x)

    def _usable(self, found: Found, rough: Array) -> Found | None:
        """Return a solution with digits, inside the bounds and near a rough solution, else None."""
        metric, (x, error) = self.metric, found
        if metric.norm(metric.difference(x, rough)) > metric.slack(rough, MOST_CORRECTED):
            return None
        x[:-1] = self._box.wrapped(x[:-1])
        error, scale = np.atleast_2d(error), metric.scale
        if not has_digits(x, error, scale) or not is_inside(self._box, x, error, scale):
            return None
        return (x, error) if solves(self.system, metric, x) else None

    # -- pursuits by rough Newton steps, all in typical magnitudes ------------------------------

    def _at_alpha(self, y: Array, known: Sequence[Array]) -> tuple[Array, bool]:
        """Return where Newton at fixed alpha leads, and whether a solution is there."""

        def step_at(y: Array, residual: Array, jacobian: Array) -> Array:
            step = np.append(_newton_step(jacobian[:, :-1], residual), 0.0)
            return step * stretch(self.metric, known, y * self._scale, step * self._scale)

        return self._pursued(y, step_at, known)

    def _freed_step(self, y: Array, residual: Array, jacobian: Array) -> Array:
        """Return the step of least length to a curve, at most to the end of the interval."""
        step = _shortest_step(jacobian, residual)
        if self._ends[0] <= y[-1] + _limit(step, y) * step[-1] <= self._ends[1]:
            return step
        rise = self._ends[0 if step[-1] < 0.0 else 1] - y[-1]  # to the end that is left
        rest = residual + jacobian[:, -1] * rise
        return np.append(_newton_step(jacobian[:, :-1], rest), rise)

    def _pursued(
        self, y: Array, step_at: Callable[[Array, Array, Array], Array], known: Sequence[Array]
    ) -> tuple[Array, bool]:
        """Return where steps lead, and whether a solution is there; ``known`` are deflated away."""
        for _ in range(MOST_PURSUIT_STEPS):
            here = self._linear(y)
            if here is None or not are_finite(step := step_at(y, *here)):
                break
            if _length(step) <= self._slack(y, LAST_STEP):
                return y + step, True
            moved = self._moved(y, here[0], step, known)
            if moved is None or _length(moved[:-1]) > self._farthest:
                break
            y = moved
        return y, False

    def _across(self, y: Array, direction: Array) -> Array | None:
        """Return where Newton leads in the plane through a point normal to a direction."""
        there = y
        for _ in range(MOST_IN_PLANE):
            here = self._linear(there)
            if here is None:
                return None
            apart = self.metric.difference(there * self._scale, y * self._scale) / self._scale
            matrix, off = np.vstack([here[1], direction]), direction.dot(apart)
            step = _newton_step(matrix, np.append(here[0], off))
            if not are_finite(step):
                return None
            there = there + step
            if _length(step) <= self._slack(y, LAST_STEP):
                return there
        return None

    def _along(self, y: Array) -> Array:
        """Return another point of the curve through a point, which may be a special point."""
        direction = self._direction(y)
        if direction is None:
            return y
        for way in (direction, -direction):
            beside = y + self._slack(y, MOVED_ALONG) * way
            if not self._ends[0] <= beside[-1] <= self._ends[1]:
                continue
            found = self._across(beside, direction)
            if found is not None and self._ends[0] <= found[-1] <= self._ends[1]:
                return found
        return y

    def _direction(self, y: Array) -> Array | None:
        here = self._linear(y)
        return None if here is None else np.asarray(np.linalg.svd(here[1])[2][-1])

    def _is_flat(self, y: Array, direction: Array) -> bool:
        """Tell whether alpha hardly changes along the curve, as where a pursuit ran to infinity."""
        outwards = direction if direction.dot(y) > 0.0 else -direction
        far = _length(y[:-1]) > FAR_IN_MAGNITUDES
        least, way = (ALMOST, 0.5 * _length(y[:-1])) if far else (LEAN, MOVED_ASIDE)
        if abs(direction[-1]) > least:
            return False
        beside = self._direction(y + way * outwards)
        return beside is None or abs(beside[-1]) <= least

    def _linear(self, y: Array) -> tuple[Array, Array] | None:
        """Return scaled residual and Jacobian; None if H is not finite, or outside the interval."""
        check_budget()
        place = self._place(y)
        found = place and equations_in_magnitudes(self.system, *place, self._scale)
        if found is None:
            return None
        residual, jacobian, self._rows = found
        return residual, jacobian

    def _place(self, y: Array) -> tuple[Array, float] | None:
        x = y * self._scale
        return (x[:-1], float(x[-1])) if self.metric.admits(x) else None

    def _moved(
        self, y: Array, residual: Array, step: Array, known: Sequence[Array]
    ) -> Array | None:
        """Return the first of y + step, y + step / 2, ... that reduces the merit enough."""

        def merit(y: Array, residual: Array) -> float:
            return _length(residual) * deflation(self.metric, known, y * self._scale)

        before, part = merit(y, residual), _limit(step, y)
        for _ in range(MOST_STEP_HALVINGS):
            trial = y + part * step
            if place := self._place(trial):
                off = residual_at(self.system, *place, self.system.character(*place)) / self._rows
                if merit(trial, off) <= (1.0 - DESCENT * part) * before:
                    return trial
            part *= 0.5
        return None

    def _slack(self, y: Array, tolerance: float) -> float:
        return self.metric.slack(y * self._scale, tolerance)


def solution_from(
    system: PiecewiseSystem, metric: Metric, guess: Array, alpha: float, known: Sequence[Array]
) -> Found | None:
    """Return the solution to which semismooth Newton leads, None for a failure."""
    found = semismooth_newton(system, metric, guess, alpha, known)
    return None if isinstance(found, Failure) else settled(system, metric, found)


def is_new(metric: Metric, x: Array, known: Sequence[Array], same: float = SAME_SOLUTION) -> bool:
    """Tell whether a point is none of the known points."""
    if not len(known):
        return True
    apart = metric.difference(x, np.array(known)) / metric.scale
    return float(np.linalg.norm(apart, axis=1).min()) > metric.slack(x, same)


def _with_tails(even: Array) -> Array:
    """Return numbers between -1 and 1 spread over all numbers, ever sparser farther out."""
    return even * np.sqrt(2.0 / (1.0 - even**2))


def _newton_step(jacobian: Array, residual: Array) -> Array:
    """Return Newton's step, for a singular Jacobian the step of Levenberg and Marquardt."""
    with suppress(np.linalg.LinAlgError):
        step: Array = np.asarray(np.linalg.solve(jacobian, -residual), dtype=float)
        if are_finite(step):
            return step
    return _shortest_step(jacobian, residual)


def _shortest_step(jacobian: Array, residual: Array) -> Array:
    """Return the shortest step that solves the linear equations, regularised a little."""
    square = jacobian.dot(jacobian.T)
    square.flat[:: len(square) + 1] += DAMPED**2 * min(1.0, float(residual.dot(residual))) + EPS
    try:
        return -jacobian.T.dot(np.linalg.solve(square, residual))
    except np.linalg.LinAlgError:
        return np.full(jacobian.shape[1], np.inf)


def _limit(step: Array, y: Array) -> float:
    """Return the part of a step that is not much longer than the way from zero to the point."""
    return min(1.0, LONGEST_STEP * (1.0 + _length(y[:-1])) / max(_length(step), EPS))


def _length(y: Array) -> float:
    return math.sqrt(float(y.dot(y)))
