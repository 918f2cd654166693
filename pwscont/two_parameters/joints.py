"""Joints: transitions, folds and vertical edges on the segments between patches.

On a segment the polygons of some cells end. The solutions of such a cell on the segment lie on the
interface to another cell, and are solutions in the other cell, too (F1). So the cells that end on
the segment fall into groups that share a solution: two cells on opposite sides are a transition,
two cells on the same side a fold. In every group the signs of det(dH/dz) have equal sums on the
left and on the right, because no solution comes from nowhere. If a singular cell joins several
groups, only the sums over all these groups are equal; if the singular cell is unbounded, no sums
need be equal. A segment with unequal sums shows a mistake, and is returned as doubtful.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

from pwscont.extending import EPS, GUARD, Array
from pwscont.two_parameters.affine import Window
from pwscont.two_parameters.arrangement import Arrangement, Side
from pwscont.two_parameters.cells import Cell, Strip
from pwscont.two_parameters.half_planes import width_of
from pwscont.two_parameters.loci import LocusPart, Passing

#: Segments shorter than this, in tolerances, lie where several lines meet, and are skipped:
#: rounding decides which cells end on such a segment.
SHORT = 100.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A segment on which solutions pass from cell to cell, or end.

    Attributes
    ----------
    kind : Passing
    label : str
        The labels of the cells that meet.
    cell : Cell or None
        A cell that meets the segment, to compute z; None if only a singular cell does.
    ends : ndarray, shape (2, 2)
        The ends of the segment, as points of the square.
    """

    kind: Passing
    label: str
    cell: Cell | None
    ends: Array


@final
@dataclass(slots=True, eq=False)
class Joints:
    """All joints, and the middles of doubtful segments."""

    found: list[Joint] = field(default_factory=list)
    doubtful: list[Array] = field(default_factory=list)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """The cells of a plane, with the rule by which solutions of two cells are the same solution.

    Attributes
    ----------
    cells : sequence of Cell
        The cells with solutions over a polygon.
    thin : sequence of Cell
        The cells with solutions over a point or a segment only; the numbers of thin cells follow
        the numbers of ``cells``.
    strips : sequence of Strip
    strip_labels : sequence of str
    scale : ndarray, shape (n,)
        Typical magnitudes of z.
    tolerance : float
        Points of the square closer than this count as one point.
    """

    cells: Sequence[Cell]
    thin: Sequence[Cell]
    strips: Sequence[Strip]
    strip_labels: Sequence[str]
    scale: Array
    tolerance: float

    def groups(self, cells: Iterable[int], point: Array) -> list[list[int]]:
        """Return groups of cells, by number, that share a solution at a point of the square."""
        groups: list[list[int]] = []
        for i in cells:
            one = next((g for g in groups if self._share(g[0], i, point)), None)
            if one is None:
                groups.append([i])
            else:
                one.append(i)
        return groups

    def _share(self, i: int, j: int, point: Array) -> bool:
        one, other = self.cell(i), self.cell(j)
        slopes = np.abs(one.z[:, :2]).sum(axis=1) + np.abs(other.z[:, :2]).sum(axis=1)
        limit = 2.0 * self.tolerance * slopes + GUARD * (one.rounding + other.rounding) * self.scale
        return bool((np.abs(one.at(point) - other.at(point)) <= limit).all())

    def cell(self, i: int) -> Cell:
        """Return the cell with a number, also a thin cell."""
        return self.cells[i] if i < len(self.cells) else self.thin[i - len(self.cells)]

    def around(self, point: Array) -> list[int]:
        """Return the numbers of the cells with solutions over a point inside a patch."""
        return [i for i, cell in enumerate(self.cells) if cell.margin(point) >= 0.0]

    def touching(self, point: Array) -> list[int]:
        """Return the numbers of the cells with a solution over a point, within rounding."""
        blur = GUARD * EPS + max((cell.blur for cell in self.cells), default=0.0)
        every = enumerate([*self.cells, *self.thin])
        return [i for i, cell in every if cell.margin(point) >= -max(blur, cell.blur)]

    def strips_at(self, point: Array) -> list[int]:
        """Return the numbers of the strips with infinitely many solutions over a point."""
        limit = 2.0 * self.tolerance
        return [i for i, s in enumerate(self.strips) if _distance(s.shadow, point) <= limit]


def joints(
    solved: Solved, arrangement: Arrangement, solutions: Sequence[Sequence[list[int]]]
) -> Joints:
    """Return the joints of all segments between patches.

    Parameters
    ----------
    solved : Solved
    arrangement : Arrangement
    solutions : sequence of sequence of list of int
        The solutions of each patch; a solution is the list of the numbers of all cells that have
        the solution.
    """
    answer = Joints()
    for side in arrangement.sides:
        if np.hypot(*np.diff(side.ends, axis=0)[0]) > SHORT * solved.tolerance:
            _cross(solved, side, (solutions[side.left], solutions[side.right]), answer)
    answer.found += _alone(solved, answer.found)
    return answer


def _cross(
    solved: Solved,
    side: Side,
    solutions: tuple[Sequence[list[int]], Sequence[list[int]]],
    answer: Joints,
) -> None:
    """Add the joints of a segment to ``answer``, from the solutions on the left and right."""
    left, right = _ending(*solutions), _ending(*solutions[::-1])
    middle = side.ends.mean(axis=0)
    strips, unbalanced = solved.strips_at(middle), list[list[int]]()
    for group in solved.groups(sorted(left | right), middle):
        here, there = [i for i in group if i in left], [i for i in group if i in right]
        if _sum(solved, here) != _sum(solved, there):
            unbalanced.append(group)
            continue
        kind = Passing.TRANSITION if len(here) == len(there) else Passing.FOLD
        answer.found.append(_joint(solved, kind, group, side))
    if unbalanced and not _excused(solved, strips, left, right):
        answer.doubtful.append(middle)
    labels = [solved.strip_labels[i] for i in strips]
    answer.found += [_vertical(solved, group[0], labels, side) for group in unbalanced]


