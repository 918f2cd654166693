"""What accepted and open boxes prove of the solutions of a formula in a box.

The number of solutions is constant on every stretch of alpha between groups of open boxes. A group
is *passed* if all solutions in its hull are proved to lie on one curve; the *turn* says how the
number changes in the hull when alpha grows: it only grows (1), only falls (-1), stays (0), or is
not known (not a number). The theorem stands on the page "Proofs".
"""

from __future__ import annotations

from typing import final

import numpy as np
from scipy.sparse.csgraph import connected_components

from pwscont.basics.arrays import Array, Signs
from pwscont.curve.metric import Range
from pwscont.graph.proved import BoxProof, Corners, CountedStretch
from pwscont.proof.interval import (
    BY_CRIVAL,
    FUNCTION_ULPS,
    MODES,
    Interval,
    chosen,
    solved_last,
    together,
)
from pwscont.proof.search import FINEST_ALPHA, Covered, Region, are_regular, covered
from pwscont.proof.tape import evaluated, with_slopes

#: How often a solution that is enclosed is enclosed anew, ever more narrowly.
NARROWED = 4
#: Most boxes that are looked at for a count, for every accepted box.
LOOKED_AT = 30
#: Parts of a stretch at which solutions are counted, in turn, until all are told apart.
PLACES = (0.5, 0.381966, 0.61803, 0.26, 0.74)
ASSUMED = (
    "assumed: a formula without state, the same for numbers and for the tape; arithmetic of "
    "IEEE 754 to nearest"
)
#: What is assumed besides where numpy evaluates the elementary functions.
ACCURATE_FUNCTIONS = (
    f"; elementary functions of numpy within {FUNCTION_ULPS:g} units in the last place"
)
#: What is assumed of classes besides.
AGREEING_SELECTIONS = "; selections of a class that agree where tests vanish"
#: Most open boxes that are put together.
MOST_GROUPED = 4000
#: Into how many parts the weights of two modes are divided.
WEIGHTS = 8


def counted_proof(region: Region, found: Covered, *, is_whole: bool = False) -> BoxProof:
    """Return what accepted and open boxes with all solutions prove.

    ``is_whole``: a proof of a part is of no use, so that nothing is counted where a box is open.
    """
    box, alpha = region.box[:-1], region.box[-1]
    hulls, passed, turns = grouped(region, found.open)
    unsaid = _united(hulls[-1], turns, FINEST_ALPHA * float(region.scale[-1]))
    interval = float(alpha.lo), float(alpha.hi)
    ends = [interval[0], *(end for lo, hi, _ in unsaid for end in (lo, hi)), interval[1]]
    pairs = zip(ends[::2], ends[1::2], strict=True) if passed.all() or not is_whole else ()
    stretches = [_counted(region, found.accepted, each) for each in pairs if each[0] < each[1]]
    opened = list(zip(hulls.lo.T[~passed], hulls.hi.T[~passed], strict=True))
    assumed = ASSUMED + ACCURATE_FUNCTIONS * (not BY_CRIVAL)
    assumed += AGREEING_SELECTIONS * any(step.name == "select" for step in region.tape.steps)
    corners = box.lo, box.hi
    return BoxProof(corners, interval, stretches, unsaid, opened, found.looked_at, assumed)


def _united(ranges: Interval, turns: Array, apart: float) -> list[tuple[float, float, float]]:
    """Return the union of ranges with turns; ranges closer than ``apart`` become one range."""
    united: list[tuple[float, float, float]] = []
    ends = (each.tolist() for each in (ranges.lo, ranges.hi, turns))
    for lo, hi, turn in sorted(zip(*ends, strict=True)):
        if united and lo <= united[-1][1] + apart:
            first, last, before = united.pop()
            both = float(np.sign(before + turn)) if before * turn >= 0.0 else np.nan
            united.append((first, max(hi, last), both))
        else:
            united.append((lo, hi, turn))
    return united


