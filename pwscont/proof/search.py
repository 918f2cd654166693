"""Boxes of (z, alpha), excluded, contracted, accepted or halved, generation by generation.

Boxes are accepted where H(., alpha) is injective, so that solutions go on with alpha; at one alpha,
where a solution is enclosed. The theorems stand on the page "Proofs" of the manual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.basics.budget import check_budget
from pwscont.proof.interval import ULP, Interval, inverse_of, solved_last, times, together
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
#: The widest coordinate, in magnitudes, is halved among the coordinates that change preconditioned
#: rows by at least this part of the largest change by a coordinate.
MATTERS = 0.5
#: By what part of typical magnitudes derivatives are taken around a box: kinks lie on faces.
BESIDE = 2.0**-44
#: How much wider than a box, than a few roundings of the centre, and than the residual of the
#: centre as unknowns, the neighbourhood is in which a solution is enclosed.
WIDER, SLACK, ROOM = 1.25, 64.0 * ULP, 2.0


class Covered(NamedTuple):
    """Accepted and open boxes (n + 1, k) with all solutions, and how many boxes were looked at."""

    accepted: Interval
    open: Interval
    looked_at: int


@final
@dataclass(frozen=True, eq=False)
class Region:
    """A formula in a box (n + 1,) of (z, alpha), with typical magnitudes (n + 1,)."""

    tape: Tape
    box: Interval
    scale: Array

    @property
    def whole(self) -> Interval:
        """The box, shape (n + 1, 1)."""
        return self.box[:, np.newaxis]

    @property
    def size(self) -> Array:
        """The magnitudes, shape (n + 1, 1)."""
        return self.scale[:, np.newaxis]

    def slopes(self, boxes: Interval) -> Interval:
        """Return the derivatives in boxes (n + 1, B) and a little around, shape (n, n + 1, B).

        Not a number where the formula, or a derivative, may be without a value.
        """
        beside = Interval(-BESIDE * self.size, BESIDE * self.size)
        value, slopes = with_slopes(self.tape.slopes, (boxes + beside).meet(self.whole))
        is_smooth = np.isfinite(slopes.width()).all(axis=1) & np.isfinite(value.width())
        return slopes.where(np.all(is_smooth, axis=0))

    def continues(self, boxes: Interval, slopes: Interval) -> Signs:
        """Tell in which boxes inside of the whole box all solutions go on with alpha, one each."""
        is_inside = boxes[:-1].is_within(self.whole[:-1]).all(axis=0)
        return is_inside & are_regular(slopes[:, :-1], self.size[:-1])

    def enclosed(self, boxes: Interval) -> Interval:
        """Return what holds the only zero in and around boxes at one alpha, shape (n, B).

        Around the centre c of a neighbourhood of a box, all x with H'x + H(c) = 0 are enclosed,
        whatever the derivatives there. If c + x lies inside, the neighbourhood has one zero. Where
        that is not so, or the neighbourhood leaves the whole box, nothing is said.
        """
        centre, alpha = boxes.middle()[:-1], boxes[-1]
        value = evaluated(self.tape, together(np.vstack, Interval(centre), alpha))
        step = times(inverse_of(self.slopes(boxes).middle()[:, :-1]), value).reach()
        far = WIDER * (boxes[:-1] - centre).reach() + SLACK * np.abs(centre) + ROOM * step
        far += BESIDE * self.size[:-1]
        near = Interval(centre - far, centre + far)
        slopes = self.slopes(together(np.vstack, near, alpha))
        found = solved_last(slopes[:, :-1], value) + centre
        is_proved = found.is_within(near) & near.is_within(self.whole[:-1])
        return found.where(np.all(is_proved, axis=0))


def are_regular(matrices: Interval, size: Array) -> Signs:
    """Tell which intervals of matrices (n, n, B) hold regular matrices only.

    With any matrix R, best about the inverse, they do if |I - R K| v < v for some v > 0.
    """
    unit = np.eye(len(size))[..., np.newaxis]
    off = (unit - times(inverse_of(matrices.middle()), matrices)).reach()
    v = size + (off * size).sum(axis=1)
    regular: Signs = ((Interval(off) * Interval(v)).total(axis=1).hi < v).all(axis=0)
    return regular


Accepts = Callable[[Interval, Interval], Signs]


def covered(
    region: Region, boxes: Interval, accepts: Accepts, seconds: float, most: int
) -> Covered:
    """Return accepted and open boxes that hold all zeros in some boxes, in some ``seconds``.

    ``accepts`` tells of boxes, and the derivatives in the boxes, which are accepted. A generation
    with which more than ``most`` boxes would be looked at is not begun.
    """
    none, number, end = boxes[:, :0], 0, perf_counter() + seconds
    accepted, left = [none], [none]
    while count := boxes.lo.shape[1]:
        halves, is_last = [none], number + count > most
        for first in range(0, count, TOGETHER):
            some = boxes[:, first : first + TOGETHER]
            check_budget()
            if is_last or perf_counter() > end:
                left.append(some)
                continue
            number += some.lo.shape[1]
            found, small, more = _looked_at(region, some, accepts)
            accepted.append(found)
            left.append(small)
            halves += more
        boxes = together(np.hstack, *halves)
    return Covered(together(np.hstack, *accepted), together(np.hstack, *left), number)


def _looked_at(
    region: Region, boxes: Interval, accepts: Accepts
) -> tuple[Interval, Interval, list[Interval]]:
    """Return the boxes that are accepted, those too small to be halved, and halves of others."""
    tape, size = region.tape, region.size
    boxes = boxes[:, ~evaluated(tape, boxes).excludes_zero().any(axis=0)]
    slopes = region.slopes(boxes)
    matrix = preconditioner(slopes.middle(), boxes.width())
    rows = times(matrix, slopes)
    boxes, empty = contracted(boxes, rows, times(matrix, evaluated(tape, Interval(boxes.middle()))))
    boxes, rows, slopes = boxes[:, ~empty], rows[..., ~empty], slopes[..., ~empty]
    is_accepted = accepts(boxes, slopes)
    *unknowns, alpha = boxes.width() / size
    widest = np.max(unknowns, axis=0)
    is_flat = (widest <= THIN) & (alpha > 0.0) & (alpha <= FINEST_ALPHA)
    is_small = (np.maximum(widest, alpha) <= FINEST) | is_flat
    wide = ~is_accepted & ~is_small
    halves = _halved(boxes[:, wide], rows[..., wide], size)
    return boxes[:, is_accepted], boxes[:, ~is_accepted & is_small], halves


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


def _halved(boxes: Interval, rows: Interval, size: Array) -> list[Interval]:
    """Return both halves of boxes, along the widest coordinate that matters."""
    width = boxes.width()
    effect = np.where(width > FINEST * size, (rows.reach() * width).sum(axis=0), 0.0)
    relative = np.where(effect < MATTERS * effect.max(axis=0), 0.0, width / size)
    split = relative.argmax(axis=0), np.arange(boxes.lo.shape[1])
    lower, upper = boxes.hi.copy(), boxes.lo.copy()
    lower[split] = upper[split] = boxes.middle()[split]
    return [Interval(boxes.lo, lower), Interval(upper, boxes.hi)]
