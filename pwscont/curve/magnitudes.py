"""Typical magnitudes of the unknowns, from H and from solutions.

Before a solution is known (:func:`rough_magnitudes`), the magnitude of an unknown is the change by
which H changes by the terms of H. H is evaluated for changes of all sizes, because H may be flat or
singular at a point; if unknowns are many, one Newton step tells, in less time. If H oscillates, as
tan(z), the size by which H changes a little is found first, and larger sizes in turn. Equations
with alpha come first: the constant of another equation may be a small saturation current. At a
solution that stays for all alpha no term is left, and the change by which H bends is taken.

Solutions (:func:`magnitudes_of`) tell the sizes of the unknowns that move; an unknown at rest may
rest at a bound. Next to a fold dz/dalpha is large, so the smallest of several solutions counts if
unknowns are many; an unknown that is tiny beside the largest, at the end of a chain, has no size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from itertools import islice, product
from typing import final

import numpy as np

from pwscont.basics.arrays import (
    Array,
    Matrix,
    are_finite,
    dense,
    generic,
    is_anywhere,
    joined,
    largest,
    power_of_two,
    smallest,
)
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.basics.rounding import CONFIDENCE, HALF_DIGITS
from pwscont.curve.error_samples import Found, magnitude
from pwscont.curve.metric import Metric, Range
from pwscont.linear.factorise import balanced, balanced_columns, bordered, entry_sizes, last_unit
from pwscont.system.box import Box
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem

#: Changes of an unknown, in typical magnitudes, at which H is compared with the linear part of H.
OUTWARDS = 4.0 ** np.arange(25)
#: H is clearly nonlinear if the rest is more than this part of the linear change, and of the change
#: over a typical magnitude.
BENDS = 0.5
#: A power by which H grows is steady if the power changes by less than this, so many changes long.
STEADY, AS_LONG = 0.1, 8
#: By what factor reaches beyond a reach grow.
FARTHER = 16.0
#: Magnitudes that differ by no more than this factor are alike.
ALIKE = 4.0
#: Magnitudes found from 1 / ALIKE to this one are taken for one.
MOST = 2.0
#: Sizes that are tried: powers of this base up to this one, and down to its negative; up to others
#: only where none of these is right, because bisection goes astray along functions such as tan(z),
#: and H may overflow.
BASE, POWERS, MORE_POWERS = 2.0**0.25, 512, (768, 1024, 1536)
#: What part of its terms a row is seen to change by: by all of them sin(z) would hardly ever do.
PART = 0.5
#: Parts that are looked for near LITTLE, where H oscillates or levels off.
PARTS = (PART, 0.5 * PART, 0.25 * PART)
#: What part of the change of a row two changes in proportion may differ by.
BENT = 0.25
#: A change that is rounding vanishes at this part of the step. Bends that are followed by straight
#: parts are looked for at every eighth power, a factor of 4.
MERE, STRIDE = 2.0**-12, 8
#: A little of the terms; and so many powers less than what PART of them needs, by 10,000, not even
#: a little would do if H were straight. If LEVEL does, H levels off, and rounding may reach PART.
LITTLE, FAR_BELOW, LEVEL = 0.001, 53, 0.99 * PART
#: A period in typical magnitudes: that of the sine.
PERIOD = 2.0 * np.pi
#: Where in the interval H is asked: at both ends, and where no function vanishes by design.
PLACES = (0.0, 0.381966, 1.0)
#: A row that changes by less than this part of itself says that the interval is short.
SHORT = 1e-4
#: Most unknowns whose sizes are told by more than a single Newton step.
MANY = 32
#: Sizes that differ by more than this factor are compared with Newton steps, and are too small if
#: all steps are longer by the second factor.
FAR_APART, FAR_BEYOND = 1e6, 1e3
#: Among many unknowns, an unknown smaller than this part of the largest, in units in which columns
#: of the Jacobian are balanced, is not measured by its own size.
TAIL = 1e-3
#: An unknown smaller than this part of the largest is zero in any units, and has no size.
VANISHED = 1e-30


def rounded_to_one(sizes: Array) -> Array:
    """Return magnitudes, rounded to 1 where a magnitude is close to 1."""
    close = (sizes >= 1.0 / ALIKE) & (sizes <= MOST)
    return np.where(close, 1.0, np.maximum(sizes, VANISHED * sizes.max()))


def are_alike(sizes: Array, others: Array) -> bool:
    """Tell whether magnitudes differ by no more than a factor."""
    return bool(((sizes <= ALIKE * others) & (others <= ALIKE * sizes)).all())


# -- before any solution is known ------------------------------------------------------------


@np.errstate(all="ignore")  # trial points may lie where H cannot be computed
def rough_magnitudes(system: PiecewiseSystem, interval: Range, z: Array) -> Array:
    """Return magnitudes from the terms of H around a point, shape (n,), one where H says nothing.

    ``system`` is fitted to the interval.
    """
    lo, hi = interval
    alphas = [(1.0 - place) * lo + place * hi for place in PLACES]  # exact at both ends
    if system.size > MANY and system.knows_jacobian:
        return _by_newton(system, alphas, z)
    if isinstance(system, PiecewiseLinearSystem) and system.size <= MANY:
        return _by_coefficients(system, interval)
    box = Box.of(system)
    z = box.inside(np.where(np.abs(z) > VANISHED * largest(np.abs(z)), z, 0.0))
    probe = _Probe(system, alphas, z)
    probe.leave_out_jumps()  # as of (2 + alpha)^z at z = 0, alpha = -2
    terms, others = _finite(np.ptp(probe.here, axis=0)), _finite(np.abs(probe.here).max(axis=0))
    for j in np.flatnonzero(z).tolist():  # at a solution terms cancel
        others = reduce(np.maximum, probe.changes(j, abs(float(z[j]))), others)
    terms = np.where((terms > 0.0) & (terms < SHORT * others), others, terms)
    most_of = box.period / PERIOD  # a periodic unknown has this size, whatever H is
    sizes = np.where(np.isfinite(most_of), most_of, 0.0)
    most, may_bend = np.zeros((system.size, system.size)), True
    for number in range(system.size + 2):
        unknown = np.flatnonzero(sizes == 0.0).tolist()
        for j in unknown:
            check_budget()
            sizes[j] = probe.reach(j, terms)
        if number and not sizes[unknown].any():
            if not may_bend:
                break
            may_bend = False
            sizes[unknown] = [probe.bend(way) for way in np.eye(system.size)[unknown]]
            sizes = sizes if sizes.any() else probe.bends()
        for j in unknown if number else range(system.size):
            most[:, j] = reduce(np.maximum, probe.changes(j, sizes[j]))
        if sizes.all():
            break
        terms = np.maximum(terms, np.maximum(others, most.max(axis=1)))
    sizes = np.where(sizes > 0.0, sizes, np.minimum(1.0, box.upper - box.lower))
    if largest(sizes) > FAR_APART * smallest(sizes):
        sizes = np.maximum(sizes, _least_steps(system, probe.alphas, sizes))
    return np.minimum(sizes, most_of)


@final
class _Probe:
    """H at a point and at a few alphas, and how H changes if the unknowns change."""

    def __init__(self, system: PiecewiseSystem, alphas: Sequence[float], z: Array) -> None:
        self._system, self._box, self._z = system, Box.of(system), z
        self.alphas = alphas
        self.here = [_residual(system, z, alpha) for alpha in alphas]

    def leave_out_jumps(self) -> None:
        """Leave out alphas at which H changes as much as H itself, however little z does.

        If H does so at all alphas, all stay: another unit of the unknowns may be the cause.
        """
        sizes, kept = _finite(np.abs(self.here).max(axis=0)), list[int]()
        change = BASE ** -MORE_POWERS[-1] * generic(len(self._z))
        for i, (alpha, before) in enumerate(zip(self.alphas, self.here, strict=True)):
            beside = (self._at(alpha, self._z + way) for way in (change, -change))
            jumps = (_finite(np.abs(values - before)) >= PART * sizes for values in beside)
            if not any(jump[sizes > 0.0].any() for jump in jumps):
                kept.append(i)
        if kept:
            self.alphas, self.here = [self.alphas[i] for i in kept], [self.here[i] for i in kept]

    def changes(self, j: int, size: float) -> Iterator[Array]:
        """Yield by how much each row changes if z_j grows or shrinks by a size, at each alpha."""
        lower, upper = self._box.lower.item(j), self._box.upper.item(j)
        for before, alpha in zip(self.here, self.alphas, strict=True):
            for change in (size, -size):
                moved = self._z.copy()
                moved[j] = min(max(moved.item(j) + change, lower), upper)
                yield _finite(np.abs(_residual(self._system, moved, alpha) - before))

    def reach(self, j: int, terms: Array) -> float:
        """Return by how much z_j must change for a row to change by its terms, 0 if none does."""
        rows = np.flatnonzero(terms)

        def is_enough(power: int, part: float = PART) -> bool:
            least = part * terms[rows]
            changes = self.changes(j, BASE**power)
            return any(is_anywhere(change[rows] >= least) for change in changes)

        high = _first(is_enough, -POWERS, POWERS) if rows.size else POWERS
        if high == POWERS:
            most = next(filter(is_enough, MORE_POWERS if rows.size else ()), None)
            if most is None:
                return 0.0
            high = _first(is_enough, POWERS, most)
        elif high == 1 - POWERS:
            high = _first(is_enough, -MORE_POWERS[-1], high)
        if is_enough(high - FAR_BELOW, LITTLE):
            small = _first(lambda power: is_enough(power, LITTLE), -POWERS, high)
            near = range(small, min(small + FAR_BELOW, high), 2)
            first = 1 if is_enough(high - FAR_BELOW, LEVEL) else 0
            parts = [part for part in PARTS[first:] if not is_enough(-POWERS, part)]  # no jump of H
            found = (power for part in parts for power in near if is_enough(power, part))
            high = next(found, high)
        return float(BASE**high / PART)

    def bends(self) -> Array:
        """Return sizes from the bend of H if all unknowns change, zero if H is straight.

        Along one unknown alone a product of two, as of predator and prey, is straight. In general
        ways weak parts of H, such as a load that buckles a chain, hide behind strong ones: the way
        along which H changes least comes next.
        """
        system, z, alpha = self._system, self._z, self.alphas[len(self.alphas) // 2]
        jacobian = jacobian_at(system, z, alpha, system.character(z, alpha))
        entries = entry_sizes(jacobian)[:, :-1]
        unit, way = power_of_two(balanced(entries, system.size)[0]), generic(system.size)
        if step := self.bend(unit * way):
            return step * unit
        factor = bordered(jacobian, last_unit(system.size + 1), np.append(unit, 1.0))
        rows = entries @ unit
        for _ in range(0 if factor.is_singular() else 2):  # inverse iteration
            found = _finite(factor.solve(joined(rows * way, 0.0))[:-1]) / unit
            way = found / largest(np.abs(found)) if found.any() else way
        return unit * self.bend(unit * way)

    def bend(self, way: Array) -> float:
        """Return the step along a way at which H is clearly not in proportion to it, 0 if none.

        H has no terms at a solution that stays for all alpha, such as z = 0: only bends tell the
        units. The longest step of all alphas counts, because at a branch point H is nothing but
        bent.
        """

        def bend(alpha: float, before: Array) -> float:
            def changes(step: float) -> Array:
                ways = (step * way, -step * way)
                return np.array([self._at(alpha, self._z + s) - before for s in ways])

            def is_bent(power: int) -> bool:
                step = BASE**power
                once, twice, little = changes(step), changes(2.0 * step), changes(MERE * step)
                bent = (np.abs(twice - grows * once) > BENT * np.abs(twice)) & (little != 0.0)
                return is_anywhere(bent.ravel()) or not np.isfinite(twice).all(axis=1).any()

            once, twice = changes(BASE**-POWERS), changes(2.0 * BASE**-POWERS)
            grows = np.where(once != 0.0, twice / once, 2.0)  # 4 for a product: no unit either
            power, lower = POWERS, [POWERS]
            while lower and lower[0] > -POWERS:  # bisection goes astray along sin(z)
                power = _first(is_bent, -POWERS, lower[0])
                beneath = range(power - STRIDE, power - FAR_BELOW, -STRIDE)
                lower = list(islice(filter(is_bent, beneath), 1))
            if power == POWERS and alpha == self.alphas[len(self.alphas) // 2]:
                # z - tanh(z): straight far away
                power = next(filter(is_bent, range(POWERS, -POWERS, -STRIDE)), POWERS)
                power = _first(is_bent, -POWERS, power)
            return float(BASE**power / PART) if 1 - POWERS < power < POWERS else 0.0

        return max(map(bend, self.alphas, self.here))

    def _at(self, alpha: float, z: Array) -> Array:
        """Return H at the point within the bounds of the unknowns that is nearest to z."""
        return _residual(self._system, self._box.inside(z), alpha)


def _least_steps(system: PiecewiseSystem, alphas: Sequence[float], sizes: Array) -> Array:
    """Return the least Newton steps from several points, zero where not far beyond sizes.

    In a fast reaction an unknown seems tiny, because a little of the unknown changes each row a
    lot: only sums of rows tell the size of the unknown.
    """
    least, box = np.full(len(sizes), np.inf), Box.of(system)
    for shift, alpha in product((0.0, 1.0, 2.0), alphas):
        z = box.inside(2.0 * sizes * generic(len(sizes), shift))
        jacobian = dense(jacobian_at(system, z, alpha, system.character(z, alpha)))
        factor = bordered(jacobian, last_unit(len(z) + 1), balanced_columns(jacobian))
        if factor.is_singular():
            return np.zeros(len(sizes))
        step = factor.solve(joined(_residual(system, z, alpha), 0.0))[:-1]
        least = np.fmin(least, np.abs(step))
    return np.where(np.isfinite(least) & (least > FAR_BEYOND * sizes), least, 0.0)


def _first(holds: Callable[[int], bool], low: int, high: int) -> int:
    """Return the first power at which a condition holds, by bisection."""
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _residual(system: PiecewiseSystem, z: Array, alpha: float) -> Array:
    """Return H, nan where the tests do not tell the cell."""
    tests = np.asarray(system.test_functions(z, alpha), dtype=float)
    if len(tests) and not are_finite(tests):
        return np.full(len(z), np.nan)
    return residual_at(system, z, alpha, Character.of(tests))


def _finite(sizes: Array) -> Array:
    """Return sizes; sizes that are not finite say nothing and become zero."""
    return sizes if are_finite(sizes.ravel()) else np.where(np.isfinite(sizes), sizes, 0.0)


def _by_coefficients(system: PiecewiseLinearSystem, interval: Range) -> Array:
    """Return the magnitudes that balance the rows of some cells.

    Another unit of an unknown or of an equation changes nothing else. The cells are those of all
    positive and of all negative tests; where some unknown stands in no row of these, as the
    unknown in ``clip(z)`` does, cells with one other sign are added.
    """
    count = len(system.test_functions(np.zeros(system.size), interval[0]))
    cells = [Character((sign,) * count) for sign in (True, False)]
    terms = np.vstack([_terms(system, interval, cell) for cell in cells])
    for cell in (cell.flip(test) for test in range(count) for cell in cells):
        if terms[:, : system.size].any(axis=0).all():
            break
        terms = np.vstack([terms, _terms(system, interval, cell)])
    return balanced(terms, system.size)[0]


def _terms(system: PiecewiseLinearSystem, interval: Range, cell: Character) -> Array:
    """Return coefficients of z and values at z = 0 of a cell, shape (n, n + 2), sizes only."""
    zero = np.zeros(system.size)
    jacobian = dense(jacobian_at(system, zero, interval[0], cell))[:, :-1]
    values = [residual_at(system, zero, alpha, cell) for alpha in interval]
    return _finite(np.abs(np.column_stack([jacobian, *values])))


def _by_newton(system: PiecewiseSystem, alphas: Sequence[float], z: Array) -> Array:
    """Return the sizes of the Newton steps at both ends, the largest for unknowns that stay.

    Where the load vanishes at both ends, as sin(pi alpha) does, the step inside is taken.
    """
    before = [_residual(system, z, alpha) for alpha in alphas]
    sizes = [largest(np.abs(values)) for values in before]
    asked = (1,) if max(sizes[0], sizes[2]) <= HALF_DIGITS * sizes[1] else (0, 2)
    steps = np.zeros((len(asked), system.size))
    for i, place in enumerate(asked):
        jacobian = jacobian_at(system, z, alphas[place], system.character(z, alphas[place]))
        factor = bordered(jacobian, last_unit(system.size + 1), balanced_columns(jacobian))
        if not factor.is_singular():
            steps[i] = _finite(factor.solve(joined(before[place], 0.0))[:-1])
    probe = _Probe(system, alphas, z - steps[0])
    here = [largest(np.abs(values)) for values in probe.here]
    if all(after <= HALF_DIGITS * size for after, size in zip(here, sizes, strict=True)):
        found = probe.bends()  # a solution of all alphas
    else:
        found = _without_tails(np.abs(steps).max(axis=0), jacobian)
    return np.where(found > 0.0, found, 1.0)


def _without_tails(sizes: Array, jacobian: Matrix) -> Array:
    """Return sizes of many unknowns, none tiny beside the largest where columns are balanced."""
    balanced = balanced_columns(jacobian)[:-1]
    return np.maximum(sizes, _finite(TAIL * balanced * float((sizes / balanced).max())))


@np.errstate(all="ignore")
def nonlinear_reach(system: PiecewiseSystem, metric: Metric) -> Array:
    """Return how far from the centre each unknown goes until H is clearly nonlinear, shape (n,).

    Where a load is weak, other branches are many magnitudes away: z (z - 1) = alpha / 1000. At
    least the typical magnitude; no more if unknowns are many. Unknowns in which H is linear as far
    as seen follow the others.
    """
    scale, alpha, box = metric.scale[:-1], sum(metric.interval) / 2.0, Box.of(system)
    z = box.centre(scale)
    before, factors = _residual(system, z, alpha), np.zeros(system.size)
    if system.size > MANY or not np.isfinite(before).all():
        return scale.copy()
    jacobian = dense(jacobian_at(system, z, alpha, system.character(z, alpha)))[:, :-1]
    terms = (np.abs(jacobian) * scale).max(axis=1)

    def bends(j: int, change: float) -> bool:
        check_budget()
        moved, linear = z.copy(), change * jacobian[:, j]
        moved[j] += change
        rest = np.abs(_residual(system, moved, alpha) - before - linear)
        is_inside = box.lower[j] <= moved[j] <= box.upper[j]
        return is_inside and bool((rest > BENDS * np.maximum(np.abs(linear), terms)).any())

    for j, size in enumerate(scale):
        ways = (out for out in OUTWARDS if bends(j, out * size) or bends(j, -out * size))
        factors[j] = next(ways, 0.0)
    return scale * np.where(factors > 0.0, factors, max(1.0, factors.max()))


@np.errstate(all="ignore")
def farther_reaches(system: PiecewiseSystem, metric: Metric, reach: Array) -> list[Array]:
    """Return reaches beyond a reach, shape (n,) each, as far as the growth of H still changes.

    Up to z = 1000, (z - 1) (z - 1e3) (z - 1e5) grows as z, then as z^2, and from 1e5 on as z^3:
    where a power of growth ends there is room for another sheet. Unknowns are moved one by one, and
    all together.
    """
    if system.size > MANY:
        return []
    box, alpha, most = Box.of(system), sum(metric.interval) / 2.0, 1.0
    z, ways = box.centre(metric.scale[:-1]), np.vstack([np.eye(len(reach)), generic(len(reach))])
    before = _residual(system, z, alpha)
    for way in np.vstack([ways, -ways]) * reach:
        check_budget()
        moved = [_residual(system, box.inside(z + out * way), alpha) - before for out in OUTWARDS]
        powers = np.diff(np.log(np.abs(moved)), axis=0) / np.log(OUTWARDS[1])
        changes = np.abs(powers - powers[-1]) >= STEADY
        steady = np.isfinite(powers[-1]) & ~changes[-AS_LONG:].any(axis=0)
        last = np.flatnonzero((changes & steady).any(axis=1))
        most = max(most, OUTWARDS[last[-1] + 1] if len(last) else 1.0)
    return [FARTHER**k * reach for k in range(1, 1 + int(np.log(most) / np.log(FARTHER)))]


# -- from solutions ----------------------------------------------------------------------------


@np.errstate(all="ignore")
def magnitudes_of(system: PiecewiseSystem, metric: Metric, found: Sequence[Found]) -> Array:
    """Return magnitudes from solutions and the directions of the curves there, shape (n,).

    ``found``: one solution at least. The magnitudes of ``metric`` stay where nothing is seen.
    """
    sizes, slopes = np.zeros(system.size), np.full(system.size, np.inf)
    for x, error in found:
        jacobian = jacobian_at(system, x[:-1], float(x[-1]), system.character(x[:-1], float(x[-1])))
        factor = bordered(jacobian, last_unit(len(x)), metric.binary)
        own = (np.abs(x) * (np.abs(x) > CONFIDENCE * magnitude(x, np.atleast_2d(error))))[:-1]
        slope = np.full(system.size, np.inf)
        if not factor.is_singular():
            slope = metric.width * np.abs(factor.solve(last_unit(len(x))))[:-1]
        # a magnitude far below a solution would leave hardly half of the digits
        tells = (slope > HALF_DIGITS * own) | (metric.scale[:-1] < HALF_DIGITS * own)
        sizes = np.maximum(sizes, np.where(tells, own, 0.0))
        slopes = np.where(slope > HALF_DIGITS * own, np.minimum(slopes, slope), slopes)
    if system.size > MANY:
        sizes = _without_tails(np.maximum(sizes, _finite(slopes)), jacobian)
    else:
        sizes = np.maximum(sizes, metric.scale[:-1])
    return np.where(sizes > 0.0, sizes, metric.scale[:-1])