def _counted(region: Region, boxes: Interval, stretch: Range) -> CountedStretch:
    """Return a stretch with its solutions at the first place where they are told apart."""
    lo, hi = stretch
    places = [alpha for part in PLACES if lo < (alpha := lo + (hi - lo) * part) < hi]
    counted = ((alpha, enclosures_at(region, boxes, alpha)) for alpha in places)
    found = (each for each in counted if each[1] is not None)
    return CountedStretch(lo, hi, *next(found, (0.5 * (lo + hi), None)))


@np.errstate(all="ignore")
def enclosures_at(region: Region, boxes: Interval, alpha: float) -> list[Corners] | None:
    """Return an enclosure (least, largest) of every solution in accepted boxes at alpha.

    None where solutions are not enclosed, or not told apart, for certain.
    """
    boxes = boxes[:, (boxes.lo[-1] <= alpha) & (alpha <= boxes.hi[-1])]
    boxes.lo[-1] = boxes.hi[-1] = alpha

    def accepts(some: Interval, _: Interval) -> Signs:
        holds: Signs = np.all(np.isfinite(region.enclosed(some).lo), axis=0)
        return holds

    found, left, _ = covered(region, boxes, accepts, np.inf, LOOKED_AT * boxes.lo.shape[1])
    for _ in range(NARROWED):
        new = region.enclosed(found)
        found = together(np.vstack, chosen(np.isfinite(new.lo), new, found[:-1]), found[-1])
    groups = None if left.lo.size else _distinct(region, found)
    return None if groups is None else [(found.lo[:-1, i], found.hi[:-1, i]) for i in groups]


def _distinct(region: Region, found: Interval) -> list[int] | None:
    """Return one enclosure for every different solution, None where two are not told apart.

    Solutions whose enclosures do not meet are different. Two enclosures hold the same solution if H
    is injective on the hull of both.
    """
    touching = _touching(found)
    one, other = np.nonzero(np.triu(touching, 1))
    slopes = region.slopes(found[:, one].hull(found[:, other]))
    is_same = are_regular(slopes[:, :-1], region.size[:-1])
    group = connected_components(touching, directed=False)[1]
    first: list[int] = np.unique(group, return_index=True)[1].tolist()
    return first if is_same.all() else None


def _touching(boxes: Interval) -> Signs:
    """Tell which of boxes (n, k) touch which, shape (k, k)."""
    touch = np.ones((boxes.lo.shape[1],) * 2, dtype=bool)
    for lo, hi in zip(boxes.lo, boxes.hi, strict=True):
        touch &= lo <= hi[:, np.newaxis]
    return touch & touch.T


def grouped(region: Region, boxes: Interval) -> tuple[Interval, Signs, Array]:
    """Return the hulls of groups of open boxes (n + 1, k) that touch, which are passed, and turns.

    Where many boxes are open, every box is a group.
    """
    if not 0 < (number := boxes.lo.shape[1]) <= MOST_GROUPED:
        return boxes, np.zeros(number, dtype=bool), np.full(number, np.nan)
    boxes = boxes[:, np.argsort(boxes.lo[-1])]
    count, group = connected_components(_touching(boxes), directed=False)
    lo, hi = (np.full((count, len(boxes.lo)), far) for far in (np.inf, -np.inf))
    np.minimum.at(lo, group, boxes.lo.T)
    np.maximum.at(hi, group, boxes.hi.T)
    hulls = Interval(lo.T, hi.T)
    passage = _Passage(region, hulls)
    passed = passage.is_passed()
    return hulls, passed, np.where(passed, passage.turns(), np.nan)


