"""Boxes of (z, alpha), excluded, contracted, accepted or halved, the widest first.

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
from pwscont.proof.interval import ULP, Interval, are_regular, inverses, solved, together
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
    """Accepted and open boxes (k, n + 1) with all solutions, and how many boxes were looked at."""

    accepted: Interval
    open: Interval
    looked_at: int


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

        Around the centre c of a neighbourhood of a box, all x with H'x + H(c) = 0 are enclosed,
        whatever the derivatives there. If c + x lies inside, the neighbourhood has one zero. Where
        that is not so, or the neighbourhood leaves the whole box, nothing is said.
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
) -> Covered:
    """Return accepted and open boxes that hold all zeros in some boxes, in some ``seconds``.

    ``accepts`` tells of boxes, and the derivatives in the boxes, which are accepted. About ``most``
    boxes are looked at, at most.
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
    return Covered(together(np.concatenate, *accepted), left, number)


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
    is_small = (np.maximum(widest, alpha) <= FINEST) | is_flat
    wide = ~is_accepted & ~is_small
    halves = _halved(boxes[wide], rows[wide], domain.scale)
    return boxes[is_accepted], boxes[~is_accepted & is_small], halves


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
    """Return finite matrices (B, n + 1, n) that project derivatives on what they determine.

    ``middle`` (B, n, n + 1) is about the derivatives; with coordinates in units of ``width``, the
    matrix times the derivatives is about I - t t', t the unit tangent. Any numbers will do.
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
