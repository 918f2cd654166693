"""Boxes of (z, alpha), excluded, contracted, proved or halved, generation by generation.

Failure modes and answers
-------------------------
- A double root, a flat set, an area of solutions: the number of boxes is bounded, and boxes that
  remain are open.
- A solution on the boundary of the whole box: no box that touches the boundary is accepted.
- Resolution: no coordinate is halved below a part of its typical magnitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import final

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.budget import check_budget
from pwscont.proof.boxes import (
    consistent,
    eliminated,
    inverse_of,
    newton,
    times,
    with_slopes,
)
from pwscont.proof.interval import Interval, together
from pwscont.proof.tape import Tape
from pwscont.proof.tubes import Tubes, around, joined

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
    """What a search has left of a box: every solution lies in a proved tube or in an open box.

    ``open`` are boxes (n + 1, k), and ``boxes`` is how many boxes were looked at.
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
    whole = waiting = box[:, np.newaxis]
    tubes: list[Tubes] = []
    left, boxes, end = [whole[:, :0]], 0, perf_counter() + seconds
    most = most or MOST_BOXES * max(tape.size - 2, 1) ** 2
    while count := waiting.lo.shape[1]:
        following, is_last = [whole[:, :0]], boxes + count > most
        for first in range(0, count, TOGETHER):
            some = waiting[:, first : first + TOGETHER]
            check_budget()
            if is_last or perf_counter() > end:
                left.append(some)
                continue
            boxes += some.lo.shape[1]
            found, rest, finished = _looked_at(tape, some, whole, scale)
            tubes.append(found)
            left.append(finished)
            following += rest
        waiting = together(np.hstack, *following)
    return Cover(joined(*tubes) if tubes else None, together(np.hstack, *left), boxes)


def _looked_at(
    tape: Tape, boxes: Interval, whole: Interval, scale: Array
) -> tuple[Tubes, list[Interval], Interval]:
    """Return the tubes of boxes that are proved, the halves of others, and boxes left open."""
    boxes, empty = consistent(tape, boxes)
    boxes = boxes[:, ~empty]
    values, slopes = with_slopes(tape.slopes, boxes)
    boxes, empty = newton(tape, boxes, slopes)
    keeps = ~(empty | values.excludes_zero().any(axis=0))
    boxes, slopes = boxes[:, keeps], slopes[:, :, keeps]

    by_z = slopes[:, :-1]  # a tube may be proved where these do not vary too much
    spread = np.einsum("ijb,jkb->ikb", np.abs(inverse_of(by_z.middle())), 0.5 * by_z.width())
    tried = boxes[:-1].is_within(whole[:-1]).all(axis=0) & (spread.sum(axis=1).max(axis=0) < TRIED)
    tubes, is_proved = around(tape, boxes[:, tried], slopes[:, :, tried], LEAST * scale[:-1])
    rest = ~tried
    rest[tried] = ~is_proved
    boxes, slopes = boxes[:, rest], slopes[:, :, rest]

    width, size = boxes.width(), scale[:, np.newaxis]
    is_small = (width <= FINEST * size).all(axis=0)
    is_thin = width <= np.append(np.full(tape.size, THIN), FINEST_ALPHA)[:, np.newaxis] * size
    is_small |= is_thin.all(axis=0)
    halves = _halved(boxes[:, ~is_small], slopes[:, :, ~is_small], size)
    return tubes[is_proved], halves, boxes[:, is_small]


def _halved(boxes: Interval, slopes: Interval, scale: Array) -> list[Interval]:
    """Return both halves of boxes, along the coordinate that changes preconditioned rows most."""
    width = boxes.width()
    matrix, _ = eliminated(slopes.middle(), width)
    effect = times(matrix, slopes).reach() * width
    effect = (effect / effect.sum(axis=1, keepdims=True)).sum(axis=0)
    relative = width / scale
    effect = np.where(np.isfinite(effect).all(axis=0), effect, relative)
    effect = np.where(LENGTHY * relative >= relative.max(axis=0), effect, 0.0)
    effect = np.where(width > FINEST * scale, effect, -1.0)
    split = effect.argmax(axis=0), np.arange(boxes.lo.shape[1])
    lower, upper = boxes.hi.copy(), boxes.lo.copy()
    lower[split] = upper[split] = boxes.middle()[split]
    return [Interval(boxes.lo, lower), Interval(upper, boxes.hi)]
