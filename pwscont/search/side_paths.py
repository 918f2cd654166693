"""Side paths through known solutions: at fixed alpha, the curves on which H = mu d.

Where such a curve comes back to mu = 0, another solution stands (Branin 1972; Ma and Thorp 1993 for
power flow). The direction d is generic, so that a side path passes through no branch point,
whatever the symmetry of the system. A side path leads from solution to solution that random starts
hardly meet: low voltages of a grid, buckled shapes of a string.

Steps are rough, with one Jacobian each. A step that lands on another curve does no harm, since
solutions are corrected and compared with all care.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, final

import numpy as np

from pwscont.basics.arrays import Array, are_finite, dense, generic_angles, joined
from pwscont.basics.budget import check_budget
from pwscont.curve.error_samples import Found
from pwscont.enumeration.continua import is_one_of_many
from pwscont.search.pursuit import DISTINCT, Pursuit, is_new
from pwscont.system.box import Box
from pwscont.system.selection import Selection

#: Length of the first step, and the longest step as a part of 1 plus the distance from zero.
FIRST_SIDE_STEP, LONGEST_SIDE_STEP = 0.1, 0.5
#: Shortest step; a side path that needs shorter steps is given up.
SHORTEST_STEP = 1e-5
#: Factors by which steps shrink after a failure and grow where the direction hardly changes.
SIDE_SHRINKS, SIDE_GROWS = 0.35, 1.7
#: Cosine between the directions at both ends of a step, the least and that of a step that grows.
LEAST_COSINE, HARDLY_TURNED = 0.5, 0.92
#: Largest first correction as a part of the step, largest quotient of corrections, most
#: corrections, and the last correction as a part of 1 plus the length of the point.
MOST_OFF, CONTRACTS, MOST_CORRECTIONS, LAST = 0.5, 0.5, 6, 1e-4
#: Most steps of a side path each way.
MOST_SIDE_STEPS = 300
#: A side path ends this many times farther out than the farthest known solution.
FARTHER_OUT = 2.5
#: How far outside of its bounds an unknown of a side path may be, in magnitudes.
OUTSIDE = 0.5


class _Place(NamedTuple):
    """A point w = (z in magnitudes, mu) of a side path."""

    w: Array
    cell: Selection
    direction: Array
    inverse: Array  # of [J, -d; direction]
    sign: float  # of the determinant, which a side path keeps (F2)


@final
class SidePaths:
    """Side paths through the solutions at an alpha that a pursuit knows, and corrects.

    At most so many ``steps`` are taken, each with one Jacobian.
    """

    def __init__(self, pursuit: Pursuit, steps: int) -> None:
        self._pursuit, self._system, self._metric = pursuit, pursuit.system, pursuit.metric
        self._scale, self._box, self._left = self._metric.scale[:-1], Box.of(self._system), steps
        self._alpha, self._d, self._rows = 0.0, np.ones(0), np.ones(0)

    def at(self, alpha: float, number: int) -> Iterator[Found]:
        """Yield new solutions at an alpha; other numbers lead along other d."""
        d = np.cos((1.0 + number) * generic_angles(self._system.size))
        self._alpha, self._d, passed = alpha, d / np.linalg.norm(d), list[Array]()
        while self._left > 0:
            known = self._pursuit.solutions(alpha)
            start = next((x for x in known if is_new(self._metric, x, passed, DISTINCT)), None)
            if start is None:
                return
            if not passed:  # rows of H are divided by their largest coefficients at a solution
                cell = Selection(self._system, self._system.character(start[:-1], alpha))
                rows = np.abs(dense(cell.jacobian(start))[:, :-1] * self._scale).max(axis=1)
                self._rows = np.where((rows > 0.0) & np.isfinite(rows), rows, 1.0)
            passed.append(start)
            yield from self._through(start, passed)

    def _through(self, start: Array, passed: list[Array]) -> Iterator[Found]:
        """Yield the new solutions on the side path through a solution."""
        for way in (1.0, -1.0):
            for z in self._crossings(start[:-1], way):
                found = self._pursuit.solution_near(z, self._alpha)
                if found is None or is_one_of_many(self._system, self._metric, found[0]):
                    continue
                if not is_new(self._metric, found[0], [start], DISTINCT):
                    return  # the side path is closed
                if is_new(self._metric, found[0], passed, DISTINCT):
                    passed.append(found[0].copy())
                    if is_new(self._metric, found[0], self._pursuit.solutions(self._alpha)):
                        yield found

    def _crossings(self, z: Array, way: float) -> Iterator[Array]:
        """Yield rough states at which mu changes its sign on the side path from a solution."""
        known = np.array(self._pursuit.solutions(self._alpha))[:, :-1] / self._scale
        farthest = FARTHER_OUT * (1.0 + float(np.linalg.norm(known, axis=1).max()))
        cell = Selection(self._system, self._system.character(z, self._alpha))
        w, length = joined(z / self._scale, 0.0), FIRST_SIDE_STEP
        if not are_finite(jacobian := self._jacobian(w, cell)):
            return
        here = self._place(w, cell, way * np.linalg.svd(jacobian)[2][-1])
        for _ in range(MOST_SIDE_STEPS):
            if here is None or self._left <= 0 or length < SHORTEST_STEP:
                return
            there = self._step(here, length)
            if there is None:
                length *= SIDE_SHRINKS
                continue
            if here.w[-1] * there.w[-1] < 0.0:
                part = here.w[-1] / (here.w[-1] - there.w[-1])
                yield (here.w + part * (there.w - here.w))[:-1] * self._scale
            is_straight = there.direction.dot(here.direction) > HARDLY_TURNED
            here, size = there, float(np.linalg.norm(there.w[:-1]))
            length *= SIDE_GROWS if is_straight else 1.0
            length = min(length, LONGEST_SIDE_STEP * (1.0 + size))
            inside = self._box.contains(here.w[:-1] * self._scale, OUTSIDE * self._scale)
            if size > farthest or not inside:
                return

    def _step(self, here: _Place, length: float) -> _Place | None:
        """Return the place after a step, None for a failure.

        A step across an interface ends near the interface, in the cell beyond.
        """
        w = self._corrected(here, here.w + length * here.direction, length)
        there = None if w is None else self._place(w, here.cell, here.direction, here.sign)
        if there is None or there.direction.dot(here.direction) < LEAST_COSINE:
            return None
        before, after = (here.cell.tests(self._point(place.w)) for place in (here, there))
        left = np.flatnonzero((after < 0.0) & (after < before))
        if not len(left):
            return there
        parts = np.clip(before[left] / (before[left] - after[left]), 0.0, 1.0)
        first = parts.argmin()
        w = self._corrected(here, here.w + parts[first] * (there.w - here.w), length)
        test = int(here.cell.bounding[left[first]])
        cell = Selection(self._system, here.cell.character.flip(test))
        return None if w is None else self._place(w, cell, here.direction, here.sign)

    def _place(self, w: Array, cell: Selection, near: Array, sign: float = 0.0) -> _Place | None:
        """Return a place with the direction of a given sign, or with a direction near ``near``."""
        self._left -= 1
        check_budget()
        jacobian = self._jacobian(w, cell)
        matrix = np.vstack([jacobian, near])
        try:
            direction: Array = np.linalg.inv(matrix)[:, -1]
            direction = direction / np.linalg.norm(direction)
            if (own := float(np.linalg.slogdet(matrix)[0])) * sign < 0.0:
                direction, own = -direction, sign
            inverse: Array = np.linalg.inv(np.vstack([jacobian, direction]))
        except np.linalg.LinAlgError:
            return None
        return _Place(w, cell, direction, inverse, own) if are_finite(inverse) else None

    def _corrected(self, here: _Place, w: Array, length: float) -> Array | None:
        """Return the point of the side path near a point, by corrections across the direction."""
        before = MOST_OFF * length / CONTRACTS
        for _ in range(MOST_CORRECTIONS):
            step = here.inverse[:, :-1] @ -self._residual(w, here.cell)
            size = float(np.linalg.norm(step))
            if not size <= CONTRACTS * before:
                return None
            w, before = w + step, size
            if size <= LAST * (1.0 + float(np.linalg.norm(w))):
                return w
        return None

    def _point(self, w: Array) -> Array:
        return joined(w[:-1] * self._scale, self._alpha)

    def _residual(self, w: Array, cell: Selection) -> Array:
        return cell.residual(self._point(w)) / self._rows - w[-1] * self._d

    def _jacobian(self, w: Array, cell: Selection) -> Array:
        by_z = dense(cell.jacobian(self._point(w)))[:, :-1] * self._scale
        return np.column_stack([by_z / self._rows[:, np.newaxis], -self._d])
