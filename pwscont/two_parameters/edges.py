"""Joints put together: one part for all segments of one line on which the same cells meet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.two_parameters.joints import Joint
from pwscont.two_parameters.loci import LocusPart, Passing
from pwscont.two_parameters.window import Window


def edges(
    joints: Sequence[Joint], window: Window, size: int, tolerance: float
) -> tuple[LocusPart, ...]:
    """Return the edges of a map as parts of loci, folds first.

    Parameters
    ----------
    joints : sequence of Joint
    window : Window
    size : int
        How many unknowns a user knows of.
    tolerance : float
        Segments of one line that are closer than this belong together.
    """
    together: dict[tuple[Passing, str], list[Joint]] = {}
    for joint in joints:
        together.setdefault((joint.kind, joint.label), []).append(joint)
    order = list(Passing)
    keys = sorted(together, key=lambda key: (order.index(key[0]), key[1]))
    return tuple(
        LocusPart(kind, label, *_points(together[kind, label][0], ends, window, size, tolerance))
        for kind, label in keys
        for ends in _joined([c.ends for c in together[kind, label]], tolerance)
    )


def _joined(segments: list[Array], tolerance: float) -> Iterator[Array]:
    """Yield the longest segments that segments make."""
    while segments:
        line = max(segments, key=_length)
        on_it = [s for s in segments if _is_on(line, s, tolerance)]
        segments = [s for s in segments if not _is_on(line, s, tolerance)]
        yield from _merged(line, on_it, tolerance)


def _length(segment: Array) -> float:
    return float(np.hypot(*(segment[1] - segment[0])))


def _is_on(line: Array, segment: Array, tolerance: float) -> bool:
    """Tell whether a segment lies on the line of another, which is not shorter."""
    if segment is line:
        return True
    way = (line[1] - line[0]) / (_length(line) or 1.0)
    aside = (segment - line[0]) @ np.array([-way[1], way[0]])
    far = np.abs((segment - line[0]) @ way).max() / (_length(line) or 1.0)
    return bool(np.abs(aside).max() <= 4.0 * tolerance * (1.0 + far))


def _merged(line: Array, segments: Iterable[Array], tolerance: float) -> Iterator[Array]:
    """Yield segments of one line, those that touch as one."""
    way = line[1] - line[0]
    ordered = sorted(
        (s if (s[1] - s[0]) @ way >= 0.0 else s[::-1] for s in segments),
        key=lambda s: float(s[0] @ way),
    )
    begin, end = ordered[0]
    for first, last in ordered[1:]:
        if (first - end) @ way > 200.0 * tolerance * _length(line):
            yield np.array([begin, end])
            begin = first
        end = last
    yield np.array([begin, end])


def _points(
    joint: Joint, ends: Array, window: Window, size: int, tolerance: float
) -> tuple[Array, Array]:
    """Return both ends (z, alpha, mu), mu increasing, and their errors.

    z is nan where only a singular cell is. The ends of the square are off by the tolerance.
    """
    plane = window.inside(ends)
    z, spread = np.full((2, size), np.nan), np.full(size, np.nan)
    if joint.cell is not None:
        z = np.array([joint.cell.at(end)[:size] for end in ends])
        spread = tolerance * np.abs(joint.cell.z[:size]).sum(axis=1)
    points = np.column_stack([z, plane])
    error = np.tile(np.append(spread, tolerance * window.half), (2, 1))
    return points if plane[1, 1] >= plane[0, 1] else points[::-1], error
