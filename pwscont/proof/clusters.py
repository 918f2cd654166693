"""Open boxes that touch, together: around folds, kinks, and whatever cannot be decided.

A group of open boxes is a *window* if all solutions in the hull of the group are proved to lie on
one curve without branch points: then the group lies around a fold, or where a curve leaves the box.
Other groups stay open.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.graph.structure import connected
from pwscont.proof.evaluate import number_undecided, slopes_of, values_of
from pwscont.proof.interval import Interval, above, chosen
from pwscont.proof.newton import inverse, stacked, times
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


def are_passed(tape: Tape, boxes: Interval, scale: Array) -> Signs:
    """Tell in which boxes (n + 1, k) all solutions lie on one curve without branch points.

    The curve is proved if the derivatives of H and of one linear function make a regular matrix,
    whatever the derivatives in the box: then H and the function together are injective. Where one
    switch may be in two modes, the derivatives are those of both modes, averaged with any weight;
    of several such switches, the hull. ``scale`` are the magnitudes of coordinates.
    """
    values = values_of(tape, boxes)
    magnitude = Interval.point(scale[:, np.newaxis])
    one, other, both = (
        stacked(slopes_of(tape, values, boxes, each)) * magnitude
        for each in (_first, _second, Interval.hull)
    )
    single = number_undecided(tape, values) <= 1
    along = _tangent(one.middle()) + _tangent(other.middle())
    passed = np.ones(boxes.lo.shape[1], dtype=bool)
    for k in range(WEIGHTS):
        weight = Interval(np.full(1, k / WEIGHTS), np.full(1, (k + 1) / WEIGHTS))
        mixed = chosen(single, other + weight * (one - other), both)
        passed &= _are_regular(mixed, along)
    return passed


def _first(one: Interval, other: Interval) -> Interval:
    return one


def _second(one: Interval, other: Interval) -> Interval:
    return other


def _tangent(slopes: Array) -> Array:
    """Return about the unit tangents of curves, oriented by determinants, shape (n + 1, k)."""
    rows = np.where(np.isfinite(slopes), slopes, 0.0).transpose(2, 0, 1)
    tangent = np.linalg.svd(rows)[2][:, -1:]
    sign = np.linalg.slogdet(np.concatenate([rows, tangent], axis=1))[0]
    oriented: Array = (sign[:, np.newaxis] * tangent[:, 0]).T
    return oriented


def _are_regular(slopes: Interval, along: Array) -> Signs:
    """Tell for which derivatives, with the row ``along``, all matrices are regular."""
    lo, hi = (np.concatenate([end, along[np.newaxis]]) for end in (slopes.lo, slopes.hi))
    square, unit = Interval(lo, hi), np.eye(len(lo))[:, :, np.newaxis]
    off = (Interval.point(unit) - times(inverse(square.middle()), square)).reach()
    regular: Signs = above(off.sum(axis=1), 2.0 * len(lo)).max(axis=0) < 1.0
    return regular
