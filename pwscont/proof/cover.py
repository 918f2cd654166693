"""Boxes of (z, alpha), excluded, contracted, proved or halved, generation by generation.

Failure modes and answers
-------------------------
- A double root, a flat set, an area of solutions: the number of boxes is bounded, and boxes that
  remain are open.
- A solution on the boundary of the whole box: no box that touches the boundary is accepted.
- Resolution: no coordinate is halved below a part of its typical magnitude.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.basics.budget import check_budget
from pwscont.intervals.interval import Interval
from pwscont.proof.evaluate import values_of
from pwscont.proof.hull_consistency import contracted
from pwscont.proof.newton import eliminated, inverse, newton, times, with_slopes
from pwscont.proof.tape import Tape
from pwscont.proof.tubes import Tubes, around

#: No coordinate is halved below this part of its magnitude; the magnitude of alpha is the interval.
FINEST = 2.0**-24
#: A box is left open if alpha is as narrow as this part of the interval, and the unknowns are as
#: narrow as this part of their magnitudes.
FINEST_ALPHA, THIN = 2.0**-40, 2.0**-12
#: Boxes that are worked on at once: their numbers fit into the cache of a processor.
TOGETHER = 2048
#: Most boxes in all for up to three unknowns; for n unknowns (n - 2)**2 times as many. Then a
#: double root or an area of solutions ends the search.
MOST_BOXES = 300_000
#: The least radius of a tube, relative to typical magnitudes.
LEAST = 2.0**-44
#: A coordinate is halved only if no other coordinate is this many times as wide, in typical
#: magnitudes: else a coordinate that hardly matters to any row would never be halved.
LENGTHY = 4.0
#: Contraction of the Jacobian, to rounding, above which no tube is tried.
TRIED = 0.9


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cover:
    """What a search has left of a box: every solution lies in a tube or in an open box.

    Attributes
    ----------
    tubes : Tubes
        Proved; the solutions of the accepted boxes lie in the tubes.
    open : Interval, shape (n + 1, k)
        Boxes that are not decided.
    boxes : int
        How many boxes were looked at.
    """

    tubes: Tubes | None
    open: Interval
    boxes: int


def covered(
    tape: Tape, box: Interval, scale: Array, seconds: float, most: int | None = None
) -> Cover:
    """Return the cover of all zeros of a formula in a box (n + 1,), in some ``seconds`` at most.

    ``scale`` are the typical magnitudes of (z, alpha), shape (n + 1,). A generation with which more
    than ``most`` boxes would be looked at is not begun.
    """
    finest = FINEST * scale
    whole = box[:, np.newaxis]
    waiting, tubes, left, boxes = whole, [], [], 0
    end = perf_counter() + seconds
    most = most or MOST_BOXES * max(tape.size - 2, 1) ** 2
    while waiting.lo.shape[1]:
        following = []
        is_last = boxes + waiting.lo.shape[1] > most
        for some in _portions(waiting):
            check_budget()
            if is_last or perf_counter() > end:
                left.append(some)
                continue
            boxes += some.lo.shape[1]
            found, rest, finished = _looked_at(tape, some, whole, scale, finest)
            tubes.append(found)
            left.append(finished)
            following.append(rest)
        waiting = _joined(following, len(scale))
    return Cover(Tubes.joined(tubes) if tubes else None, _joined(left, len(scale)), boxes)


def _portions(boxes: Interval) -> Iterator[Interval]:
    for first in range(0, boxes.lo.shape[1], TOGETHER):
        yield boxes[:, first : first + TOGETHER]


def _joined(parts: list[Interval], rows: int) -> Interval:
    if not parts:
        return Interval(np.zeros((rows, 0)), np.zeros((rows, 0)))
    lo, hi = (
        np.concatenate([getattr(part, end) for part in parts], axis=1) for end in ("lo", "hi")
    )
    return Interval(lo, hi)


def _looked_at(
    tape: Tape, boxes: Interval, whole: Interval, scale: Array, finest: Array
) -> tuple[Tubes, Interval, Interval]:
    """Return the tubes of boxes that are proved, the halves of others, and boxes left open."""
    boxes, empty = contracted(tape, values_of(tape, boxes), boxes)
    boxes = boxes[:, ~empty]
    values, slopes = with_slopes(tape, boxes)
    boxes, empty = newton(tape, boxes, slopes)
    keeps = ~(empty | values.excludes_zero().any(axis=0))
    boxes, slopes = boxes[:, keeps], slopes[:, :, keeps]
    tubes, is_proved = _proved(tape, boxes, slopes, whole, scale)
    boxes, slopes = boxes[:, ~is_proved], slopes[:, :, ~is_proved]
    width = boxes.width()
    is_small = (width <= finest[:, np.newaxis]).all(axis=0)
    is_thin = (width[:-1] <= THIN * scale[:-1, np.newaxis]).all(axis=0)
    is_small |= is_thin & (width[-1] <= FINEST_ALPHA * scale[-1])
    rest = _halved(boxes[:, ~is_small], slopes[:, :, ~is_small], scale, finest)
    return tubes, rest, boxes[:, is_small]


def _proved(
    tape: Tape, boxes: Interval, slopes: Interval, whole: Interval, scale: Array
) -> tuple[Tubes, Signs]:
    """Return the tubes of boxes inside the whole box, and which boxes have a tube."""
    inside = boxes[:-1].is_within(whole[:-1]).all(axis=0) & _are_regular(slopes)
    tubes, found = around(tape, boxes[:, inside], slopes[:, :, inside], LEAST * scale[:-1])
    is_proved = inside.copy()
    is_proved[inside] = found
    return tubes[found], is_proved


def _are_regular(slopes: Interval) -> Signs:
    """Tell for which boxes a tube may be proved: the derivatives by z do not vary too much."""
    by_z = slopes[:, :-1]
    spread = np.einsum("ijb,jkb->ikb", np.abs(inverse(by_z.middle())), 0.5 * by_z.width())
    regular: Signs = spread.sum(axis=1).max(axis=0) < TRIED
    return regular


def _halved(boxes: Interval, slopes: Interval, scale: Array, finest: Array) -> Interval:
    """Return both halves of boxes, along the coordinate that changes preconditioned rows most."""
    width, count = boxes.width(), boxes.lo.shape[1]
    matrix, _ = eliminated(slopes.middle(), width)
    effect = times(matrix, slopes).reach() * width
    effect = (effect / effect.sum(axis=1, keepdims=True)).sum(axis=0)
    relative = width / scale[:, np.newaxis]
    effect = np.where(np.isfinite(effect).all(axis=0), effect, relative)
    effect = np.where(LENGTHY * relative >= relative.max(axis=0), effect, 0.0)
    effect = np.where(width > finest[:, np.newaxis], effect, -1.0)
    split, each = effect.argmax(axis=0), np.arange(count)
    middle = boxes.middle()[split, each]
    lower, upper = boxes.hi.copy(), boxes.lo.copy()
    lower[split, each], upper[split, each] = middle, middle
    return _joined([Interval(boxes.lo, lower), Interval(upper, boxes.hi)], len(scale))
