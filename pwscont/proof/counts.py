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
    are_regular,
    chosen,
    solved,
    together,
)
from pwscont.proof.search import FINEST_ALPHA, Covered, Domain, covered
from pwscont.proof.tape import evaluated, with_slopes

#: How often a solution that is enclosed is enclosed anew, ever more narrowly.
NARROWED = 4
#: Most boxes that are looked at for a count, for every accepted box.
LOOKED_AT = 30
#: Parts of a stretch at which solutions are counted, in turn, until all are told apart.
PLACES = (0.5, 0.381966, 0.61803, 0.26, 0.74)
#: What is always assumed, of functions of numpy, and of classes.
ASSUMED = (
    "assumed: a formula without state, the same for numbers and for the tape; arithmetic of "
    "IEEE 754 to nearest"
)
OF_NUMPY = f"; elementary functions of numpy within {FUNCTION_ULPS:g} units in the last place"
OF_CLASSES = "; selections of a class that agree where tests vanish"
#: Most open boxes that are put together; fewer where only a proof of everything is of use.
MOST_GROUPED, MOST_OF_A_WHOLE = 4000, 400
#: Into how many parts the weights of two modes are divided.
WEIGHTS = 8


def counted_proof(domain: Domain, found: Covered, *, is_whole: bool = False) -> BoxProof:
    """Return what accepted and open boxes with all solutions prove.

    ``is_whole``: a proof of a part is of no use, so that nothing is counted where a box is open.
    """
    box, alpha = domain.box[:-1], domain.box[-1]
    most = MOST_OF_A_WHOLE if is_whole else MOST_GROUPED
    hulls, passed, turns = grouped(domain, found.open, most)
    unsaid = _united(hulls[:, -1], turns, FINEST_ALPHA * float(domain.scale[-1]))
    interval, corners = (float(alpha.lo), float(alpha.hi)), (box.lo, box.hi)
    ends = [interval[0], *(end for lo, hi, _ in unsaid for end in (lo, hi)), interval[1]]
    pairs = zip(ends[::2], ends[1::2], strict=True) if passed.all() or not is_whole else ()
    stretches = _counted(domain, found.accepted, [(lo, hi) for lo, hi in pairs if lo < hi])
    opened = list(zip(hulls.lo[~passed], hulls.hi[~passed], strict=True))
    assumed = ASSUMED + OF_NUMPY * (not BY_CRIVAL)
    assumed += OF_CLASSES * any(step.name == "select" for step in domain.tape.steps)
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


def _counted(domain: Domain, boxes: Interval, stretches: list[Range]) -> list[CountedStretch]:
    """Return stretches with solutions at the first place of each where all are told apart."""
    known = {pair: CountedStretch(*pair, 0.5 * sum(pair), None) for pair in stretches}
    for part in PLACES:
        left = [(lo, hi) for (lo, hi), each in known.items() if each.count is None]
        places = {(lo, hi): lo + (hi - lo) * part for lo, hi in left}
        found = enclosures(domain, boxes, list(places.values()))
        for ((lo, hi), alpha), solutions in zip(places.items(), found, strict=True):
            known[lo, hi] = CountedStretch(lo, hi, alpha, solutions if lo < alpha < hi else None)
    return list(known.values())


@np.errstate(all="ignore")
def enclosures(domain: Domain, boxes: Interval, alphas: list[float]) -> list[list[Corners] | None]:
    """Return enclosures (least, largest) of all solutions in accepted boxes at each alpha.

    None where solutions are not enclosed, or not told apart, for certain.
    """
    slices = [boxes[(boxes.lo[:, -1] <= alpha) & (alpha <= boxes.hi[:, -1])] for alpha in alphas]
    for each, alpha in zip(slices, alphas, strict=True):
        each.lo[:, -1] = each.hi[:, -1] = alpha
    boxes = together(np.concatenate, boxes[:0], *slices)

    def accepts(some: Interval, _: Interval) -> Signs:
        holds: Signs = np.all(np.isfinite(domain.enclosed(some).lo), axis=1)
        return holds

    found, left, _ = covered(domain, boxes, accepts, np.inf, LOOKED_AT * len(boxes.lo))
    for _ in range(NARROWED):
        new = domain.enclosed(found)
        found = chosen(np.isfinite(new.lo), new, found)
    return [
        None if alpha in left.lo[:, -1] else _told_apart(domain, found[found.lo[:, -1] == alpha])
        for alpha in alphas
    ]


def _told_apart(domain: Domain, found: Interval) -> list[Corners] | None:
    """Return one enclosure for every different solution, None where that is not certain.

    Solutions whose enclosures do not meet are different. Two enclosures hold the same solution if H
    is injective on the hull of both.
    """
    touching = np.triu(_touching(found), 1)
    one, other = np.nonzero(touching)
    slopes = domain.slopes(found[one].hull(found[other]))
    is_same = are_regular(slopes[..., :-1], domain.scale[:-1])
    first = np.flatnonzero(~touching.any(axis=0))  # enclosures of one solution all touch
    return [(found.lo[i, :-1], found.hi[i, :-1]) for i in first] if is_same.all() else None


def _touching(boxes: Interval) -> Signs:
    """Tell which of k boxes touch which, shape (k, k)."""
    touch = np.ones((len(boxes.lo),) * 2, dtype=bool)
    for lo, hi in zip(boxes.lo.T, boxes.hi.T, strict=True):
        touch &= lo <= hi[:, np.newaxis]
    return touch & touch.T


