"""Open boxes that touch, together: around folds, kinks, and whatever cannot be decided.

A group of open boxes is *passed* if all solutions in the hull of the group are proved to lie on one
curve without branch points; other groups stay open. The *turn* of a group that is passed says how
the number of solutions can change in the hull when alpha grows: the number only grows (around folds
that open to larger alpha, or where the curve enters the box), only falls, or stays.

Failure modes and answers
-------------------------
- Several switches are undecided, a smooth fold beside a kink, both a fold and a face of the box:
  the turn is not known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.graph.structure import connected
from pwscont.intervals.interval import Interval, above, below, chosen
from pwscont.proof.evaluate import second_slopes, slopes_of, undecided, values_of
from pwscont.proof.newton import inverse, picked, times, total
from pwscont.proof.tape import Tape

#: Most open boxes that are put together.
MOST_GROUPED = 4000
#: Into how many parts the weights of two modes are divided.
WEIGHTS = 8


def hulls(boxes: Interval) -> Interval:
    """Return the hulls of groups of boxes (n + 1, k) that touch; of too many boxes, the boxes."""
    count = boxes.lo.shape[1]
    if not 0 < count <= MOST_GROUPED:
        return boxes
    order = np.argsort(boxes.lo[-1])
    groups = connected(range(count), _touching(boxes[:, order]))
    places = [order[sorted(group)] for group in groups]
    lo = np.stack([boxes.lo[:, each].min(axis=1) for each in places], axis=1)
    hi = np.stack([boxes.hi[:, each].max(axis=1) for each in places], axis=1)
    return Interval(lo, hi)


def _touching(boxes: Interval) -> list[tuple[int, int]]:
    """Return the pairs of boxes that touch; boxes are sorted by their least alpha."""
    pairs, count = [], boxes.lo.shape[1]
    ends = np.searchsorted(boxes.lo[-1], boxes.hi[-1], side="right")
    for i in range(count):
        some = np.s_[:, i + 1 : ends[i]]
        touch = (boxes.lo[some] <= boxes.hi[:, [i]]) & (boxes.hi[some] >= boxes.lo[:, [i]])
        pairs += [(i, i + 1 + int(j)) for j in np.flatnonzero(touch.all(axis=0))]
    return pairs


@final
@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Groups of open boxes, shapes (k,).

    Attributes
    ----------
    hulls : Interval, shape (n + 1, k)
    passed : ndarray of bool
        Whether all solutions in the hull lie on one curve without branch points.
    turns : ndarray
        Whether the number of solutions only grows with alpha (1), only falls (-1), or stays (0);
        not a number where this is not known.
    """

    hulls: Interval
    passed: Signs
    turns: Array

    @classmethod
    def of(cls, tape: Tape, boxes: Interval, whole: Interval, scale: Array) -> Groups:
        """Return the groups of open boxes of a whole box (n + 1,); no groups if boxes are too many.

        ``scale`` are the magnitudes of coordinates.
        """
        groups = hulls(boxes)
        count = groups.lo.shape[1]
        if not 0 < count <= MOST_GROUPED:
            return cls(groups, np.zeros(count, dtype=bool), np.full(count, np.nan))
        passage = _Passage(tape, groups, scale)
        passed = passage.is_passed()
        return cls(groups, passed, np.where(passed, passage.turns(whole), np.nan))

    def turn_of(self, lo: float, hi: float) -> float:
        """Return the turn of all groups within a range of alpha together."""
        turns = self.turns[(self.hulls.lo[-1] >= lo) & (self.hulls.hi[-1] <= hi)]
        least, largest = float(turns.min()), float(turns.max())
        return float(np.sign(least + largest)) if least * largest >= 0.0 else np.nan


def _first(one: Interval, other: Interval) -> Interval:
    return one


def _second(one: Interval, other: Interval) -> Interval:
    return other


