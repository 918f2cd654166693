"""Boxes of (z, alpha) that hold all solutions of a formula, and what they prove.

Boxes are excluded, contracted, accepted (where solutions go on with alpha) or halved. The number of
solutions is constant on every stretch of alpha between groups of open boxes. A group is *passed* if
all solutions in its hull are proved to lie on one curve; the *turn* says how the number changes in
the hull when alpha grows: it only grows (1), only falls (-1), stays (0), or is not known (not a
number). The theorems stand on the page "Proofs" of the manual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import final

import numpy as np
from scipy.sparse.csgraph import connected_components

from pwscont.basics.arrays import GOLDEN, Array, Signs
from pwscont.basics.budget import check_budget
from pwscont.curve.metric import Range
from pwscont.graph.proved import BoxProof, Corners, CountedStretch
from pwscont.proof.interval import (
    ASSUMED,
    MODES,
    ULP,
    Interval,
    are_regular,
    inverses,
    solved,
    together,
)
from pwscont.proof.tape import Tape, evaluated, with_slopes

#: No coordinate is halved below this part of its magnitude; the magnitude of alpha is the interval.
FINEST = 2.0**-24
#: A box is left open, too, if alpha is as narrow as this part of the interval, but not a number,
#: and the unknowns are as narrow as this part of their magnitudes.
FINEST_ALPHA, THIN = 2.0**-40, 2.0**-12
#: Boxes that are worked on at once: their numbers fit into the cache of a processor.
TOGETHER = 2048
#: Most boxes in all for up to three unknowns; for n unknowns (n - 2)**2 times as many.
MOST_BOXES = 300_000
#: The widest coordinate is halved of those that change rows by this part of the largest change.
MATTERS = 0.5
#: By what part of typical magnitudes derivatives are taken around a box: kinks lie on faces.
BESIDE = 2.0**-44
#: How much wider than a box, than a few roundings of the centre, and than the residual of the
#: centre as unknowns, the neighbourhood is in which a solution is enclosed.
WIDER, SLACK, ROOM = 1.25, 64.0 * ULP, 2.0


@final
@dataclass(frozen=True, eq=False)
class Domain:
    """A formula in a box (n + 1,) of (z, alpha), with typical magnitudes (n + 1,)."""

    tape: Tape
    box: Interval
    scale: Array

    def slopes(self, boxes: Interval) -> Interval:
        """Return the derivatives in boxes (B, n + 1) and a little around, shape (B, n, n + 1).

        Not a number where the formula, or a derivative, may be without a value.
        """
        beside = Interval(-BESIDE * self.scale, BESIDE * self.scale)
        value, slopes = with_slopes(self.tape.slopes, (boxes + beside).meet(self.box))
        is_finite = np.isfinite(slopes.width()).all(axis=2) & np.isfinite(value.width())
        return slopes.where(np.all(is_finite, axis=1, keepdims=True)[..., np.newaxis])

    def continues(self, boxes: Interval, slopes: Interval) -> Signs:
        """Tell in which boxes inside of the whole box all solutions go on with alpha, one each."""
        is_inside = boxes[:, :-1].is_within(self.box[:-1]).all(axis=1)
        return is_inside & are_regular(slopes[..., :-1], self.scale[:-1])

    def enclosed(self, boxes: Interval) -> Interval:
        """Return what holds the only zero in and around boxes at one alpha, and alpha.

        If all x with H'x + H(c) = 0, whatever the derivatives in a neighbourhood with the centre c,
        have c + x inside of the neighbourhood, there is one zero. Else nothing is said.
        """
        centre, alpha = boxes.middle()[:, :-1], boxes[:, -1:]
        value = evaluated(self.tape, together(np.hstack, Interval(centre), alpha))[..., np.newaxis]
        inverse = inverses(self.slopes(boxes).middle()[..., :-1])
        far = WIDER * (boxes[:, :-1] - centre).reach() + SLACK * np.abs(centre)
        far += ROOM * (Interval(inverse) @ value).reach()[..., 0] + BESIDE * self.scale[:-1]
        near = Interval(centre - far, centre + far)
        slopes = self.slopes(together(np.hstack, near, alpha))
        found = solved(slopes[..., :-1], value)[..., 0] + centre
        is_proved = found.is_within(near) & near.is_within(self.box[:-1])
        return together(np.hstack, found.where(np.all(is_proved, axis=1, keepdims=True)), alpha)


Accepts = Callable[[Interval, Interval], Signs]


def covered(
    domain: Domain, boxes: Interval, accepts: Accepts, seconds: float, most: int
) -> tuple[Interval, Interval, int]:
    """Return accepted and open boxes with all zeros in some boxes, and how many were looked at.

    ``accepts`` tells of boxes, and the derivatives in the boxes, which are accepted. Boxes are left
    open after some ``seconds``, and when about ``most`` boxes were looked at.
    """
    accepted, small, number, end = [boxes[:0]], [boxes[:0]], 0, perf_counter() + seconds
    while len(boxes.lo) and number < most and perf_counter() < end:
        check_budget()
        some, others = boxes[:TOGETHER], boxes[TOGETHER:]
        number += len(some.lo)
        found, too_small, halves = _looked_at(domain, some, accepts)
        accepted.append(found)
        small.append(too_small)
        boxes = together(np.concatenate, others, *halves)
    left = together(np.concatenate, *small, boxes)
    return together(np.concatenate, *accepted), left, number


def _looked_at(
    domain: Domain, boxes: Interval, accepts: Accepts
) -> tuple[Interval, Interval, list[Interval]]:
    """Return the boxes that are accepted, those too small to be halved, and halves of others."""
    boxes = boxes[~evaluated(domain.tape, boxes).excludes_zero().any(axis=1)]
    slopes = domain.slopes(boxes)
    matrix = Interval(preconditioner(slopes.middle(), boxes.width()))
    start = evaluated(domain.tape, Interval(boxes.middle()))[..., np.newaxis]
    rows = matrix @ slopes
    boxes, empty = contracted(boxes, rows, (matrix @ start)[..., 0])
    boxes, rows, slopes = boxes[~empty], rows[~empty], slopes[~empty]
    is_accepted = accepts(boxes, slopes)
    relative = boxes.width() / domain.scale
    widest, alpha = relative[:, :-1].max(axis=1), relative[:, -1]
    is_flat = (widest <= THIN) & (alpha > 0.0) & (alpha <= FINEST_ALPHA)
    is_small = ~is_accepted & ((np.maximum(widest, alpha) <= FINEST) | is_flat)
    wide = ~is_accepted & ~is_small
    return boxes[is_accepted], boxes[is_small], _halved(boxes[wide], rows[wide], domain.scale)


def contracted(boxes: Interval, rows: Interval, rest: Interval) -> tuple[Interval, Signs]:
    """Return boxes contracted by one step of interval Newton, and which boxes are empty.

    Solutions x solve rows (x - middle) + rest = 0, every row for an unknown of its own.
    """
    middle, places = boxes.middle(), np.arange(boxes.lo.shape[1])
    terms = rows * (boxes - middle)[:, np.newaxis]
    empty = (rest + terms.total()).excludes_zero()
    terms.lo[:, places, places] = terms.hi[:, places, places] = 0.0
    found = boxes.meet(-(rest + terms.total()) / rows[:, places, places] + middle)
    return found, np.any(empty | (found.lo > found.hi), axis=1)


def preconditioner(middle: Array, width: Array) -> Array:
    """Return matrices (B, n + 1, n) that make about I - t t' of derivatives ``middle``.

    t is the unit tangent, with coordinates in units of ``width``. Any finite numbers will do.
    """
    rows = np.where(np.isfinite(middle), middle, 0.0) * width[:, np.newaxis]
    square = inverses(rows @ rows.mT)
    matrix: Array = rows.mT @ np.where(np.isfinite(square), square, 0.0)
    return matrix


def _halved(boxes: Interval, rows: Interval, scale: Array) -> list[Interval]:
    """Return both halves of boxes, along the widest coordinate that matters."""
    width = boxes.width()
    effect = (rows.reach() * width[:, np.newaxis]).sum(axis=1)
    effect = np.where(width > FINEST * scale, effect, 0.0)
    relative = np.where(effect < MATTERS * effect.max(axis=1, keepdims=True), 0.0, width / scale)
    split = np.arange(len(width)), relative.argmax(axis=1)
    lower, upper = boxes.hi.copy(), boxes.lo.copy()
    lower[split] = upper[split] = boxes.middle()[split]
    return [Interval(boxes.lo, lower), Interval(upper, boxes.hi)]


# -- what the boxes prove ----------------------------------------------------------------------

#: How often a solution that is enclosed is enclosed anew, ever more narrowly.
NARROWED = 4
#: Most boxes that are looked at for a count, for every accepted box.
LOOKED_AT = 30
#: Parts of a stretch at which solutions are counted, in turn, until all are told apart.
PLACES = (0.5, 1.0 - GOLDEN, GOLDEN, 0.26, 0.74)
OF_CLASSES = "; selections of a class that agree where tests vanish"
#: Most open boxes that are put together; fewer where only a proof of everything is of use: an
#: ``explore`` that would prove and follow 319 loops takes minutes.
MOST_GROUPED, MOST_OF_A_WHOLE = 4000, 400
#: Into how many parts the weights of two modes are divided.
WEIGHTS = 8


def counted_proof(
    domain: Domain, accepted: Interval, left: Interval, number: int, *, is_whole: bool = False
) -> BoxProof:
    """Return what accepted and open boxes prove; ``number`` boxes were looked at.

    ``is_whole``: a proof of a part is of no use, so that nothing is counted where a box is open.
    """
    box, alpha = domain.box[:-1], domain.box[-1]
    hulls, passed, turns = grouped(domain, left, MOST_OF_A_WHOLE if is_whole else MOST_GROUPED)
    unsaid = _united(hulls[:, -1], turns, FINEST_ALPHA * float(domain.scale[-1]))
    interval, corners = (float(alpha.lo), float(alpha.hi)), (box.lo, box.hi)
    ends = [interval[0], *(end for lo, hi, _ in unsaid for end in (lo, hi)), interval[1]]
    pairs = zip(ends[::2], ends[1::2], strict=True) if passed.all() or not is_whole else ()
    stretches = _counted(domain, accepted, [(lo, hi) for lo, hi in pairs if lo < hi])
    opened = list(zip(hulls.lo[~passed], hulls.hi[~passed], strict=True))
    is_class = any(step.name == "select" for step in domain.tape.steps)
    assumed = ASSUMED + OF_CLASSES * is_class
    return BoxProof(corners, interval, stretches, unsaid, opened, number, assumed)


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
        found = new.where(np.isfinite(new.lo), found)
    return [
        None if alpha in left.lo[:, -1] else _told_apart(domain, found[found.lo[:, -1] == alpha])
        for alpha in alphas
    ]


def _told_apart(domain: Domain, found: Interval) -> list[Corners] | None:
    """Return one enclosure for every different solution, None where that is not certain.

    Two enclosures hold the same solution if H is injective on the hull of both.
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
            self._test = (by[:, k] * domain.scale).where(each[:, np.newaxis], self._test)
        hull, *modes = (with_slopes(domain.tape.slopes, hulls, rules)[1] for rules in MODES)
        is_many = (self._undecided > 1)[:, np.newaxis, np.newaxis]
        modes = [hull.where(is_many, each) * domain.scale for each in modes]
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
            mixed = (other + weight * (one - other)).where(is_one, one)
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