def _ending(here: Sequence[list[int]], there: Sequence[list[int]]) -> set[int]:
    """Return a cell of each solution here that shares no cell with a solution there."""
    others = {cell for cells in there for cell in cells}
    return {cells[0] for cells in here if not others & set(cells)}


def _excused(solved: Solved, strips: Sequence[int], left: set[int], right: set[int]) -> bool:
    """Tell whether singular cells on a segment explain unequal sums of signs."""
    if any(solved.strips[i].is_unbounded for i in strips):
        return True
    return bool(strips) and _sum(solved, left) == _sum(solved, right)


def _sum(solved: Solved, cells: Iterable[int]) -> int:
    return sum(solved.cells[i].det_sign for i in cells)


def _joint(solved: Solved, kind: Passing, group: list[int], side: Side) -> Joint:
    middle = side.ends.mean(axis=0)
    cells = sorted((solved.cells[i] for i in group), key=lambda cell: _is_above(cell, middle))
    return Joint(kind, " | ".join(cell.label for cell in cells), cells[0], side.ends)


def _vertical(solved: Solved, number: int, labels: Sequence[str], side: Side) -> Joint:
    cell = solved.cells[number]
    names = (
        [*labels, cell.label] if _is_above(cell, side.ends.mean(axis=0)) else [cell.label, *labels]
    )
    return Joint(Passing.VERTICAL, " | ".join(names), cell, side.ends)


def _is_above(cell: Cell, point: Array) -> bool:
    """Tell whether the test of a cell that vanishes at a point is positive in the cell."""
    return cell.character.signs[cell.test_at(point)]


def _alone(solved: Solved, known: Sequence[Joint]) -> Iterator[Joint]:
    """Yield joints for the strips over points and segments where no regular cell ends."""
    middles = [c.ends.mean(axis=0) for c in known if c.kind is Passing.VERTICAL]
    limit = 2.0 * solved.tolerance
    for strip, label in zip(solved.strips, solved.strip_labels, strict=True):
        shadow = strip.shadow
        if len(shadow) < 3 and not any(_distance(shadow, m) <= limit for m in middles):
            yield Joint(Passing.VERTICAL, label, None, shadow[[0, -1]])


def _distance(shadow: Array, point: Array) -> float:
    """Return the distance of a point from a shadow: point, segment or convex polygon."""
    ahead = np.roll(shadow, -1, axis=0)
    if width_of(shadow) > 0.0 and _is_within(shadow, ahead, point):
        return 0.0
    way = ahead - shadow
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    part = np.clip(((point - shadow) * way).sum(axis=1) / square, 0.0, 1.0)
    nearest = shadow + part[:, np.newaxis] * way
    return float(np.hypot(*(nearest - point).T).min())


def _is_within(shadow: Array, ahead: Array, point: Array) -> bool:
    (x, y), (u, v) = (ahead - shadow).T, (point - shadow).T
    return bool((x * v - y * u >= 0.0).all())


def edges(
    joints: Sequence[Joint], window: Window, size: int, tolerance: float
) -> tuple[LocusPart, ...]:
    """Return the edges of a map as parts of loci, folds first.

    Parameters
    ----------
    joints : sequence of Joint
    window : Window
    size : int
        The number of unknowns that a user knows of.
    tolerance : float
        Segments of a line that are closer than this belong together.
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
    """Yield segments joined, line by line, into segments as long as possible."""
    while segments:
        line = max(segments, key=_length)
        on_it = [s for s in segments if _is_on(line, s, tolerance)]
        segments = [s for s in segments if not _is_on(line, s, tolerance)]
        yield from _merged(line, on_it, tolerance)


def _length(segment: Array) -> float:
    return float(np.hypot(*(segment[1] - segment[0])))


def _is_on(line: Array, segment: Array, tolerance: float) -> bool:
    """Tell whether a segment lies on a line, given by a segment that is not shorter."""
    if segment is line:
        return True
    way = (line[1] - line[0]) / (_length(line) or 1.0)
    aside = (segment - line[0]) @ np.array([-way[1], way[0]])
    far = np.abs((segment - line[0]) @ way).max() / (_length(line) or 1.0)
    return bool(np.abs(aside).max() <= 4.0 * tolerance * (1.0 + far))


def _merged(line: Array, segments: Iterable[Array], tolerance: float) -> Iterator[Array]:
    """Yield the segments of a line, touching segments merged."""
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
    """Return the ends (z, alpha, mu) of an edge, mu increasing, and the errors of the ends.

    z is nan for a joint without regular cell. The error of (s, t) is the tolerance.
    """
    plane = window.inside(ends)
    z, spread = np.full((2, size), np.nan), np.full(size, np.nan)
    if joint.cell is not None:
        z = np.array([joint.cell.at(end)[:size] for end in ends])
        spread = tolerance * np.abs(joint.cell.z[:size]).sum(axis=1)
    points = np.column_stack([z, plane])
    error = np.tile(np.append(spread, tolerance * window.half), (2, 1))
    return points if plane[1, 1] >= plane[0, 1] else points[::-1], error
