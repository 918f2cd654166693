"""What tubes and open boxes prove of the solutions of a formula in a box.

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
    solved,
    together,
)
from pwscont.proof.search import FINEST_ALPHA, Covered, Tubes, around, inverse_of, polished
from pwscont.proof.tape import Tape, evaluated, with_slopes

#: How often the derivatives are taken anew when solutions are enclosed.
NEWTONS = 3
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


def counted_proof(
    tape: Tape, box: Interval, scale: Array, found: Covered, *, is_whole: bool = False
) -> BoxProof:
    """Return what tubes and open boxes with all solutions prove, from the answer of ``covered``.

    ``is_whole``: a proof of a part is of no use, so that nothing is counted where a box is open.
    """
    tubes, open_boxes, boxes = found
    hulls, passed, turns = grouped(tape, open_boxes, box, scale)
    unsaid = _united(hulls[-1], turns, FINEST_ALPHA * float(scale[-1]))
    interval = float(box.lo[-1]), float(box.hi[-1])
    ends = [interval[0], *(end for lo, hi, _ in unsaid for end in (lo, hi)), interval[1]]
    pairs = zip(ends[::2], ends[1::2], strict=True) if passed.all() or not is_whole else ()
    stretches = [_counted(tape, box, tubes, each) for each in pairs if each[0] < each[1]]
    opened = list(zip(hulls.lo.T[~passed], hulls.hi.T[~passed], strict=True))
    assumed = ASSUMED + ACCURATE_FUNCTIONS * (not BY_CRIVAL)
    assumed += AGREEING_SELECTIONS * any(step.name == "select" for step in tape.steps)
    corners = box.lo[:-1], box.hi[:-1]
    return BoxProof(corners, interval, stretches, unsaid, opened, boxes, assumed)


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


def _counted(tape: Tape, box: Interval, tubes: Tubes, stretch: Range) -> CountedStretch:
    """Return a stretch with its solutions at the first place where they are told apart."""
    lo, hi = stretch
    places = [alpha for part in PLACES if lo < (alpha := lo + (hi - lo) * part) < hi]
    counted = ((alpha, _solutions(tape, box, tubes, alpha)) for alpha in places)
    found = (each for each in counted if each[1] is not None)
    return CountedStretch(lo, hi, *next(found, (0.5 * (lo + hi), None)))


@np.errstate(all="ignore")
def _solutions(tape: Tape, box: Interval, tubes: Tubes, alpha: float) -> list[Corners] | None:
    """Return an enclosure (least, largest) of every solution in the box at alpha, off all groups.

    None where solutions are not told apart for certain.
    """
    tubes = tubes.only((tubes.first <= alpha) & (alpha <= tubes.last))
    found, whole = _enclosed(tape, tubes, alpha), box[:-1, np.newaxis]
    outside = np.any((found.hi < whole.lo) | (found.lo > whole.hi), axis=0)
    tubes, found = tubes.only(~outside), found[:, ~outside]
    groups = _distinct(tubes, found, alpha) if found.is_within(whole).all() else None
    return None if groups is None else [(found.lo[:, i], found.hi[:, i]) for i in groups]


def _enclosed(tape: Tape, tubes: Tubes, alpha: float) -> Interval:
    """Return narrow enclosures of the solutions in tubes at one alpha, shape (n, k)."""
    point = Interval(np.full(len(tubes.first), alpha))
    known = tubes.at(point, tubes.image)
    centre = known.middle()
    for _ in range(NEWTONS):
        box = Interval(np.vstack([centre, point.lo]))
        about = with_slopes(tape.slopes, box)[1].middle()
        centre = polished(tape, centre, point.lo, inverse_of(about[:, :-1]))
    thin, is_proved = around(tape, box, about, tubes.radius)
    found = thin.at(point, thin.image)
    return chosen(is_proved & tubes.hold(found, point), found, known)


def _distinct(tubes: Tubes, found: Interval, alpha: float) -> list[int] | None:
    """Return one tube for every different solution, None where two are not told apart.

    Solutions whose enclosures do not meet are different. Two enclosures that lie in one tube hold
    the same solution.
    """
    touching = _touching(found)
    one, other = np.nonzero(np.triu(touching, 1))
    point = Interval(np.full(len(one), alpha))
    is_same = tubes.only(one).hold(found[:, other], point)
    is_same |= tubes.only(other).hold(found[:, one], point)
    group = connected_components(touching, directed=False)[1]
    first: list[int] = np.unique(group, return_index=True)[1].tolist()
    return first if is_same.all() else None


def _touching(boxes: Interval) -> Signs:
    """Tell which of boxes (n, k) touch which, shape (k, k)."""
    touch = np.ones((boxes.lo.shape[1],) * 2, dtype=bool)
    for lo, hi in zip(boxes.lo, boxes.hi, strict=True):
        touch &= lo <= hi[:, np.newaxis]
    return touch & touch.T


def grouped(
    tape: Tape, boxes: Interval, whole: Interval, scale: Array
) -> tuple[Interval, Signs, Array]:
    """Return the hulls of groups of open boxes (n + 1, k) that touch, which are passed, and turns.

    ``whole`` is the whole box (n + 1,), and ``scale`` are the magnitudes of coordinates. Where many
    boxes are open, every box is a group.
    """
    if not 0 < (number := boxes.lo.shape[1]) <= MOST_GROUPED:
        return boxes, np.zeros(number, dtype=bool), np.full(number, np.nan)
    boxes = boxes[:, np.argsort(boxes.lo[-1])]
    count, group = connected_components(_touching(boxes), directed=False)
    lo, hi = (np.full((count, len(boxes.lo)), far) for far in (np.inf, -np.inf))
    np.minimum.at(lo, group, boxes.lo.T)
    np.maximum.at(hi, group, boxes.hi.T)
    hulls = Interval(lo.T, hi.T)
    passage = _Passage(tape, hulls, scale)
    passed = passage.is_passed()
    return hulls, passed, np.where(passed, passage.turns(whole), np.nan)


@final
class _Passage:
    """What the derivatives in hulls of groups say of the solutions there.

    If one switch may be in two modes, the derivatives are averages of both modes with any weight.
    """

    def __init__(self, tape: Tape, hulls: Interval, scale: Array) -> None:
        self._tape, self.hulls, self._scale = tape, hulls, Interval(scale[:, np.newaxis])
        tests, by = with_slopes(tape.tests, hulls)
        either = ~((tests.lo >= 0.0) | (tests.hi < 0.0))
        self._undecided = either.sum(axis=0)
        self._test = Interval(np.zeros_like(hulls.lo))  # of the switch that is undecided
        for k in range(len(either)):
            self._test = chosen(either[k], by[k] * self._scale, self._test)
        hull, *modes = (with_slopes(tape.slopes, hulls, rules)[1] for rules in MODES)
        self._modes = [chosen(self._undecided > 1, hull, each) * self._scale for each in modes]
        self._along = np.sum([_tangent(each.middle()) for each in self._modes], axis=0)

    def is_passed(self) -> Signs:
        """Tell in which hulls all solutions lie on one curve without branch points."""
        one, other = self._modes
        passed = np.ones(len(self._undecided), dtype=bool)
        for k in range(WEIGHTS):
            weight = Interval(np.full(1, k / WEIGHTS), np.full(1, (k + 1) / WEIGHTS))
            mixed = chosen(self._undecided == 1, other + weight * (one - other), one)
            found = _solved(mixed, self._along, Interval(0.0 * self._along))
            passed &= np.isfinite(found.lo).all(axis=0)
        return passed

    def turns(self, whole: Interval) -> Array:
        """Return the turns of groups that are passed."""
        # tangents t, with K t = (0, ..., 0, 1)
        unit = np.eye(len(self._along))[:, -1:] + 0.0 * self._along
        ways = [_solved(each, self._along, Interval(unit)) for each in self._modes]
        slope, before = (_sign(each[-1]) for each in ways)
        test, other = (_sign((self._test * each).total()) for each in ways)
        is_crossed = (self._undecided == 1) & (test == other) & (slope == -before)  # once
        kinks = np.where(is_crossed, test * slope, np.nan)
        opens = np.where(self._undecided == 0, self._of_folds(ways[0]), kinks)
        inside = self.hulls[:-1].is_within(whole[:-1, np.newaxis]).all(axis=0)
        turning = np.where(inside, opens, np.nan)
        return np.where(slope == before, self._of_faces(whole, ways), turning)

    def _of_folds(self, way: Interval) -> Array:
        """Return the signs of the second derivative of alpha along smooth curves."""
        bent = evaluated(self._tape.bent, together(np.vstack, self.hulls, way * self._scale))
        right = together(np.vstack, bent, Interval(np.zeros_like(bent.lo[:1])))
        return -_sign(_solved(self._modes[0], self._along, right)[-1])

    def _of_faces(self, whole: Interval, ways: list[Interval]) -> Array:
        """Return the turns of hulls in which the curve goes on in alpha, by the faces touched."""
        touched = turns = 0.0 * self._undecided
        for i in range(self._tape.size):
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


def _solved(slopes: Interval, along: Array, right: Interval) -> Interval:
    """Return what holds all x, shape (n + 1, k), with K x = right.

    K are the derivatives with the row ``along``, shape (n + 1, n + 1, k); where K may be singular,
    nothing is said.
    """
    square = together(np.concatenate, slopes, Interval(along[np.newaxis]))
    parts = [each.arranged(lambda end: np.moveaxis(end, -1, 0)) for each in (square, -right)]
    found = solved(parts[0], parts[1][..., np.newaxis])
    return found[..., 0].arranged(np.transpose)