@final
class _Passage:
    """What the derivatives in hulls of groups say of the solutions there.

    The curve is proved if the derivatives of H and of one linear function make a regular matrix,
    whatever the derivatives in the hull: then H and the function together are injective. If one
    switch may be in two modes, the derivatives are averages of both modes with any weight; if
    several switches may be, the derivatives are anything in the hull.
    """

    def __init__(self, tape: Tape, hulls: Interval, scale: Array) -> None:
        self._tape, self._hulls, self._scale = tape, hulls, scale
        self._values = values_of(tape, hulls)
        slopes = [slopes_of(tape, self._values, hulls, each) for each in (_first, _second)]
        both = slopes_of(tape, self._values, hulls)
        self._undecided, test = undecided(tape, self._values, both)
        self._magnitude = Interval.point(scale[:, np.newaxis])
        self._test, many = test * self._magnitude, self._undecided > 1
        self._modes = [
            chosen(many, picked(tape, both), picked(tape, each)) * self._magnitude
            for each in slopes
        ]
        along = [_tangent(each.middle()) for each in self._modes]
        self._along = along[0] + along[1]

    def is_passed(self) -> Signs:
        """Tell in which hulls all solutions lie on one curve without branch points."""
        one, other = self._modes
        passed = np.ones(len(self._undecided), dtype=bool)
        for k in range(WEIGHTS):
            weight = Interval(np.full(1, k / WEIGHTS), np.full(1, (k + 1) / WEIGHTS))
            mixed = chosen(self._undecided == 1, other + weight * (one - other), one)
            rows = _contraction(mixed, self._along)[1]
            passed &= rows.max(axis=0) < 1.0
        return passed

    def turns(self, whole: Interval) -> Array:
        """Return the turns of groups that are passed."""
        along = [_directions(each, self._along) for each in self._modes]
        signs = [_sign(each[-1]) for each in along]
        inside = self._hulls[:-1].is_within(whole[:-1, np.newaxis]).all(axis=0)
        opens = np.where(self._undecided == 0, self._of_folds(along[0]), self._of_kinks(along))
        is_monotone = signs[0] == signs[1]
        return np.where(is_monotone, self._of_faces(whole, along), np.where(inside, opens, np.nan))

    def _of_folds(self, along: Interval) -> Array:
        """Return the signs of the second derivative of alpha along smooth curves."""
        direction = along * self._magnitude
        bent = picked(self._tape, second_slopes(self._tape, self._values, direction, _first))
        nothing = np.zeros((1, bent.lo.shape[1]))
        right = Interval(np.vstack([bent.lo, nothing]), np.vstack([bent.hi, nothing]))
        return -_sign(_solved(self._modes[0], self._along, right)[-1])

    def _of_kinks(self, along: list[Interval]) -> Array:
        """Return the signs of the change of the slope of alpha at kinks that are crossed once."""
        test, other = (_sign(_dot(self._test, each)) for each in along)
        slope, before = (_sign(each[-1]) for each in along)
        is_one = (self._undecided == 1) & (test == other) & (slope == -before)
        return np.where(is_one, test * slope, np.nan)

    def _of_faces(self, whole: Interval, along: list[Interval]) -> Array:
        """Return the turns of hulls in which the curve goes on in alpha, by the faces touched."""
        count = len(self._undecided)
        touched, turns = np.zeros(count), np.zeros(count)
        for i in range(len(self._scale) - 1):
            one, other = (_sign(each[i]) * _sign(each[-1]) for each in along)
            speed = np.where(one == other, one, np.nan)
            at_least = self._hulls.lo[i] <= whole.lo[i]
            at_most = self._hulls.hi[i] >= whole.hi[i]
            touched += 1.0 * at_least + at_most
            turns = np.where(at_least, speed, np.where(at_most, -speed, turns))
        return np.where(touched > 1.0, np.nan, turns)


def _sign(x: Interval) -> Array:
    """Return the signs of intervals, not a number where an interval may hold zero."""
    return np.where(x.lo > 0.0, 1.0, np.where(x.hi < 0.0, -1.0, np.nan))


def _dot(one: Interval, other: Interval) -> Interval:
    products = one * other
    return total([products[i] for i in range(len(products.lo))])


def _tangent(slopes: Array) -> Array:
    """Return about the unit tangents of curves, oriented by determinants, shape (n + 1, k)."""
    rows = np.where(np.isfinite(slopes), slopes, 0.0).transpose(2, 0, 1)
    tangent = np.linalg.svd(rows)[2][:, -1:]
    sign = np.linalg.slogdet(np.concatenate([rows, tangent], axis=1))[0]
    oriented: Array = (sign[:, np.newaxis] * tangent[:, 0]).T
    return oriented


def _contraction(slopes: Interval, along: Array) -> tuple[Array, Array]:
    """Return R, about the inverse of K, and the row sums of |I - R K|.

    K are the derivatives with the row ``along``, shape (n + 1, n + 1, k).
    """
    lo, hi = (np.concatenate([end, along[np.newaxis]]) for end in (slopes.lo, slopes.hi))
    square, unit = Interval(lo, hi), np.eye(len(lo))[:, :, np.newaxis]
    about = inverse(square.middle())
    off = (Interval.point(unit) - times(about, square)).reach()
    return about, above(off.sum(axis=1), 2.0 * len(lo))


def _solved(slopes: Interval, along: Array, right: Interval) -> Interval:
    """Return what holds all x with K x = right: with R about the inverse, x = R b + (I - R K) x."""
    about, rows = _contraction(slopes, along)
    start, left = times(about, right), below(1.0 - rows.max(axis=0))
    largest = above(start.reach().max(axis=0) / np.where(left > 0.0, left, np.nan))
    return start + Interval.ball(above(rows * largest))


def _directions(slopes: Interval, along: Array) -> Interval:
    """Return what holds the tangents t with K t = (0, ..., 0, 1)."""
    right = np.zeros((len(along), along.shape[1]))
    right[-1] = 1.0
    return _solved(slopes, along, Interval.point(right))
