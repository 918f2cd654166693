"""Open boxes that touch, together: around folds, kinks, and whatever cannot be decided.

A group of open boxes is a *window* if one regular curve is proved to pass through the hull of the
group, with any coordinate as the parameter: then the group lies around a fold, or where a curve
leaves the box. Other groups stay open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.graph.structure import connected
from pwscont.proof.interval import Interval
from pwscont.proof.newton import with_slopes
from pwscont.proof.tape import Tape
from pwscont.proof.tubes import around

#: Most open boxes that are put together.
MOST_GROUPED = 4000
#: How often a tube around a group is tried: near a fold a curve bends much in a narrow window.
TRIES = 4


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


def with_parameter(tape: Tape, j: int) -> Tape:
    """Return a tape on which coordinate j and alpha have changed places."""
    other = {float(j): float(tape.size), float(tape.size): float(j)}
    steps = [
        replace(step, number=other.get(step.number, step.number))
        if step.name == "variable"
        else step
        for step in tape.steps
    ]
    return Tape(tape.size, steps, tape.outputs)


def swapped(size: int, j: int) -> Indices:
    """Return the order of coordinates in which j and alpha have changed places."""
    order = np.arange(size + 1)
    order[[j, size]] = size, j
    return order


def are_passed(tape: Tape, boxes: Interval, scale: Array) -> Signs:
    """Tell through which boxes exactly one regular curve is proved to pass."""
    passed, least = np.zeros(boxes.lo.shape[1], dtype=bool), np.zeros(tape.size)
    if len(passed) > MOST_GROUPED:
        return passed
    for j in range(tape.size + 1):
        left = np.flatnonzero(~passed)
        order = swapped(tape.size, j)
        some, own = boxes[order][:, left], with_parameter(tape, j)
        slopes = with_slopes(own, some)[1]
        passed[left] = around(own, some, slopes, least, TRIES)[1]
    return passed
