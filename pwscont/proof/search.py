"""Boxes of (z, alpha), excluded, contracted, proved as tubes or halved, generation by generation.

The theorem stands on the page "Proofs" of the manual: Krawczyk's operator proves that a tube has
exactly one zero at every alpha. A box that touches the boundary of the whole box is not accepted.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.basics.budget import check_budget
from pwscont.proof.interval import ULP, Interval, above, inverses, times, together
from pwscont.proof.tape import Tape, evaluated, with_slopes

#: No coordinate is halved below this part of its magnitude; the magnitude of alpha is the interval.
FINEST = 2.0**-24
#: A box is left open if alpha is as narrow as this part of the interval, and the unknowns are as
#: narrow as this part of their magnitudes.
FINEST_ALPHA, THIN = 2.0**-40, 2.0**-12
#: Boxes that are worked on at once: their numbers fit into the cache of a processor.
TOGETHER = 2048
#: Most boxes in all for up to three unknowns; for n unknowns (n - 2)**2 times as many.
MOST_BOXES = 300_000
#: A tube is tried where the mean value form, as unknowns, is narrower than this part of the box.
TRIED = 2.0
#: The widest coordinate, in magnitudes, is halved among the coordinates that change preconditioned
#: rows by at least this part of the largest change by a coordinate.
MATTERS = 0.5
#: How much wider than the box a tube is tried.
WIDER = 1.25
#: The least radius of a tube, relative to typical magnitudes: a box may have no width at all.
LEAST = 2.0**-44
#: How much wider than necessary a tube is: a few roundings, relative to the tube's centre.
SLACK = 64.0 * ULP
#: By how many times the residual of the centre, as unknowns, a tube is wider.
ROOM = 2.0
#: Newton steps that improve the centre of a tube.
POLISHED = 2


class Tubes(NamedTuple):
    """Tubes, one after the other along the last axis, shapes (B,) and (n, B).

    ``image`` is the radius of the image of Krawczyk's operator, in which the solutions lie.
    """

    first: Array
    middle: Array
    last: Array
    centre: Array
    slope: Array
    radius: Array
    image: Array

    def only(self, which: Any) -> Tubes:
        """Return some of the tubes."""
        return Tubes(*(each[..., which] for each in self))

    def at(self, alpha: Interval, radius: Any = 0.0) -> Interval:
        """Return the hull of the tubes of another radius over intervals of alpha, shape (n, B)."""
        line = Interval(self.slope) * (alpha - self.middle)
        return line + self.centre + Interval(-radius, radius)

    def far(self, z: Interval, alpha: Interval) -> Array:
        """Return how far boxes of z reach from the lines of tubes, at every alpha of intervals."""
        ends = (alpha.lo, alpha.hi)  # lines: the ends are enough
        far: Array = np.maximum(*((z - self.at(Interval(end))).reach() for end in ends))
        return far

    def hold(self, z: Interval, alpha: Interval) -> Signs:
        """Tell which tubes hold boxes of z at every alpha of intervals."""
        held: Signs = np.all(self.far(z, alpha) < self.radius, axis=0)
        return held


Covered = tuple[Tubes, Interval, int]


def covered(
    tape: Tape, box: Interval, scale: Array, seconds: float, most: int | None = None
) -> Covered:
    """Return proved tubes and open boxes (n + 1, k) that hold all zeros of a formula in a box.

    And how many boxes were looked at, in some ``seconds`` at most. ``scale`` are the typical
    magnitudes of (z, alpha), shape (n + 1,). A generation with which more than ``most`` boxes would
    be looked at is not begun.
    """
    whole = waiting = box[:, np.newaxis]
    tubes = [Tubes(*np.zeros((3, 0)), *np.zeros((4, tape.size, 0)))]
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
            found, rest, finished = _looked_at(tape, some, whole, scale[:, np.newaxis])
            tubes += found
            left.append(finished)
            following += rest
        waiting = together(np.hstack, *following)
    joined = Tubes(*(np.concatenate(each, axis=-1) for each in zip(*tubes, strict=True)))
    return joined, together(np.hstack, *left), boxes


def _looked_at(
    tape: Tape, boxes: Interval, whole: Interval, size: Array
) -> tuple[list[Tubes], list[Interval], Interval]:
    """Return the tubes of boxes that are proved, the halves of others, and boxes left open."""
    boxes = boxes[:, ~evaluated(tape, boxes).excludes_zero().any(axis=0)]
    start, slopes = evaluated(tape, Interval(boxes.middle())), with_slopes(tape.slopes, boxes)[1]
    width, about = boxes.width(), slopes.middle()
    blur = 0.5 * (slopes.width() * width).sum(axis=1) + start.width()
    blur = np.einsum("ijb,jb->ib", np.abs(inverse_of(about[:, :-1])), blur)
    is_sharp = (blur < TRIED * width[:-1] + LEAST * size[:-1]).all(axis=0)
    matrix = preconditioner(about, width)
    rows = times(matrix, slopes)
    boxes, empty = contracted(boxes, rows, times(matrix, start))
    tried = is_sharp & ~empty & boxes[:-1].is_within(whole[:-1]).all(axis=0)
    left, found = ~tried & ~empty, list[Tubes]()
    if tried.any():
        tubes, is_proved = around(tape, boxes[:, tried], about[..., tried], size[:-1])
        left[tried], found = ~is_proved, [tubes.only(is_proved)]
    *unknowns, alpha = boxes.width() / size
    widest = np.max(unknowns, axis=0)
    is_small = (np.maximum(widest, alpha) <= FINEST) | (widest <= THIN) & (alpha <= FINEST_ALPHA)
    halved = left & ~is_small
    return found, _halved(boxes[:, halved], rows[..., halved], size), boxes[:, left & is_small]


def contracted(box: Interval, rows: Interval, rest: Interval) -> tuple[Interval, Signs]:
    """Return boxes contracted by one sweep of interval Newton, and which boxes are empty.

    Solutions x solve rows (x - middle) + rest = 0, every row for an unknown of its own.
    """
    middle, found = box.middle(), Interval(box.lo.copy(), box.hi.copy())
    empty = np.zeros(box.lo.shape[1], dtype=bool)
    for i, row in enumerate(rows[i] for i in range(len(middle))):
        terms = row * (found - middle)
        empty |= (rest[i] + terms.total()).excludes_zero()
        terms.lo[i] = terms.hi[i] = 0.0
        new = found[i].meet(middle[i] - (rest[i] + terms.total()) / row[i])
        found.lo[i], found.hi[i] = new.lo, new.hi
    return found, empty | (found.lo > found.hi).any(axis=0)


def preconditioner(middle: Array, width: Array) -> Array:
    """Return finite matrices (n + 1, n, B) that project derivatives on what they determine.

    ``middle`` (n, n + 1, B) is about the derivatives; with coordinates in units of ``width``, the
    matrix times the derivatives is about I - t t', t the unit tangent. Any numbers will do.
    """
    rows = np.where(np.isfinite(middle), middle, 0.0) * width
    square = inverse_of(np.einsum("ikb,jkb->ijb", rows, rows))
    matrix: Array = np.einsum("jkb,jib->kib", rows, np.where(np.isfinite(square), square, 0.0))
    return matrix


def inverse_of(middle: Array) -> Array:
    """Return about the inverse of square matrices (n, n, B); any numbers will do."""
    return inverses(middle.transpose(2, 0, 1)).transpose(1, 2, 0)


def _halved(boxes: Interval, rows: Interval, size: Array) -> list[Interval]:
    """Return both halves of boxes, along the widest coordinate that matters."""
    width = boxes.width()
    effect = np.where(width > FINEST * size, (rows.reach() * width).sum(axis=0), 0.0)
    relative = np.where(effect < MATTERS * effect.max(axis=0), 0.0, width / size)
    split = relative.argmax(axis=0), np.arange(boxes.lo.shape[1])
    lower, upper = boxes.hi.copy(), boxes.lo.copy()
    lower[split] = upper[split] = boxes.middle()[split]
    return [Interval(boxes.lo, lower), Interval(upper, boxes.hi)]


def around(tape: Tape, box: Interval, slopes: Array, size: Any) -> tuple[Tubes, Signs]:
    """Return tubes that hold boxes (n + 1, B), and which of the tubes are proved.

    ``slopes`` are about the derivatives.
    """
    middle, alpha, matrix = box.middle(), box[-1], inverse_of(slopes[:, :-1])
    slope = -np.einsum("ijb,jb->ib", matrix, slopes[:, -1])
    centre = polished(tape, middle[:-1], middle[-1], matrix)
    tubes = Tubes(alpha.lo, middle[-1], alpha.hi, centre, slope, centre, centre)
    radius = WIDER * tubes.far(box[:-1], alpha) + SLACK * np.abs(centre) + LEAST * size
    return proved(tape, tubes, radius, matrix)  # the radius is more than the box needs


def polished(tape: Tape, z: Array, alpha: Array, matrix: Array) -> Array:
    """Return states (n, B) at alpha, moved towards solutions by steps of Newton."""
    for _ in range(POLISHED):
        value = evaluated(tape, Interval(np.vstack([z, alpha]))).middle()
        step = np.einsum("ijb,jb->ib", matrix, value)
        z = z - np.where(np.isfinite(step), step, 0.0)
    return z


def proved(tape: Tape, tubes: Tubes, radius: Array, matrix: Array) -> tuple[Tubes, Signs]:
    """Return tubes of a radius, or a little more, and of their images, and which are proved."""
    start = times(matrix, evaluated(tape, Interval(np.vstack([tubes.centre, tubes.middle]))))
    radius = radius + ROOM * start.reach()
    alpha = Interval(tubes.first, tubes.last)
    box = together(np.vstack, tubes.at(alpha, radius), alpha)
    slopes = times(matrix, with_slopes(tape.slopes, box)[1])
    along = (slopes[:, :-1] * Interval(tubes.slope)).total(axis=1)
    away = (slopes[:, -1] + along) * (alpha - Interval(tubes.middle))
    residual = (start + away).reach()
    off = (np.eye(tape.size)[:, :, np.newaxis] - slopes[:, :-1]).reach()
    image = above(residual + (Interval(off) * Interval(radius)).total(axis=1).hi)
    is_proved: Signs = np.all((image < radius) & np.isfinite(radius), axis=0)
    return tubes._replace(radius=radius, image=image), is_proved
