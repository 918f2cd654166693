"""Tubes: boxes of (z, alpha) in which exactly one solution is proved at every alpha.

A tube is the set of all (z, alpha) with alpha in [first, last] and z within ``radius`` of the line
centre + slope (alpha - middle). Krawczyk's operator, for the equations at fixed alpha, maps the
tube at every alpha into the inside of the tube: so H(., alpha) has exactly one zero there, and the
zero lies in the image (Krawczyk 1969; Neumaier 1990, theorem 5.1.8). Across kinks the derivatives
are hulls of the derivatives of all branches (docs/theory, F20), and continuity of H is all that is
needed besides.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.intervals.interval import ULP, Interval, above
from pwscont.proof.newton import formula, inverse, times, total, with_slopes
from pwscont.proof.tape import Tape

#: How much wider than the box a tube is tried, and how many times the residual besides.
WIDER, ROOM = 1.1, 2.0
#: Newton steps that improve the centre of a tube.
POLISHED = 2
#: How much wider than necessary a tube is, in roundings of the tube's centre.
SLACK = 64.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tubes:
    """Tubes, one after the other along the last axis.

    Attributes
    ----------
    first, middle, last : ndarray, shape (B,)
    centre, slope, radius : ndarray, shape (n, B)
    image : ndarray, shape (n, B)
        The radius of the image of Krawczyk's operator, in which the solutions lie.
    """

    first: Array
    middle: Array
    last: Array
    centre: Array
    slope: Array
    radius: Array
    image: Array

    def __getitem__(self, which: Signs | Indices) -> Tubes:
        return Tubes(*(getattr(self, each.name)[..., which] for each in fields(self)))

    @classmethod
    def joined(cls, parts: list[Tubes]) -> Tubes:
        """Return several sets of tubes as one."""
        names = [each.name for each in fields(cls)]
        return cls(*(np.concatenate([getattr(p, name) for p in parts], axis=-1) for name in names))

    def at(self, alpha: Interval, radius: Array) -> Interval:
        """Return the hull of the tubes of another radius over intervals of alpha, shape (n, B)."""
        line = Interval.point(self.slope) * (alpha - Interval.point(self.middle))
        return Interval.point(self.centre) + line + Interval.ball(radius)

    def hold(self, z: Interval, alpha: Interval) -> Signs:
        """Tell which tubes hold boxes of z at every alpha of intervals."""
        ends = [Interval.point(alpha.lo), Interval.point(alpha.hi)]  # lines: the ends are enough
        held = [(z - self.at(end, np.zeros_like(self.radius))).reach() for end in ends]
        found: Signs = (np.max(held, axis=0) < self.radius).all(axis=0)
        return found


def whole(z: Interval, alpha: Interval) -> Interval:
    """Return boxes (n + 1, B) from those of z (n, B) and of alpha (B,)."""
    return Interval(np.vstack([z.lo, alpha.lo]), np.vstack([z.hi, alpha.hi]))


def around(tape: Tape, box: Interval, slopes: Interval, least: Array) -> tuple[Tubes, Signs]:
    """Return tubes that hold boxes, and which of the tubes are proved.

    Parameters
    ----------
    tape : Tape
    box : Interval, shape (n + 1, B)
    slopes : Interval, shape (n, n + 1, B)
        The derivatives on the boxes, from which the shape of the tubes is guessed.
    least : ndarray, shape (n,)
        A radius that every tube exceeds: a box may have no width at all.
    """
    guess = slopes.middle()
    matrix = inverse(guess[:, :-1])
    middle, alpha = box.middle(), box[-1]
    slope = -np.einsum("ijb,jb->ib", matrix, guess[:, -1])
    centre = polished(tape, middle, matrix)
    zero = np.zeros_like(centre)
    tubes = Tubes(alpha.lo, middle[-1], alpha.hi, centre, slope, zero, zero)
    ends = [Interval.point(alpha.lo), Interval.point(alpha.hi)]
    needed = np.max([(box[:-1] - tubes.at(end, zero)).reach() for end in ends], axis=0)
    radius = WIDER * needed + _rough(tape, tubes, matrix) + slack(centre)
    radius = radius + least[:, np.newaxis]
    tubes, is_proved = proved(tape, tubes, radius, matrix)
    return tubes, is_proved & tubes.hold(box[:-1], alpha)


def slack(centre: Array) -> Array:
    """Return a distance that is a few roundings of numbers."""
    return SLACK * ULP * np.abs(centre)


def _rough(tape: Tape, tubes: Tubes, matrix: Array) -> Array:
    """Return about how far solutions are from the line of a tube, seen at both ends of alpha."""
    far = []
    for alpha in (tubes.first, tubes.last):
        z = tubes.at(Interval.point(alpha), np.zeros_like(tubes.radius)).middle()
        value = formula(tape, Interval.point(np.vstack([z, alpha]))).middle()
        far.append(np.abs(np.einsum("ijb,jb->ib", matrix, value)))
    rough: Array = ROOM * np.max(far, axis=0)
    return rough


def polished(tape: Tape, middle: Array, matrix: Array) -> Array:
    """Return the centres of boxes, moved towards solutions."""
    x = middle.copy()
    for _ in range(POLISHED):
        value = formula(tape, Interval.point(x)).middle()
        step = np.einsum("ijb,jb->ib", matrix, value)
        x[:-1] -= np.where(np.isfinite(step), step, 0.0)
    centre: Array = x[:-1]
    return centre


def proved(tape: Tape, tubes: Tubes, radius: Array, matrix: Array) -> tuple[Tubes, Signs]:
    """Return tubes of a radius with the radius of their images, and which tubes are proved."""
    alpha = Interval(tubes.first, tubes.last)
    slopes = with_slopes(tape, whole(tubes.at(alpha, radius), alpha))[1]
    start = formula(tape, Interval.point(np.vstack([tubes.centre, tubes.middle])))
    along = total([slopes[:, j] * Interval.point(tubes.slope[j]) for j in range(tape.size)])
    away = (slopes[:, -1] + along) * (alpha - Interval.point(tubes.middle))
    residual = times(matrix, start + away).reach()
    unit = Interval.point(np.eye(tape.size)[:, :, np.newaxis])
    off = (unit - times(matrix, slopes[:, :-1])).reach()
    image = above(residual + above(_product(off, radius)))
    is_proved: Signs = np.all((image < radius) & np.isfinite(radius), axis=0)
    names = (tubes.first, tubes.middle, tubes.last, tubes.centre, tubes.slope)
    return Tubes(*names, radius, image), is_proved


def _product(matrix: Array, vector: Array) -> Array:
    """Return upper bounds of products of matrices and vectors that are not negative."""
    found = above(matrix[:, 0] * vector[0])
    for j in range(1, len(vector)):
        found = above(found + above(matrix[:, j] * vector[j]))
    return found