@final
class _Passage:
    """What the derivatives in hulls of groups say of the solutions there.

    If one switch may be in two modes, the derivatives are averages of both modes with any weight.
    """

    def __init__(self, region: Region, hulls: Interval) -> None:
        self._region, self.hulls, self._scale = region, hulls, Interval(region.size)
        tests, by = with_slopes(region.tape.tests, hulls)
        either = ~((tests.lo >= 0.0) | (tests.hi < 0.0))
        self._undecided = either.sum(axis=0)
        self._test = Interval(np.zeros_like(hulls.lo))  # of the switch that is undecided
        for k in range(len(either)):
            self._test = chosen(either[k], by[k] * self._scale, self._test)
        hull, *modes = (with_slopes(region.tape.slopes, hulls, rules)[1] for rules in MODES)
        modes = [chosen(self._undecided > 1, hull, each) * self._scale for each in modes]
        along = np.sum([_tangent(each.middle()) for each in modes], axis=0)
        #: The derivatives with one more row, along the curve.
        self._modes = [together(np.concatenate, m, Interval(along[np.newaxis])) for m in modes]

    def is_passed(self) -> Signs:
        """Tell in which hulls all solutions lie on one curve without branch points."""
        one, other = self._modes
        passed = np.ones(len(self._undecided), dtype=bool)
        for k in range(WEIGHTS):
            weight = Interval(np.full(1, k / WEIGHTS), np.full(1, (k + 1) / WEIGHTS))
            mixed = chosen(self._undecided == 1, other + weight * (one - other), one)
            passed &= are_regular(mixed, np.ones((len(one.lo), 1)))
        return passed

    def turns(self) -> Array:
        """Return the turns of groups that are passed."""
        unit = np.zeros_like(self.hulls.lo)
        unit[-1] = -1.0  # tangents t: K t = (0, ..., 0, 1)
        ways = [solved_last(each, Interval(unit)) for each in self._modes]
        slope, before = (_sign(each[-1]) for each in ways)
        test, other = (_sign((self._test * each).total()) for each in ways)
        is_crossed = (self._undecided == 1) & (test == other) & (slope == -before)  # once
        kinks = np.where(is_crossed, test * slope, np.nan)
        opens = np.where(self._undecided == 0, self._of_folds(ways[0]), kinks)
        inside = self.hulls[:-1].is_within(self._region.whole[:-1]).all(axis=0)
        turning = np.where(inside, opens, np.nan)
        return np.where(slope == before, self._of_faces(ways), turning)

    def _of_folds(self, way: Interval) -> Array:
        """Return the signs of the second derivative of alpha along smooth curves."""
        bend = evaluated(self._region.tape.bent, together(np.vstack, self.hulls, way * self._scale))
        right = together(np.vstack, bend, Interval(np.zeros_like(bend.lo[:1])))
        return _sign(solved_last(self._modes[0], right)[-1])

    def _of_faces(self, ways: list[Interval]) -> Array:
        """Return the turns of hulls in which the curve goes on in alpha, by the faces touched."""
        touched = turns = 0.0 * self._undecided
        whole = self._region.whole
        for i in range(self._region.tape.size):
            one, other = (_sign(each[i]) * _sign(each[-1]) for each in ways)
            speed = np.where(one == other, one, np.nan)
            at_least, at_most = self.hulls.lo[i] <= whole.lo[i], self.hulls.hi[i] >= whole.hi[i]
            touched = touched + at_least + at_most
            turns = np.where(at_least, speed, np.where(at_most, -speed, turns))
        return np.where(touched > 1.0, np.nan, turns)


def _sign(x: Interval) -> Array:
    """Return the signs of intervals, not a number where an interval may hold zero."""
    return np.where(x.lo > 0.0, 1.0, np.where(x.hi < 0.0, -1.0, np.nan))


def _tangent(slopes: Array) -> Array:
    """Return about the unit tangents of curves, oriented by determinants, shape (n + 1, k)."""
    rows = np.where(np.isfinite(slopes), slopes, 0.0).transpose(2, 0, 1)
    tangent = np.linalg.svd(rows)[2][:, -1:]
    sign = np.linalg.slogdet(np.concatenate([rows, tangent], axis=1))[0]
    oriented: Array = (sign[:, np.newaxis] * tangent[:, 0]).T
    return oriented
