"""What is proved of the solutions of a formula in a box.

Theorem (the page "Proofs" of the manual): between the windows and open boxes every solution in the
box lies in a tube and inside the boundary of the box, so that the number of solutions in the box is
constant on every stretch of alpha between windows; the number is counted at one alpha of the
stretch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import counted
from pwscont.graph.structure import connected
from pwscont.proof.agreement import judged
from pwscont.proof.clusters import MOST_GROUPED, are_passed, hulls
from pwscont.proof.cover import FINEST_ALPHA, Cover
from pwscont.proof.interval import FUNCTION_ULPS, Interval
from pwscont.proof.newton import formula, inverse, with_slopes
from pwscont.proof.tape import Tape
from pwscont.proof.tubes import ROOM, Tubes, polished, proved, slack, whole

if TYPE_CHECKING:
    from pwscont.graph import BranchGraph

#: Where in a stretch between windows solutions are counted: until a count is certain, at most here.
PLACES = (0.5, 0.381966, 0.61803, 0.26, 0.74)
#: How many of these counts have to agree.
AGREEING = 2
ASSUMED = (
    "assumed: a formula without state, the same for numbers and for the tape; arithmetic of "
    f"IEEE 754 to nearest; elementary functions of numpy within {FUNCTION_ULPS:g} units in "
    "the last place"
)


@final
@dataclass(frozen=True, slots=True)
class CountedStretch:
    """A stretch of alpha between windows, ends excluded but for those of the interval.

    Attributes
    ----------
    lo, hi : float
    alpha : float
        Where solutions were counted.
    count : int or None
        The proved number of solutions in the box; None where the count is not certain.
    """

    lo: float
    hi: float
    alpha: float
    count: int | None


@final
class BoxProof:
    """All solutions of a formula in a box of (z, alpha), as far as proved.

    Made by :class:`pwscont.Everywhere`, and at hand as ``graph.proof``.

    Attributes
    ----------
    box : tuple of ndarray, shape (n,)
        The least and largest unknowns; nothing is said of solutions outside.
    interval : tuple of float
        The values of alpha.
    windows : list of tuple of float
        Stretches (lo, hi) of alpha around folds, and where a curve leaves the box, in which nothing
        is said of the count.
    open : list of tuple of ndarray, shape (n + 1,)
        Boxes (least, largest) of (z, alpha) that are not decided.
    boxes : int
        How many boxes were looked at.

    Examples
    --------
    >>> from pwscont import Everywhere, Switched, explore
    >>> arch = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    >>> proof = explore(arch, (-0.5, 1.0), search=Everywhere()).proof
    >>> proof.holds, proof.count(0.2), len(proof.windows)
    (True, 3, 2)
    """

    def __init__(self, tape: Tape, box: Interval, scale: Array, cover: Cover) -> None:
        self._tape, self._box, self._scale, self._tubes = tape, box, scale, cover.tubes
        self.boxes = cover.boxes
        self.box = box.lo[:-1], box.hi[:-1]
        self.interval = float(box.lo[-1]), float(box.hi[-1])
        groups = hulls(cover.open)
        passed = self._passed(groups)
        apart = FINEST_ALPHA * float(scale[-1])
        self.windows = _united(groups[-1][passed], apart)
        self.open = list(zip(groups.lo[:, ~passed].T, groups.hi[:, ~passed].T, strict=True))
        self._unsaid = _united(groups[-1], apart)

    def _passed(self, groups: Interval) -> Signs:
        """Tell which groups of open boxes are windows; of too many groups, none is tried."""
        count = groups.lo.shape[1]
        tried = 0 < count <= MOST_GROUPED
        return are_passed(self._tape, groups, self._scale) if tried else np.zeros(count, dtype=bool)

    # -- counts --------------------------------------------------------------------------------

    @cached_property
    def stretches(self) -> list[CountedStretch]:
        """The stretches of alpha between windows, with the number of solutions in the box."""
        lo, hi = self.interval
        ends = [lo, *(end for window in self._unsaid for end in window), hi]
        pairs = zip(ends[::2], ends[1::2], strict=True)
        return [self._counted(a, b) for a, b in pairs if a < b]

    def _counted(self, lo: float, hi: float) -> CountedStretch:
        """Return a stretch with its count, which several places agree on."""
        counts: dict[float, int] = {}
        for part in PLACES:
            alpha = lo + (hi - lo) * part
            found = self.solutions(alpha) if lo < alpha < hi else None
            if found is not None:
                counts[alpha] = len(found)
            if len(counts) == AGREEING:
                break
        if len(set(counts.values())) != 1:
            return CountedStretch(lo, hi, 0.5 * (lo + hi), None)
        alpha, count = next(iter(counts.items()))
        return CountedStretch(lo, hi, alpha, count)

    def count(self, alpha: float) -> int | None:
        """Return the proved number of solutions in the box; None in windows and where undecided.

        Raises
        ------
        InvalidInputError
            If alpha lies outside the interval.
        """
        lo, hi = self.interval
        if not lo <= alpha <= hi:
            raise InvalidInputError(f"alpha = {alpha} lies outside the interval ({lo}, {hi})")
        for each in self.stretches:
            inside = (each.lo < alpha or each.lo == lo) and (alpha < each.hi or each.hi == hi)
            if each.lo <= alpha <= each.hi and inside and not self._is_unsaid(alpha):
                return each.count
        return None

    def _is_unsaid(self, alpha: float) -> bool:
        return any(lo <= alpha <= hi for lo, hi in self._unsaid)

    @np.errstate(all="ignore")
    def solutions(self, alpha: float) -> list[tuple[Array, Array]] | None:
        """Return an enclosure (least, largest), shapes (n,), of every solution in the box at alpha.

        None where alpha is in a window, or where solutions are not told apart for certain.
        """
        if self._is_unsaid(alpha):
            return None
        if self._tubes is None:
            return []
        active = (self._tubes.first <= alpha) & (alpha <= self._tubes.last)
        tubes = self._tubes[active]
        found = _enclosed(self._tape, tubes, alpha)
        lower, upper = (end[:, np.newaxis] for end in self.box)
        outside: Signs = np.any((found.hi < lower) | (found.lo > upper), axis=0)
        tubes, found = tubes[~outside], found[:, ~outside]
        if not found.is_within(self._box[:-1, np.newaxis]).all():
            return None
        groups = _distinct(tubes, found, alpha)
        return None if groups is None else [(found.lo[:, i], found.hi[:, i]) for i in groups]

    # -- words ---------------------------------------------------------------------------------

    @property
    def holds(self) -> bool:
        """Whether the number of solutions in the box is proved at every alpha but in windows."""
        return not self.open and all(each.count is not None for each in self.stretches)

    @property
    def words(self) -> str:
        """What is proved, in a few words."""
        if not self.holds:
            vague = [each for each in self.stretches if each.count is None]
            parts = [_several(len(self.open), "box")] if self.open else []
            parts += [_several(len(vague), "stretch")] if vague else []
            return f"not proved in {' and in '.join(parts)}"
        if not self.windows:
            return "complete in the box, proved"
        widest = max(hi - lo for lo, hi in self.windows)
        return (
            f"complete in the box, proved, except in {counted(len(self.windows), 'window')} of "
            f"alpha of width up to {widest:.1g} (around folds)"
        )

    @property
    def statements(self) -> tuple[str, ...]:
        """What is proved, of which box, and what is assumed, a sentence each."""
        ranges = ", ".join(f"[{lo:.8g}, {hi:.8g}]" for lo, hi in zip(*self.box, strict=True))
        return (self.words, f"the box: {ranges}; nothing is said of solutions outside", ASSUMED)

    def judged(self, graph: BranchGraph, words: str) -> str:
        """Return the guarantee of a graph with what is proved, for ``graph.guarantee``."""
        with np.errstate(all="ignore"):
            return judged(self, graph, words)

    def __repr__(self) -> str:
        return f"BoxProof({self.words}; {_several(self.boxes, 'box')})"


def _several(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 'es'}"


def _united(ranges: Interval, apart: float) -> list[tuple[float, float]]:
    """Return the union of ranges; ranges closer together than ``apart`` become one range."""
    united: list[tuple[float, float]] = []
    for lo, hi in sorted(zip(ranges.lo.tolist(), ranges.hi.tolist(), strict=True)):
        if united and lo <= united[-1][1] + apart:
            united[-1] = (united[-1][0], max(hi, united[-1][1]))
        else:
            united.append((lo, hi))
    return united


def _enclosed(tape: Tape, tubes: Tubes, alpha: float) -> Interval:
    """Return narrow enclosures of the solutions in tubes at one alpha, shape (n, k)."""
    point = Interval.point(np.full(len(tubes.first), alpha))
    known = tubes.at(point, tubes.image)
    slopes = with_slopes(tape, whole(known, point))[1]
    matrix = inverse(slopes.middle()[:, :-1])
    centre = polished(tape, np.vstack([known.middle(), point.lo]), matrix)
    value = formula(tape, Interval.point(np.vstack([centre, point.lo])))
    far = np.einsum("ijb,jb->ib", np.abs(matrix), value.reach())
    radius = ROOM * far + slack(centre) + slack(tubes.radius)
    zero = np.zeros_like(centre)
    thin = Tubes(point.lo, point.lo, point.lo, centre, zero, radius, radius)
    thin, is_proved = proved(tape, thin, radius, matrix)
    found = thin.at(point, thin.image)
    is_proved &= tubes.hold(found, point)
    return Interval(
        np.where(is_proved, found.lo, known.lo), np.where(is_proved, found.hi, known.hi)
    )


def _distinct(tubes: Tubes, found: Interval, alpha: float) -> list[int] | None:
    """Return one tube for every different solution, None where two are not told apart.

    Solutions whose enclosures do not meet are different. Two enclosures that lie in one tube hold
    the same solution.
    """
    count = len(tubes.first)
    pairs = []
    for i in range(count):
        others = np.arange(i + 1, count)
        apart = (found.lo[:, others] > found.hi[:, [i]]) | (found.hi[:, others] < found.lo[:, [i]])
        others = others[~apart.any(axis=0)]
        if not _are_same(tubes, found, i, others, alpha).all():
            return None
        pairs += [(i, int(j)) for j in others]
    return [min(group) for group in connected(range(count), pairs)]


def _are_same(tubes: Tubes, found: Interval, i: int, others: Indices, alpha: float) -> Signs:
    """Tell which of other solutions are the solution of tube i, by either tube."""
    mine = np.full(len(others), i)
    point = Interval.point(np.full(len(others), alpha))
    in_mine = tubes[mine].hold(found[:, others], point)
    return in_mine | tubes[others].hold(found[:, mine], point)
