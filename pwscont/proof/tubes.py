"""Tubes: boxes of (z, alpha) in which exactly one solution is proved at every alpha.

A tube is the set of all (z, alpha) with alpha in [first, last] and z within ``radius`` of the line
centre + slope (alpha - middle). Krawczyk's operator, for the equations at fixed alpha, maps the
tube at every alpha into the inside of the tube: so H(., alpha) has exactly one zero there, and the
zero lies in the image (Krawczyk 1969; Neumaier 1990, theorem 5.1.8). Across kinks the derivatives
are hulls of the derivatives of all branches (docs/theory, F20), and continuity of H is all that is
needed besides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Signs
from pwscont.proof.boxes import evaluated, inverse_of, times, with_slopes
from pwscont.proof.interval import ULP, Interval, above, together
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

    @classmethod
    def made(cls, function: Callable[[list[Array]], Array], *parts: Tubes) -> Tubes:
        """Return tubes whose arrays a function makes from the arrays of parts."""
        names = [each.name for each in fields(cls)]
        return cls(*(function([getattr(part, name) for part in parts]) for name in names))

    def __getitem__(self, which: Any) -> Tubes:
        return Tubes.made(lambda arrays: arrays[0][..., which], self)

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


joined = partial(Tubes.made, partial(np.concatenate, axis=-1))


def around(tape: Tape, box: Interval, slopes: Interval, least: Array) -> tuple[Tubes, Signs]:
    """Return tubes that hold boxes (n + 1, B), and which of the tubes are proved.

    From ``slopes``, the derivatives on the boxes, the shape of the tubes is guessed. Every tube
    exceeds a radius ``least``: a box may have no width at all.
    """
    guess, middle, alpha = slopes.middle(), box.middle(), box[-1]
    matrix = inverse_of(guess[:, :-1])
    slope = -np.einsum("ijb,jb->ib", matrix, guess[:, -1])
    centre = polished(tape, middle, matrix)
    tubes = Tubes(alpha.lo, middle[-1], alpha.hi, centre, slope, centre, centre)
    ends = [np.vstack([tubes.at(Interval(end)).middle(), end]) for end in (alpha.lo, alpha.hi)]
    rough = np.maximum(*(np.abs(_newton_step(tape, x, matrix)) for x in ends))
    radius = WIDER * tubes.far(box[:-1], alpha) + ROOM * rough + slack(centre)
    tubes, is_proved = proved(tape, tubes, radius + least[:, np.newaxis], matrix)
    return tubes, is_proved & tubes.hold(box[:-1], alpha)


def slack(centre: Array) -> Array:
    """Return a distance that is a few roundings of numbers."""
    return SLACK * ULP * np.abs(centre)


def _newton_step(tape: Tape, x: Array, matrix: Array) -> Array:
    """Return Newton's step at points (n + 1, B): about how far solutions are."""
    step: Array = np.einsum("ijb,jb->ib", matrix, evaluated(tape, Interval(x)).middle())
    return step


def polished(tape: Tape, middle: Array, matrix: Array) -> Array:
    """Return the centres of boxes, moved towards solutions."""
    x = middle.copy()
    for _ in range(POLISHED):
        step = _newton_step(tape, x, matrix)
        x[:-1] -= np.where(np.isfinite(step), step, 0.0)
    centre: Array = x[:-1]
    return centre


def proved(tape: Tape, tubes: Tubes, radius: Array, matrix: Array) -> tuple[Tubes, Signs]:
    """Return tubes of a radius with the radius of their images, and which tubes are proved."""
    alpha = Interval(tubes.first, tubes.last)
    slopes = with_slopes(tape.slopes, together(np.vstack, tubes.at(alpha, radius), alpha))[1]
    start = evaluated(tape, Interval(np.vstack([tubes.centre, tubes.middle])))
    along = (slopes[:, :-1] * Interval(tubes.slope)).total(axis=1)
    away = (slopes[:, -1] + along) * (alpha - Interval(tubes.middle))
    residual = times(matrix, start + away).reach()
    off = (np.eye(tape.size)[:, :, np.newaxis] - times(matrix, slopes[:, :-1])).reach()
    image = above(residual + (Interval(off) * Interval(radius)).total(axis=1).hi)
    is_proved: Signs = np.all((image < radius) & np.isfinite(radius), axis=0)
    return replace(tubes, radius=radius, image=image), is_proved