def grouped(domain: Domain, boxes: Interval, most: int) -> tuple[Interval, Signs, Array]:
    """Return the hulls of groups of open boxes (k, n + 1) that touch, which are passed, and turns.

    Where more than ``most`` boxes are open, every box is a group.
    """
    if not 0 < (number := len(boxes.lo)) <= most:
        return boxes, np.zeros(number, dtype=bool), np.full(number, np.nan)
    boxes = boxes[np.argsort(boxes.lo[:, -1])]
    count, group = connected_components(_touching(boxes), directed=False)
    hulls = Interval(*(np.full((count, boxes.lo.shape[1]), far) for far in (np.inf, -np.inf)))
    np.minimum.at(hulls.lo, group, boxes.lo)
    np.maximum.at(hulls.hi, group, boxes.hi)
    passage = _Passage(domain, hulls)
    passed = passage.is_passed()
    return hulls, passed, np.where(passed, passage.turns(), np.nan)


@final
class _Passage:
    """What the derivatives in hulls of groups say of the solutions there.

    If one switch may be in two modes, the derivatives are averages of both modes with any weight.
    """

    def __init__(self, domain: Domain, hulls: Interval) -> None:
        self._domain, self._hulls = domain, hulls
        tests, by = with_slopes(domain.tape.tests, hulls)
        either = ~((tests.lo >= 0.0) | (tests.hi < 0.0))
        self._undecided = either.sum(axis=1)
        self._test = Interval(np.zeros_like(hulls.lo))  # of the switch that is undecided
        for k, each in enumerate(either.T):
            self._test = chosen(each[:, np.newaxis], by[:, k] * domain.scale, self._test)
        hull, *modes = (with_slopes(domain.tape.slopes, hulls, rules)[1] for rules in MODES)
        is_many = (self._undecided > 1)[:, np.newaxis, np.newaxis]
        modes = [chosen(is_many, hull, each) * domain.scale for each in modes]
        along = Interval(np.sum([_tangents(each.middle()) for each in modes], axis=0))
        #: The derivatives with one more row, along the curve.
        self._modes = [together(np.hstack, m, along) for m in modes]

    def is_passed(self) -> Signs:
        """Tell in which hulls all solutions lie on one curve without branch points."""
        one, other = self._modes
        passed = np.ones(len(self._undecided), dtype=bool)
        is_one = (self._undecided == 1)[:, np.newaxis, np.newaxis]
        for k in range(WEIGHTS):
            weight = Interval(np.full(1, k / WEIGHTS), np.full(1, (k + 1) / WEIGHTS))
            mixed = chosen(is_one, other + weight * (one - other), one)
            passed &= are_regular(mixed, np.ones(one.lo.shape[-1]))
        return passed

    def turns(self) -> Array:
        """Return the turns of groups that are passed."""
        unit = np.zeros((*self._hulls.lo.shape, 1))
        unit[:, -1] = -1.0  # tangents t: K t = (0, ..., 0, 1)
        ways = [solved(each, Interval(unit))[..., 0] for each in self._modes]
        slope, before = (_sign(each[:, -1]) for each in ways)
        test, other = (_sign((self._test * each).total()) for each in ways)
        is_crossed = (self._undecided == 1) & (test == other) & (slope == -before)  # once
        kinks = np.where(is_crossed, test * slope, np.nan)
        opens = np.where(self._undecided == 0, self._of_folds(ways[0]), kinks)
        inside = self._hulls[:, :-1].is_within(self._domain.box[:-1]).all(axis=1)
        turning = np.where(inside, opens, np.nan)
        return np.where(slope == before, self._of_faces(ways), turning)

    def _of_folds(self, way: Interval) -> Array:
        """Return the signs of the second derivative of alpha along smooth curves."""
        at = together(np.hstack, self._hulls, way * self._domain.scale)
        bend = evaluated(self._domain.tape.bent, at)
        right = together(np.hstack, bend, Interval(np.zeros_like(bend.lo[:, :1])))
        return _sign(solved(self._modes[0], right[..., np.newaxis])[:, -1, 0])

    def _of_faces(self, ways: list[Interval]) -> Array:
        """Return the turns of hulls in which the curve goes on in alpha, by the faces touched."""
        one, other = (_sign(each[:, :-1]) * _sign(each[:, -1:]) for each in ways)
        speed, whole = np.where(one == other, one, np.nan), self._domain.box
        at_least, at_most = self._hulls.lo <= whole.lo, self._hulls.hi >= whole.hi
        at_least, at_most = at_least[:, :-1], at_most[:, :-1]
        turns = np.where(at_least, speed, np.where(at_most, -speed, 0.0)).sum(axis=1)
        return np.where(at_least.sum(axis=1) + at_most.sum(axis=1) > 1, np.nan, turns)


def _sign(x: Interval) -> Array:
    """Return the signs of intervals, not a number where an interval may hold zero."""
    return np.where(x.lo > 0.0, 1.0, np.where(x.hi < 0.0, -1.0, np.nan))


def _tangents(slopes: Array) -> Array:
    """Return about the unit tangents of curves, oriented by determinants, shape (k, 1, n + 1)."""
    rows = np.where(np.isfinite(slopes), slopes, 0.0)
    tangents = np.linalg.svd(rows)[2][:, -1:]
    signs = np.linalg.slogdet(np.concatenate([rows, tangents], axis=1))[0]
    oriented: Array = signs[:, np.newaxis, np.newaxis] * tangents
    return oriented
