"""Stretches of alpha with infinitely many solutions, put together from what single cells fill."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from pwscont.enumeration.filled import Filled
from pwscont.graph.fields import DamagedError, Fields
from pwscont.graph.records import Stretch

#: Which entries of a row in a file tell whether an end is closed.
IS_CLOSED = [False, False, True, True]


def joined(parts: Iterable[Filled], known: Sequence[float]) -> tuple[Stretch, ...]:
    """Return the stretches that some parts cover together, in order.

    Parameters
    ----------
    parts : iterable of Filled
    known : sequence of float
        Values of alpha, of which an end takes one that rounding does not tell from it; or zero.
    """
    ends = [*known, 0.0]
    rows = sorted(
        (
            Stretch(
                _settled(part.lo, part.blur, ends),
                _settled(part.hi, part.blur, ends),
                math.inf,
                part.lo_closed,
                part.hi_closed,
            )
            for part in parts
        ),
        key=lambda stretch: (stretch[0], not stretch.lo_closed),
    )
    found: list[Stretch] = []
    for new in rows:
        if found and _touch(found[-1], new):
            found[-1] = _both(found[-1], new)
        else:
            found.append(new)
    return tuple(found)


def _settled(alpha: float, blur: float, ends: list[float]) -> float:
    """Return the known end that alpha is within rounding, or alpha, which is known from now on."""
    nearest = min(ends, key=lambda end: abs(end - alpha), default=math.inf)
    if abs(nearest - alpha) <= blur:
        return nearest
    ends.append(alpha)
    return alpha


def _touch(a: Stretch, b: Stretch) -> bool:
    return b[0] < a[1] or (b[0] == a[1] and (a.hi_closed or b.lo_closed))


def _both(a: Stretch, b: Stretch) -> Stretch:
    """Return two stretches that touch, the first of which begins first, as one."""
    hi = max(a[1], b[1])
    hi_closed = (a.hi_closed and a[1] == hi) or (b.hi_closed and b[1] == hi)
    return Stretch(a[0], hi, math.inf, a.lo_closed, hi_closed)


def rows_of(stretches: Iterable[Stretch]) -> list[list[float | bool]]:
    """Return stretches as a file holds them: both ends, and whether they are closed."""
    return [[*row[:2], row.lo_closed, row.hi_closed] for row in stretches]


def read_stretches(header: Fields, interval: tuple[float, float]) -> tuple[Stretch, ...]:
    """Return the stretches of a file, which old files lack."""
    return tuple(_read(header, interval))


def _read(header: Fields, interval: tuple[float, float]) -> Iterator[Stretch]:
    for row in header.items("infinite") if header.has("infinite") else ():
        if not isinstance(row, list) or [type(one) is bool for one in row] != IS_CLOSED:
            raise DamagedError("infinite must be rows of two ends, and whether they are closed")
        ends = Fields("infinite", {"lo": row[0], "hi": row[1]})
        lo, hi = ends.finite("lo"), ends.finite("hi")
        if not interval[0] <= lo <= hi <= interval[1]:
            raise DamagedError(f"infinitely many solutions outside the interval: {lo} to {hi}")
        yield Stretch(lo, hi, math.inf, *row[2:])
